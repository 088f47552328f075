"""Leaves in flat form, as verification needs them: what answering ones say is looked up, and whose turn it was is noted.

Almost all of the time goes by here and in the controls around them.
"""

from collections.abc import Sequence
from typing import NamedTuple

from py_trees.behaviour import Behaviour

from sar_compiler.checks.verify.choices import Choices
from sar_compiler.checks.verify.outcomes import NUMBERS
from sar_compiler.checks.verify.prepared import Prepared
from sar_compiler.checks.verify.trail import Trail
from sar_compiler.runtime.answers import Answer
from sar_compiler.runtime.flat import Times
from sar_compiler.runtime.flat.cells import INVALID, RUNNING, SKIPPED, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Build, Part
from sar_compiler.runtime.flat.table import builder_of
from sar_compiler.runtime.stub_leaf import ANSWERED, HALTED, STARTED, StubLeaf


class _Reply(NamedTuple):
    """An answer that is possible.

    Attributes:
        event: The number of its event.
        outcome: What the tick comes to.
        change: The answer, if it changes facts or keys.
    """

    event: int
    outcome: int
    change: Answer | None


class FlatLeaves:
    """Brings leaves into flat form.

    Args:
        prepared: Their tree.
        choices: Decide what is answered.
        trail: Is told what happens; the bit of a leaf is that of its node.

    Attributes:
        ran: The indexes of the leaves that were ticked.
    """

    def __init__(self, prepared: Prepared, choices: Choices, trail: Trail) -> None:
        self.ran: set[int] = set()
        self._facts = prepared.facts
        self._numbers = prepared.alphabet.numbers
        self._pick = choices.pick
        self._trail = trail

    def builder(self, behaviour: Behaviour) -> Build:
        """Return what brings a node into flat form, whether it is a leaf or not.

        Raises:
            NotFlatError: If its rules are not known.
        """
        if isinstance(behaviour, StubLeaf):
            return self._answering
        build = builder_of(behaviour)
        return build if behaviour.children else self._noting(build)

    def _noting(self, build: Build) -> Build:
        """Build a leaf of the language that notes its turns."""
        note = self.ran.add

        def noting(part: Part) -> tuple[Tick, Stop]:
            tick_leaf, stop = build(part)

            def tick(cells: Cells, times: Times) -> int:
                note(part.index)
                return tick_leaf(cells, times)

            return tick, stop

        return noting

    def _answering(self, part: Part) -> tuple[Tick, Stop]:
        """Build a leaf that does what `StubLeaf` does in `initialise`, `update` and `terminate`."""
        leaf, index, at, bit = part.behaviour, part.index, part.at, 1 << part.index
        note, pick, trail, facts = self.ran.add, self._pick, self._trail, self._facts
        take = trail.take
        started, halted = (self._numbers[id(leaf), what, id(None)] for what in (STARTED, HALTED))
        known: dict[int, Sequence[_Reply]] = {}

        def tick(cells: Cells, times: Times) -> int:  # noqa: ARG001
            note(index)
            if cells[at] != RUNNING:
                trail.changed |= bit
                take(started)
            replies = known.get(facts.number)
            if replies is None:
                replies = self._replies(leaf, known)
            event, outcome, change = replies[pick(len(replies))]
            take(event)
            if change is not None:
                facts.change(leaf, change)
            if outcome == RUNNING:
                trail.going_on |= bit
            else:
                trail.changed |= bit
            if outcome != SKIPPED:
                cells[at] = outcome
            return outcome

        def stop(cells: Cells, times: Times) -> None:  # noqa: ARG001
            if cells[at] == RUNNING:
                trail.changed |= bit
                take(halted)
            cells[at] = INVALID

        return tick, stop

    def _replies(self, leaf: StubLeaf, known: dict[int, Sequence[_Reply]]) -> Sequence[_Reply]:
        """Return what a leaf can answer now, and keep it if it depends on facts only.

        The last one comes first: leaves name their setbacks behind their successes, and among runs of as many
        ticks those with setbacks are found first, which are shorter to read.
        """
        replies = [
            _Reply(
                self._numbers[id(leaf), ANSWERED, id(answer)],
                NUMBERS[answer.status],
                answer if answer.then else None,
            )
            for answer in reversed(self._facts.options(leaf))
        ]
        if self._facts.decide_alone(leaf):
            known[self._facts.number] = replies
        return replies
