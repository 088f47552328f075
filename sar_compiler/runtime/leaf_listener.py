"""Hearing what the leaves of a tree do while it is ticked, at the moment when they do it.

A visitor is told of each node when its tick is over, and of what was halted when the whole tick is. The order of events within a tick is known only to
the leaves themselves. So their methods are taken in hand, each leaf's own: they are what every engine calls.
"""

from typing import Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.answers import Outcome

_WORDS = {outcome.status: outcome.name for outcome in Outcome}


class LeafListener(Protocol):
    """Who is told what a leaf does."""

    def looks(self, number: int) -> None:
        """Be told that something will be done, before anything is changed by that."""

    def starts(self, number: int) -> None:
        """Be told that a leaf starts."""

    def answers(self, number: int, status: str) -> None:
        """Be told what status a leaf has answered, once it has done so."""

    def halts(self, number: int) -> None:
        """Be told that a leaf is stopped while it was running."""


def hear(leaf: Behaviour, number: int, ear: LeafListener) -> None:
    """Tell what a leaf does, from now on; to be called before its tree is ticked for the first time.

    Args:
        leaf: The leaf.
        number: Its number, by which it is told of.
        ear: Who is told.
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
