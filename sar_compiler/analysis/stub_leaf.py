"""A leaf whose outcomes a policy chooses, instead of a real leaf.

Its only state is py_trees' status. Answers change facts: entries of a board beside the tree's, so scripts and snapshots work
on them as on any entry.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.answers import Answer, Outcome, nominal
from sar_compiler.runtime.blackboard import Entry, Scope
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.events import ANSWERED, HALTED, STARTED, Event, FactChanges, changes_in
from sar_compiler.runtime.expressions import Script, name_uses
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.script_code import compile_fast_script
from sar_compiler.runtime.scripting import ScopeVariables
from sar_compiler.runtime.skipping import SkippableLeaf
from sar_compiler.runtime.variables import UNKNOWN, Enums, ScriptValue, UnknownValue

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.entry_cells import Memo

T = TypeVar("T")

STATUSES: Mapping[str, Status] = {outcome.name: outcome.status for outcome in Outcome}
"""The return value of `update` for the status of an outcome."""


class StubLeafError(SarError):
    """A leaf cannot return an outcome: none is possible, or a script fails.

    Attributes:
        leaf: The leaf's name.
    """

    def __init__(self, leaf: str, message: str) -> None:
        super().__init__(message)
        self.leaf = leaf


class OutcomePolicy(Protocol):
    """Chooses the outcomes of leaves."""

    def choose(self, leaf: "StubLeaf", options: Sequence[Answer]) -> Answer:
        """Return one of the possible outcomes for this tick."""
        ...


class NominalPolicy:
    """Chooses the default outcomes."""

    def choose(self, leaf: "StubLeaf", options: Sequence[Answer]) -> Answer:  # noqa: ARG002 - as the protocol has it
        """Return the first possible outcome that is not RUNNING."""
        return nominal(options)


class FactVariables:
    """Facts as a script's variables; other names are keys of the tree, and `unknown` is an unknown value.

    Args:
        facts: The facts.
        keys: The keys of the leaf's tree.
        enums: The names that stand for numbers.
        leaf: The name of the leaf.
        named: Entries with their own names, whose keys scripts cannot write.

    Attributes:
        enums: The names that stand for numbers.
    """

    def __init__(
        self,
        facts: Scope,
        keys: Scope,
        enums: Enums,
        leaf: str = "",
        named: Mapping[str, Entry] | None = None,
    ) -> None:
        self._scope = facts
        self.enums = enums
        self._facts = ScopeVariables(facts, enums)
        self._keys = ScopeVariables(keys, enums, named)
        self._leaf = leaf
        self._known: dict[str, ScopeVariables] = {}

    def read(self, name: str) -> ScriptValue:
        """Return the value; see `Variables`."""
        if name == UNKNOWN and not self.is_fact(name):
            # A script passes it to `create` or `assign` unchanged.
            return cast("ScriptValue", UnknownValue(self._leaf))
        return self._leaf_variables(name).read(name)

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write the value; create a key of the tree if the name is unknown."""
        return self._write_unknown(name, value) or self._leaf_variables(name).create(name, value)

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write the value of an existing name."""
        return self._write_unknown(name, value) or self._leaf_variables(name).assign(name, value)

    def entry(self, name: str) -> Entry:
        """Return the entry of a name."""
        return self._leaf_variables(name).entry(name)

    def values_of(self, names: Iterable[str]) -> dict[str, object]:
        """Return the values of the facts among some names, by their board names."""
        entries = [self.entry(name) for name in names if self.is_fact(name)]
        return {entry.name.rpartition("/")[2]: entry.read() for entry in entries}

    def memo(self, scripts: Iterable[Script]) -> "Memo | None":
        """Return a cache for the effect of some scripts; None unless the boards are numbered."""
        return self.memo_of([self.entry(use.name) for each in scripts for use in name_uses(each)])

    def memo_of(self, entries: Sequence[Entry]) -> "Memo | None":
        """Return a cache for the effect of code on some entries; None unless the boards are numbered."""
        return self._scope.board.memo(entries)

    def is_fact(self, name: str) -> bool:
        """Return whether a name is a fact's."""
        return self._leaf_variables(name) is self._facts

    @property
    def is_numbered(self) -> bool:
        """Whether the entries of facts are stored as numbers."""
        return self._scope.board.is_numbered

    def fast_runner(
        self, program: Program, condition: Callable[[ScriptValue], bool] | None = None
    ) -> Callable[[], Any] | None:
        """Return a fast runner for a short program on facts; None for other programs.

        Args:
            program: The program.
            condition: For a condition, converts its value to the answer.
        """
        if not all(self.is_fact(use.name) for use in name_uses(program.script)):
            return None
        usual = [partial(statement, self) for statement in program.statements]
        return compile_fast_script(program.script, self.entry, self.enums.numbers, usual, condition)

    def _write_unknown(self, name: str, value: object) -> ScriptValue | None:
        """Write an unknown value; return None for any other value."""
        if not isinstance(value, UnknownValue):
            return None
        entry = self.entry(name)
        unknown = UnknownValue(value.leaf, entry.key)
        entry.declare()
        entry.write(unknown)
        return cast("ScriptValue", unknown)

    def _leaf_variables(self, name: str) -> ScopeVariables:
        known = self._known.get(name)
        if known is None:
            # The names of facts are settled before the first tick.
            is_fact = self._scope.resolve(name).exists
            known = self._known[name] = self._facts if is_fact else self._keys
        return known


class StubLeaf(SkippableLeaf):
    """Returns the outcome that an outcome policy chooses.

    Args:
        name: The node's name.
        tag: The tag of the leaf that it stands for.
        answers: The possible answers of that leaf; no placeholders are left in the scripts.
        variables: The variables of scripts: facts, and keys of the tree.
        enums: The names that stand for numbers.

    Attributes:
        tag: The tag of the leaf that it stands for.
        answers: What it can answer.
        path: The names of its ancestors, from the root down, and its own.
        number: Its number in the tree, from 0 in pre-order.
        variables: What its scripts read and write.
        policy: Chooses its answers.
        events: Its events are recorded here; shared by the leaves of a tree.
    """

    def __init__(
        self, name: str, tag: str, answers: Sequence[Answer], variables: FactVariables, enums: Enums
    ) -> None:
        super().__init__(name)
        self.tag = tag
        self.answers = tuple(answers)
        self.path: tuple[str, ...] = (name,)
        self.number = 0
        self.policy: OutcomePolicy = NominalPolicy()
        self.answer_label = ""
        self.events: list[Event] = []
        self.variables = variables
        self._conditions = {a: Program(parse(a.when), enums.numbers) for a in self.answers if a.when}
        self._effects = {a: Program(parse(a.then), enums.numbers) for a in self.answers if a.then}
        self._memos: dict[Answer | None, Memo | None] = {}
        self._quick: dict[tuple[FactVariables, Program], Callable[[], Any] | None] = {}

    @property
    def is_random(self) -> bool:
        """Whether any of its outcomes has a known probability or duration."""
        return any(answer.p is not None or answer.sec != (0.0, 0.0) for answer in self.answers)

    def options(self) -> tuple[Answer, ...]:
        """Return the outcomes that are possible now.

        Raises:
            StubLeafError: If there is none, or a condition cannot be evaluated.
        """
        if not self._conditions:
            return self.answers
        possible = tuple(answer for answer in self.answers if self.is_possible(answer))
        if not possible:
            conditions = "; ".join(f"'{answer.name}' when {answer.when}" for answer in self.answers)
            message = f"'{self.name}' ({self.tag}) has no possible outcome now: {conditions}"
            raise StubLeafError(self.name, message)
        return possible

    def change(self, answer: Answer) -> None:
        """Apply the effects of an outcome.

        Raises:
            StubLeafError: If its script fails.
        """
        effect = self._effects.get(answer)
        if effect is not None:
            try:
                quick = self._quick_form(effect)
                effect.run(self.variables) if quick is None else quick()
            except EvaluationError as error:
                raise self._unusable(answer, "then", answer.then, error) from error

    def entries(self, scripts: Iterable[str]) -> list[Entry]:
        """Return the entries that scripts of its outcomes can read or write."""
        names = (use.name for script in scripts for use in name_uses(parse(script)))
        return [
            self.variables.entry(name) for name in names if name != UNKNOWN or self.variables.is_fact(name)
        ]

    def initialise(self) -> None:
        """Record the start."""
        self.events.append(self.event(STARTED))

    def update(self) -> Status:
        """Return the outcome that the policy chooses, and apply its effects.

        Raises:
            StubLeafError: If no answer is possible, or a script fails.
        """
        answer = self.policy.choose(self, self._recall(None, self._conditions.values(), self.options))
        scripts = [self._effects[answer]] if answer in self._effects else []
        self.events.append(self._recall(answer, scripts, partial(self._apply_outcome, answer)))
        self.feedback_message, self.answer_label = answer.name, answer.label
        return STATUSES[answer.status]

    def terminate(self, new_status: Status) -> None:
        """Record an interruption."""
        if new_status is Status.INVALID and self.status is Status.RUNNING:
            self.events.append(self.event(HALTED))

    def event(self, what: str, answer: Answer | None = None, facts: FactChanges = ()) -> Event:
        """Return an event of this leaf."""
        status, label = ("", "") if answer is None else (answer.status, answer.label)
        return Event(self.path, self.number, what, status, label, facts)

    def _recall(self, what: Answer | None, programs: Iterable[Program], run: Callable[[], T]) -> T:
        """Run code that uses some entries; on numbered boards, reuse the result for equal values."""
        if what not in self._memos:
            self._memos[what] = self.variables.memo(each.script for each in programs)
        memo = self._memos[what]
        answer: T = run() if memo is None else memo.call(run)
        return answer

    def _apply_outcome(self, answer: Answer) -> Event:
        """Apply the effects of an outcome, and return its event; an error is also an event."""
        before = self._facts_of(answer)
        try:
            self.change(answer)
        except StubLeafError:
            self.events.append(self._outcome_event(answer, before))
            raise
        return self._outcome_event(answer, before)

    def _outcome_event(self, answer: Answer, before: Mapping[str, object]) -> Event:
        return self.event(ANSWERED, answer, changes_in(before, self._facts_of(answer)))

    def _facts_of(self, answer: Answer) -> dict[str, object]:
        """Return the current facts that an outcome's script uses."""
        effect = self._effects.get(answer)
        return (
            {} if effect is None else self.variables.values_of(use.name for use in name_uses(effect.script))
        )

    def is_possible(self, answer: Answer) -> bool:
        """Return whether an outcome is possible now.

        Raises:
            StubLeafError: If its condition cannot be evaluated.
        """
        condition = self._conditions.get(answer)
        if condition is None:
            return True
        try:
            quick = self._quick_form(condition, condition.as_condition)
            return condition.holds(self.variables) if quick is None else bool(quick())
        except EvaluationError as error:
            raise self._unusable(answer, "when", answer.when, error) from error

    def _quick_form(
        self, program: Program, condition: Callable[[ScriptValue], bool] | None = None
    ) -> Callable[[], Any] | None:
        """Return the fast form of one of its scripts; None if there is none."""
        if self.variables.is_numbered:
            return None
        wanted = self.variables, program
        if wanted not in self._quick:
            self._quick[wanted] = self.variables.fast_runner(program, condition)
        return self._quick[wanted]

    def _unusable(self, answer: Answer, part: str, script: str, error: EvaluationError) -> StubLeafError:
        hint = f"; {error.hint}" if error.hint else ""
        message = f"'{self.name}' ({self.tag}), answer '{answer.name}': {part} '{script}': {error}{hint}"
        return StubLeafError(self.name, message)
