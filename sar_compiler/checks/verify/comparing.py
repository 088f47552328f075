"""Comparing the answers about two trees."""

from collections.abc import Mapping
from dataclasses import dataclass

from sar_compiler.checks.verify.verdicts import ProofStatus, Verdict, Verification

SAME, WORSE, BETTER, OTHER = "the same", "worse", "better", "different"
"""The ways in which an answer can have changed."""

# What is not asked of a tree, because it lacks the leaves, is as little known as what is not decided.
_RANKS: Mapping[ProofStatus | None, int] = {
    ProofStatus.BROKEN: 0,
    ProofStatus.UNDECIDED: 1,
    None: 1,
    ProofStatus.PROVED: 2,
}


@dataclass(frozen=True)
class ComparedAnswer:
    """A question that was asked of two trees, or of one of them.

    Attributes:
        question: The question.
        before: The answer for the one tree; None if it was left out there.
        now: The answer for the other tree; None if it was left out there.
    """

    question: str
    before: Verdict | None
    now: Verdict | None

    @property
    def change(self) -> str:
        """How the answer has changed: `SAME`, `WORSE`, `BETTER`, or `OTHER` for neither."""
        before, now = (None if each is None else each.outcome for each in (self.before, self.now))
        if before is now:
            return SAME
        if _RANKS[before] == _RANKS[now]:
            return OTHER
        return WORSE if _RANKS[now] < _RANKS[before] else BETTER


@dataclass(frozen=True)
class VerificationComparison:
    """The answers about two trees, of which the same was asked.

    Attributes:
        before: The result for the one tree.
        now: The result for the other.
    """

    before: Verification
    now: Verification

    @property
    def answers(self) -> tuple[ComparedAnswer, ...]:
        """Every question that was asked of either tree, in their order."""
        before, now = ({v.question: v for v in each.verdicts} for each in (self.before, self.now))
        return tuple(ComparedAnswer(name, before.get(name), now.get(name)) for name in {**now, **before})

    @property
    def worse(self) -> bool:
        """Whether any answer is worse than before."""
        return any(answer.change == WORSE for answer in self.answers)
