"""Decorators that turn one end of their child into another."""

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.kernel.cells import FAILURE, RUNNING, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.turning import RunOnceNode, SubTreeNode, TurningNode
from sar_compiler.runtime.parents import Decorator
from sar_compiler.runtime.ports import Input


class Inverter(Decorator):
    """Turns success into failure and failure into success; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.
    """

    node_class = TurningNode
    turned = FAILURE, SUCCESS, SKIPPED


class ForceSuccess(Decorator):
    """Succeeds when its child ends, however it does; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.
    """

    node_class = TurningNode
    turned = SUCCESS, SUCCESS, SKIPPED


class ForceFailure(ForceSuccess):
    """Fails when its child ends, however it does; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.
    """

    turned = FAILURE, FAILURE, SKIPPED


class KeepRunningUntilFailure(Decorator):
    """Answers RUNNING until its child fails, also when the child succeeds or is skipped.

    Stock py_trees' SuccessIsRunning is stopped by a child that is skipped.
    """

    node_class = TurningNode
    turned = RUNNING, FAILURE, RUNNING


class RunOnce(Decorator):
    """Lets its child end once; from then on it is skipped, or answers what the child did.

    Stock py_trees' OneShot can only do the second. A child that was halted has not ended, and may run again.

    Args:
        then_skip: Whether to be skipped afterwards (true), or to answer the same again (false).
    """

    node_class = RunOnceNode

    def __init__(self, name: str, child: Behaviour, then_skip: Input[bool] | None = None) -> None:
        super().__init__(name, child)
        self._then_skip = then_skip or Input(source=True)


class SubTree(Decorator):
    """The root of a subtree: passes on what its child answers.

    Stock py_trees' PassThrough does it for children that are never skipped.

    Args:
        child: The root of what the subtree consists of.
    """

    node_class = SubTreeNode
