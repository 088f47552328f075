"""Sequences and fallbacks: children in order, until one of them decides.

BehaviorTree.CPP's Sequence and Fallback are py_trees' own as long as no child skips; the classes here are for
children that may, and for the forms that py_trees does not have.
"""

from collections.abc import Sequence as Children

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.parents import Control, Ticking, Yielding, outcome_of
from sar_compiler.runtime.skipping import SKIPPED, reset


class _InOrder(Control):
    """Children in order: one that answers `_hands_over` is followed by the next, the other end decides.

    Args:
        name: The node's name.
        memory: Whether to go on with the child that was running, or to look at every child again.
        children: The children, in order.
    """

    _hands_over: Status

    def __init__(self, name: str, memory: bool, children: Children[Behaviour]) -> None:
        super().__init__(name, children)
        self.memory = memory
        self._index = 0
        self._skipped = 0

    def _work(self) -> Ticking:
        if self.status != Status.RUNNING:
            self._skipped = 0
            self.feedback_message = ""
        self.status = Status.RUNNING
        return self._go_on() if self.memory else self._look_at_all()

    def _go_on(self) -> Ticking:
        count = len(self.children)
        while self._index < count:
            child = self.current_child = self.children[self._index]
            was_running = child.status == Status.RUNNING
            yield from child.tick()
            outcome = outcome_of(child)
            if outcome == Status.RUNNING:
                return outcome
            if outcome == SKIPPED:
                self._skipped += 1
            elif outcome != self._hands_over:
                self._decide(child)
                return outcome
            self._index += 1
            if outcome != SKIPPED and not was_running and self._index < count and self._pauses():
                return Status.RUNNING
        all_skipped = self._skipped == count
        self._index = self._skipped = 0
        self._reset_children()
        return SKIPPED if all_skipped else self._hands_over

    def _look_at_all(self) -> Ticking:
        all_skipped = True
        for child in self.children:
            self.current_child = child
            yield from child.tick()
            outcome = outcome_of(child)
            if outcome == SKIPPED:
                reset(child)
                continue
            all_skipped = False
            if outcome == Status.RUNNING:
                self._reset_others(child)
                return outcome
            if outcome != self._hands_over:
                self._decide(child)
                return outcome
        self._reset_children()
        return SKIPPED if all_skipped else self._hands_over

    def _decide(self, child: Behaviour) -> None:
        """Come to the end because of a child."""
        self.feedback_message = f"{child.name} {'failed' if child.status == Status.FAILURE else 'succeeded'}"
        first = self._forget()
        self._reset_children(first)

    def _pauses(self) -> bool:
        """Pause after a child that has ended in its first tick, where that is this node's way."""
        return False

    def _forget(self) -> int:
        """Start from the first child again; return the first child to be reset."""
        self._index = 0
        return 0

    def _reset_others(self, running: Behaviour) -> None:
        for child in self.children:
            if child is not running:
                reset(child)

    def _halt(self) -> None:
        self._forget()
        super()._halt()


class Sequence(_InOrder, composites.Sequence):
    """A sequence that passes over children that are skipped; it is skipped itself if all of them are.

    Stock py_trees stops at a skipped child, as if it had been interrupted.

    Args:
        name: The node's name.
        memory: Whether to go on with the child that was running (true), or to look at every child again (false).
        children: The children, in order.
    """

    _hands_over = Status.SUCCESS


class Fallback(_InOrder, composites.Selector):
    """A fallback that passes over children that are skipped; it is skipped itself if all of them are.

    Stock py_trees takes a skipped child for one that failed.

    Args:
        name: The node's name.
        memory: Whether to go on with the child that was running (true), or to look at every child again (false).
        children: The children, in order.
    """

    _hands_over = Status.FAILURE


class _Pausing(Yielding, _InOrder):
    def __init__(self, name: str, children: Children[Behaviour]) -> None:
        super().__init__(name, True, children)  # noqa: FBT003 - stock composites have it second

    def _pauses(self) -> bool:
        return self._pause() == Status.RUNNING


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

    def _forget(self) -> int:
        return self._index
