"""Search and rescue: the leaves of the mission and the state that they share.

This module is what the entry point `sar_compiler.nodes` names, so it has the spec of every leaf. What is named there is
imported when a tree is made, without ROS: rclpy and the message types are imported when a leaf is set up.
"""

from search_and_rescue.leaf_specs import SPECS

__all__ = ["SPECS"]
