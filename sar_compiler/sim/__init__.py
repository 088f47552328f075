"""The simulated world that replaces a robot with `--sim`.

The core (world, robot, lidar, map, planner, navigator) is plain Python and numpy, deterministic and seeded.
Only :mod:`sar_compiler.sim.simulation` connects it to ROS 2; no other module here imports ROS.
"""

PUBLIC_MODULES = (
    "isolation",
    "messages",
    "node_host",
    "occupancy",
    "placement",
    "planner",
    "simulated_runs",
    "simulation",
    "survey",
    "world",
)
"""The modules that other parts may import."""
