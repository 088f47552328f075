"""The possible events of a tick, as numbers."""

from collections.abc import Mapping

from sar_compiler.checks.leaf_words import EventPattern
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.runtime.stub_leaf import ANSWERED, HALTED, STARTED, Event


class Alphabet:
    """The possible events of the stub leaves of a tree.

    Args:
        simulated: The tree.

    Attributes:
        events: What each number means.
        numbers: The number of each event, by the identities of the leaf and of the answer (or of None).
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        self.events: list[Event] = []
        for leaf in simulated.leaves:
            self.events += [Event(leaf, ANSWERED, answer) for answer in leaf.answers]
            self.events += [Event(leaf, STARTED), Event(leaf, HALTED)]
        # By identity: two answers of a leaf may say the same.
        self.numbers: Mapping[tuple[int, str, int], int] = {
            (id(event.leaf), event.what, id(event.answer)): number for number, event in enumerate(self.events)
        }

    def meant_by(self, deed: EventPattern) -> set[int]:
        """Return the numbers of all events that a text of a file means."""
        return {number for number, event in enumerate(self.events) if deed.matches(event)}
