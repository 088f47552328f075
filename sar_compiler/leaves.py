"""What leaves, controls and decorators of your own are made of: bases, ports, registration.

::

    @register("DriveTo", kind=Kind.ACTION, uses=[Use.action("navigate_to_pose"), Use.nav2()])
    class DriveTo(ActionLeaf): ...
"""

from typing import TYPE_CHECKING

from sar_compiler.faces import lazy

if TYPE_CHECKING:
    from sar_compiler.nodes.constructors import RegistrationError
    from sar_compiler.nodes.register import register
    from sar_compiler.nodes.semantics import Semantics
    from sar_compiler.nodes.spec import Kind, Use
    from sar_compiler.nodes.values import Milliseconds, Seconds
    from sar_compiler.ros.leaves.action_leaf import ActionLeaf
    from sar_compiler.ros.leaves.errors import LeafDefinitionError
    from sar_compiler.ros.leaves.leaf import RosLeaf
    from sar_compiler.ros.leaves.service_leaf import ServiceLeaf
    from sar_compiler.ros.leaves.topic_leaf import TopicLeaf
    from sar_compiler.runtime.answers import Answer
    from sar_compiler.runtime.clock import Clock
    from sar_compiler.runtime.kernel.user_nodes import Tick
    from sar_compiler.runtime.parents import Control, Decorator
    from sar_compiler.runtime.ports import InOut, Input, Output
    from sar_compiler.runtime.skipping import SKIPPED, SkippableLeaf

__all__ = [
    "SKIPPED",
    "ActionLeaf",
    "Answer",
    "Clock",
    "Control",
    "Decorator",
    "InOut",
    "Input",
    "Kind",
    "LeafDefinitionError",
    "Milliseconds",
    "Output",
    "RegistrationError",
    "RosLeaf",
    "Seconds",
    "Semantics",
    "ServiceLeaf",
    "SkippableLeaf",
    "Tick",
    "TopicLeaf",
    "Use",
    "register",
]

_MODULES = {
    "nodes.constructors": ("RegistrationError",),
    "nodes.register": ("register",),
    "nodes.semantics": ("Semantics",),
    "nodes.spec": ("Kind", "Use"),
    "nodes.values": ("Milliseconds", "Seconds"),
    "ros.leaves.action_leaf": ("ActionLeaf",),
    "ros.leaves.errors": ("LeafDefinitionError",),
    "ros.leaves.leaf": ("RosLeaf",),
    "ros.leaves.service_leaf": ("ServiceLeaf",),
    "ros.leaves.topic_leaf": ("TopicLeaf",),
    "runtime.answers": ("Answer",),
    "runtime.clock": ("Clock",),
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
