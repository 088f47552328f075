"""The controls and decorators of Nav2, as its C++ sources have them.

What is the same in every distribution has one class; a tag's record says what another one does differently
(`nodes.nav2`). Some decorators look at the world: at odometry, transforms or topics. What stands for them where there is
no robot asks a leaf in the world's place, whose answers are theirs.
"""

import math
from collections.abc import Sequence

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.kernel import nav2_controls, nav2_decorators
from sar_compiler.runtime.parents import Control, Decorator
from sar_compiler.runtime.ports import InOut, Input

_USUAL_RETRIES = 1
_USUAL_RATE = 10.0


class PlaceError(SarError):
    """The place of a sequence is not one that it can begin with."""


class RecoveryNode(Control):
    """Ticks its first child; when that fails, the second one, and after its success the first one again.

    It fails when the first child has failed once more than there are retries, or when the recovery fails. A recovery that
    is skipped makes it fail, too, and then the retries so far are not forgotten.

    Args:
        number_of_retries: How often to recover; less than 0 counts as 1.
    """

    node_class = nav2_controls.RecoveryNodeNode

    def __init__(
        self, name: str, children: Sequence[Behaviour], number_of_retries: Input[int] | None = None
    ) -> None:
        super().__init__(name, children)
        self._number_of_retries = number_of_retries or Input(_USUAL_RETRIES)

    def number_of_retries(self) -> int:
        """Return how often to recover."""
        number: int = self._number_of_retries.get()
        return number if number >= 0 else _USUAL_RETRIES


class PipelineSequence(Control):
    """Ticks every child again in each tick, and the next one only when all before it have succeeded once.

    It returns RUNNING at the furthest child that was reached; children before that one may run beside it. It succeeds with its
    last child, and fails with any.
    """

    node_class = nav2_controls.PipelineNode


class RoundRobin(Control):
    """Ticks its children in turn until one succeeds; the next start begins with the child after that one.

    It fails when all children have failed.

    Args:
        wrap_around: Whether the first child follows the last one. If not, any end of the last child, a success
            as well, makes it fail and begin with the first child again.
    """

    node_class = nav2_controls.RoundRobinNode

    def __init__(
        self, name: str, children: Sequence[Behaviour], wrap_around: Input[bool] | None = None
    ) -> None:
        super().__init__(name, children)
        self._wrap_around = wrap_around or Input(source=False)

    def wraps(self) -> bool:
        """Return whether the first child follows the last one."""
        return self._wrap_around.get()


class WrappingRoundRobin(RoundRobin):
    """Ticks its children in turn until one succeeds; the next start begins with the child after that one.

    The first child follows the last one. It fails when all children have failed.
    """

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children, Input(source=True))


class NonblockingSequence(Control):
    """Ticks all its children in every tick, those that have succeeded as well; succeeds when all do in one tick.

    It fails with any child. A child that is skipped is an error.
    """

    node_class = nav2_controls.NonblockingNode


class PersistentSequence(Control):
    """A sequence whose place is kept in a key of the blackboard, so that it goes on there after a halt.

    A child that is skipped counts as one that has succeeded.

    Args:
        current_child_idx: The key with the index of the child in hand, counted from 0; it has to be written before.
    """

    node_class = nav2_controls.PersistentNode

    def __init__(self, name: str, children: Sequence[Behaviour], current_child_idx: InOut[int]) -> None:
        super().__init__(name, children)
        self._current_child_idx = current_child_idx

    def read_place(self) -> int:
        """Return the index of the child in hand.

        Raises:
            PlaceError: If it is below 0.
        """
        place: int = self._current_child_idx.get()
        if place < 0:
            message = f"'{self.name}' is to begin with child {place}; they are counted from 0"
            raise PlaceError(message)
        return place

    def write_place(self, place: int) -> None:
        """Write the index of the child in hand."""
        self._current_child_idx.set(place)


class RateController(Decorator):
    """Ticks its child at a rate: at the start, while it runs, and when a period is over since it last succeeded.

    In between it returns RUNNING.

    Args:
        hz: The rate, in hertz.
    """

    node_class = nav2_decorators.RateNode

    def __init__(self, name: str, child: Behaviour, clock: Clock, hz: Input[float] | None = None) -> None:
        super().__init__(name, child)
        self._hz = hz or Input(_USUAL_RATE)
        self.clock = clock

    def period(self) -> float:
        """Return how long a period is, in seconds."""
        rate: float = self._hz.get()
        return 1.0 / rate if rate else math.inf


class SingleTrigger(Decorator):
    """Lets its child end once; ticked again before it is reset or halted, it fails."""

    node_class = nav2_decorators.SingleTriggerNode


class _Asking(Decorator):
    """A decorator that asks a leaf in the world's place.

    Args:
        child: The child.
        asked: The leaf.
    """

    def __init__(self, name: str, child: Behaviour, asked: Behaviour) -> None:
        super().__init__(name, child)
        self.children.insert(0, asked)
        asked.parent = self


class WhenDue(_Asking):
    """Ticks its child at the start, while that runs, and when the leaf says that it is due."""

    node_class = nav2_decorators.WhenDueNode


class WhenDriven(_Asking):
    """Ticks its child at the start, while that runs, and when the leaf says that the robot has driven far enough."""

    node_class = nav2_decorators.DistanceNode


class WhenPathIsLonger(_Asking):
    """Ticks its child while the leaf says that the path has become longer; else it succeeds."""

    node_class = nav2_decorators.LongerPathNode


class PausedOnRequest(Control):
    """Ticks one of its children: for work, for the pause, and for the changes between these, as the leaf says.

    Args:
        children: The children.
        asked: The leaf.
    """

    node_class = nav2_controls.PauseResumeNode

    def __init__(self, name: str, children: Sequence[Behaviour], asked: Behaviour) -> None:
        super().__init__(name, [asked, *children])
