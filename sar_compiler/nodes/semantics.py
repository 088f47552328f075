"""What a node means, whatever its class: the record that checks, conversions and palettes ask.

Whoever adds a node says here, with its registration, how it goes through the nodes in it and what it makes of their
answers. Nothing else in the project knows a node by its tag.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from py_trees.common import Status

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.outcome_sets import ALLOWED, ANSWERS, F, Possible, R, S

if TYPE_CHECKING:
    from sar_compiler.nodes.binding.bound import BoundNode
    from sar_compiler.nodes.btcpp.notes import Notes
    from sar_compiler.nodes.btcpp.rewrites import Draft

Number: TypeAlias = Callable[["BoundNode"], float | None]
"""Reads a number off what is written for a node; None where that is not known before the run."""


class Order(Enum):
    """How a node goes through its children."""

    IN_ORDER = "in order"
    """One after the other, as long as each answers `Semantics.goes_on` or is skipped."""
    TOGETHER = "together"
    """Each of them in every tick, until enough have ended."""
    CHOSEN = "chosen"
    """As it decides by itself, for instance one of several branches."""


class Gate(NamedTuple):
    """What must have happened before a child is ticked.

    Attributes:
        children: The indexes of the children of which at least one must have answered so.
        answers: The answers, an outcome set.
    """

    children: tuple[int, ...]
    answers: int


class AccessKind(Enum):
    """What is done with a key of the blackboard."""

    READ = "read"
    PEEK = "peek"
    """Asked for, and done without where nothing has been written."""
    WRITE = "write"
    CHANGE = "change"
    """A script's `=` and the like: the key must have been written, or have a port."""
    BOTH = "both"
    """A port that is both: whoever has it may read first, or write first."""
    FIXED = "fixed"
    """Read when the tree is compiled: a parameter of the mission, or a constant."""
    NONE = "none"
    """Neither: the key is only removed."""


class KeyRole(NamedTuple):
    """What a node does with the key that a port is given, where the port's direction does not tell.

    Attributes:
        kind: What it does.
        by_name: Whether a text without braces is the name of a key, too.
        indirect: Whether a key in braces holds the name of the key that is meant.
    """

    kind: AccessKind
    by_name: bool = False
    indirect: bool = False


@dataclass(frozen=True)
class Counterpart:
    """What BehaviorTree.CPP has in a node's place.

    Attributes:
        built_in: Whether it has a node of this tag itself.
        rewrite: Turns a node of this project into one of BehaviorTree.CPP's; None where the tag stays.
        hint: What to do where there is none.
    """

    built_in: bool = False
    rewrite: "Callable[[Draft, Notes], None] | None" = None
    hint: str = "register a node of that name in C++"


def _ungated(_bound: "BoundNode") -> Mapping[int, Gate]:
    return {}


@dataclass(frozen=True)
class Semantics:
    """What a node makes of the nodes in it, of time, and of the blackboard.

    `Semantics.sequence()` and its like are what most controls and decorators need.

    Attributes:
        possible: Its outcome set as a function of those of its children (`nodes.outcome_sets`); None where only the
            registered outcomes are known.
        order: How it goes through its children.
        goes_on: After which end of a child the next one is ticked, for `Order.IN_ORDER`: `S` or `F`.
        gates: Which children are ticked only after others have answered something, by their indexes.
        reactive: Whether it looks at every child again in every tick; an attribute `memory` may say so instead.
        steady: Whether it ticks its child whenever it is ticked itself.
        changes: The answers of its child that it does not pass on.
        repeats: The ends of its child after which it starts the child again.
        rounds: How often it ticks its child to an end; None for a node that does not count.
        once: Whether its child is done once in the whole run.
        limit_sec: How long its child may run, in seconds, `math.inf` for ever; None for a node without a limit.
        resumes: Whether it goes on where it was when it is started again, or waits for what others do.
        with_memory: The tag of the node that does the same and looks only at the child that was running.
        keys: What it does with the keys of some of its ports.
        counterpart: What BehaviorTree.CPP has in its place.
    """

    possible: Possible | None = None
    order: Order = Order.CHOSEN
    goes_on: int = 0
    gates: "Callable[[BoundNode], Mapping[int, Gate]]" = _ungated
    reactive: bool = False
    steady: bool = False
    changes: int = 0
    repeats: int = 0
    rounds: Number | None = None
    once: bool = False
    limit_sec: Number | None = None
    resumes: bool = False
    with_memory: str = ""
    keys: Mapping[str, KeyRole] = field(default_factory=dict)
    counterpart: Counterpart = Counterpart()

    @classmethod
    def sequence(
        cls, *, reactive: bool = False, pauses: bool = False, keeps_place: bool = False
    ) -> "Semantics":
        """Return the semantics of a node that ticks its children in order until one does not succeed.

        Args:
            reactive: Whether it looks at every child again in every tick.
            pauses: Whether it answers RUNNING between two children.
            keeps_place: Whether it begins with the child that failed when it is started again.
        """
        possible = outcome_sets.in_order(S, pauses=pauses, keeps_place=keeps_place)
        return cls(possible, Order.IN_ORDER, S, reactive=reactive, resumes=keeps_place)

    @classmethod
    def selector(cls, *, reactive: bool = False, pauses: bool = False) -> "Semantics":
        """Return the semantics of a node that ticks its children in order until one does not fail.

        Args:
            reactive: Whether it looks at every child again in every tick.
            pauses: Whether it answers RUNNING between two children.
        """
        return cls(outcome_sets.in_order(F, pauses=pauses), Order.IN_ORDER, F, reactive=reactive)

    @classmethod
    def parallel(cls, possible: Possible | None = None) -> "Semantics":
        """Return the semantics of a node that ticks its children side by side.

        Args:
            possible: Its outcome set as a function of those of its children, where that is known.
        """
        return cls(possible, Order.TOGETHER)

    @classmethod
    def turning(cls, turns: Mapping[Status, Status]) -> "Semantics":
        """Return the semantics of a decorator that answers something else for some answers of its child.

        Args:
            turns: What it answers instead; what is not named is passed on.
        """
        by_bit = {outcome_sets.bit_of(old): outcome_sets.bit_of(new) for old, new in turns.items()}
        return cls(outcome_sets.turning(by_bit), steady=True, changes=outcome_sets.union(by_bit))

    @property
    def is_sequence(self) -> bool:
        """Whether it ticks its children in order until one does not succeed."""
        return self.order is Order.IN_ORDER and self.goes_on == S

    @property
    def is_selector(self) -> bool:
        """Whether it ticks its children in order until one does not fail."""
        return self.order is Order.IN_ORDER and self.goes_on == F

    def always_ends_with_child(self, bound: "BoundNode") -> bool:
        """Return whether it starts its child at once, and goes on only when the child does not run any more."""
        if not self.steady or self.possible is None:
            return False
        return self.possible(bound, [R], ALLOWED) in (R, R | F)

    def ends_by(self, bound: "BoundNode") -> int:
        """Return the answers of its only child after which it can end, an outcome set."""
        if self.possible is None:
            return outcome_sets.ALL
        ends = (answer for answer in ANSWERS if self.possible(bound, [answer], ALLOWED) & ~R)
        return outcome_sets.union(ends)


def endless(count: float | None) -> float | None:
    """Return a number of rounds of BehaviorTree.CPP's, in which -1 is for ever and less is none."""
    if count is None:
        return None
    return math.inf if count == -1 else max(count, 0)
