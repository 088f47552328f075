"""py_trees' own decorators: what they make of their child's status is their own `update`, which is called.

What such a decorator remembers between two ticks is moved between its attributes and cells.
"""

from collections.abc import Callable, Iterable
from typing import Any

from py_trees import decorators as stock
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
from sar_compiler.runtime.frozen import freeze, thaw

Initialise = Callable[[Cells, Times], None]
Update = Callable[[Cells, Times], int]
Terminate = Callable[[Cells, int], None]


@builds(
    stock.Condition,
    stock.Count,
    stock.Inverter,
    stock.PassThrough,
    stock.StatusToBlackboard,
    stock.FailureIsRunning,
    stock.FailureIsSuccess,
    stock.RunningIsFailure,
    stock.RunningIsSuccess,
    stock.SuccessIsFailure,
    stock.SuccessIsRunning,
)
def stateless(part: Part) -> tuple[Tick, Stop]:
    """Build a decorator that remembers nothing; what Count counts makes no difference to any tick."""
    return decorated(part, _nothing, _own_update(part), _own_terminate(part))


@builds(stock.Repeat)
def repeat(part: Part) -> tuple[Tick, Stop]:
    """Build a Repeat; one that has no end does not have to remember how often it was."""
    return _counting(part, "success", bounded=part.behaviour.num_success > 0)


@builds(stock.Retry)
def retry(part: Part) -> tuple[Tick, Stop]:
    """Build a Retry."""
    return _counting(part, "failures", bounded=True)


def _counting(part: Part, attribute: str, *, bounded: bool) -> tuple[Tick, Stop]:
    behaviour, count = part.behaviour, part.cell(0)
    own_update = _own_update(part)

    def initialise(cells: Cells, times: Times) -> None:  # noqa: ARG001
        behaviour.initialise()
        cells[count] = 0

    def update(cells: Cells, times: Times) -> int:
        if bounded:
            setattr(behaviour, attribute, cells[count])
        status = own_update(cells, times)
        if bounded:
            cells[count] = getattr(behaviour, attribute)
        return status

    def terminate(cells: Cells, status: int) -> None:  # noqa: ARG001
        cells[count] = 0

    return decorated(part, initialise, update, terminate)


@builds(stock.EternalGuard)
def eternal_guard(part: Part) -> tuple[Tick, Stop]:
    """Build an EternalGuard."""
    at, behaviour, (child,) = part.at, part.behaviour, part.children
    go_on, stop = stateless(part)

    def tick(cells: Cells, times: Times) -> int:
        if _holds(behaviour):
            return go_on(cells, times)
        if cells[child.at] == RUNNING:
            child.stop(cells, times)
        cells[at] = FAILURE
        return FAILURE

    return tick, stop


def _holds(guard: Any) -> bool:
    result = guard.condition()
    if isinstance(result, Status):
        return result is not Status.FAILURE
    if not isinstance(result, bool):
        message = f"'{guard.name}': its condition has to answer with a bool or a status, not with {result!r}"
        raise RuntimeError(message)  # noqa: TRY004 - what py_trees raises
    return result


@builds(stock.OneShot)
def one_shot(part: Part) -> tuple[Tick, Stop]:
    """Build a OneShot. The outcome of its child is kept for good, whatever is stopped."""
    at, behaviour, (child,) = part.at, part.behaviour, part.children
    final = part.cell(number_of(behaviour.final_status))
    counts = frozenset(number_of(status) for status in behaviour.policy.value)

    def terminate(cells: Cells, status: int) -> None:
        if not cells[final] and status in counts:
            behaviour.feedback_message = "oneshot completed"
            cells[final] = status

    go_on, stop = decorated(part, _nothing, _own_update(part), terminate)

    def tick(cells: Cells, times: Times) -> int:
        status = cells[final]
        if not status:
            return go_on(cells, times)
        if cells[child.at] == RUNNING:
            child.stop(cells, times)
        cells[at] = status
        return int(status)

    return tick, stop


def for_each(part: Part) -> tuple[Tick, Stop]:
    """Build a ForEach; it takes the items of its list when it starts, whatever becomes of that list."""
    behaviour, (child,) = part.behaviour, part.children
    waiting, has_item = part.cell(()), part.cell(INVALID)

    def initialise(cells: Cells, times: Times) -> None:  # noqa: ARG001
        items = behaviour.blackboard.get(behaviour.source_key) or []
        if not isinstance(items, Iterable):
            message = f"'{behaviour.name}': '{behaviour.source_key}' holds {items!r}, which is no list"
            raise TypeError(message)
        cells[waiting] = tuple(freeze(item) for item in items)
        advance(cells)

    def advance(cells: Cells) -> None:
        cells[has_item] = 0
        if cells[waiting]:
            first, *others = cells[waiting]
            item = thaw(first)
            behaviour.blackboard.set(behaviour.target_key, item)
            cells[waiting], cells[has_item] = tuple(others), int(item is not None)

    def update(cells: Cells, times: Times) -> int:  # noqa: ARG001
        if not cells[has_item]:
            return SUCCESS
        if cells[child.at] == SUCCESS:
            advance(cells)
            if cells[has_item]:
                return RUNNING
        return int(cells[child.at])

    def terminate(cells: Cells, status: int) -> None:  # noqa: ARG001
        cells[waiting], cells[has_item] = (), 0

    return decorated(part, initialise, update, terminate)


if hasattr(stock, "ForEach"):  # from py_trees 2.4 on
    builds(stock.ForEach)(for_each)


def decorated(part: Part, initialise: Initialise, update: Update, terminate: Terminate) -> tuple[Tick, Stop]:
    """Build a decorator of what it does to start, after each tick of its child, and at its end.

    Args:
        part: The decorator.
        initialise: What its `initialise` does.
        update: What its `update` does; returns the status.
        terminate: What its `terminate` does; is given the status.
    """
    at, ((_, tick_child, stop_child, cell),) = part.at, part.children

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] != RUNNING:
            initialise(cells, times)
        tick_child(cells, times)
        status = update(cells, times)
        if status != RUNNING:
            terminate(cells, status)
            if status == INVALID:
                stop_child(cells, times)
            if cells[cell] == RUNNING:
                stop_child(cells, times)
        cells[at] = status
        return status or SKIPPED

    def stop(cells: Cells, times: Times) -> None:
        terminate(cells, INVALID)
        stop_child(cells, times)
        cells[at] = INVALID

    return tick, stop


def _own_update(part: Part) -> Update:
    own, (child,) = part.behaviour.update, part.children
    behaviour, cell = child.behaviour, child.at

    def update(cells: Cells, times: Times) -> int:  # noqa: ARG001
        behaviour.status = STATUSES[cells[cell]]
        return number_of(own())

    return update


def _own_terminate(part: Part) -> Terminate:
    own = part.behaviour.terminate

    def terminate(cells: Cells, status: int) -> None:  # noqa: ARG001
        own(STATUSES[status])

    return terminate


def _nothing(cells: Cells, times: Times) -> None:
    """Do nothing: the start of a decorator that remembers nothing."""
