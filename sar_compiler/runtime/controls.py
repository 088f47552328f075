"""The controls of BehaviorTree.CPP that py_trees does not have.

Its Sequence and Fallback are py_trees' own as long as no child skips; the classes here are for children that may, and for the
forms that py_trees does not have. What a control does is said by its node, and its attributes by the record of its tag.
"""

from dataclasses import dataclass, field

from py_trees import composites

from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.kernel import branching, counting, ordering
from sar_compiler.runtime.kernel.cells import FAILURE, SUCCESS
from sar_compiler.runtime.kernel.tree_nodes import Part
from sar_compiler.runtime.parents import OwnControl
from sar_compiler.runtime.ports import Input


@dataclass(eq=False, repr=False)
class _InOrder(OwnControl):
    """Children in order: one that comes to `hands_over` is followed by the next, the other end decides.

    Attributes:
        memory: Whether to go on with the child that was running (true), or to look at every child again (false).
    """

    node_class = ordering.OrderedNode
    hands_over = SUCCESS
    memory: bool

    def build_node(self, part: Part) -> ordering.OrderedNode:
        """Build the node, which depends on the memory."""
        return ordering.ResumingNode(part) if self.memory else ordering.ReactiveNode(part)


class Sequence(_InOrder, composites.Sequence):
    """A sequence that passes over children that are skipped; it is skipped itself if all of them are.

    Stock py_trees stops at a skipped child, as if it had been interrupted.
    """


class Fallback(_InOrder, composites.Selector):
    """A fallback that passes over children that are skipped; it is skipped itself if all of them are.

    Stock py_trees takes a skipped child for one that failed.
    """

    hands_over = FAILURE


@dataclass(eq=False, repr=False)
class _Pausing(_InOrder):
    keeps_place = False
    memory: bool = field(default=True, init=False)

    def build_node(self, part: Part) -> ordering.OrderedNode:
        """Build the node."""
        return ordering.PausingNode(part)


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


class IfThenElse(OwnControl):
    """Ticks its second child if the first one succeeds, else the third; asks the first one only once.

    Stock py_trees has no such node, only an idiom of several that asks again in every tick. A condition that is
    skipped makes the whole node skipped.
    """

    node_class = branching.IfThenElseNode


class WhileDoElse(OwnControl):
    """Ticks its second child as long as the first one succeeds, and the third as long as it fails.

    Stock py_trees has no such node: EternalGuard knows no third child. A condition that is skipped halts the
    branch that is running, and makes the whole node skipped.
    """

    node_class = branching.WhileDoElseNode


@dataclass(eq=False, repr=False)
class Switch(OwnControl):
    """Ticks the child whose case is equal to a variable, and the last one if none is.

    Stock py_trees has no such node. The variable is looked at in every tick; if another child has been running,
    it is halted.
    """

    node_class = branching.SwitchNode
    variable: Input[str]
    enums: Enums
    case_1: Input[str]
    case_2: Input[str]
    case_3: Input[str] | None = None
    case_4: Input[str] | None = None
    case_5: Input[str] | None = None
    case_6: Input[str] | None = None


@dataclass(eq=False, repr=False)
class TryCatch(OwnControl):
    """Ticks its children in order but for the last one, which is ticked when one of them has failed.

    Stock py_trees can tidy up (`OnTerminate`), but not over several ticks, and not after a failure only. After
    the last child has ended, however it did, the node fails.
    """

    node_class = branching.TryCatchNode
    catch_on_halt: Input[bool] = Input(source=False)


@dataclass(eq=False, repr=False)
class Parallel(OwnControl):
    """Succeeds after success_count successes; fails after failure_count failures or when success is out of reach.

    It decides after every child: the ones behind the child that decides are not ticked any more in that tick. Stock py_trees
    has policies for all children and for one of them, ticks every child before it decides, and ticks children that have failed
    again.
    """

    node_class = counting.ParallelNode
    success_count: Input[int] = Input(-1)
    failure_count: Input[int] = Input(1)


@dataclass(eq=False, repr=False)
class ParallelAll(OwnControl):
    """Waits for all children, then fails if too many of them have failed.

    Stock py_trees fails with the first child that does.
    """

    node_class = counting.ParallelAllNode
    max_failures: Input[int] = Input(1)
