"""A tree that is made ready to be verified."""

from dataclasses import dataclass

from sar_compiler.checks.verify.alphabet import Alphabet
from sar_compiler.checks.verify.facts import RememberedFacts
from sar_compiler.compiler.simulated_tree import SimulatedTree


@dataclass(frozen=True)
class Prepared:
    """A tree with stub leaves, and what is kept of it while its states are gone through.

    Attributes:
        simulated: The tree.
        alphabet: Its events.
        facts: Its facts.
    """

    simulated: SimulatedTree
    alphabet: Alphabet
    facts: RememberedFacts

    @classmethod
    def of(cls, simulated: SimulatedTree) -> "Prepared":
        """Make a tree ready."""
        return cls(simulated, Alphabet(simulated), RememberedFacts(simulated))
