"""The topics of a mission, without a namespace."""

# Published by the simulator, and on a robot by Nav2 and the robot's drivers.
SIMULATED = frozenset(
    {
        "amcl_pose",
        "battery_state",
        "initialpose",
        "navigate_to_pose/_action/feedback",
        "navigate_to_pose/_action/status",
        "odometry/filtered",
        "cmd_vel",
        "scan",
        "tf",
    }
)
# Published by the mission itself.
OURS = frozenset({"tf_static", "behavior_tree_log", "search_and_rescue/tree", "search_and_rescue/markers"})
# Published or subscribed to by Nav2 alone: map_server, planner_server, the costmaps, bt_navigator.
NAV2 = frozenset(
    {
        "map",
        "map_updates",
        "plan",
        "global_costmap/costmap",
        "global_costmap/costmap_updates",
        "local_costmap/published_footprint",
        "goal_pose",
    }
)
KNOWN = SIMULATED | OURS | NAV2
