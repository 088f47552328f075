"""Decorators that tick their child again: those of `runtime.repetition`."""

from sar_compiler.runtime.flat.cells import RUNNING, SKIPPED, Cells, Stop, Tick, number_of
from sar_compiler.runtime.flat.decorators import ticked
from sar_compiler.runtime.flat.parts import Part, builds, halted_by, reset
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.repetition import ENDLESS, Repeat, RetryUntilSuccessful


@builds(Repeat, RetryUntilSuccessful)
def again(part: Part) -> tuple[Tick, Stop]:
    """Build a Repeat or a RetryUntilSuccessful."""
    node = _FlatAgain(part)
    return node.tick, halted_by(part, node.halt)


class _FlatAgain:
    """A decorator that ticks its child again after one end; the other end ends it."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.tick_child = ticked(part)
        self.goes_on = number_of(part.behaviour._again)
        self.times = part.behaviour._times
        self.done = part.cell(0)
        # How often one without an end has ticked its child makes no difference: it is told, and in no cell.
        self.endless = self.times.entry is None and self.times.get() == ENDLESS
        self.told = 0

    def tick(self, cells: Cells, times: Times) -> int:
        behaviour, (child,), done = self.part.behaviour, self.part.children, self.done
        wanted = self.times.get()
        cells[self.part.at] = RUNNING
        while cells[done] < wanted or wanted == ENDLESS:
            self.tell(cells, wanted)
            was_running = cells[child.at] == RUNNING
            outcome = self.tick_child(cells, times)
            if outcome == RUNNING:
                return RUNNING
            if outcome == SKIPPED:
                reset(child, cells, times)
                return SKIPPED
            if outcome != self.goes_on:
                return self.end(outcome, cells)
            self.count(cells)
            wanted = behaviour._read_again(wanted)
            if not was_running and (cells[done] < wanted or wanted == ENDLESS):
                behaviour._wake()
                return RUNNING
        return self.end(self.goes_on, cells)

    def halt(self, cells: Cells, times: Times) -> None:
        cells[self.done] = self.told = 0
        reset(self.part.children[0], cells, times)

    def tell(self, cells: Cells, wanted: int) -> None:
        number = (self.told if self.endless else cells[self.done]) + 1
        limit = "" if wanted < 0 else f" of {wanted}"
        self.part.behaviour.feedback_message = f"{self.part.behaviour._counted} {number}{limit}"

    def count(self, cells: Cells) -> None:
        if self.endless:
            self.told += 1
        else:
            cells[self.done] += 1

    def end(self, outcome: int, cells: Cells) -> int:
        cells[self.done] = self.told = 0
        cells[self.part.at] = outcome
        return outcome
