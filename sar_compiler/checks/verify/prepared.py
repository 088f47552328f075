"""A tree that is made ready to be verified."""

from dataclasses import dataclass

from sar_compiler.checks.verify.alphabet import Alphabet
from sar_compiler.checks.verify.facts import RememberedFacts
from sar_compiler.compiler.rehearsal import Rehearsal


@dataclass(frozen=True)
class Prepared:
    """A tree with answering leaves, and what is kept of it while its states are gone through.

    Attributes:
        rehearsal: The tree.
        alphabet: Its events.
        facts: Its facts.
    """

    rehearsal: Rehearsal
    alphabet: Alphabet
    facts: RememberedFacts

    @classmethod
    def of(cls, rehearsal: Rehearsal) -> "Prepared":
        """Make a tree ready."""
        return cls(rehearsal, Alphabet(rehearsal), RememberedFacts(rehearsal))
