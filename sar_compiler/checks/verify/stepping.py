"""The ticks of a simulated tree, from any state that it can be in."""

from collections.abc import Sequence
from dataclasses import dataclass

from sar_compiler.checks.verify.claims import claims_of
from sar_compiler.checks.verify.monitors import Rules
from sar_compiler.checks.verify.state import Prepared, StateValues
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.answers import Answer
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.choices import Choices
from sar_compiler.runtime.kernel.foreign_nodes import ForeignObjects
from sar_compiler.runtime.kernel.forking import FEW, ForkingTicker
from sar_compiler.runtime.kernel.stub_nodes import ChosenTimes, LeafNodes
from sar_compiler.runtime.kernel.table import flatten, is_foreign
from sar_compiler.runtime.kernel.tick_steps import TickSteps
from sar_compiler.runtime.kernel.trail import Trail
from sar_compiler.runtime.object_memory import ObjectMemory
from sar_compiler.runtime.possible_time import PossibleClock
from sar_compiler.runtime.stub_leaf import Event, StubLeaf


@dataclass(frozen=True)
class PlayedTick:
    """The events and results of a tick, for reports.

    Attributes:
        events: What the leaves did, in order.
        root: The root's status; empty if the tick was not finished.
        values: The facts and the keys of the tree afterwards.
    """

    events: tuple[Event, ...]
    root: str
    values: dict[str, object]


class _Unasked:
    """Refuses to answer for a leaf that is asked otherwise than by its tick, whose answers are gone through."""

    def choose(self, leaf: StubLeaf, options: Sequence[Answer]) -> Answer:  # noqa: ARG002 - as the protocol has it
        message = f"'{leaf.name}' is asked for its answer by update(); a class that has children asks them by tick()"
        raise UndecidableError(message)


class TreeStepper:
    """Plays ticks of a simulated tree in its flat form.

    Args:
        prepared: The tree with stub leaves.
        rules: What is watched.
        forgets: Whether states are the same that differ only in how nodes have ended, where that makes no difference.
        few: After how many ticks of a state it begins to see whether they meet.

    Raises:
        NotFlatError: If the tree has a node whose rules are not known.

    Attributes:
        flat: The flat form.
        ticker: What ticks it.
        steps: Its steps.
        states: Tells what is in its states.
        ran: The indexes of the leaves that were ticked so far.
        claims: What the records of the user's classes say of his controls and decorators.
        objects: These controls and decorators.
    """

    def __init__(self, prepared: Prepared, rules: Rules, *, forgets: bool = True, few: int = FEW) -> None:
        self._alphabet = prepared.alphabet
        choices = Choices()
        self._trail = trail = Trail(rules.guarded, rules.monitors.heard, rules.monitors.after)
        simulated = prepared.simulated
        behaviours = list(simulated.root.iterate())
        foreign = list(filter(is_foreign, behaviours))
        self.claims = claims_of(foreign, simulated.compiled)
        memory = ObjectMemory(foreign, behaviours)
        self.objects = objects = ForeignObjects(memory, choices, trail, self.claims, rules.count)
        PossibleClock.of(simulated.clock, objects)
        simulated.policy = _Unasked()
        leaves = LeafNodes(simulated.facts.board, prepared.alphabet.numbers, choices, trail, objects)
        self.flat = flatten(simulated.root, leaves.node_of)
        objects.call_through(self.flat.nodes)
        self.ran = leaves.ran
        first = self.flat.ticker(ChosenTimes(choices, trail))
        self.ticker = ForkingTicker(
            first.cells, first.values, first.times, prepared.entries, choices, trail, few, objects
        )
        judged_by = [prepared.entries.place_of(entry.name) for entry in rules.entries]
        self.steps = TickSteps(self.flat, self.ticker, rules.judge, judged_by, objects, forgets=forgets)
        self.states = StateValues(simulated, self.steps, lambda: objects.values(self.ticker))

    def played(self) -> PlayedTick:
        """Return what happened in the last step."""
        known = self._alphabet.events
        # Numbers above these are those of guarded events, which go with another one.
        events = tuple(known[number] for number in self._trail.numbers if number < len(known))
        return PlayedTick(events, WORDS[self.steps.outcome], self.states.values())
