"""The kernel's nodes for leaves. They call the methods of behaviours at the same points as py_trees."""

from typing import Any, Final

from librt.vecs import vec
from mypy_extensions import i32
from py_trees import behaviours
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.kernel.cells import (
    FAILURE,
    INVALID,
    RUNNING,
    SKIPPED,
    STATUSES,
    SUCCESS,
    WORDS,
    number_of,
)
from sar_compiler.runtime.kernel.tree_nodes import ChildlessNode, NodeBuilder, Ticker, Visit
from sar_compiler.runtime.kernel.turning import is_news, watched_entry
from sar_compiler.runtime.leaf_protocol import NoStatusError
from sar_compiler.runtime.parents import EngineBehaviour

_INVALID: Final[Any] = Status.INVALID
_RUNNING: Final[Any] = Status.RUNNING
_SUCCESS: Final[Any] = Status.SUCCESS
_FAILURE: Final[Any] = Status.FAILURE
_CONSTANTS: Final[tuple[type, ...]] = (behaviours.Success, behaviours.Failure, behaviours.Running)


class LeafNode(ChildlessNode):
    """A leaf whose class does not override py_trees' `tick` and `stop`.

    Attributes:
        initialises: Whether the leaf class overrides `initialise`.
        terminates: Whether the leaf class overrides `terminate`.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.shows_itself = True
        self.initialises = is_own(part.behaviour, "initialise")
        self.terminates = is_own(part.behaviour, "terminate")

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        cells, behaviour = ticker.cells, self.behaviour
        before = cells[self.status_cell]
        if before == RUNNING or not ticker.is_live:
            before = self.status_before_tick(ticker)
        if before != RUNNING and self.initialises:
            behaviour.initialise()
        answer = behaviour.update()
        if answer is _SUCCESS:
            now = SUCCESS
        elif answer is _RUNNING:
            now = RUNNING
        elif answer is _FAILURE:
            now = FAILURE
        else:
            return self.end_without(ticker, answer)
        if now != RUNNING and self.terminates:
            behaviour.terminate(answer)
        if now != RUNNING or before != RUNNING:
            behaviour.status = answer
            cells[self.status_cell] = now
        return now

    def status_before_tick(self, ticker: Ticker) -> int:
        """Return the leaf's status before the tick. Unless the tree is live, set it from the cell."""
        before, status = ticker.cells[self.status_cell], self.behaviour.status
        if status is STATUSES[before]:
            return before
        if ticker.is_live:
            # Other code has stopped the behaviour, or has set its status.
            return number_of(status)
        self.behaviour.status = STATUSES[before]
        return before

    def end_without(self, ticker: Ticker, answer: Any) -> int:
        """End the leaf after a result that is not a status. Like py_trees, treat the result as INVALID."""
        behaviour = self.behaviour
        ticker.number_of(behaviour, answer)
        if self.terminates:
            behaviour.terminate(_INVALID)
        behaviour.status = _INVALID
        ticker.cells[self.status_cell] = INVALID
        return SKIPPED

    def stop(self, ticker: Ticker) -> None:
        """Stop the leaf."""
        behaviour = self.behaviour
        if self.terminates:
            self.status_before_tick(ticker)
            behaviour.terminate(_INVALID)
        behaviour.status = _INVALID
        ticker.cells[self.status_cell] = INVALID


class SkippableLeafNode(LeafNode):
    """A leaf that can return INVALID to skip its tick. A skipped tick does not end the leaf."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf, and record whether it was skipped."""
        outcome = super().begin(ticker)
        self.behaviour.skipped = outcome == SKIPPED
        return outcome

    def end_without(self, ticker: Ticker, answer: Any) -> int:
        """Return SKIPPED without changing the leaf's status."""
        ticker.number_of(self.behaviour, answer)
        return SKIPPED


class StrictUpdate:
    """A wrapper around the `update` of a behaviour. It raises an error if the result is not a status.

    Args:
        behaviour: A behaviour that is ticked by its own methods.
    """

    def __init__(self, behaviour: Any) -> None:
        self._behaviour = behaviour
        self._update = behaviour.update

    def __call__(self) -> Any:
        """Call the original `update`, and return the status that it returns.

        Raises:
            NoStatusError: If the result is not a status.
        """
        answer = self._update()
        if number_of(answer) == INVALID and answer is not _INVALID:
            raise NoStatusError(self._behaviour, answer)
        return answer


def insist_on_status(behaviour: Any) -> None:
    """Make a behaviour raise an error, instead of logging it, if its `update` does not return a status.

    Only the `update` method of this object is wrapped, not the method of its class. py_trees' Success, Failure and Running are not changed,
    because they always return a status.
    """
    if type(behaviour) not in _CONSTANTS and not isinstance(behaviour.update, StrictUpdate):
        behaviour.update = StrictUpdate(behaviour)


class ForeignNode(ChildlessNode):
    """The node for a behaviour of an unknown class, which is ticked by its own methods.

    The kernel's tree does not contain the descendants of the behaviour.
    """

    def require_statuses(self) -> None:
        """Make the behaviour and its descendants raise an error if their `update` does not return a status."""
        for each in self.behaviour.iterate():
            if not isinstance(each, EngineBehaviour):
                insist_on_status(each)

    def begin(self, ticker: Ticker) -> int:
        """Tick the behaviour, and record a visit of each descendant that its `tick` yields."""
        cells, behaviour, visits = ticker.cells, self.behaviour, ticker.visits
        self.write_status(ticker.cells)
        try:
            for node in behaviour.tick():
                if visits is not None and node is not behaviour:
                    status = number_of(node.status)
                    skipped = status == INVALID or getattr(node, "skipped", False)
                    visits.append(Visit(node, SKIPPED if skipped else status, status))
        finally:
            cells[self.status_cell] = number_of(behaviour.status)
        if cells[self.status_cell] == INVALID or getattr(behaviour, "skipped", False):
            return SKIPPED
        return cells[self.status_cell]

    def stop(self, ticker: Ticker) -> None:
        """Stop the behaviour."""
        ticker.reach(self)
        self.write_status(ticker.cells)
        self.behaviour.stop(_INVALID)
        ticker.cells[self.status_cell] = number_of(self.behaviour.status)


class RememberingNode(LeafNode):
    """A leaf of py_trees that has state between two ticks. Except in a live tree, a cell stores this state.

    Attributes:
        kept: The cell that stores the leaf's state.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.kept = part.value(self.save(), keeps=True)

    def save(self) -> Any:
        """Return the state of the leaf as a hashable value."""
        raise NotImplementedError

    def load(self, kept: Any) -> None:
        """Restore the state of the leaf."""
        raise NotImplementedError

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        if ticker.is_live:
            return super().begin(ticker)
        self.load(ticker.values[self.kept])
        outcome = super().begin(ticker)
        ticker.values[self.kept] = self.save()
        return outcome

    def stop(self, ticker: Ticker) -> None:
        """Stop the leaf."""
        if ticker.is_live:
            super().stop(ticker)
            return
        self.load(ticker.values[self.kept])
        super().stop(ticker)
        ticker.values[self.kept] = self.save()


class StatusQueueNode(RememberingNode):
    """The node for a StatusQueue of py_trees. The remaining statuses are always the last ones of the queue."""

    def save(self) -> Any:
        """Return the length of the remaining queue."""
        return len(self.behaviour.current_queue)

    def load(self, kept: Any) -> None:
        """Restore the remaining queue."""
        behaviour = self.behaviour
        behaviour.current_queue = behaviour.queue[len(behaviour.queue) - kept :]


class PeriodicNode(RememberingNode):
    """The node for a Periodic of py_trees."""

    def save(self) -> Any:
        """Return the leaf's count and current response."""
        return self.behaviour.count, number_of(self.behaviour.response)

    def load(self, kept: Any) -> None:
        """Restore the leaf's count and current response."""
        self.behaviour.count, self.behaviour.response = kept[0], STATUSES[kept[1]]


class SuccessEveryNNode(RememberingNode):
    """The node for a SuccessEveryN of py_trees."""

    def save(self) -> Any:
        """Return the number of ticks since the last success."""
        return int(self.behaviour.count % abs(self.behaviour.every_n))

    def load(self, kept: Any) -> None:
        """Restore the leaf's count."""
        self.behaviour.count = kept


class TickCounterNode(RememberingNode):
    """The node for a TickCounter of py_trees."""

    def save(self) -> Any:
        """Return the number of ticks since the leaf started, or 0 if the leaf is not running."""
        return int(self.behaviour.counter) if self.behaviour.status is _RUNNING else 0

    def load(self, kept: Any) -> None:
        """Restore the leaf's counter."""
        self.behaviour.counter = kept


class ConstantNode(ChildlessNode):
    """The node for a Success, Failure or Running of py_trees. The result is constant, so `update` is not called.

    Attributes:
        outcome: The constant outcome.
        tells: Whether the behaviour's feedback message is already set.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.outcome = WORDS.index(type(part.behaviour).__name__.upper())
        self.tells = False

    def begin(self, ticker: Ticker) -> int:
        """Return the constant outcome."""
        if not self.tells:
            self.set_message(self.outcome)
        ticker.cells[self.status_cell] = self.outcome
        return self.outcome

    def write_status(self, cells: vec[i32]) -> None:
        """Set the behaviour's status from the cells. If the behaviour is idle, clear its message."""
        super().write_status(cells)
        if self.tells and cells[self.status_cell] == INVALID:
            self.set_message(INVALID)

    def set_message(self, outcome: int) -> None:
        """Set the feedback message to the name of an outcome, or to an empty string for INVALID."""
        self.behaviour.feedback_message = WORDS[outcome].lower()
        self.tells = outcome != INVALID


class UpdateCheckNode(ChildlessNode):
    """A leaf that succeeds if an entry was written after the leaf's last check. Otherwise the leaf fails.

    Attributes:
        seen: The cell that stores the entry's number of writes at the last check.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.entry = watched_entry(part.behaviour)
        self.seen = part.cell(keeps=True)
        part.watch_entry(self.entry, self.seen)

    def begin(self, ticker: Ticker) -> int:
        """Check the entry."""
        now = SUCCESS if is_news(self.entry, self.seen, ticker) else FAILURE
        ticker.cells[self.status_cell] = now
        return now


def is_own(behaviour: Any, name: str) -> bool:
    """Return whether a behaviour overrides a method of `Behaviour`."""
    method = getattr(behaviour, name)
    return getattr(method, "__func__", None) is not getattr(Behaviour, name)
