"""The conditions of a node: scripts that decide whether it is ticked, and scripts that run when it ends."""

from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.flat.cells import (
    ENDED,
    FAILURE,
    INVALID,
    RUNNING,
    SKIPPED,
    SUCCESS,
    Cells,
    Stop,
    Tick,
)
from sar_compiler.runtime.flat.parts import Part, builds, halted_by, is_reset, reset
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Wrapper
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.scripting import NodeScript


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


class Conditions(Wrapper):
    """A node's pre- and post-conditions. They belong to the node: it and they have one status between them.

    Stock py_trees has guards that can only fail, and nothing that runs when a node ends.

    Args:
        name: The node's name.
        child: The node.
        scripts: The conditions.
        scope: Where the scripts' variables are.
        enums: The names that stand for numbers.
    """

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
        }
        self._post = ready("_post", scripts.post)
        self._on_halted = ready("_onHalted", scripts.on_halted)

    @property
    def status(self) -> Status:
        """The node's status."""
        return self.decorated.status

    @status.setter
    def status(self, status: Status) -> None:
        self.decorated.status = status


@builds(Conditions)
def conditions(part: Part) -> tuple[Tick, Stop]:
    """Build the conditions of a node."""
    node = _Conditions(part)
    return node.tick, node.stop


class _Conditions:
    def __init__(self, part: Part) -> None:
        behaviour = part.behaviour
        self.part = part
        (self.child,) = part.children
        self.stop = halted_by(part, self.halt)
        self.before: list[tuple[NodeScript, str, int]] = behaviour._before
        self.goes_on: NodeScript | None = behaviour._while
        self.is_reset = is_reset(behaviour)

    def tick(self, cells: Cells, times: Times) -> int:
        outcome = self.decided(cells, times) or self.child.tick(cells, times)
        if outcome & ENDED:
            _run(self.part.behaviour._after[outcome], self.part.behaviour._post)
        if outcome != SKIPPED:
            cells[self.part.at] = outcome
        return outcome

    def decided(self, cells: Cells, times: Times) -> int:
        """Return what the pre-conditions make of this tick; 0 if the node is to be ticked."""
        behaviour, status = self.part.behaviour, cells[self.part.at]
        if status == RUNNING:
            if self.goes_on is None or self.goes_on.holds():
                return 0
            self.stop(cells, times)
            behaviour.feedback_message = "halted by _while"
            return SKIPPED
        behaviour.feedback_message = ""
        if status != INVALID and self.is_reset:
            return 0
        for script, attribute, outcome in self.before:
            if script.holds():
                behaviour.feedback_message = f"decided by {attribute}"
                return outcome
        if self.goes_on is not None and not self.goes_on.holds():
            behaviour.feedback_message = "decided by _while"
            return SKIPPED
        return 0

    def halt(self, cells: Cells, times: Times) -> None:
        was_running = cells[self.part.at] == RUNNING
        reset(self.child, cells, times)
        if was_running:
            _run(self.part.behaviour._on_halted, self.part.behaviour._post)


def _run(*scripts: NodeScript | None) -> None:
    for script in scripts:
        if script is not None:
            script.run()
