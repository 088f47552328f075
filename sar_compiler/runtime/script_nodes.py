"""Nodes that run scripts.

py_trees has checks and assignments of single blackboard variables, but no expressions.
"""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.kernel.turning import PreconditionNode
from sar_compiler.runtime.parents import Decorator
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.scripting import NodeScript


class RunScript(Behaviour):
    """Runs a script, and succeeds.

    Args:
        name: The node's name.
        code: The script.
        scope: Where its variables are.
        enums: The names that stand for numbers.
    """

    def __init__(self, name: str, code: Input[Script], scope: Scope, enums: Enums) -> None:
        super().__init__(name)
        self._script = NodeScript(code, name, "code", scope, enums)

    def update(self) -> Status:
        """Run the script."""
        self._script.run()
        return Status.SUCCESS


class ScriptCondition(Behaviour):
    """Runs a script, and succeeds if its value is true.

    Args:
        name: The node's name.
        code: The script; its value is true or false, 1 or 0.
        scope: Where its variables are.
        enums: The names that stand for numbers.

    Attributes:
        script: The script.
    """

    def __init__(self, name: str, code: Input[Script], scope: Scope, enums: Enums) -> None:
        super().__init__(name)
        self.script = NodeScript(code, name, "code", scope, enums)

    def update(self) -> Status:
        """Run the script."""
        return Status.SUCCESS if self.script.holds() else Status.FAILURE


class Precondition(Decorator):
    """Ticks its child if a condition is true when it starts; while the child runs, it does not ask again.

    Stock py_trees' EternalGuard asks in every tick, and can only fail.

    Args:
        if_: The condition, a script.
        else_: What to answer if it is false.
        scope: Where the script's variables are.
    """

    node_class = PreconditionNode

    def __init__(
        self,
        name: str,
        child: Behaviour,
        if_: Input[Script],
        scope: Scope,
        enums: Enums,
        else_: Input[Outcome] | None = None,
    ) -> None:
        super().__init__(name, child)
        self._condition = NodeScript(if_, name, "if", scope, enums)
        self._else = else_ or Input(Outcome.FAILURE)
