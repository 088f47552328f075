"""Which class is brought into flat form by which builder."""

from collections.abc import Mapping

from py_trees import behaviours, composites
from py_trees import decorators as stock
from py_trees.behaviour import Behaviour
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from sar_compiler.errors import SarError
from sar_compiler.runtime import (
    branches,
    controls,
    decorators,
    entries,
    loops,
    parallel,
    py_trees_timers,
    repetition,
    script_nodes,
    timers,
)
from sar_compiler.runtime.conditions import Conditions
from sar_compiler.runtime.flat import branches as flat_branches
from sar_compiler.runtime.flat import conditions as flat_conditions
from sar_compiler.runtime.flat import decorators as flat_decorators
from sar_compiler.runtime.flat import entries as flat_entries
from sar_compiler.runtime.flat import leaves, sequences, stock_composites, stock_decorators
from sar_compiler.runtime.flat import loops as flat_loops
from sar_compiler.runtime.flat import parallel as flat_parallel
from sar_compiler.runtime.flat import repetition as flat_repetition
from sar_compiler.runtime.flat import timers as flat_timers
from sar_compiler.runtime.flat.parts import Build
from sar_compiler.runtime.parents import Parent

_STOCK: dict[type[Behaviour], Build] = {
    composites.Sequence: stock_composites.sequence,
    composites.Selector: stock_composites.selector,
    composites.Parallel: stock_composites.parallel,
    stock.Repeat: stock_decorators.repeat,
    stock.Retry: stock_decorators.retry,
    stock.EternalGuard: stock_decorators.eternal_guard,
    stock.OneShot: stock_decorators.one_shot,
    stock.Condition: stock_decorators.stateless,
    stock.Count: stock_decorators.stateless,
    stock.Inverter: stock_decorators.stateless,
    stock.PassThrough: stock_decorators.stateless,
    stock.StatusToBlackboard: stock_decorators.stateless,
    stock.FailureIsRunning: stock_decorators.stateless,
    stock.FailureIsSuccess: stock_decorators.stateless,
    stock.RunningIsFailure: stock_decorators.stateless,
    stock.RunningIsSuccess: stock_decorators.stateless,
    stock.SuccessIsFailure: stock_decorators.stateless,
    stock.SuccessIsRunning: stock_decorators.stateless,
    py_trees_timers.Timeout: flat_timers.stock_timeout,
    py_trees_timers.Timer: flat_timers.stock_timer,
    behaviours.Periodic: leaves.periodic,
    behaviours.StatusQueue: leaves.status_queue,
    behaviours.SuccessEveryN: leaves.success_every_n,
    behaviours.TickCounter: leaves.tick_counter,
}
if hasattr(stock, "ForEach"):  # From py_trees 2.4 on.
    _STOCK[stock.ForEach] = stock_decorators.for_each

_OWN: dict[type[Behaviour], Build] = {
    controls.Sequence: sequences.in_order,
    controls.Fallback: sequences.in_order,
    controls.AsyncSequence: sequences.in_order,
    controls.AsyncFallback: sequences.in_order,
    controls.SequenceWithMemory: sequences.in_order,
    parallel.Parallel: flat_parallel.parallel,
    parallel.ParallelAll: flat_parallel.parallel_all,
    branches.IfThenElse: flat_branches.if_then_else,
    branches.WhileDoElse: flat_branches.while_do_else,
    branches.Switch: flat_branches.switch,
    branches.TryCatch: flat_branches.try_catch,
    decorators.Inverter: flat_decorators.inverter,
    decorators.ForceSuccess: flat_decorators.force_success,
    decorators.ForceFailure: flat_decorators.force_failure,
    decorators.KeepRunningUntilFailure: flat_decorators.keep_running_until_failure,
    decorators.RunOnce: flat_decorators.run_once,
    decorators.SubTree: flat_decorators.subtree,
    repetition.Repeat: flat_repetition.again,
    repetition.RetryUntilSuccessful: flat_repetition.again,
    timers.Delay: flat_timers.delay,
    timers.Timeout: flat_timers.timeout,
    timers.Sleep: flat_timers.sleep,
    loops.LoopInt: flat_loops.loop,
    loops.LoopDouble: flat_loops.loop,
    loops.LoopBool: flat_loops.loop,
    loops.LoopString: flat_loops.loop,
    entries.WasEntryUpdated: flat_entries.was_entry_updated,
    entries.SkipUnlessUpdated: flat_entries.if_updated,
    entries.WaitValueUpdate: flat_entries.if_updated,
    script_nodes.Precondition: flat_entries.precondition,
    Conditions: flat_conditions.conditions,
}

BUILDERS: Mapping[type[Behaviour], Build] = {**_STOCK, **_OWN}
"""The builder of each class that is known; a subclass of one of them is not."""


class NotFlatError(SarError):
    """A tree has a node whose rules the flat form does not know.

    Attributes:
        behaviour: The node.
    """

    def __init__(self, behaviour: Behaviour) -> None:
        self.behaviour = behaviour
        cls = type(behaviour)
        message = (
            f"'{behaviour.name}' is a {cls.__module__}.{cls.__qualname__}, and only its own methods know when it "
            "ticks and stops its children; put nodes of the library in its place, or make it a leaf"
        )
        super().__init__(message)


def builder_of(behaviour: Behaviour) -> Build:
    """Return what brings a behaviour into flat form.

    Raises:
        NotFlatError: If it is no leaf and its class is not known; a subclass of a known one is not known.
    """
    build = BUILDERS.get(type(behaviour))
    if build is not None:
        return build
    if behaviour.children or isinstance(behaviour, (Composite, Decorator)):
        raise NotFlatError(behaviour)
    return leaves.leaf


def shares_status(behaviour: Behaviour) -> bool:
    """Return whether a behaviour and its child have one status between them."""
    return isinstance(behaviour, Parent) and behaviour.is_its_child
