"""Nodes that run scripts, and the conditions of any node: scripts that decide whether it is ticked, or that run when it ends.

py_trees has checks and assignments of single blackboard variables, but no expressions.
"""

from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.kernel.cells import FAILURE, INVALID, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.turning import ConditionsNode, PreconditionNode
from sar_compiler.runtime.parents import Decorator, OwnDecorator
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


@dataclass(eq=False, repr=False)
class Precondition(OwnDecorator):
    """Ticks its child if a condition is true when it starts; while the child runs, it does not ask again.

    Stock py_trees' EternalGuard asks in every tick, and can only fail.
    """

    node_class = PreconditionNode
    if_: Input[Script]
    scope: Scope
    enums: Enums
    else_: Input[Outcome] = Input(Outcome.FAILURE)

    def __post_init__(self, child: Behaviour) -> None:
        super().__post_init__(child)
        self.condition = NodeScript(self.if_, self.name, "if", self.scope, self.enums)


@dataclass(frozen=True)
class ConditionScripts:
    """The scripts of a node's conditions; None for one that it does not have.

    Attributes:
        failure_if: Fail without being ticked if it is true when the node is to start.
        success_if: Succeed without being ticked, likewise.
        skip_if: Be skipped, likewise.
        while_: Be skipped if it is false, and be halted if it becomes false while the node runs.
        on_success: Is run when the node has succeeded.
        on_failure: Is run when the node has failed.
        on_halted: Is run when the node was halted while it ran.
        post: Is run after any of these three.
    """

    failure_if: Script | None = None
    success_if: Script | None = None
    skip_if: Script | None = None
    while_: Script | None = None
    on_success: Script | None = None
    on_failure: Script | None = None
    on_halted: Script | None = None
    post: Script | None = None


class Conditions(Decorator):
    """A node's pre- and post-conditions. They belong to the node: it and they have one status between them.

    Stock py_trees has guards that can only fail, and nothing that runs when a node ends.

    Args:
        child: The node.
        scripts: The conditions.
        scope: Where the scripts' variables are.
    """

    node_class = ConditionsNode
    is_its_child = True

    def __init__(
        self, name: str, child: Behaviour, scripts: ConditionScripts, scope: Scope, enums: Enums
    ) -> None:
        # First, because a behaviour's constructor sets its status, which is the child's here.
        self.decorated = child
        super().__init__(name, child)

        def ready(attribute: str, script: Script | None) -> NodeScript | None:
            return NodeScript(Input(script), child.name, attribute, scope, enums) if script else None

        before = (
            (ready("_failureIf", scripts.failure_if), "_failureIf", FAILURE),
            (ready("_successIf", scripts.success_if), "_successIf", SUCCESS),
            (ready("_skipIf", scripts.skip_if), "_skipIf", SKIPPED),
        )
        self._before = [(script, attribute, outcome) for script, attribute, outcome in before if script]
        self._while = ready("_while", scripts.while_)
        self._after = {
            SUCCESS: ready("_onSuccess", scripts.on_success),
            FAILURE: ready("_onFailure", scripts.on_failure),
            INVALID: ready("_onHalted", scripts.on_halted),
        }
        self._post = ready("_post", scripts.post)

    def run_after(self, outcome: int) -> None:
        """Run what is to be run after an end; INVALID means that the node was halted while it ran."""
        for script in (self._after[outcome], self._post):
            if script is not None:
                script.run()

    @property
    def status(self) -> Status:
        """The node's status."""
        return self.decorated.status

    @status.setter
    def status(self, status: Status) -> None:
        self.decorated.status = status
