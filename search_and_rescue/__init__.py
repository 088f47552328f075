"""Search and rescue: the mission's leaves, and the state that the leaves share.

The entry point `sar_compiler.nodes` names this module. The specs of the leaves are in `leaf_specs.json`, which
`make schemas` generates. The classes of the leaves are imported when a tree is constructed, without ROS: rclpy
and the message types are imported when a leaf is set up.
"""

from pathlib import Path

from sar_compiler.leaves import declared_leaves

SPECS = declared_leaves(Path(__file__).with_name("leaf_specs.json"))

__all__ = ["SPECS"]
