"""The input and output of the builders of the flat form, and the functions that they share."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.blackboard import Entry
from sar_compiler.runtime.flat.cells import INVALID, RUNNING, Cells, Stop, Tick
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Parent


class Child(NamedTuple):
    """A node in flat form, as its parent uses it.

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
    """A node that is to be brought into flat form.

    Attributes:
        index: Its index in the tree.
        at: The cell of its status.
        behaviour: The behaviour; `Any`, because each builder knows the class of its own.
        children: Its children, which are in flat form already.
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
"""Brings a node of one class into flat form."""


BUILDERS: dict[type[Behaviour], Build] = {}
"""The builder of each class that is known; a subclass of one of them is not."""


def builds(*classes: type[Behaviour]) -> Callable[[Build], Build]:
    """Return a decorator that makes a function the builder of some classes."""

    def mark(build: Build) -> Build:
        BUILDERS.update(dict.fromkeys(classes, build))
        return build

    return mark


def is_reset(behaviour: Behaviour) -> bool:
    """Return whether a node's parent resets it to INVALID before starting it again; stock parents do not.

    `Parent._starts` says why that decides which ticks are starts. It depends on the tree alone, so a builder asks once,
    where the generators ask in every tick.
    """
    around = behaviour.parent
    while isinstance(around, Parent) and around.is_its_child:
        around = around.parent
    return isinstance(around, Parent)


def reset(child: Child, cells: Cells, times: Times) -> None:
    """Bring a child back to rest, as `skipping.reset` does."""
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
        halt: What its `_halt` does.
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
