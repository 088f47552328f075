"""Sequences and fallbacks over children that can be skipped, or that pause: those of `runtime.controls`."""

from typing import Any

from sar_compiler.runtime.controls import AsyncFallback, AsyncSequence, Fallback, Sequence, SequenceWithMemory
from sar_compiler.runtime.flat.cells import FAILURE, RUNNING, SKIPPED, Cells, Stop, Tick, number_of
from sar_compiler.runtime.flat.parts import Part, builds, halted_with_children, reset, reset_all
from sar_compiler.runtime.flat.times import Times


@builds(Sequence, Fallback, AsyncSequence, AsyncFallback, SequenceWithMemory)
def in_order(part: Part) -> tuple[Tick, Stop]:
    """Build one of them."""
    if not part.behaviour.memory:
        return _reactive(part)
    node = _Resuming(part)
    forgotten = [node.skips, node.position] if node.goes_back else [node.skips]
    return node.tick, halted_with_children(part, *forgotten)


class _Resuming:
    """A control that resumes with the child that was running."""

    def __init__(self, part: Part) -> None:
        self.part = part
        cls = type(part.behaviour)
        self.goes_back = cls is not SequenceWithMemory
        self.pauses = cls in {AsyncSequence, AsyncFallback, SequenceWithMemory}
        self.hands_over = number_of(part.behaviour._hands_over)
        self.position, self.skips = part.cell(0), part.cell(0)

    def tick(self, cells: Cells, times: Times) -> int:
        at, position, behaviour, children = (
            self.part.at,
            self.position,
            self.part.behaviour,
            self.part.children,
        )
        if cells[at] != RUNNING:
            cells[self.skips] = 0
            behaviour.feedback_message = ""
        cells[at] = RUNNING
        while cells[position] < len(children):
            child, tick_child, _, cell = children[cells[position]]
            behaviour.current_child = child
            was_running = cells[cell] == RUNNING
            outcome = tick_child(cells, times)
            if outcome == RUNNING:
                return RUNNING
            if outcome == SKIPPED:
                cells[self.skips] += 1
            elif outcome != self.hands_over:
                return self.decide(outcome, cells, times)
            cells[position] += 1
            if self.pauses and outcome != SKIPPED and not was_running and cells[position] < len(children):
                behaviour._wake()
                return RUNNING
        return self.finish(cells, times)

    def decide(self, outcome: int, cells: Cells, times: Times) -> int:
        """End because of the child that was ticked last."""
        _tell(self.part.behaviour, cells[self.position], outcome)
        cells[self.skips] = 0
        if self.goes_back:
            cells[self.position] = 0
        reset_all(self.part.children[cells[self.position] :], cells, times)
        cells[self.part.at] = outcome
        return outcome

    def finish(self, cells: Cells, times: Times) -> int:
        """End because no child has decided."""
        all_skipped = cells[self.skips] == len(self.part.children)
        cells[self.position] = cells[self.skips] = 0
        reset_all(self.part.children, cells, times)
        if all_skipped:
            return SKIPPED
        cells[self.part.at] = self.hands_over
        return self.hands_over


def _reactive(part: Part) -> tuple[Tick, Stop]:
    at, behaviour, children = part.at, part.behaviour, part.children
    hands_over = number_of(behaviour._hands_over)

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] != RUNNING:
            behaviour.feedback_message = ""
        cells[at] = RUNNING
        end = SKIPPED
        for index, child in enumerate(children):
            behaviour.current_child = child.behaviour
            outcome = child.tick(cells, times)
            if outcome == SKIPPED:
                reset(child, cells, times)
                continue
            if outcome == RUNNING:
                reset_all(children[:index], cells, times)
                reset_all(children[index + 1 :], cells, times)
                return RUNNING
            end = outcome
            if outcome != hands_over:
                _tell(behaviour, index, outcome)
                break
        reset_all(children, cells, times)
        if end != SKIPPED:
            cells[at] = end
        return end

    return tick, halted_with_children(part)


def _tell(behaviour: Any, index: int, outcome: int) -> None:
    """Say which child has decided."""
    how = "failed" if outcome == FAILURE else "succeeded"
    behaviour.feedback_message = f"{behaviour.children[index].name} {how}"
