"""Errors of leaves that use ROS."""

from sar_compiler.errors import SarError


class MissingNodeError(SarError, KeyError):
    """A leaf that needs a ROS node was set up without one, or ticked while it is not set up.

    It is also a `KeyError`, which is what py_trees' own ROS leaves raise.

    Args:
        leaf_name: The node's name.
        leaf_class: The name of its class.
    """

    def __init__(self, leaf_name: str, leaf_class: str) -> None:
        self.leaf_name = leaf_name
        self.leaf_class = leaf_class
        super().__init__(leaf_name, leaf_class)

    def __str__(self) -> str:
        return (
            f"'{self.leaf_name}' ({self.leaf_class}) works with ROS and has no node: "
            "pass an rclpy node to the tree's setup, as in setup(node=my_node)"
        )


class LeafDefinitionError(SarError):
    """The class of a leaf lacks an attribute that its base needs, or names a type that is not installed."""
