"""The simulated world that replaces a robot with `--sim`.

The core (world, robot, lidar, map, planner, navigator) uses only Python and numpy, and is deterministic for a given seed.
The modules `simulation`, `robot_interface`, `amcl`, `bt_navigator` and `planner_server` connect the core to ROS 2.
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
"""The modules of this package that other packages may import."""
