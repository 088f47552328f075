"""The input and output of builders, which say what a node does in a tick, and the functions that they share."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.blackboard import Entry
from sar_compiler.runtime.flat.cells import ENDED, INVALID, RUNNING, SKIPPED, Cells, Stop, Tick
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Parent


class Child(NamedTuple):
    """A node that is built, as its parent uses it.

    Attributes:
        behaviour: The behaviour.
        tick: Ticks it.
        stop: Stops it, whatever its status is.
        at: The cell of its status.
    """

    behaviour: Behaviour
    tick: Tick
    stop: Stop
    at: int


@dataclass(frozen=True)
class Part:
    """A node that is to be built, in a flat tree or by itself.

    Attributes:
        index: Its index in the flat tree.
        at: The cell of its status.
        behaviour: The behaviour; `Any`, because each builder knows the class of its own.
        children: Its children, which are built already.
        cell: Asks for a further cell, given what is in it at first; returns its number.
        watch: Says that a cell holds how often an entry had been written when the node looked at it last.
    """

    index: int
    at: int
    behaviour: Any
    children: list[Child]
    cell: Callable[[Hashable], int]
    watch: Callable[[Entry, int], None]


Build = Callable[[Part], tuple[Tick, Stop]]
"""Says what a node of one class does in a tick, and when it is stopped; what it remembers is in cells."""


BUILDERS: dict[type[Behaviour], Build] = {}
"""The builder of each class that is known."""


def builds(*classes: type[Behaviour]) -> Callable[[Build], Build]:
    """Return a decorator that makes a function the builder of some classes."""

    def mark(build: Build) -> Build:
        BUILDERS.update(dict.fromkeys(classes, build))
        return build

    return mark


def is_reset(behaviour: Behaviour) -> bool:
    """Return whether a node's parent resets it to INVALID before starting it again; stock parents do not.

    That decides which ticks start a node, rather than go on with it; the status alone cannot tell. BehaviorTree.CPP
    starts a node that is IDLE, and its controls and decorators reset their children to that (here INVALID) when their own
    work is over. A child with SUCCESS or FAILURE below such a parent was therefore ticked earlier in the same work and
    goes on: WhileDoElse ticks its condition again without resetting it. py_trees never resets a child that has ended; it
    starts any that is not RUNNING. So below a stock parent, SUCCESS and FAILURE mean that the node starts, and so they do
    at the root, which is ticked again after its end. A parent that is one node with its child (`is_its_child`) resets
    nothing by itself; the one around it decides.
    """
    around = behaviour.parent
    while isinstance(around, Parent) and around.is_its_child:
        around = around.parent
    return isinstance(around, Parent)


def reset(child: Child, cells: Cells, times: Times) -> None:
    """Bring a child back to rest: halt it if it is running, else only forget how it ended."""
    if cells[child.at] == RUNNING:
        child.stop(cells, times)
    else:
        cells[child.at] = INVALID


def reset_all(children: list[Child], cells: Cells, times: Times) -> None:
    """Bring children back to rest, in order."""
    for _, _, stop, cell in children:
        if cells[cell] == RUNNING:
            stop(cells, times)
        else:
            cells[cell] = INVALID


def halted_by(part: Part, halt: Stop) -> Stop:
    """Return what stops a node that keeps BehaviorTree.CPP's rules.

    Args:
        part: The node.
        halt: Halts its children, and forgets where the node was.
    """
    at, behaviour = part.at, part.behaviour

    def stop(cells: Cells, times: Times) -> None:
        halt(cells, times)
        behaviour.feedback_message = ""
        cells[at] = INVALID

    return stop


def halted_with_children(part: Part, *forgotten: int) -> Stop:
    """Return what stops a control that forgets where it was and halts its children.

    Args:
        part: The control.
        *forgotten: The cells that are set to 0.
    """
    behaviour, children = part.behaviour, part.children

    def halt(cells: Cells, times: Times) -> None:
        for number in forgotten:
            cells[number] = 0
        behaviour.current_child = None
        reset_all(children, cells, times)

    return halted_by(part, halt)


def ticked(part: Part) -> Tick:
    """Return what ticks the child of a decorator, and leaves it at rest if it has ended."""
    ((_, tick_child, _, cell),) = part.children

    def tick(cells: Cells, times: Times) -> int:
        outcome = tick_child(cells, times)
        if outcome & ENDED:
            cells[cell] = INVALID
        return outcome

    return tick


def halted_with_child(part: Part, *forgotten: int) -> Stop:
    """Return what stops a decorator that forgets where it was and halts its child.

    Args:
        part: The decorator.
        *forgotten: The cells that are set to 0.
    """
    (child,) = part.children

    def halt(cells: Cells, times: Times) -> None:
        for number in forgotten:
            cells[number] = 0
        reset(child, cells, times)

    return halted_by(part, halt)


def guarded(
    part: Part, may_start: Callable[[Cells], bool], otherwise: Callable[[], int], why_not: str
) -> tuple[Tick, Stop]:
    """Build a decorator that asks whether its child may start, and not again while the child runs."""
    at, behaviour = part.at, part.behaviour
    tick_child = ticked(part)
    child_runs = part.cell(0)

    def tick(cells: Cells, times: Times) -> int:
        if not cells[child_runs] and not may_start(cells):
            behaviour.feedback_message = why_not
            outcome = otherwise()
        else:
            behaviour.feedback_message = ""
            outcome = tick_child(cells, times)
            cells[child_runs] = int(outcome == RUNNING)
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    return tick, halted_with_child(part, child_runs)
