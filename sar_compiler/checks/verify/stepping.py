"""The ticks of a tree, from any state that it can be in.

Almost all of the time of a verification goes by in the leaves here and in the controls around them.
"""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from py_trees.behaviour import Behaviour

from sar_compiler.checks.verify.choices import Choices, UnsteadyError
from sar_compiler.checks.verify.events import Trail
from sar_compiler.checks.verify.exploring import Judgement, Transition
from sar_compiler.checks.verify.monitors import Rules
from sar_compiler.checks.verify.property_conditions import ConditionError
from sar_compiler.checks.verify.state import NOT_TICKED, NUMBERS, WORDS, Prepared, State, StateStore
from sar_compiler.runtime.answers import Answer
from sar_compiler.runtime.flat.cells import INVALID, RUNNING, SKIPPED, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Build, Part
from sar_compiler.runtime.flat.table import builder_of
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.flat.tree import flatten
from sar_compiler.runtime.stub_leaf import ANSWERED, HALTED, STARTED, Event, StubLeaf


class _Reply(NamedTuple):
    """An answer that is possible.

    Attributes:
        event: The number of its event.
        outcome: The outcome of the tick.
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

        The last one comes first: leaves name their setbacks after their successes, and among runs of as many
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


_STARTED, _UP = 1, 2


class Timers:
    """Timers of which each may be up at any look, or at a later one.

    Args:
        choices: Decide whether a timer is up.
        trail: Is told what is waited for; the bit of a timer is that of its node.
    """

    def __init__(self, choices: Choices, trail: Trail) -> None:
        self._choices = choices
        self._trail = trail

    def start(self, index: int, seconds: float) -> Hashable:
        """Start a timer; one without any time is up at once."""
        self._trail.changed |= 1 << index
        return _STARTED if seconds > 0 else _UP

    def is_up(self, index: int, token: int) -> bool:
        """Choose whether a timer is up."""
        if token == _UP or self._choices.pick(2) == 1:
            self._trail.changed |= 1 << index
            return True
        self._trail.going_on |= 1 << index
        return False

    def remaining(self, index: int, token: int) -> float:  # noqa: ARG002 - as the protocol has it
        """Return 0: the time left is not known."""
        return 0.0


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

    Raises:
        NotFlatError: If the tree has a node whose rules are not known.

    Attributes:
        flat: The flat form.
        states: Takes and restores its states.
        ran: The indexes of the leaves that were ticked so far.
    """

    def __init__(self, prepared: Prepared, rules: Rules) -> None:
        self._alphabet = prepared.alphabet
        self._rules = rules
        self._choices = Choices()
        self._trail = Trail(rules.guarded)
        leaves = FlatLeaves(prepared, self._choices, self._trail)
        self.flat = flatten(prepared.simulated.root, leaves.builder)
        self.ran = leaves.ran
        self.states = StateStore(prepared, self.flat)
        self._times = Timers(self._choices, self._trail)
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
            self._outcome = outcome = self.flat.tick(states.cells, self._times)
        except (ConditionError, UnsteadyError):
            raise
        except Exception as error:  # noqa: BLE001 - whatever a leaf raises would end the mission
            return Transition(None, error=error)
        watched, broken = self._rules.monitors.after(state.watched, tuple(self._trail.numbers))
        return Transition(states.take(outcome, watched), self._trail.waits, broken)
