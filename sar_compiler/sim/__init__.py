"""The simulated world that replaces a robot when `--sim` is given.

The core (world, robot, lidar, map, planner, navigator) is plain Python and numpy, deterministic and seeded;
:mod:`sar_compiler.sim.simulation` puts it on ROS 2, and no other module here needs ROS to be imported.
"""

PUBLIC_MODULES = (
    "flights",
    "isolation",
    "messages",
    "node_host",
    "occupancy",
    "placement",
    "planner",
    "simulation",
    "survey",
    "world",
)
"""The modules that other parts may import."""
