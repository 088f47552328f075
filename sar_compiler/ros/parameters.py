"""A node that declares every parameter that is given in a parameter file or on the command line."""

from array import array
from typing import Any

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from sar_compiler.ros.arguments import RosArgumentError, convert_ros_errors


class DataNode(Node):
    """A node that declares every parameter that is given in a parameter file or on the command line.

    Args:
        name: The node's name, if no remap rule changes it.
        context: The node's context; by default the default context.
        cli_args: The node's own ROS arguments (`arguments.node_arguments`).
        options: Further keyword arguments of `rclpy.node.Node`.

    Raises:
        RosArgumentError: If a name or value in the ROS arguments is invalid.
    """

    def __init__(
        self, name: str, context: Context | None = None, cli_args: list[str] | None = None, **options: Any
    ) -> None:
        with convert_ros_errors():
            try:
                super().__init__(
                    name,
                    context=context,
                    cli_args=cli_args,
                    automatically_declare_parameters_from_overrides=True,
                    allow_undeclared_parameters=True,
                    **options,
                )
            except ValueError as error:
                # Of the user's values, only an empty list, whose type is unknown, can cause a ValueError.
                if "PARAMETER_NOT_SET" not in str(error):
                    raise
                names = _names_without_type(name, context, cli_args)
                raise RosArgumentError(
                    f"{names}: ROS cannot infer the type of an empty list. Omit the parameter, or add a value"
                ) from error
        _require_sim_time_switch(self)


def _require_sim_time_switch(node: Node) -> None:
    """Check that `use_sim_time` is a Boolean, because a node ignores values of other types."""
    value = node.get_parameter("use_sim_time").value
    if not isinstance(value, bool):
        node.destroy_node()
        raise RosArgumentError(f"parameter use_sim_time must be true or false, but is {value!r}")


def _names_without_type(name: str, context: Context | None, cli_args: list[str] | None) -> str:
    """Return the names of the parameters whose type ROS cannot infer."""
    probe = Node(
        name, context=context, cli_args=cli_args, start_parameter_services=False, enable_rosout=False
    )
    given: dict[str, Parameter] = getattr(probe, "_parameter_overrides", {})
    probe.destroy_node()
    names = [key for key, value in given.items() if value.type_ == Parameter.Type.NOT_SET]
    return f"parameter {', '.join(names)}" if names else "a parameter"


def flat_parameters(node: Node) -> dict[str, object]:
    """Return the values of a node's parameters by flat name; arrays are converted to lists."""
    values = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
    return {name: list(value) if isinstance(value, array) else value for name, value in values.items()}
