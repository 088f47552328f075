"""The decorators of BehaviorTree.CPP, in place of which py_trees' own do something else, at least where a child may be skipped."""

from dataclasses import dataclass
from typing import Any, ClassVar

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.kernel import repeating, turning
from sar_compiler.runtime.kernel.cells import FAILURE, RUNNING, SKIPPED, SUCCESS
from sar_compiler.runtime.parents import OwnDecorator
from sar_compiler.runtime.ports import Input, Output
from sar_compiler.runtime.queues import QueueError, queue_items
from sar_compiler.runtime.tokens import excerpt


class Inverter(OwnDecorator):
    """Turns success into failure and failure into success; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.
    """

    node_class = turning.TurningNode
    turned = FAILURE, SUCCESS, SKIPPED


class ForceSuccess(Inverter):
    """Succeeds when its child ends, however it does; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.
    """

    turned = SUCCESS, SUCCESS, SKIPPED


class ForceFailure(Inverter):
    """Fails when its child ends, however it does; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.
    """

    turned = FAILURE, FAILURE, SKIPPED


class KeepRunningUntilFailure(Inverter):
    """Answers RUNNING until its child fails, also when the child succeeds or is skipped.

    Stock py_trees' SuccessIsRunning is stopped by a child that is skipped.
    """

    turned = RUNNING, FAILURE, RUNNING


@dataclass(eq=False, repr=False)
class RunOnce(OwnDecorator):
    """Lets its child end once; from then on it is skipped, or answers what the child did.

    Stock py_trees' OneShot can only do the second. A child that was halted has not ended, and may run again.
    """

    node_class = turning.RunOnceNode
    then_skip: Input[bool] = Input(source=True)


class SubTree(OwnDecorator):
    """The root of a subtree: passes on what its child answers.

    Stock py_trees' PassThrough does it for children that are never skipped.
    """

    node_class = turning.SubTreeNode


@dataclass(eq=False, repr=False)
class Repeat(OwnDecorator):
    """Repeats its child until it has succeeded num_cycles times; a failure ends it.

    A child that has taken several ticks is started again in the same tick; after one that took only one, the node pauses.
    Stock py_trees waits for the next tick after each success, and never ends if the number is 0.
    """

    node_class = repeating.RepeatNode
    num_cycles: Input[int]


@dataclass(eq=False, repr=False)
class RetryUntilSuccessful(OwnDecorator):
    """Retries its child until it has failed num_attempts times; a success ends it.

    It pauses as Repeat does. Stock py_trees waits for the next tick after each failure, and takes -1 for "not even once".
    """

    node_class = repeating.RetryNode
    num_attempts: Input[int]


@dataclass(eq=False, repr=False)
class _Loop(OwnDecorator):
    """Ticks its child once for each item of a queue.

    Stock py_trees' ForEach ticks its child once even if there is no item, and takes no literal queue.
    """

    node_class = repeating.LoopNode
    kind: ClassVar[type]
    queue: Input[object]
    value: Output[Any] | None = None
    if_empty: Input[Outcome] = Input(Outcome.SUCCESS)

    def __post_init__(self, child: Behaviour) -> None:
        super().__post_init__(child)
        self.literal = self.read(self.queue.get()) if self.queue.entry is None else None

    def read(self, held: object) -> list[Any]:
        """Return the items of a queue.

        Raises:
            QueueError: If it is none, or one of them has the wrong type.
        """
        try:
            return queue_items(held, self.kind)
        except QueueError as error:
            message = f"'{self.name}': queue: {error}"
            raise QueueError(message) from None

    def write(self, raw: object, left: int) -> None:
        """Write an item to the output, and tell how many are left."""
        (item,) = self.read([raw])
        if self.value is not None:
            self.value.set(item)
        self.feedback_message = f"item {excerpt(str(item))}, {left} left"


class LoopInt(_Loop):
    """Ticks its child once for each whole number of a queue."""

    kind = int


class LoopDouble(_Loop):
    """Ticks its child once for each real number of a queue."""

    kind = float


class LoopBool(_Loop):
    """Ticks its child once for each truth value of a queue."""

    kind = bool


class LoopString(_Loop):
    """Ticks its child once for each text of a queue."""

    kind = str
