"""The ticks of a tree, from any state that it can be in.

Almost all of the time of a verification goes by in the leaves here and in the controls around them.
"""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass

from sar_compiler.checks.verify.exploring import Judgement, Transition
from sar_compiler.checks.verify.monitors import Rules
from sar_compiler.checks.verify.property_conditions import ConditionError
from sar_compiler.checks.verify.state import NOT_TICKED, Prepared, State, StateStore
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.choices import Choices, UnsteadyError
from sar_compiler.runtime.kernel.stub_nodes import ChosenTimes, LeafNodes
from sar_compiler.runtime.kernel.table import flatten
from sar_compiler.runtime.kernel.trail import Trail
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

    Raises:
        NotFlatError: If the tree has a node whose rules are not known.

    Attributes:
        flat: The flat form.
        states: Takes and restores its states.
        ran: The indexes of the leaves that were ticked so far.
    """

    def __init__(self, prepared: Prepared, rules: Rules, *, forgets: bool = True) -> None:
        self._alphabet = prepared.alphabet
        self._rules = rules
        self._choices = Choices()
        self._trail = Trail(rules.guarded)
        leaves = LeafNodes(prepared.facts, prepared.alphabet.numbers, self._choices, self._trail)
        self.flat = flatten(prepared.simulated.root, leaves.node_of)
        self.ran = leaves.ran
        self._ticker = self.flat.ticker(ChosenTimes(self._choices, self._trail))
        self.states = StateStore(prepared, self.flat, self._ticker, forgets=forgets)
        self._outcome = NOT_TICKED
        self._start = self.states.take(NOT_TICKED, rules.monitors.start)

    def start(self) -> State:
        """Return the state before the first tick."""
        return self._start

    @property
    def path(self) -> tuple[int, ...]:
        """The choices of the last tick."""
        return self._choices.path

    def steps(self, state: Hashable) -> Iterator[Transition]:
        """Yield every possible result of the next tick.

        Raises:
            ConditionError: If a condition of a property cannot be evaluated.
            UnsteadyError: If the tree does not do the same twice.
        """
        assert isinstance(state, State)  # noqa: S101 - there are no others
        choices = self._choices
        choices.begin()
        while True:
            yield self._play(state)
            if not choices.advance():
                return

    def judge(self, state: Hashable, *, idle: bool | None) -> Judgement:
        """Judge a state."""
        assert isinstance(state, State)  # noqa: S101
        self.states.restore_boards(state)
        return self._rules.judge(WORDS[state.outcome], state.watched, idle=idle)

    def played(self) -> PlayedTick:
        """Return what happened in the step that was yielded last."""
        known = self._alphabet.events
        # Numbers above these are those of guarded events, which go with another one.
        events = tuple(known[number] for number in self._trail.numbers if number < len(known))
        return PlayedTick(events, WORDS[self._outcome], self.states.values())

    def _play(self, state: State) -> Transition:
        states = self.states
        states.restore(state)
        self._trail.begin()
        self._outcome = NOT_TICKED
        try:
            self._outcome = outcome = self.flat.tick(self._ticker)
        except (ConditionError, UnsteadyError):
            raise
        except Exception as error:  # noqa: BLE001 - whatever a leaf raises would end the mission
            return Transition(None, error=error)
        watched, broken = self._rules.monitors.after(state.watched, tuple(self._trail.numbers))
        return Transition(states.take(outcome, watched), self._trail.waits, broken)
