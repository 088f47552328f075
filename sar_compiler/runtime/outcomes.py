"""The possible outcomes of a leaf's tick, as plain data, for runs without a robot."""

import enum
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from py_trees.common import Status

Fact: TypeAlias = bool | int | float | str
"""The types of a fact."""


class ReturnedStatus(enum.Enum):
    """A status that a tick returns, as named in an attribute of a tree file."""

    SUCCESS = "SUCCESS"
    FAILURE = "FAILURE"
    RUNNING = "RUNNING"
    SKIPPED = "SKIPPED"

    @property
    def status(self) -> "Status":
        """The status that a tick returns."""
        from py_trees.common import Status

        from sar_compiler.runtime.skipping import SKIPPED

        return SKIPPED if self is ReturnedStatus.SKIPPED else Status[self.name]


STATUSES = tuple(ReturnedStatus.__members__)
"""The possible statuses, the most common ones first."""


@dataclass(frozen=True)
class Outcome:
    """One possible outcome of a leaf's tick.

    In the scripts, and in the names of facts, `{self}` is replaced by the node's name as an identifier, and
    `{parameter}` by the name of the node that a reference parameter refers to. In the scripts, it is also replaced by
    the value of an integer parameter.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `RUNNING` or `SKIPPED`.
        label: Its meaning in one or two words, such as "found" or "refused"; empty for the status's own name.
        when: A script over facts; the outcome is possible only if it is true. Empty means always.
        then: A script that changes facts when the outcome occurs.
        p: The minimum and maximum probability that a run of the leaf ends with it; None if unknown.
        sec: The minimum and maximum run time of the leaf in seconds, uniformly distributed.
        writes: The attributes whose keys it has written; None if unknown.
    """

    status: str
    label: str = ""
    when: str = ""
    then: str = ""
    p: tuple[float, float] | None = None
    sec: tuple[float, float] = (0.0, 0.0)
    writes: tuple[str, ...] | None = None

    @property
    def name(self) -> str:
        """The label, or else the status."""
        return self.label or self.status


def nominal(options: Sequence[Outcome]) -> Outcome:
    """Return the first outcome that is not RUNNING, or the first one."""
    return next((outcome for outcome in options if outcome.status != "RUNNING"), options[0])


def probabilities(outcomes: Sequence[Outcome]) -> list[tuple[float, float]]:
    """Return the minimum and maximum probability of each outcome, given that one of them occurs.

    If all have a probability, they are normalised, because some of a leaf's outcomes may be impossible now. An outcome
    without a probability gets the rest. If all probabilities are zero, nothing is known.
    """
    known = [outcome.p for outcome in outcomes if outcome.p is not None]
    low, high = sum(p[0] for p in known), sum(p[1] for p in known)
    if len(outcomes) == 1:
        return [(1.0, 1.0)]
    if not high:
        return [(0.0, 1.0)] * len(outcomes)
    if len(known) < len(outcomes) and low < 1.0:
        least = max(0.0, 1.0 - high) if len(known) + 1 == len(outcomes) else 0.0
        return [outcome.p or (least, 1.0 - low) for outcome in outcomes]
    weights = [outcome.p or (0.0, 0.0) for outcome in outcomes]
    return [(_probability(p[0], high - p[1]), _probability(p[1], low - p[0])) for p in weights]


def middle(bounds: Sequence[tuple[float, float]]) -> list[float]:
    """Return probabilities with the sum 1, all at the same relative position between their bounds."""
    room = sum(high - low for low, high in bounds)
    part = (1.0 - sum(low for low, _ in bounds)) / room if room else 0.0
    return [low + part * (high - low) for low, high in bounds]


def _probability(weight: float, others: float) -> float:
    return weight / (weight + others) if weight else 0.0


class DeclaredOutcomes:
    """The declared outcomes of a live leaf, for looking up its status and `outcome_label`.

    Args:
        outcomes: The outcomes.
    """

    def __init__(self, outcomes: Iterable[Outcome]) -> None:
        self._labels: dict[str, list[str]] = defaultdict(list)
        for outcome in outcomes:
            if outcome.label not in self._labels[outcome.status]:
                self._labels[outcome.status].append(outcome.label)
        self._all = {label for labels in self._labels.values() for label in labels}

    def label(self, status: str, said: str) -> str:
        """Return the label of a leaf's outcome; empty if it is unknown.

        The only outcome of a status needs no `outcome_label`. A label of another status is ignored then.

        Args:
            status: The leaf's status.
            said: Its `outcome_label`.
        """
        labels = self._labels.get(status, [])
        if said in labels:
            return said
        return labels[0] if len(labels) == 1 else ""

    def why_invalid(self, status: str, said: str) -> str:
        """Return why a leaf's `outcome_label` is invalid; empty if it is valid."""
        labels = self._labels.get(status, [])
        if said in ("", *labels) or (said in self._all and len(labels) == 1):
            return ""
        known = ", ".join(filter(None, labels)) or "none"
        return f"its outcome_label '{said}' is not declared for {status} (declared: {known})"
