"""Search and rescue: the leaves of the mission and the state that they share.

This module is what the entry point `sar_compiler.nodes` names, so it has the spec of every leaf, as `make schemas` writes them. What is
named there is imported when a tree is made, without ROS: rclpy and the message types are imported when a leaf is set up.
"""

from pathlib import Path

from sar_compiler.leaves import declared_leaves

SPECS = declared_leaves(Path(__file__).with_name("leaf_specs.json"))

__all__ = ["SPECS"]
