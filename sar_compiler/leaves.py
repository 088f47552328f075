"""What leaves, controls and decorators of your own are made of: bases, ports, registration.

::

    @register("DriveTo", kind=Kind.ACTION, uses=[Use.action("navigate_to_pose"), Use.nav2()])
    class DriveTo(ActionLeaf): ...
"""

from typing import TYPE_CHECKING

from sar_compiler.faces import lazy

if TYPE_CHECKING:
    from sar_compiler.nodes.constructors import RegistrationError
    from sar_compiler.nodes.declaring import (
        attribute,
        handed_over,
        inout_port,
        input_port,
        leaf_spec,
        output_port,
        reference,
    )
    from sar_compiler.nodes.register import register
    from sar_compiler.nodes.semantics import Semantics
    from sar_compiler.nodes.spec import Kind, Use
    from sar_compiler.nodes.values import Milliseconds, Seconds, at_least
    from sar_compiler.ros.leaves.action_leaf import ActionLeaf
    from sar_compiler.ros.leaves.deadline import Deadline
    from sar_compiler.ros.leaves.errors import LeafDefinitionError
    from sar_compiler.ros.leaves.goal import describe_status
    from sar_compiler.ros.leaves.goal_statuses import SUCCEEDED
    from sar_compiler.ros.leaves.interfaces import find_interface, qos_profile
    from sar_compiler.ros.leaves.leaf import RosLeaf, alive
    from sar_compiler.ros.leaves.service_leaf import ServiceLeaf
    from sar_compiler.ros.leaves.standstill import Standstill
    from sar_compiler.ros.leaves.topic_leaf import TopicLeaf
    from sar_compiler.ros.nav2_log import nav2_log
    from sar_compiler.ros.of_node import of_node
    from sar_compiler.ros.poses import turn_by, yaw_of
    from sar_compiler.ros.robot_estimate import RobotEstimate, robot_estimate
    from sar_compiler.runtime.answers import Answer
    from sar_compiler.runtime.clock import Clock, WallClock
    from sar_compiler.runtime.kernel.user_nodes import Tick
    from sar_compiler.runtime.parents import Control, Decorator
    from sar_compiler.runtime.ports import InOut, Input, Output
    from sar_compiler.runtime.skipping import SKIPPED, SkippableLeaf

__all__ = [
    "SKIPPED",
    "SUCCEEDED",
    "ActionLeaf",
    "Answer",
    "Clock",
    "Control",
    "Deadline",
    "Decorator",
    "InOut",
    "Input",
    "Kind",
    "LeafDefinitionError",
    "Milliseconds",
    "Output",
    "RegistrationError",
    "RobotEstimate",
    "RosLeaf",
    "Seconds",
    "Semantics",
    "ServiceLeaf",
    "SkippableLeaf",
    "Standstill",
    "Tick",
    "TopicLeaf",
    "Use",
    "WallClock",
    "alive",
    "at_least",
    "attribute",
    "describe_status",
    "find_interface",
    "handed_over",
    "inout_port",
    "input_port",
    "leaf_spec",
    "nav2_log",
    "of_node",
    "output_port",
    "qos_profile",
    "reference",
    "register",
    "robot_estimate",
    "turn_by",
    "yaw_of",
]

_MODULES = {
    "nodes.constructors": ("RegistrationError",),
    "nodes.declaring": (
        "attribute",
        "handed_over",
        "inout_port",
        "input_port",
        "leaf_spec",
        "output_port",
        "reference",
    ),
    "nodes.register": ("register",),
    "nodes.semantics": ("Semantics",),
    "nodes.spec": ("Kind", "Use"),
    "nodes.values": ("Milliseconds", "Seconds", "at_least"),
    "ros.leaves.action_leaf": ("ActionLeaf",),
    "ros.leaves.deadline": ("Deadline",),
    "ros.leaves.errors": ("LeafDefinitionError",),
    "ros.leaves.goal": ("describe_status",),
    "ros.leaves.goal_statuses": ("SUCCEEDED",),
    "ros.leaves.interfaces": ("find_interface", "qos_profile"),
    "ros.leaves.leaf": ("RosLeaf", "alive"),
    "ros.leaves.service_leaf": ("ServiceLeaf",),
    "ros.leaves.standstill": ("Standstill",),
    "ros.leaves.topic_leaf": ("TopicLeaf",),
    "ros.nav2_log": ("nav2_log",),
    "ros.of_node": ("of_node",),
    "ros.poses": ("turn_by", "yaw_of"),
    "ros.robot_estimate": ("RobotEstimate", "robot_estimate"),
    "runtime.answers": ("Answer",),
    "runtime.clock": ("Clock", "WallClock"),
    "runtime.kernel.user_nodes": ("Tick",),
    "runtime.parents": ("Control", "Decorator"),
    "runtime.ports": ("InOut", "Input", "Output"),
    "runtime.skipping": ("SKIPPED", "SkippableLeaf"),
}
_look_up, _names = lazy(__name__, _MODULES)
if not TYPE_CHECKING:
    __getattr__ = _look_up


def __dir__() -> list[str]:
    return [*globals(), *_names]
