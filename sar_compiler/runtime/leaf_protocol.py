"""The optional interface between a leaf and the runner, which ticks the tree.

A leaf is an ordinary py_trees behaviour. A runner passes these keyword arguments to `setup`:

* `node`: the rclpy node with which the leaf creates its clients and publishers;
* `wake`: a `Wake`, which the leaf calls in the runner's thread when a result has arrived. The tree is then ticked at
  once instead of in the next period.
"""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError

Wake = Callable[[], None]


def ignore_wake() -> None:
    """Do nothing. Leaves use this function as `Wake` if the runner passes none."""


@runtime_checkable
class SettlingLeaf(Protocol):
    """A leaf whose work, such as the cancellation of a goal, may continue after the leaf was stopped."""

    def is_settled(self) -> bool:
        """Return whether the leaf has no active work left. Called after the tree was stopped."""
        ...


class NoStatusError(SarError, TypeError):
    """Raised if a method of a behaviour, usually `update()`, does not return a status.

    Attributes:
        behaviour: The behaviour.
    """

    def __init__(self, behaviour: Behaviour, returned: object, method: str = "") -> None:
        self.behaviour = behaviour
        message = f"update() returned {returned!r}, which is not a status. Return Status.SUCCESS, FAILURE or RUNNING"
        if method:
            message = f"{message.replace('update', method, 1)}, or the child to tick next"
        super().__init__(message)
