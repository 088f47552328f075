"""Observation of leaf events while a tree is ticked.

A visitor sees each node only after its tick, and halted nodes only after the whole tick. Only the leaves know the order
of events within a tick. So this module wraps the methods of each leaf, which every engine calls.
"""

from typing import Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.answers import Outcome

_WORDS = {outcome.status: outcome.name for outcome in Outcome}


class LeafListener(Protocol):
    """The receiver of a leaf's events."""

    def looks(self, number: int) -> None:
        """React to a leaf that is about to act."""

    def starts(self, number: int) -> None:
        """React to the start of a leaf."""

    def answers(self, number: int, status: str) -> None:
        """React to the status that a leaf has returned."""

    def halts(self, number: int) -> None:
        """React to a leaf that is halted while it runs."""


def hear(leaf: Behaviour, number: int, ear: LeafListener) -> None:
    """Report a leaf's events from now on; call it before the tree's first tick.

    Args:
        leaf: The leaf.
        number: Its number, which is reported with the events.
        ear: The receiver of the events.
    """
    initialise, update, terminate = leaf.initialise, leaf.update, leaf.terminate

    def start() -> None:
        ear.looks(number)
        ear.starts(number)
        initialise()

    def answer() -> Status:
        ear.looks(number)
        status = update()
        if isinstance(status, Status):
            ear.answers(number, _WORDS[status])
        return status

    def end(new_status: Status) -> None:
        if new_status is Status.INVALID and leaf.status is Status.RUNNING:
            ear.looks(number)
            ear.halts(number)
        terminate(new_status)

    methods: dict[str, object] = {"initialise": start, "update": answer, "terminate": end}
    for name, method in methods.items():
        setattr(leaf, name, method)
