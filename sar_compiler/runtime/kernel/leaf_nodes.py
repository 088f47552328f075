"""Leaves, the behaviours that do the work. Their methods are called at the same points as by py_trees."""

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
    """A leaf with py_trees' own `tick` and `stop`.

    Attributes:
        initialises: Whether its class defines `initialise`.
        terminates: Whether its class defines `terminate`.
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
        """Return the status before the tick, after storing the behaviour's status in its cell."""
        before, status = ticker.cells[self.status_cell], self.behaviour.status
        if status is STATUSES[before]:
            return before
        if ticker.is_live:
            # Other code has stopped it, or set its status.
            return number_of(status)
        self.behaviour.status = STATUSES[before]
        return before

    def end_without(self, ticker: Ticker, answer: Any) -> int:
        """End with a result other than SUCCESS, FAILURE and RUNNING; py_trees converts it to INVALID and logs it."""
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
    """A leaf that may be skipped: INVALID means skipped, and does not end it."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf, and record whether it was skipped."""
        outcome = super().begin(ticker)
        self.behaviour.skipped = outcome == SKIPPED
        return outcome

    def end_without(self, ticker: Ticker, answer: Any) -> int:
        """Keep the old status."""
        ticker.number_of(self.behaviour, answer)
        return SKIPPED


class StrictUpdate:
    """The `update` of a behaviour that its own methods tick; raises an error if the result is not a status.

    Args:
        behaviour: The behaviour.
    """

    def __init__(self, behaviour: Any) -> None:
        self._behaviour = behaviour
        self._update = behaviour.update

    def __call__(self) -> Any:
        """Return the status.

        Raises:
            NoStatusError: If the result is not a status.
        """
        answer = self._update()
        if number_of(answer) == INVALID and answer is not _INVALID:
            raise NoStatusError(self._behaviour, answer)
        return answer


def insist_on_status(behaviour: Any) -> None:
    """Make a behaviour raise an error if its `update` does not return a status; py_trees only logs one in each tick.

    Its class stays unchanged; only the method of this object is wrapped. py_trees' constants always return a status,
    and their nodes replace `update`.
    """
    if type(behaviour) not in _CONSTANTS and not isinstance(behaviour.update, StrictUpdate):
        behaviour.update = StrictUpdate(behaviour)


class ForeignNode(ChildlessNode):
    """A behaviour that is ticked by its own methods, because its class is unknown.

    Its descendants, if there are any, are not part of this tree.
    """

    def require_statuses(self) -> None:
        """Make all behaviours that other nodes tick raise an error if they return no status."""
        for each in self.behaviour.iterate():
            if not isinstance(each, EngineBehaviour):
                insist_on_status(each)

    def begin(self, ticker: Ticker) -> int:
        """Tick the behaviour, and record each descendant that it yields as a visit."""
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
    """A leaf with state between two ticks. The state is stored in a cell; on a live tree the leaf may keep it itself.

    Attributes:
        kept: The cell.
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
    """A StatusQueue; the remaining queue is always the end of its list."""

    def save(self) -> Any:
        """Return the length of the remaining queue."""
        return len(self.behaviour.current_queue)

    def load(self, kept: Any) -> None:
        """Restore the queue."""
        behaviour = self.behaviour
        behaviour.current_queue = behaviour.queue[len(behaviour.queue) - kept :]


class PeriodicNode(RememberingNode):
    """A Periodic."""

    def save(self) -> Any:
        """Return its count and its status."""
        return self.behaviour.count, number_of(self.behaviour.response)

    def load(self, kept: Any) -> None:
        """Restore them."""
        self.behaviour.count, self.behaviour.response = kept[0], STATUSES[kept[1]]


class SuccessEveryNNode(RememberingNode):
    """A SuccessEveryN, which restarts after each success."""

    def save(self) -> Any:
        """Return its count since the last success."""
        return int(self.behaviour.count % abs(self.behaviour.every_n))

    def load(self, kept: Any) -> None:
        """Restore it."""
        self.behaviour.count = kept


class TickCounterNode(RememberingNode):
    """A TickCounter, which restarts with each start."""

    def save(self) -> Any:
        """Return its count."""
        return int(self.behaviour.counter) if self.behaviour.status is _RUNNING else 0

    def load(self, kept: Any) -> None:
        """Restore it."""
        self.behaviour.counter = kept


class ConstantNode(ChildlessNode):
    """A Success, Failure or Running of py_trees, which replaces `update` because its result and message are constant.

    Attributes:
        outcome: The outcome that it returns.
        tells: Whether the behaviour already has the message.
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
        """Set the behaviour's message, and its status from the cells."""
        super().write_status(cells)
        if self.tells and cells[self.status_cell] == INVALID:
            self.set_message(INVALID)

    def set_message(self, outcome: int) -> None:
        """Set the feedback message, which is empty when idle."""
        self.behaviour.feedback_message = WORDS[outcome].lower()
        self.tells = outcome != INVALID


class UpdateCheckNode(ChildlessNode):
    """A leaf that succeeds if an entry was written since its last check, else fails.

    Attributes:
        seen: The cell with the entry's number of writes at that time.
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
    """Return whether a method is not the empty default of all behaviours."""
    method = getattr(behaviour, name)
    return getattr(method, "__func__", None) is not getattr(Behaviour, name)
