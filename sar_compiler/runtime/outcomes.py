"""The possible outcomes of a leaf's tick. Runs without a robot use these descriptions instead of the leaf."""

import enum
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from py_trees.common import Status

Fact: TypeAlias = bool | int | float | str
"""The value of a fact."""


class ReturnedStatus(enum.Enum):
    """A status returned by a tick. Attributes in tree files contain the names of these statuses."""

    SUCCESS = "SUCCESS"
    FAILURE = "FAILURE"
    RUNNING = "RUNNING"
    SKIPPED = "SKIPPED"

    @property
    def status(self) -> "Status":
        """The py_trees status."""
        from py_trees.common import Status

        from sar_compiler.runtime.skipping import SKIPPED

        return SKIPPED if self is ReturnedStatus.SKIPPED else Status[self.name]


STATUSES = tuple(ReturnedStatus.__members__)
"""The names of the possible statuses, in descending order of frequency."""


@dataclass(frozen=True)
class Outcome:
    """One possible outcome of a leaf's tick.

    In scripts and names of facts, `{self}` is replaced by the node's name as an identifier. `{parameter}` is replaced
    by the name of the node to which a reference parameter refers. In scripts, `{parameter}` may also name an integer
    parameter and is replaced by its value.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `RUNNING` or `SKIPPED`.
        label: The meaning in one or two words, such as "found" or "refused"; empty if the name of the status is used.
        when: The condition on facts under which the outcome is possible; empty if the outcome is always possible.
        then: A script that changes facts when the outcome occurs.
        p: The minimum and maximum probability that a run of the leaf ends with this outcome; None if not known.
        sec: The minimum and maximum run time of the leaf in seconds, uniformly distributed.
        writes: The attributes whose keys the leaf has written with this outcome; None if not known.
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
        """The label, or the status if there is no label."""
        return self.label or self.status


def nominal(options: Sequence[Outcome]) -> Outcome:
    """Return the first outcome that is not RUNNING, or the first outcome if all are RUNNING."""
    return next((outcome for outcome in options if outcome.status != "RUNNING"), options[0])


def probabilities(outcomes: Sequence[Outcome]) -> list[tuple[float, float]]:
    """Return the minimum and maximum probability of each outcome if exactly one of the outcomes occurs.

    If all outcomes have a probability, the probabilities are normalised, because other outcomes of the leaf may be impossible now.
    Otherwise, the outcomes without a probability share the remaining probability. If all probabilities are zero, each outcome may have any
    probability.
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
    """Choose one probability within each pair of bounds, so that all probabilities add up to 1."""
    room = sum(high - low for low, high in bounds)
    part = (1.0 - sum(low for low, _ in bounds)) / room if room else 0.0
    return [low + part * (high - low) for low, high in bounds]


def _probability(weight: float, others: float) -> float:
    return weight / (weight + others) if weight else 0.0


class DeclaredOutcomes:
    """Looks up the declared outcomes of a leaf by the leaf's status and `outcome_label`.

    Args:
        outcomes: The outcomes.
    """

    def __init__(self, outcomes: Iterable[Outcome]) -> None:
        self._labels: dict[str, list[str]] = defaultdict(list)
        for outcome in outcomes:
            if outcome.label not in self._labels[outcome.status]:
                self._labels[outcome.status].append(outcome.label)
        self._all = {label for labels in self._labels.values() for label in labels}

    def label(self, status: str, given: str) -> str:
        """Return the label of a leaf's outcome, or an empty string if the label is not known.

        If only one outcome has the status, its label is returned, and any other label is ignored.

        Args:
            status: The leaf's status.
            given: The leaf's `outcome_label`.
        """
        labels = self._labels.get(status, [])
        if given in labels:
            return given
        return labels[0] if len(labels) == 1 else ""

    def why_invalid(self, status: str, given: str) -> str:
        """Return why a leaf's `outcome_label` is invalid, or an empty string if the label is valid."""
        labels = self._labels.get(status, [])
        if given in ("", *labels) or (given in self._all and len(labels) == 1):
            return ""
        known = ", ".join(filter(None, labels)) or "none"
        return f"its outcome_label '{given}' is not a declared label for {status} (declared labels: {known})"
