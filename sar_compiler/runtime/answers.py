"""The possible answers of a leaf to a tick, as plain data, for runs without a robot."""

import enum
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from py_trees.common import Status

Fact: TypeAlias = bool | int | float | str
"""The types of a fact."""


class Outcome(enum.Enum):
    """An outcome of a tick that an attribute of a tree file chooses."""

    SUCCESS = "SUCCESS"
    FAILURE = "FAILURE"
    RUNNING = "RUNNING"
    SKIPPED = "SKIPPED"

    @property
    def status(self) -> "Status":
        """The outcome that a tick returns."""
        from py_trees.common import Status

        from sar_compiler.runtime.skipping import SKIPPED

        return SKIPPED if self is Outcome.SKIPPED else Status[self.name]


STATUSES = tuple(Outcome.__members__)
"""The statuses of an answer, the usual ones first."""


@dataclass(frozen=True)
class Answer:
    """One possible answer of a leaf to a tick.

    In the scripts, and in the names of facts, `{self}` stands for the node's name as an identifier, and
    `{parameter}` for that of the node that a reference parameter refers to. In the scripts it also stands for
    the value of a parameter that is a whole number.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `RUNNING` or `SKIPPED`.
        label: What it means, in a word or two: "found", "refused"; empty for the status's own name.
        when: A script over facts; the answer is possible only if it is true. Empty: always.
        then: A script that changes facts when the answer is given.
        p: How likely it is that it ends what the leaf has begun, at least and at most; None if nobody knows.
        sec: How long the leaf runs before, at least and at most, in seconds; every time between is as likely.
        writes: The attributes whose keys it has written then; None if that is not known.
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
        """Its label, or else its status."""
        return self.label or self.status


def nominal(options: Sequence[Answer]) -> Answer:
    """Return the first answer that is not RUNNING, or else the first one."""
    return next((answer for answer in options if answer.status != "RUNNING"), options[0])


def probabilities(answers: Sequence[Answer]) -> list[tuple[float, float]]:
    """Return how likely each of some answers is, at least and at most, where it will be one of them.

    Where all have a chance, these count in relation to each other, as some of a leaf's answers may be impossible now. One
    that has none has what the others leave. Where none can be, of all that are possible, nothing is known.
    """
    known = [answer.p for answer in answers if answer.p is not None]
    low, high = sum(p[0] for p in known), sum(p[1] for p in known)
    if len(answers) == 1:
        return [(1.0, 1.0)]
    if not high:
        return [(0.0, 1.0)] * len(answers)
    if len(known) < len(answers) and low < 1.0:
        least = max(0.0, 1.0 - high) if len(known) + 1 == len(answers) else 0.0
        return [answer.p or (least, 1.0 - low) for answer in answers]
    weights = [answer.p or (0.0, 0.0) for answer in answers]
    return [(_share(p[0], high - p[1]), _share(p[1], low - p[0])) for p in weights]


def middle(bounds: Sequence[tuple[float, float]]) -> list[float]:
    """Return chances that add up to 1, each as far between its bounds as the others are."""
    room = sum(high - low for low, high in bounds)
    part = (1.0 - sum(low for low, _ in bounds)) / room if room else 0.0
    return [low + part * (high - low) for low, high in bounds]


def _share(weight: float, others: float) -> float:
    return weight / (weight + others) if weight else 0.0


class DeclaredAnswers:
    """The answers that a live leaf has declared, among which its status and its `answer_label` are looked up.

    Args:
        answers: The answers.
    """

    def __init__(self, answers: Iterable[Answer]) -> None:
        self._labels: dict[str, list[str]] = defaultdict(list)
        for answer in answers:
            if answer.label not in self._labels[answer.status]:
                self._labels[answer.status].append(answer.label)
        self._all = {label for labels in self._labels.values() for label in labels}

    def label(self, status: str, said: str) -> str:
        """Return the label of the answer that a leaf has given; empty if that is not known.

        The only answer of a status need not be said. What was said of another status counts for nothing then.

        Args:
            status: The leaf's status.
            said: Its `answer_label`.
        """
        labels = self._labels.get(status, [])
        if said in labels:
            return said
        return labels[0] if len(labels) == 1 else ""

    def objection(self, status: str, said: str) -> str:
        """Return why what a leaf has said cannot be so, in words; empty if it can."""
        labels = self._labels.get(status, [])
        if said in ("", *labels) or (said in self._all and len(labels) == 1):
            return ""
        known = ", ".join(filter(None, labels)) or "none"
        return f"its answer_label is '{said}' with {status}, of which it has declared: {known}"
