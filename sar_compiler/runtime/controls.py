"""Sequences and fallbacks: children in order, until one of them decides.

BehaviorTree.CPP's Sequence and Fallback are py_trees' own as long as no child skips; the classes here are for
children that may, and for the forms that py_trees does not have.
"""

from collections.abc import Sequence as Children

from py_trees import composites
from py_trees.behaviour import Behaviour

from sar_compiler.runtime.kernel.cells import FAILURE, SUCCESS
from sar_compiler.runtime.kernel.ordering import OrderedNode, PausingNode, ReactiveNode, ResumingNode
from sar_compiler.runtime.kernel.tree_nodes import Part
from sar_compiler.runtime.parents import Control, Yielding


class _InOrder(Control):
    """Children in order: one that answers `_hands_over` is followed by the next, the other end decides.

    Args:
        memory: Whether to go on with the child that was running, or to look at every child again.
    """

    node_class = OrderedNode
    _hands_over: int

    def __init__(self, name: str, memory: bool, children: Children[Behaviour]) -> None:
        super().__init__(name, children)
        self.memory = memory

    def build_node(self, part: Part) -> OrderedNode:
        """Build the node, which depends on the memory."""
        return ResumingNode(part) if self.memory else ReactiveNode(part)


class Sequence(_InOrder, composites.Sequence):
    """A sequence that passes over children that are skipped; it is skipped itself if all of them are.

    Stock py_trees stops at a skipped child, as if it had been interrupted.

    Args:
        memory: Whether to go on with the child that was running (true), or to look at every child again (false).
    """

    _hands_over = SUCCESS


class Fallback(_InOrder, composites.Selector):
    """A fallback that passes over children that are skipped; it is skipped itself if all of them are.

    Stock py_trees takes a skipped child for one that failed.

    Args:
        memory: Whether to go on with the child that was running (true), or to look at every child again (false).
    """

    _hands_over = FAILURE


class _Pausing(Yielding, _InOrder):
    keeps_place = False
    node_class = PausingNode

    def __init__(self, name: str, children: Children[Behaviour]) -> None:
        super().__init__(name, True, children)  # noqa: FBT003 - stock composites have it second

    def build_node(self, part: Part) -> OrderedNode:
        """Build the node."""
        return PausingNode(part)


class AsyncSequence(_Pausing, Sequence):
    """A sequence that pauses after every child that succeeds at once, so that it can be interrupted there.

    Stock py_trees goes through such children in one tick.
    """


class AsyncFallback(_Pausing, Fallback):
    """A fallback that pauses after every child that fails at once, so that it can be interrupted there.

    Stock py_trees goes through such children in one tick.
    """


class SequenceWithMemory(_Pausing, Sequence):
    """A sequence that goes on with the child that failed or was halted when it is started again.

    Stock py_trees starts from the first child then. It also pauses as AsyncSequence does.
    """

    keeps_place = True
