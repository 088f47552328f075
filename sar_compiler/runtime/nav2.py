"""The controls and decorators of Nav2, as its C++ sources have them.

What is the same in every distribution has one class; a tag's record says what another one does differently
(`nodes.nav2`). Some decorators look at the world: at odometry, transforms or topics. What stands for them where there is
no robot asks a leaf in the world's place, whose answers are theirs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.kernel import nav2_controls, nav2_decorators
from sar_compiler.runtime.parents import Control, Decorator, OwnControl, OwnDecorator
from sar_compiler.runtime.ports import InOut, Input


@dataclass(eq=False, repr=False)
class RecoveryNode(OwnControl):
    """Ticks its first child; when that fails, the second one, and after its success the first one again.

    It fails when the first child has failed once more than there are retries, or when the recovery fails. A recovery that
    is skipped makes it fail, too, and then the retries so far are not forgotten.
    """

    node_class = nav2_controls.RecoveryNodeNode
    number_of_retries: Input[int] = Input(1)


class PipelineSequence(OwnControl):
    """Ticks every child again in each tick, and the next one only when all before it have succeeded once.

    It returns RUNNING at the furthest child that was reached; children before that one may run beside it. It succeeds with its
    last child, and fails with any.
    """

    node_class = nav2_controls.PipelineNode


@dataclass(eq=False, repr=False)
class RoundRobin(OwnControl):
    """Ticks its children in turn until one succeeds; the next start begins with the child after that one.

    It fails when all children have failed.
    """

    node_class = nav2_controls.RoundRobinNode
    wrap_around: Input[bool] = Input(source=False)


@dataclass(eq=False, repr=False)
class WrappingRoundRobin(RoundRobin):
    """Ticks its children in turn until one succeeds; the next start begins with the child after that one.

    The first child follows the last one. It fails when all children have failed.
    """

    wrap_around: Input[bool] = field(default=Input(source=True), init=False)


class NonblockingSequence(OwnControl):
    """Ticks all its children in every tick, those that have succeeded as well; succeeds when all do in one tick.

    It fails with any child. A child that is skipped is an error.
    """

    node_class = nav2_controls.NonblockingNode


@dataclass(eq=False, repr=False)
class PersistentSequence(OwnControl):
    """A sequence whose place is kept in a key of the blackboard, so that it goes on there after a halt.

    A child that is skipped counts as one that has succeeded.
    """

    node_class = nav2_controls.PersistentNode
    current_child_idx: InOut[int]


@dataclass(eq=False, repr=False)
class RateController(OwnDecorator):
    """Ticks its child at a rate: at the start, while it runs, and when a period is over since it last succeeded.

    In between it returns RUNNING.
    """

    node_class = nav2_decorators.RateNode
    clock: Clock
    hz: Input[float] = Input(10.0)


class SingleTrigger(OwnDecorator):
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
