"""The facts while states are gone through: what was worked out once of them is not worked out again.

There are few different contents of the facts, and scripts take longer than all the rest of a tick. So the facts are
a number, and what a script makes of a number is remembered.
"""

from collections.abc import Callable, Sequence

from sar_compiler.checks.verify.snapshots import Snapshots
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.runtime.answers import Answer
from sar_compiler.runtime.expressions import Script, name_uses
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.stub_leaf import StubLeaf

_UNKNOWN = -1


class RememberedFacts:
    """The facts of a tree.

    The board of the facts is brought up to date only where somebody looks at it: `write_out` does that.

    Args:
        simulated: The tree.
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        self._snapshots = Snapshots(simulated.facts.board)
        self._names = frozenset(simulated.fact_values())
        self._written = self.number = self._snapshots.take()
        """The number of the facts as they are now."""
        # The leaves whose scripts look at facts only, and change nothing else.
        self._known = {
            id(leaf)
            for leaf in simulated.leaves
            if all(
                self.alone(parse(text)) for each in leaf.answers for text in (each.when, each.then) if text
            )
        }
        self._changes: dict[tuple[int, int, int], int] = {}

    def alone(self, script: Script) -> bool:
        """Say whether a script speaks of facts only."""
        return self._names.issuperset(use.name for use in name_uses(script))

    def write_out(self) -> None:
        """Bring the board up to date."""
        if self._written != self.number:
            self._snapshots.restore(self.number)
            self._written = self.number

    def decide_alone(self, leaf: StubLeaf) -> bool:
        """Say whether nothing but facts decides what a leaf can answer, and nothing else is changed by it."""
        return id(leaf) in self._known

    def options(self, leaf: StubLeaf) -> Sequence[Answer]:
        """Return the answers of a leaf that are possible now; raises as `StubLeaf.options`."""
        self.write_out()
        return leaf.options()

    def change(self, leaf: StubLeaf, answer: Answer) -> None:
        """Change what an answer of a leaf changes; raises as `StubLeaf.change`."""
        place = (id(leaf), id(answer), self.number)
        number = self._changes.get(place)
        if number is None:
            self.write_out()
            # Whatever becomes of the change, the board is no longer what it was.
            self._written = _UNKNOWN
            leaf.change(answer)
            number = self._written = self._snapshots.take()
            if id(leaf) in self._known:
                self._changes[place] = number
        self.number = number

    def remembering(self, script: Script, holds: Callable[[], bool]) -> Callable[[], bool]:
        """Return a function that evaluates a condition on the facts as they are now.

        Args:
            script: The condition.
            holds: Evaluates it on the board.
        """
        known: dict[int, bool] = {}
        alone = self.alone(script)

        def remembered() -> bool:
            answer = known.get(self.number)
            if answer is None:
                self.write_out()
                answer = holds()
                if alone:
                    known[self.number] = answer
            return answer

        return remembered
