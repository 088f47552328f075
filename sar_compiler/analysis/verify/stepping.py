"""Plays ticks of a simulated tree from any state, and checks what the user's classes declare."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import pairwise

from librt.vecs import vec
from mypy_extensions import i32
from py_trees.behaviour import Behaviour

from sar_compiler.analysis.state_search.branch_nodes import BranchNode
from sar_compiler.analysis.state_search.choices import Choices
from sar_compiler.analysis.state_search.forking import ForkingTicker
from sar_compiler.analysis.state_search.probabilities import ChoiceTable, ProbabilisticLeaf, WeighedSteps
from sar_compiler.analysis.state_search.searching import Judgement
from sar_compiler.analysis.state_search.stub_nodes import ChosenTimes, LeafNodes
from sar_compiler.analysis.state_search.tick_steps import TickSteps
from sar_compiler.analysis.state_search.trail import Trail
from sar_compiler.analysis.verify.properties import PropertyAutomata
from sar_compiler.analysis.verify.state import PreparedTree, StateValues
from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes
from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError, UndecidableError
from sar_compiler.nodes.binding.nesting import trees_in
from sar_compiler.nodes.outcome_sets import ALL, BITS, WORD_OF
from sar_compiler.nodes.semantics import Order
from sar_compiler.runtime.events import Event, TickRecord, append_end, changes_in, value_changes
from sar_compiler.runtime.kernel.cells import INVALID, WORDS
from sar_compiler.runtime.kernel.table import flatten
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.tree_nodes import Ticker
from sar_compiler.runtime.kernel.user_nodes import Claim, UserNode
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.runtime.outcomes import nominal
from sar_compiler.runtime.variables import UNKNOWN, unknown_value_of


def check_declarations(
    nodes: Iterable[UserNode], compiled: CompiledTree, deny: Callable[[Behaviour, str], None]
) -> bool:
    """Check during ticks that nodes behave as they declare. Return whether any node has declarations.

    Args:
        nodes: The nodes.
        compiled: The tree of the nodes.
        deny: Called with each behaviour that deviates from its declarations, and a description of the deviation.
    """
    possible: PossibleOutcomes | None = None
    for node in nodes:
        bound = compiled.origins[node.behaviour.id].bound
        semantics, statuses = bound.spec.semantics, bound.spec.statuses
        if semantics.possible is None and not statuses:
            continue
        possible = possible or PossibleOutcomes(trees_in(compiled.instance.tree))
        outcomes = possible.possible_results(bound)
        if statuses:
            outcomes &= sum(BITS[word] for word in statuses)
        goes_on = WORDS.index(WORD_OF.get(semantics.goes_on, "")) if semantics.order is Order.IN_ORDER else 0
        if outcomes != ALL or goes_on:
            numbers = sum(1 << WORDS.index(word) for word, bit in BITS.items() if outcomes & bit)
            node.claim = Claim(numbers, goes_on, deny)
    return possible is not None


class TreeStepper:
    """Plays ticks of a simulated tree, which is converted to flat form.

    Args:
        prepared: The tree with stub leaves.
        rules: The monitored properties.
        flattened: Converts the tree to flat form, given the builder of leaves; None for the unchanged tree.
        forgets: Whether states forget the last statuses of nodes that make no difference between ticks.
        meets: Whether ticks that reach the same intermediate state are merged from there on.
        probabilities: Receives the choices of leaves with known probabilities; None to ignore probabilities.
        merges: Whether values that no run can distinguish are merged (`slicing`).

    Raises:
        NotFlatError: If the tree has a node with unknown behaviour.

    Attributes:
        leaves: The tree's stub leaves.
        writes_unknown_values: Whether a leaf writes unknown values.
        flat: The flat form of the tree.
        ticker: Ticks the flat form.
        steps: The steps between the tree's states.
        states: Describes the tree's states.
        ran: The indices of the leaves that were ticked so far.
        claims: Whether the user's controls and decorators have declarations that are checked.
        wrong: A description of the last deviation from these declarations.
    """

    def __init__(
        self,
        prepared: PreparedTree,
        rules: PropertyAutomata,
        flattened: Callable[[LeafNodes], FlatTree] | None = None,
        *,
        forgets: bool = True,
        meets: bool = True,
        probabilities: ChoiceTable | None = None,
        merges: bool = True,
    ) -> None:
        self._alphabet = prepared.alphabet
        choices = Choices()
        entries = prepared.entries
        entries.restore(vec[i32](prepared.start if merges else prepared.plain_start or prepared.start))
        self._trail = trail = Trail(
            rules.guarded, rules.monitors.relevant_events, rules.monitors.next_state, entries
        )
        simulated = prepared.simulated
        stub = partial(ProbabilisticLeaf, probabilities=probabilities) if probabilities else None
        leaves = LeafNodes(simulated.facts.board, prepared.alphabet.numbers, choices, trail, stub)
        self.flat = flattened(leaves) if flattened else flatten(simulated.root, leaves.node_of)
        self.ran = leaves.ran
        first = self.flat.ticker(probabilities.times if probabilities else ChosenTimes(choices, trail))
        self._begin_as_first(prepared, first)
        self.ticker = ForkingTicker(first, entries, choices, trail, meets=meets)
        self.wrong, self._rule = "", rules.count
        self._rules, self._watched = rules, 0
        self._own = [node for node in self.flat.nodes if isinstance(node, UserNode)]
        self.claims = check_declarations(self._own, simulated.compiled, self._deny)
        judged_by = [entries.place_of(entry.name) for entry in rules.entries]
        self.leaves = simulated.leaves
        self.writes_unknown_values = any(
            UNKNOWN in each.then for leaf in self.leaves for each in leaf.outcomes
        )
        self.steps = (
            WeighedSteps(self.flat, self.ticker, rules.judge, judged_by, probabilities.times)
            if probabilities
            else TickSteps(self.flat, self.ticker, rules.judge, judged_by, forgets=forgets)
        )
        self.states = StateValues(simulated, self.steps, self._user_cells)
        self._before: tuple[Mapping[str, object], Mapping[str, object]] = ({}, {})

    def _begin_as_first(self, prepared: PreparedTree, ticker: Ticker) -> None:
        """Give nodes the initial cells that they had in the first stepper.

        The behaviours may have been ticked since.
        """
        cells, values = ticker.cells, ticker.values
        for node in self.flat.nodes:
            keeps_nothing = node.first_cell == node.last_cell and node.first_value == node.last_value
            if keeps_nothing or isinstance(node, BranchNode):
                continue
            now = list(cells[node.first_cell : node.last_cell]), values[node.first_value : node.last_value]
            begun = prepared.begun.setdefault(node.behaviour, now)
            values[node.first_value : node.last_value] = begun[1]
            for place, number in enumerate(begun[0], node.first_cell):
                cells[place] = i32(number)

    def _deny(self, behaviour: Behaviour, what: str) -> None:
        cls = type(behaviour)
        self._trail.broken |= 1 << self._rule
        self.wrong = f"'{behaviour.name}' ({cls.__module__}.{cls.__qualname__}) {what}. Correct the declared outcomes or semantics"

    def _user_cells(self) -> dict[str, object]:
        """Return the cell values of the user's controls and decorators, by node and attribute name."""
        values = self.ticker.values
        return {
            f"{node.behaviour.name}.{name}": values[at]
            for node in self._own
            for at, cell in zip(node.own, node.behaviour.cells, strict=True)
            for name, value in vars(node.behaviour).items()
            if value is cell
        }

    def ticks(self, state: bytes, path: tuple[int, ...] = ()) -> Iterator[TickSteps]:
        """Play the ticks that start in a state, one after the other, or only the tick with the choices *path*.

        After each tick, `tick_record`, `unusual_outcomes` and `violated_properties` describe it.
        """
        self._watched = self.steps.restore(state)[1]
        self._before = self.states.facts_and_keys()
        self._trail.keeps = True
        try:
            self.steps.enter(state, alone=True, path=path)
            while self.steps.step():
                yield self.steps
        finally:
            self._trail.keeps = False

    def states_after_halt(self, state: bytes, *, begins: bool = False) -> Iterator[bytes]:
        """Yield the states that are possible after a BehaviorTree.CPP program has halted the tree.

        `Tree::haltTree` halts the running nodes, and then every node, even if it is not running. So each `_onHalted` runs once more.

        Args:
            state: The state.
            begins: Whether a new run begins then, so that the properties start over.
        """
        outcome, watched = self.steps.restore(self.steps.start() if begins else state)
        self.steps.enter(state, alone=True)
        is_left = 0
        while is_left >= 0:
            if self._halts_tree():
                self.ticker.trail.watched = watched
                self.steps.save_state(outcome)
                if self.steps.state is not None:
                    yield self.steps.state
            is_left = self.ticker.next_fork()

    def _halts_tree(self) -> bool:
        """Halt the tree. Return False if a script fails, which would end the program."""
        try:
            self.flat.nodes[0].stop(self.ticker)
            for node in self.flat.nodes:
                node.reset_cells(self.ticker)
                node.reset_outcome(self.ticker)
                if isinstance(node.behaviour, Conditions):
                    node.behaviour.run_after(INVALID)
        except UndecidableError:
            raise
        except SarError as error:
            if unknown_value_of(error) is not None:
                raise UndecidableError(
                    f"an error occurred after the program had halted the tree: {error}"
                ) from error
            return False
        return True

    def pass_over(self, place: int) -> None:
        """Skip all further ticks that are equal to the last tick up to the outcome with index *place*.

        The next combination of choices then differs at this outcome or before it.
        """
        outcomes = [
            at
            for at, event in enumerate(self._trail.numbers)
            if event < len(self._alphabet.events) and self._alphabet.outcomes[event][1] is not None
        ]
        forks = self.ticker._forks  # noqa: SLF001 - belongs to the same search
        behind = (fork.asked for fork in forks if fork.happened > outcomes[place])
        self.ticker.choices.rewind(next(behind, self.ticker.choices.choice_count))

    def play(self, state: bytes, wanted: Callable[[TickSteps], bool], number: int = 0) -> TickRecord:
        """Play the first tick from a state that *wanted* accepts.

        Return the tick's record with the given number.
        """
        next(step for step in self.ticks(state) if wanted(step))
        return self.tick_record(number)

    def tick_record(self, number: int = 0) -> TickRecord:
        """Return the record of the last tick. *number* is the tick number in the record."""
        now, events = self.ticker.entries.now, []
        happened, after = self._recorded_events(), list(now)
        for (event, past), (_, then) in pairwise([*happened, (0, after)]):
            changed = () if past == then else changes_in(self._facts_in(past), self._facts_in(then))
            events.append(self._alphabet.events[event]._replace(facts=changed))
        self.ticker.entries.restore(now)
        root, steps = self.flat.nodes[0].behaviour.name, self.steps
        (facts_before, keys_before), (facts, keys) = self._before, self.states.facts_and_keys()
        return TickRecord(
            append_end(events, root, WORDS[steps.outcome], number),
            value_changes(facts_before, facts),
            value_changes(keys_before, keys),
            error="" if steps.error is None else f"{type(steps.error).__name__}: {steps.error}",
        )

    def outcomes(self) -> list[Event]:
        """Return the leaf outcomes of the last tick as events, without the changes of facts."""
        events = self._alphabet.events
        numbers = (number for number in self._trail.numbers if number < len(events))
        return [event for event in map(events.__getitem__, numbers) if event.outcome]

    def unusual_outcomes(self) -> tuple[bool, ...]:
        """Return, for each outcome of the last tick, whether this outcome is unusual."""
        entries, unusual = self.ticker.entries, []
        after = entries.now
        for event, past in self._recorded_events():
            leaf, outcome = self._alphabet.outcomes[event]
            if outcome is not None:
                entries.restore(vec[i32](past))
                unusual.append(nominal(leaf.options()) is not outcome)
        entries.restore(after)
        return tuple(unusual)

    def judgement(self, state: bytes, *, idle: bool | None = None) -> Judgement:
        """Return the judgement of a state, as `PropertyAutomata.judge` defines it."""
        outcome, watched = self.steps.restore(state)
        return self._rules.judge(outcome, watched, idle)

    def violated_properties(self) -> tuple[tuple[int, Event], ...]:
        """Return the rule number of each event property that the last tick violated, and the event."""
        if not self.steps.broken:
            return ()
        watched, found = self._watched, []
        monitors, numbers = self._rules.monitors, self._trail.numbers
        for place, number in enumerate(numbers):
            watched, wrong = monitors.next_state(watched, number)
            event = self._alphabet.events[self._own_number(place)]
            found += [(rule, event) for rule in range(monitors.count) if wrong >> rule & 1]
        return tuple(found)

    def _own_number(self, place: int) -> int:
        """Return the number of an event of the last tick.

        For an additional event, return that of its leaf event.
        """
        count, numbers = len(self._alphabet.events), self._trail.numbers
        if numbers[place] < count:
            return numbers[place]
        beside = (each for some in self._rules.guarded.values() for each in some)
        comes_first = next(each.comes_first for each in beside if each.number == numbers[place])
        others = numbers[place:] if comes_first else numbers[place::-1]
        return next(number for number in others if number < count)

    def restore_before_outcome(self, place: int) -> None:
        """Restore the entries as they were before the outcome with index *place* in the last tick."""
        outcomes = [
            past for event, past in self._recorded_events() if self._alphabet.outcomes[event][1] is not None
        ]
        self.ticker.entries.restore(vec[i32](outcomes[place]))

    def _recorded_events(self) -> list[tuple[int, list[int]]]:
        """Return the leaf events of the last tick, and for each event the contents of the entries before it."""
        # Numbers after the alphabet belong to second events, which accompany leaf events.
        count, trail = len(self._alphabet.events), self._trail
        return [each for each in zip(trail.numbers, trail.pasts, strict=True) if each[0] < count]

    def _facts_in(self, entries: list[int]) -> Mapping[str, object]:
        self.ticker.entries.restore(vec[i32](entries))
        return self.states.fact_values()


def plain_stepper(prepared: PreparedTree, rules: PropertyAutomata) -> TreeStepper | None:
    """Return a stepper that does not merge values, or None if the previous searches have not merged any."""
    has_merged = any(each.is_used for each in prepared.merged)
    return TreeStepper(prepared, rules, merges=False) if has_merged else None
