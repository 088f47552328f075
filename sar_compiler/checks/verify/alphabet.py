"""The events of a tree's runs, each with a number."""

from collections.abc import Mapping

from sar_compiler.checks.leaf_words import Deed
from sar_compiler.compiler.rehearsal import Rehearsal
from sar_compiler.runtime.answering import ANSWERED, HALTED, STARTED, Event


class Alphabet:
    """What the answering leaves of a tree can do.

    Args:
        rehearsal: The tree.

    Attributes:
        events: What each number means.
        numbers: The number of each event, by the identities of the leaf and of the answer (or of None).
    """

    def __init__(self, rehearsal: Rehearsal) -> None:
        self.events: list[Event] = []
        for leaf in rehearsal.leaves:
            self.events += [Event(leaf, ANSWERED, answer) for answer in leaf.answers]
            self.events += [Event(leaf, STARTED), Event(leaf, HALTED)]
        # By identity: two answers of a leaf may say the same.
        self.numbers: Mapping[tuple[int, str, int], int] = {
            (id(event.leaf), event.what, id(event.answer)): number for number, event in enumerate(self.events)
        }

    def meant_by(self, deed: Deed) -> set[int]:
        """Return the numbers of all events that are what a file says."""
        return {number for number, event in enumerate(self.events) if deed.is_done(event)}
