"""Check that `update()` returns a status.

For any other value py_trees only logs an error in every tick, and the behaviour continues as if it had been
reset: a `Timeout` around it starts over each time. Our own engine is strict by itself.
"""

from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.leaf_protocol import NoStatusError


def require_statuses(root: Behaviour) -> None:
    """Make every behaviour of a tree raise an error in the tick in which its `update()` returns no status.

    The behaviours keep their classes; only the method of each instance is wrapped.
    """
    for behaviour in root.iterate():
        if not isinstance(behaviour.update, _StatusOnly):
            setattr(behaviour, "update", _StatusOnly(behaviour))  # noqa: B010 - for the type checker


class _StatusOnly:
    __slots__ = ("_behaviour", "_update")

    def __init__(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour
        self._update: Callable[[], object] = behaviour.update

    def __call__(self) -> Status:
        status = self._update()
        if isinstance(status, Status):
            return status
        raise NoStatusError(self._behaviour, status)
