"""Sequences and fallbacks: children in order, until one of them decides.

BehaviorTree.CPP's Sequence and Fallback are py_trees' own as long as no child skips; the classes here are for
children that may, and for the forms that py_trees does not have.
"""

from collections.abc import Sequence as Children
from typing import Any

from py_trees import composites
from py_trees.behaviour import Behaviour

from sar_compiler.runtime.flat.cells import FAILURE, RUNNING, SKIPPED, SUCCESS, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Part, builds, halted_with_children, reset, reset_all
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Control, Yielding


class _InOrder(Control):
    """Children in order: one that answers `_hands_over` is followed by the next, the other end decides.

    Args:
        name: The node's name.
        memory: Whether to go on with the child that was running, or to look at every child again.
        children: The children, in order.
    """

    _hands_over: int

    def __init__(self, name: str, memory: bool, children: Children[Behaviour]) -> None:
        super().__init__(name, children)
        self.memory = memory


class Sequence(_InOrder, composites.Sequence):
    """A sequence that passes over children that are skipped; it is skipped itself if all of them are.

    Stock py_trees stops at a skipped child, as if it had been interrupted.

    Args:
        name: The node's name.
        memory: Whether to go on with the child that was running (true), or to look at every child again (false).
        children: The children, in order.
    """

    _hands_over = SUCCESS


class Fallback(_InOrder, composites.Selector):
    """A fallback that passes over children that are skipped; it is skipped itself if all of them are.

    Stock py_trees takes a skipped child for one that failed.

    Args:
        name: The node's name.
        memory: Whether to go on with the child that was running (true), or to look at every child again (false).
        children: The children, in order.
    """

    _hands_over = FAILURE


class _Pausing(Yielding, _InOrder):
    def __init__(self, name: str, children: Children[Behaviour]) -> None:
        super().__init__(name, True, children)  # noqa: FBT003 - stock composites have it second


class AsyncSequence(_Pausing, Sequence):
    """A sequence that pauses after every child that succeeds at once, so that it can be interrupted there.

    Stock py_trees goes through such children in one tick.

    Args:
        name: The node's name.
        children: The children, in order.
    """


class AsyncFallback(_Pausing, Fallback):
    """A fallback that pauses after every child that fails at once, so that it can be interrupted there.

    Stock py_trees goes through such children in one tick.

    Args:
        name: The node's name.
        children: The children, in order.
    """


class SequenceWithMemory(_Pausing, Sequence):
    """A sequence that goes on with the child that failed or was halted when it is started again.

    Stock py_trees starts from the first child then. It also pauses as AsyncSequence does.

    Args:
        name: The node's name.
        children: The children, in order.
    """


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
        self.hands_over: int = part.behaviour._hands_over
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
    hands_over = behaviour._hands_over

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
