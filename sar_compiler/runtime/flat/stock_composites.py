"""py_trees' own composites."""

from collections.abc import Callable

from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy

from sar_compiler.runtime.flat.cells import FAILURE, INVALID, RUNNING, SKIPPED, SUCCESS, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Child, Part, builds
from sar_compiler.runtime.flat.times import Times

_IS_2_3 = not hasattr(decorators, "ForEach")


@builds(composites.Sequence)
def sequence(part: Part) -> tuple[Tick, Stop]:
    """Build a Sequence, with memory or without."""
    return _resuming_sequence(part) if part.behaviour.memory else _reactive_sequence(part)


def _resuming_sequence(part: Part) -> tuple[Tick, Stop]:
    at, behaviour, children = part.at, part.behaviour, part.children
    count, position = len(children), part.cell(0)

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] != RUNNING:
            _stop_all(children, cells, times)
            cells[position] = 0
        status = SUCCESS
        for index in range(cells[position], count):
            child, tick_child, _, cell = children[index]
            cells[position], behaviour.current_child = index, child
            tick_child(cells, times)
            status = cells[cell]
            if status != SUCCESS:
                break
        if status == INVALID and not _IS_2_3:
            stop(cells, times)
            return SKIPPED
        if status != RUNNING:
            cells[position] = 0
        cells[at] = status
        return status or SKIPPED

    def stop(cells: Cells, times: Times) -> None:
        _stop_composite(part, cells, times)
        cells[position] = 0

    return tick, stop


def _reactive_sequence(part: Part) -> tuple[Tick, Stop]:
    at, behaviour, children = part.at, part.behaviour, part.children

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] != RUNNING:
            _stop_all(children, cells, times)
        status = SUCCESS
        for index, (child, tick_child, _, cell) in enumerate(children):
            behaviour.current_child = child
            tick_child(cells, times)
            status = cells[cell]
            if status != SUCCESS:
                _stop_all(children[index + 1 :], cells, times)
                break
        if status == INVALID and not _IS_2_3:
            stop(cells, times)
            return SKIPPED
        cells[at] = status
        return status or SKIPPED

    def stop(cells: Cells, times: Times) -> None:
        _stop_composite(part, cells, times)

    return tick, stop


@builds(composites.Selector)
def selector(part: Part) -> tuple[Tick, Stop]:
    """Build a Selector, with memory or without."""
    at, behaviour, children = part.at, part.behaviour, part.children
    memory, count = behaviour.memory, len(children)
    stop_passed = _stop_even_at_rest if _IS_2_3 else _stop_all
    position = part.cell(0)

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] != RUNNING:
            behaviour.current_child = children[0].behaviour if count else None
        previous = cells[position]
        if memory:
            stop_passed(children[:previous], cells, times)
        for index in range(previous if memory else 0, count):
            child, tick_child, _, cell = children[index]
            tick_child(cells, times)
            status = cells[cell]
            if status and status != FAILURE:
                behaviour.current_child = child
                if index != previous:
                    _stop_all(children[index + 1 :], cells, times)
                cells[position] = index if status == RUNNING else 0
                cells[at] = status
                return int(status)
        behaviour.current_child = children[-1].behaviour if count else None
        cells[position] = 0
        cells[at] = FAILURE
        return FAILURE

    def stop(cells: Cells, times: Times) -> None:
        _stop_composite(part, cells, times)
        cells[position] = 0

    return tick, stop


@builds(composites.Parallel)
def parallel(part: Part) -> tuple[Tick, Stop]:
    """Build a Parallel, with any of py_trees' policies."""
    at, behaviour, children = part.at, part.behaviour, part.children
    behaviour.validate_policy_configuration()
    synchronise = behaviour.policy.synchronise
    decide = _decider(behaviour.policy, children)

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] != RUNNING:
            _stop_all(children, cells, times)
            behaviour.current_child = None
        for _, tick_child, _, cell in children:
            if not (synchronise and cells[cell] == SUCCESS):
                tick_child(cells, times)
        status, behaviour.current_child = decide(cells)
        if status != RUNNING:
            _stop_running(children, cells, times)
        cells[at] = status
        return status

    def stop(cells: Cells, times: Times) -> None:
        _stop_running(children, cells, times)
        _stop_composite(part, cells, times)

    return tick, stop


def _decider(
    policy: ParallelPolicy.Base, children: list[Child]
) -> Callable[[Cells], tuple[int, Behaviour | None]]:
    """Return a function that gives the status of a Parallel after its children were ticked, and the child that decided it."""
    all_of = children
    if isinstance(policy, ParallelPolicy.SuccessOnSelected):
        of_behaviour = {child.behaviour.id: child for child in children}
        all_of = [of_behaviour[behaviour.id] for behaviour in policy.children]
    one_is_enough = isinstance(policy, ParallelPolicy.SuccessOnOne)

    def decide(cells: Cells) -> tuple[int, Behaviour | None]:
        if not children:
            return SUCCESS, None
        for child, _, _, cell in children:
            if cells[cell] == FAILURE:
                return FAILURE, child
        if one_is_enough:
            for child, _, _, cell in reversed(children):
                if cells[cell] == SUCCESS:
                    return SUCCESS, child
        elif all(cells[child.at] == SUCCESS for child in all_of):
            return SUCCESS, all_of[-1].behaviour
        return RUNNING, children[-1].behaviour

    return decide


def _stop_composite(part: Part, cells: Cells, times: Times) -> None:
    """Do what every composite does to be stopped."""
    part.behaviour.current_child = None
    _stop_all(part.children, cells, times)
    cells[part.at] = INVALID


def _stop_running(children: list[Child], cells: Cells, times: Times) -> None:
    for _, _, stop_child, cell in children:
        if cells[cell] == RUNNING:
            stop_child(cells, times)


def _stop_all(children: list[Child], cells: Cells, times: Times) -> None:
    for _, _, stop_child, cell in children:
        if cells[cell]:
            stop_child(cells, times)


def _stop_even_at_rest(children: list[Child], cells: Cells, times: Times) -> None:
    """Stop children as a Selector with memory of py_trees 2.3 does, in every tick."""
    for child in children:
        child.stop(cells, times)
