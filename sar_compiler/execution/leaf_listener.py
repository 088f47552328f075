"""Observation of leaf events while a tree is ticked.

A visitor sees each node only after its tick, and halted nodes only after the whole tick. Only the leaves know the order
of events within a tick. So this module wraps the methods of each leaf, which every engine calls.
"""

from typing import Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.outcomes import ReturnedStatus

_WORDS = {outcome.status: outcome.name for outcome in ReturnedStatus}


class LeafListener(Protocol):
    """The receiver of a leaf's events."""

    def on_before_event(self, number: int) -> None:
        """React to a leaf that is about to act."""

    def on_start(self, number: int) -> None:
        """React to the start of a leaf."""

    def on_status(self, number: int, status: str) -> None:
        """React to the status that a leaf has returned."""

    def on_halt(self, number: int) -> None:
        """React to a leaf that is halted while it runs."""


def listen_to_leaf(leaf: Behaviour, number: int, ear: LeafListener) -> None:
    """Report a leaf's events from now on; call it before the tree's first tick.

    Args:
        leaf: The leaf.
        number: Its number, which is reported with the events.
        ear: The receiver of the events.
    """
    initialise, update, terminate = leaf.initialise, leaf.update, leaf.terminate

    def start() -> None:
        ear.on_before_event(number)
        ear.on_start(number)
        initialise()

    def return_status() -> Status:
        ear.on_before_event(number)
        status = update()
        if isinstance(status, Status):
            ear.on_status(number, _WORDS[status])
        return status

    def end(new_status: Status) -> None:
        if new_status is Status.INVALID and leaf.status is Status.RUNNING:
            ear.on_before_event(number)
            ear.on_halt(number)
        terminate(new_status)

    methods: dict[str, object] = {"initialise": start, "update": return_status, "terminate": end}
    for name, method in methods.items():
        setattr(leaf, name, method)
