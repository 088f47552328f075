"""The conditions of a node: those of `runtime.conditions`. A node and its conditions share one cell for their status."""

from sar_compiler.runtime.conditions import Conditions
from sar_compiler.runtime.flat.cells import (
    ENDED,
    INVALID,
    RUNNING,
    SKIPPED,
    Cells,
    Stop,
    Tick,
    number_of,
)
from sar_compiler.runtime.flat.parts import Part, builds, halted_by, is_reset, reset
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.scripting import NodeScript


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
        self.before = [
            (script, attribute, number_of(status) or SKIPPED)
            for script, attribute, status in behaviour._before
        ]
        self.goes_on: NodeScript | None = behaviour._while
        self.after = {number_of(status): script for status, script in behaviour._after.items()}
        self.is_reset = is_reset(behaviour)

    def tick(self, cells: Cells, times: Times) -> int:
        outcome = self.decided(cells, times) or self.child.tick(cells, times)
        if outcome & ENDED:
            _run(self.after[outcome], self.part.behaviour._post)
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
