"""The semantics of a node, independent of its class, for checks, conversions and palettes.

A node's registration declares how the node ticks its children and how it uses their results. No other code of the
project depends on a node's tag.
"""

import math
from collections.abc import Callable, Mapping
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.outcome_sets import ALLOWED, RESULTS, F, Number, Possible, R, S

if TYPE_CHECKING:
    from py_trees.common import Status

    from sar_compiler.nodes.btcpp.draft import NodeDraft
    from sar_compiler.nodes.collector import FindingCollector, NodeView

WRITES, REMOVES = "writes to the blackboard", "removes from the blackboard"
"""Effects that do not change the world."""


class Order(Enum):
    """The order in which a node ticks its children."""

    IN_ORDER = "in order"
    """One child after the other.

    The next child is ticked if the child returns a result in `Semantics.goes_on` or is skipped.
    """
    TOGETHER = "together"
    """All children in every tick, until enough of them have ended."""
    CHOSEN = "chosen"
    """The children that the node selects, for example one of several branches."""


class Gate(NamedTuple):
    """The results that siblings must have returned before a child is ticked.

    Attributes:
        children: The indices of the siblings; at least one of them must have had one of the results.
        outcomes: The results, as an outcome set.
    """

    children: tuple[int, ...]
    outcomes: int


class AccessKind(Enum):
    """The kind of access to a blackboard key."""

    READ = "read"
    PEEK = "peek"
    """Read if the key has a value. The key need not have been written."""
    WRITE = "write"
    CHANGE = "change"
    """Written by an operator such as `=` in a script.

    The key must have been written before, or a port must use it.
    """
    BOTH = "both"
    """Used by a port that is both an input and an output. The node may read or write first."""
    FIXED = "fixed"
    """Read when the tree is compiled. The key is a mission parameter or has a constant value."""
    NONE = "none"
    """Removed, but neither read nor written."""


class KeyRole(NamedTuple):
    """A node's access to the key of a port, if the access differs from the port's direction.

    Attributes:
        kind: The kind of access.
        by_name: Whether a text without braces is also the name of a key.
        indirect: Whether the key in braces contains the name of the key that the node uses.
    """

    kind: AccessKind
    by_name: bool = False
    indirect: bool = False


NO_HINT = "register a node of this name in C++"
"""The default remedy for a node without a counterpart."""


class Counterpart(NamedTuple):
    """A node's counterpart in BehaviorTree.CPP.

    Attributes:
        built_in: Whether BehaviorTree.CPP has a node of this tag.
        rewrite: A function that rewrites the node for BehaviorTree.CPP; None if the node keeps its tag.
        hint: The remedy if there is no counterpart; empty if a C++ library provides the same node.
        since: The version that introduced the node (see `nodes.btcpp`); empty if all versions have it.
    """

    built_in: bool = False
    rewrite: "Callable[[NodeDraft, FindingCollector], None] | None" = None
    hint: str = NO_HINT
    since: str = ""


def _no_gates(_bound: "NodeView") -> Mapping[int, Gate]:
    return {}


class Semantics(NamedTuple):
    """How a node ticks its children, and how it uses time and the blackboard.

    `Semantics.sequence()` and the other class methods cover most controls and decorators.

    Attributes:
        possible: A function that computes the node's outcome set from the sets of its children (`nodes.outcome_sets`);
            None if only the registered outcomes are known.
        order: The order in which the node ticks its children.
        goes_on: For `Order.IN_ORDER`, the result of a child after which the next child is ticked: `S` or `F`.
        gates: A function that returns, by child index, the results of siblings that are required before a child is ticked.
        reactive: Whether the node re-evaluates all its children in every tick, unless an attribute `memory` decides this.
        steady: Whether each run of the node ticks the child, at once or after a delay, independently of the blackboard.
        changes: The results of the child that the node does not pass on.
        repeats: The results of the child after which the node restarts the child.
        rounds: A function that returns how often the node lets its child complete; None for a node that does not count.
        once: Whether the child is executed only once in the whole run.
        limit_sec: A function that returns the child's time limit in seconds (`math.inf`: no limit); None without a limit.
        wait_sec: A function that returns the time, in seconds, until a leaf ends or a decorator starts its child, if known.
        resumes: Whether the node continues at its former position after a restart, or waits for other nodes.
        with_memory: The tag of the node's non-reactive counterpart, which ticks only the child that was running.
        keys: For each port, the access to the port's key, if this access differs from the port's direction.
        copies: The port that contains the source key if the node copies a value with its type from one key to another;
            empty if the node copies nothing.
        counts: The ports whose values are numbers of children. Negative numbers count down: -1 means all children.
        counterpart: The node's counterpart in BehaviorTree.CPP.
    """

    possible: Possible | None = None
    order: Order = Order.CHOSEN
    goes_on: int = 0
    gates: "Callable[[NodeView], Mapping[int, Gate]]" = _no_gates
    reactive: bool = False
    steady: bool = False
    changes: int = 0
    repeats: int = 0
    rounds: Number | None = None
    once: bool = False
    limit_sec: Number | None = None
    wait_sec: Number | None = None
    resumes: bool = False
    with_memory: str = ""
    keys: Mapping[str, KeyRole] = {}
    copies: str = ""
    counts: tuple[str, ...] = ()
    counterpart: Counterpart = Counterpart()

    @classmethod
    def sequence(
        cls, *, reactive: bool = False, pauses: bool = False, keeps_place: bool = False
    ) -> "Semantics":
        """Return the semantics of a node that ticks its children in order until one does not succeed.

        Args:
            reactive: Whether the node re-evaluates all its children in every tick.
            pauses: Whether the node returns RUNNING between two children.
            keeps_place: Whether the node begins with the failed child after a restart.
        """
        possible = outcome_sets.in_order(S, pauses=pauses, keeps_place=keeps_place)
        return cls(possible, Order.IN_ORDER, S, reactive=reactive, resumes=keeps_place)

    @classmethod
    def selector(cls, *, reactive: bool = False, pauses: bool = False) -> "Semantics":
        """Return the semantics of a node that ticks its children in order until one does not fail.

        Args:
            reactive: Whether the node re-evaluates all its children in every tick.
            pauses: Whether the node returns RUNNING between two children.
        """
        return cls(outcome_sets.in_order(F, pauses=pauses), Order.IN_ORDER, F, reactive=reactive)

    @classmethod
    def parallel(cls, possible: Possible | None = None, counts: tuple[str, ...] = ()) -> "Semantics":
        """Return the semantics of a node that ticks its children in parallel.

        Args:
            possible: A function that computes the node's outcome set from the sets of its children; None
                if the outcome set cannot be computed.
            counts: The ports whose values are numbers of children.
        """
        return cls(possible, Order.TOGETHER, counts=counts)

    @classmethod
    def mapping(cls, turns: "Mapping[Status, Status] | Mapping[int, int]") -> "Semantics":
        """Return the semantics of a decorator that replaces some results of its child.

        Args:
            turns: The replacement of each result, as statuses or single-result outcome sets; other results are passed on.
        """
        by_bit = {outcome_sets.bit_of(old): outcome_sets.bit_of(new) for old, new in turns.items()}
        return cls(outcome_sets.mapping_results(by_bit), steady=True, changes=outcome_sets.union(by_bit))

    @classmethod
    def transparent(cls) -> "Semantics":
        """Return the semantics of a decorator that returns its child's results."""
        return cls(outcome_sets.passing_results, steady=True)

    @classmethod
    def restarts_child(cls, after: "Status | int", rounds: Number | str) -> "Semantics":
        """Return the semantics of a decorator that restarts its child after a given result.

        The decorator then returns RUNNING.

        Args:
            after: The result, as a status or outcome set: SUCCESS for a decorator that repeats, FAILURE for a retry.
            rounds: The attribute with the maximum number of rounds (-1 for no limit), or a function of the node that
                returns the number: `math.inf` for no limit, None if the number is known only at runtime.
        """
        end = outcome_sets.bit_of(after)
        count = partial(_rounds_in, rounds) if isinstance(rounds, str) else rounds
        return cls(
            partial(outcome_sets.rounds, count, end), steady=True, changes=end, repeats=end, rounds=count
        )

    @classmethod
    def limits_child(cls, limit: Number | str) -> "Semantics":
        """Return the semantics of a decorator that fails when its child has run for too long.

        Args:
            limit: The attribute with the limit in seconds, or a function of the node that returns the limit: `math.inf`
                for no limit, None if the limit is known only at runtime.
        """
        limit_sec = partial(outcome_sets.number, name=limit) if isinstance(limit, str) else limit
        return cls(partial(outcome_sets.time_limit, limit_sec), steady=True, changes=R, limit_sec=limit_sec)

    @property
    def is_sequence(self) -> bool:
        """Whether the node ticks its children in order until one does not succeed."""
        return self.order is Order.IN_ORDER and self.goes_on == S

    @property
    def is_selector(self) -> bool:
        """Whether the node ticks its children in order until one does not fail."""
        return self.order is Order.IN_ORDER and self.goes_on == F

    def always_ends_with_child(self, bound: "NodeView") -> bool:
        """Return whether the node ticks its child in each run, and succeeds only after the child has ended."""
        if not self.steady or self.possible is None:
            return False
        return self.possible(bound, [R], ALLOWED) in (R, R | F)

    def end_results(self, bound: "NodeView") -> int:
        """Return the results of a single child after which the node can end, as an outcome set."""
        if self.possible is None:
            return outcome_sets.ALL
        ends = (outcome for outcome in RESULTS if self.possible(bound, [outcome], ALLOWED) & ~R)
        return outcome_sets.union(ends)


def _rounds_in(attribute: str, bound: "NodeView") -> float | None:
    """Return the number of rounds that an attribute contains. In BehaviorTree.CPP, -1 means no limit."""
    count = outcome_sets.number(bound, attribute)
    if count is None:
        return None
    return math.inf if count == -1 else max(count, 0)
