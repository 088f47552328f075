"""What verification answers."""

from dataclasses import dataclass
from enum import Enum

from sar_compiler.checks.verify.properties import LeftOut
from sar_compiler.checks.verify.traces import Trace
from sar_compiler.runtime.stub_leaf import StubLeaf


class ProofStatus(str, Enum):
    """What is known of a question."""

    PROVED = "proved"
    BROKEN = "does not hold"
    UNDECIDED = "not decided"


@dataclass(frozen=True)
class Verdict:
    """A question and its answer.

    Attributes:
        question: What was asked, as what should be.
        outcome: What is known of it.
        reason: Why it does not hold, or is not decided; empty where it is proved.
        trace: A run in which it does not hold, with as few ticks as can be.
    """

    question: str
    outcome: ProofStatus
    reason: str = ""
    trace: Trace | None = None


@dataclass(frozen=True)
class Verification:
    """All that was found out about a tree.

    Attributes:
        verdicts: The questions with their answers.
        states: How many states were found.
        ticks: How many different ticks there are between them.
        depth: How many ticks it takes to come everywhere; where not every state was gone through, how many ticks
            every run was followed for.
        complete: Whether every state was gone through.
        left_out: The properties that say nothing about this tree.
        growing: What had most values where not every state was gone through, with their number.
        leaves: The leaves that the runs speak of.
    """

    verdicts: tuple[Verdict, ...]
    states: int
    ticks: int
    depth: int
    complete: bool
    left_out: tuple[LeftOut, ...] = ()
    growing: tuple[tuple[str, int], ...] = ()
    leaves: tuple[StubLeaf, ...] = ()

    @property
    def proved(self) -> bool:
        """Whether everything is proved."""
        return all(verdict.outcome is ProofStatus.PROVED for verdict in self.verdicts)
