"""The ticks of a simulated tree, from any state that it can be in."""

from dataclasses import dataclass

from py_trees.behaviour import Behaviour

from sar_compiler.checks.verify.claims import hold_to_records
from sar_compiler.checks.verify.monitors import Rules
from sar_compiler.checks.verify.state import Prepared, StateValues
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.choices import Choices
from sar_compiler.runtime.kernel.forking import FEW, ForkingTicker
from sar_compiler.runtime.kernel.stub_nodes import ChosenTimes, LeafNodes
from sar_compiler.runtime.kernel.table import flatten
from sar_compiler.runtime.kernel.tick_steps import TickSteps
from sar_compiler.runtime.kernel.trail import Trail
from sar_compiler.runtime.kernel.user_nodes import UserNode
from sar_compiler.runtime.stub_leaf import Event


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
        claims: Whether the records of the user's controls and decorators say anything that could be wrong.
        wrong: What these have done last that their records exclude, in words.
    """

    def __init__(self, prepared: Prepared, rules: Rules, *, forgets: bool = True, few: int = FEW) -> None:
        self._alphabet = prepared.alphabet
        choices = Choices()
        self._trail = trail = Trail(rules.guarded, rules.monitors.heard, rules.monitors.after)
        simulated = prepared.simulated
        leaves = LeafNodes(simulated.facts.board, prepared.alphabet.numbers, choices, trail)
        self.flat = flatten(simulated.root, leaves.node_of)
        self.ran = leaves.ran
        first = self.flat.ticker(ChosenTimes(choices, trail))
        self.ticker = ForkingTicker(
            first.cells, first.values, first.times, prepared.entries, choices, trail, few
        )
        self.wrong, self._rule = "", rules.count
        self._own = [node for node in self.flat.nodes if isinstance(node, UserNode)]
        self.claims = hold_to_records(self._own, simulated.compiled, self._deny)
        judged_by = [prepared.entries.place_of(entry.name) for entry in rules.entries]
        self.steps = TickSteps(self.flat, self.ticker, rules.judge, judged_by, forgets=forgets)
        self.states = StateValues(simulated, self.steps, self._remembered)

    def _deny(self, behaviour: Behaviour, what: str) -> None:
        cls = type(behaviour)
        self._trail.broken |= 1 << self._rule
        self.wrong = f"'{behaviour.name}' ({cls.__module__}.{cls.__qualname__}) {what}: mend its outcomes or semantics, which checks rely on"

    def _remembered(self) -> dict[str, object]:
        """Return what the user's controls and decorators have in their cells, by the names of the node and of the attribute."""
        values = self.ticker.values
        return {
            f"{node.behaviour.name}.{name}": values[at]
            for node in self._own
            for at, cell in zip(node.own, node.behaviour.cells, strict=True)
            for name, held in vars(node.behaviour).items()
            if held is cell
        }

    def played(self) -> PlayedTick:
        """Return what happened in the last step."""
        known = self._alphabet.events
        # Numbers above these are those of guarded events, which go with another one.
        events = tuple(known[number] for number in self._trail.numbers if number < len(known))
        return PlayedTick(events, WORDS[self.steps.outcome], self.states.values())
