"""Leaves: the behaviours that do the work; their own methods are called, at the same times as by py_trees."""

from collections.abc import Callable, Hashable
from typing import Any

from py_trees import behaviours
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.flat.cells import (
    FAILURE,
    INVALID,
    RUNNING,
    SKIPPED,
    STATUSES,
    SUCCESS,
    Cells,
    Stop,
    Tick,
    number_of,
)
from sar_compiler.runtime.flat.parts import Part, builds
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.skipping import SkippableLeaf, was_skipped


def leaf(part: Part) -> tuple[Tick, Stop]:
    """Build a leaf."""
    cls = type(part.behaviour)
    if cls.stop is Behaviour.stop:
        if cls.tick is Behaviour.tick:
            return _plain(part)
        if cls.tick is SkippableLeaf.tick:
            return _skippable(part)
    return _with_its_own_tick(part)


@builds(behaviours.StatusQueue)
def status_queue(part: Part) -> tuple[Tick, Stop]:
    """Build a StatusQueue; what is left of its queue is the end of the list that it was given."""

    def save(behaviour: Any) -> int:
        return len(behaviour.current_queue)

    def load(behaviour: Any, left: int) -> None:
        behaviour.current_queue = behaviour.queue[len(behaviour.queue) - left :]

    return _remembering(part, save, load)


@builds(behaviours.Periodic)
def periodic(part: Part) -> tuple[Tick, Stop]:
    """Build a Periodic."""

    def save(behaviour: Any) -> tuple[int, int]:
        return behaviour.count, number_of(behaviour.response)

    def load(behaviour: Any, state: tuple[int, int]) -> None:
        behaviour.count, behaviour.response = state[0], STATUSES[state[1]]

    return _remembering(part, save, load)


@builds(behaviours.SuccessEveryN)
def success_every_n(part: Part) -> tuple[Tick, Stop]:
    """Build a SuccessEveryN, which begins again after each success."""

    def save(behaviour: Any) -> int:
        return int(behaviour.count % abs(behaviour.every_n))

    def load(behaviour: Any, count: int) -> None:
        behaviour.count = count

    return _remembering(part, save, load)


@builds(behaviours.TickCounter)
def tick_counter(part: Part) -> tuple[Tick, Stop]:
    """Build a TickCounter, which begins again whenever it is started."""

    def save(behaviour: Any) -> int:
        return int(behaviour.counter) if behaviour.status is Status.RUNNING else 0

    def load(behaviour: Any, count: int) -> None:
        behaviour.counter = count

    return _remembering(part, save, load)


def _remembering(
    part: Part, save: Callable[[Any], Hashable], load: Callable[[Any, Any], None]
) -> tuple[Tick, Stop]:
    """Build a leaf that remembers something between two ticks, which is kept in a cell.

    Args:
        part: The leaf.
        save: Returns what it remembers.
        load: Gives it back.
    """
    behaviour = part.behaviour
    tick_leaf, stop_leaf = _plain(part)
    remembered = part.cell(save(behaviour))

    def tick(cells: Cells, times: Times) -> int:
        load(behaviour, cells[remembered])
        outcome = tick_leaf(cells, times)
        cells[remembered] = save(behaviour)
        return outcome

    def stop(cells: Cells, times: Times) -> None:
        load(behaviour, cells[remembered])
        stop_leaf(cells, times)
        cells[remembered] = save(behaviour)

    return tick, stop


def _plain(part: Part) -> tuple[Tick, Stop]:
    at, behaviour = part.at, part.behaviour
    update = behaviour.update
    initialise = _overridden(behaviour, "initialise")
    terminate = _overridden(behaviour, "terminate")

    def tick(cells: Cells, times: Times) -> int:  # noqa: ARG001
        before = cells[at]
        behaviour.status = STATUSES[before]
        if before != RUNNING and initialise is not None:
            initialise()
        answer = update()
        if answer is Status.RUNNING:
            now = RUNNING
        elif answer is Status.SUCCESS:
            now = SUCCESS
        elif answer is Status.FAILURE:
            now = FAILURE
        else:
            now, answer = INVALID, _no_end(behaviour, answer)
        if now != RUNNING and terminate is not None:
            terminate(answer)
        behaviour.status = answer
        cells[at] = now
        return now or SKIPPED

    return tick, _stopping(at, behaviour, terminate)


def _skippable(part: Part) -> tuple[Tick, Stop]:
    at, behaviour = part.at, part.behaviour
    update = behaviour.update
    initialise = _overridden(behaviour, "initialise")
    terminate = _overridden(behaviour, "terminate")

    def tick(cells: Cells, times: Times) -> int:  # noqa: ARG001
        before = cells[at]
        behaviour.status = STATUSES[before]
        if before != RUNNING and initialise is not None:
            initialise()
        answer = update()
        now = number_of(answer)
        behaviour.skipped = now == INVALID
        if now == INVALID:
            return SKIPPED
        if now != RUNNING and terminate is not None:
            terminate(answer)
        behaviour.status = answer
        cells[at] = now
        return now

    return tick, _stopping(at, behaviour, terminate)


def _with_its_own_tick(part: Part) -> tuple[Tick, Stop]:
    """Build a leaf whose class has a `tick` or a `stop` of its own, which are called."""
    at, behaviour = part.at, part.behaviour

    def tick(cells: Cells, times: Times) -> int:  # noqa: ARG001
        behaviour.status = STATUSES[cells[at]]
        try:
            behaviour.tick_once()
        finally:
            cells[at] = number_of(behaviour.status)
        return SKIPPED if was_skipped(behaviour) else int(cells[at])

    def stop(cells: Cells, times: Times) -> None:  # noqa: ARG001
        behaviour.status = STATUSES[cells[at]]
        behaviour.stop(Status.INVALID)
        cells[at] = number_of(behaviour.status)

    return tick, stop


def _stopping(at: int, behaviour: Behaviour, terminate: Callable[[Status], None] | None) -> Stop:
    def stop(cells: Cells, times: Times) -> None:  # noqa: ARG001
        if terminate is not None:
            behaviour.status = STATUSES[cells[at]]
            terminate(Status.INVALID)
        behaviour.status = Status.INVALID
        cells[at] = INVALID

    return stop


def _overridden(behaviour: Behaviour, name: str) -> Any:
    """Return a method, unless it is the empty one that every behaviour has."""
    method = getattr(behaviour, name)
    return None if getattr(method, "__func__", None) is getattr(Behaviour, name) else method


def _no_end(behaviour: Behaviour, answer: object) -> Status:
    """Return what py_trees makes of an answer that is none of the usual ones, and log what it logs."""
    if answer is not Status.INVALID:
        behaviour.logger.error(
            f"A behaviour returned an invalid status, setting to INVALID [{answer}][{behaviour.name}]"
        )
    return Status.INVALID
