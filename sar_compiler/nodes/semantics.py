"""The semantics of a node, independent of its class, for checks, conversions and palettes.

The registration of a node declares here how it ticks its children and how it uses their results. Nothing else
in the project depends on a node's tag.
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
    """One after the other, as long as each returns `Semantics.goes_on` or is skipped."""
    TOGETHER = "together"
    """All of them in every tick, until enough have ended."""
    CHOSEN = "chosen"
    """By its own decision, for instance one of several branches."""


class Gate(NamedTuple):
    """The condition under which a child is ticked.

    Attributes:
        children: The indices of the children; at least one of them must have had such a result.
        outcomes: The results, an outcome set.
    """

    children: tuple[int, ...]
    outcomes: int


class AccessKind(Enum):
    """The kind of access to a blackboard key."""

    READ = "read"
    PEEK = "peek"
    """Read, but not required: the key may be unwritten."""
    WRITE = "write"
    CHANGE = "change"
    """A script's `=` and the like: the key must have been written, or have a port."""
    BOTH = "both"
    """A port with both directions: its node may read first, or write first."""
    FIXED = "fixed"
    """Read when the tree is compiled: a parameter of the mission, or a constant."""
    NONE = "none"
    """No access: the key is only removed."""


class KeyRole(NamedTuple):
    """A node's access to a port's key, if it differs from the port's direction.

    Attributes:
        kind: The kind of access.
        by_name: Whether a text without braces is also the name of a key.
        indirect: Whether a key in braces holds the name of the key to use.
    """

    kind: AccessKind
    by_name: bool = False
    indirect: bool = False


NO_HINT = "register a node of that name in C++"
"""The remedy for a node without a counterpart, unless another is given."""


class Counterpart(NamedTuple):
    """A node's counterpart in BehaviorTree.CPP.

    Attributes:
        built_in: Whether BehaviorTree.CPP has a node of this tag.
        rewrite: Function that rewrites a node for BehaviorTree.CPP; None if the tag is kept.
        hint: The remedy if there is no counterpart; empty if a C++ library provides the same node.
        since: The version that introduced the node of this tag (`nodes.btcpp`); empty if all have it.
    """

    built_in: bool = False
    rewrite: "Callable[[NodeDraft, FindingCollector], None] | None" = None
    hint: str = NO_HINT
    since: str = ""


def _no_gates(_bound: "NodeView") -> Mapping[int, Gate]:
    return {}


class Semantics(NamedTuple):
    """How a node treats its children, time, and the blackboard.

    `Semantics.sequence()` and the like cover most controls and decorators.

    Attributes:
        possible: Its outcome set as a function of its children's (`nodes.outcome_sets`); None if only the registered
            outcomes are known.
        order: The order in which it ticks its children.
        goes_on: The result of a child after which the next one is ticked, for `Order.IN_ORDER`: `S` or `F`.
        gates: The children that are ticked only after certain results of others, by their indices.
        reactive: Whether it re-evaluates all its children in every tick; an attribute `memory` may decide this instead.
        steady: Whether each of its runs ticks the child, at once or after a delay, independently of the blackboard.
        changes: The results of its child that it does not pass on.
        repeats: The results of its child after which it restarts the child.
        rounds: The number of times that it runs its child to an end; None for a node that does not count.
        once: Whether its child is executed only once in the whole run.
        limit_sec: The time limit of its child in seconds, `math.inf` for no limit; None for a node without a limit.
        wait_sec: Its own time in seconds: of a leaf until it ends, of a decorator until its child starts; None if unknown.
        resumes: Whether it continues at its former place after a restart, or waits for other nodes.
        with_memory: The tag of its non-reactive counterpart, which ticks only the child that was running.
        keys: Its use of the keys of some of its ports.
        copies: The port of a key whose value it writes, with its type, to its other key; empty if it does not.
        counts: The ports whose values are numbers of its children; negative ones are counted from the end.
        counterpart: Its counterpart in BehaviorTree.CPP.
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
            reactive: Whether it re-evaluates all its children in every tick.
            pauses: Whether it returns RUNNING between two children.
            keeps_place: Whether it begins with the failed child after a restart.
        """
        possible = outcome_sets.in_order(S, pauses=pauses, keeps_place=keeps_place)
        return cls(possible, Order.IN_ORDER, S, reactive=reactive, resumes=keeps_place)

    @classmethod
    def selector(cls, *, reactive: bool = False, pauses: bool = False) -> "Semantics":
        """Return the semantics of a node that ticks its children in order until one does not fail.

        Args:
            reactive: Whether it re-evaluates all its children in every tick.
            pauses: Whether it returns RUNNING between two children.
        """
        return cls(outcome_sets.in_order(F, pauses=pauses), Order.IN_ORDER, F, reactive=reactive)

    @classmethod
    def parallel(cls, possible: Possible | None = None, counts: tuple[str, ...] = ()) -> "Semantics":
        """Return the semantics of a node that ticks its children in parallel.

        Args:
            possible: Its outcome set as a function of its children's, if known.
            counts: Its ports that are numbers of children.
        """
        return cls(possible, Order.TOGETHER, counts=counts)

    @classmethod
    def mapping(cls, turns: "Mapping[Status, Status] | Mapping[int, int]") -> "Semantics":
        """Return the semantics of a decorator that replaces some results of its child.

        Args:
            turns: The replacements by result, as statuses or outcome sets of one; other results are passed on.
        """
        by_bit = {outcome_sets.bit_of(old): outcome_sets.bit_of(new) for old, new in turns.items()}
        return cls(outcome_sets.mapping_results(by_bit), steady=True, changes=outcome_sets.union(by_bit))

    @classmethod
    def transparent(cls) -> "Semantics":
        """Return the semantics of a decorator that returns its child's results."""
        return cls(outcome_sets.passing_results, steady=True)

    @classmethod
    def restarts_child(cls, after: "Status | int", rounds: Number | str) -> "Semantics":
        """Return the semantics of a decorator that restarts its child after one of its results, and then runs.

        Args:
            after: That result, a status or an outcome set: SUCCESS for one that repeats, FAILURE for one that retries.
            rounds: The attribute with the largest number of rounds, -1 for no limit; or a function of the node that
                returns the number, `math.inf` for no limit, None if it is not known before the run.
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
            limit: The attribute with the limit in seconds; or a function of the node that returns it, `math.inf` for
                none, None if it is not known before the run.
        """
        limit_sec = partial(outcome_sets.number, name=limit) if isinstance(limit, str) else limit
        return cls(partial(outcome_sets.time_limit, limit_sec), steady=True, changes=R, limit_sec=limit_sec)

    @property
    def is_sequence(self) -> bool:
        """Whether it ticks its children in order until one does not succeed."""
        return self.order is Order.IN_ORDER and self.goes_on == S

    @property
    def is_selector(self) -> bool:
        """Whether it ticks its children in order until one does not fail."""
        return self.order is Order.IN_ORDER and self.goes_on == F

    def always_ends_with_child(self, bound: "NodeView") -> bool:
        """Return whether it starts its child at once, and continues only when the child has ended."""
        if not self.steady or self.possible is None:
            return False
        return self.possible(bound, [R], ALLOWED) in (R, R | F)

    def end_results(self, bound: "NodeView") -> int:
        """Return the results of its only child after which it can end, as an outcome set."""
        if self.possible is None:
            return outcome_sets.ALL
        ends = (outcome for outcome in RESULTS if self.possible(bound, [outcome], ALLOWED) & ~R)
        return outcome_sets.union(ends)


def _rounds_in(attribute: str, bound: "NodeView") -> float | None:
    """Convert a number of rounds from BehaviorTree.CPP's notation, in which -1 means endless."""
    count = outcome_sets.number(bound, attribute)
    if count is None:
        return None
    return math.inf if count == -1 else max(count, 0)
