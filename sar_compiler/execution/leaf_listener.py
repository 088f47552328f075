"""Observation of leaf events while a tree is ticked.

A visitor sees each node only after its tick, and halted nodes only after the whole tick. Only the leaves know the order
of events within a tick. So this module wraps the leaf methods that every engine calls.
"""

from typing import Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.outcomes import ReturnedStatus

_STATUS_NAMES = {outcome.status: outcome.name for outcome in ReturnedStatus}


class LeafListener(Protocol):
    """The receiver of leaf events; each leaf is identified by its number."""

    def on_before_event(self, number: int) -> None:
        """Called just before a leaf is started, updated or halted."""

    def on_start(self, number: int) -> None:
        """Called when a leaf has started."""

    def on_status(self, number: int, status: str) -> None:
        """Called with the status that a leaf has returned."""

    def on_halt(self, number: int) -> None:
        """Called when a running leaf has been halted."""


def listen_to_leaf(leaf: Behaviour, number: int, listener: LeafListener) -> None:
    """Report a leaf's events to a listener; call this function before the tree's first tick.

    Args:
        leaf: The leaf.
        number: The leaf's number, which is reported with the events.
        listener: The receiver of the events.
    """
    initialise, update, terminate = leaf.initialise, leaf.update, leaf.terminate

    def start() -> None:
        listener.on_before_event(number)
        listener.on_start(number)
        initialise()

    def return_status() -> Status:
        listener.on_before_event(number)
        status = update()
        if isinstance(status, Status):
            listener.on_status(number, _STATUS_NAMES[status])
        return status

    def end(new_status: Status) -> None:
        if new_status is Status.INVALID and leaf.status is Status.RUNNING:
            listener.on_before_event(number)
            listener.on_halt(number)
        terminate(new_status)

    methods: dict[str, object] = {"initialise": start, "update": return_status, "terminate": end}
    for name, method in methods.items():
        setattr(leaf, name, method)
