"""Stub leaves, which replace real leaves and return the outcomes that a policy chooses.

A stub leaf's only state is its py_trees status. Outcomes change facts, which are entries of a separate board, so that
scripts and snapshots handle them like other entries.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.blackboard import Entry, Scope
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.events import HALTED, RETURNED, STARTED, Event, FactChanges, changes_in
from sar_compiler.runtime.expressions import Script, name_uses
from sar_compiler.runtime.outcomes import Outcome, ReturnedStatus, nominal
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.script_code import compile_fast_script
from sar_compiler.runtime.scripting import ScopeVariables
from sar_compiler.runtime.skipping import SkippableLeaf
from sar_compiler.runtime.variables import UNKNOWN, Enums, ScriptValue, UnknownValue

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.entry_cells import Memo

T = TypeVar("T")

STATUSES: Mapping[str, Status] = {outcome.name: outcome.status for outcome in ReturnedStatus}
"""The statuses that `update` returns, by name."""


class StubLeafError(SarError):
    """Raised if a leaf cannot return an outcome, because no outcome is possible or a script fails.

    Attributes:
        leaf: The leaf's name.
    """

    def __init__(self, leaf: str, message: str) -> None:
        super().__init__(message)
        self.leaf = leaf


class OutcomePolicy(Protocol):
    """Decides which outcome a leaf returns."""

    def choose(self, leaf: "StubLeaf", options: Sequence[Outcome]) -> Outcome:
        """Choose one of the outcomes *options* for the current tick."""
        ...


class NominalPolicy:
    """Chooses default outcomes."""

    def choose(self, leaf: "StubLeaf", options: Sequence[Outcome]) -> Outcome:  # noqa: ARG002 - required by the protocol
        """Return the first possible outcome that is not RUNNING."""
        return nominal(options)


class FactVariables:
    """The variables of a leaf's scripts: facts, keys of the leaf's tree, and `unknown` for an unknown value.

    Args:
        facts: The scope of the facts.
        keys: The scope of the leaf's tree.
        enums: The named constants.
        leaf: The name of the leaf.
        named: Further entries, by names that are not keys.

    Attributes:
        enums: The named constants.
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
        """Return the value of a variable, or an unknown value for the name `unknown`."""
        if name == UNKNOWN and not self.is_fact(name):
            # A script passes the value unchanged to `create` or `assign`.
            return cast("ScriptValue", UnknownValue(self._leaf))
        return self._leaf_variables(name).read(name)

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write a variable. If no variable has this name, create a key of the tree."""
        return self._write_unknown(name, value) or self._leaf_variables(name).create(name, value)

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write an existing variable."""
        return self._write_unknown(name, value) or self._leaf_variables(name).assign(name, value)

    def entry(self, name: str) -> Entry:
        """Return the entry of a variable."""
        return self._leaf_variables(name).entry(name)

    def values_of(self, names: Iterable[str]) -> dict[str, object]:
        """Return the values of the facts among *names*.

        The result's keys are the last parts of the facts' entry names.
        """
        entries = [self.entry(name) for name in names if self.is_fact(name)]
        return {entry.name.rpartition("/")[2]: entry.read() for entry in entries}

    def memo(self, scripts: Iterable[Script]) -> "Memo | None":
        """Return a cache for the results of scripts, or None if the blackboard stores no numbers."""
        return self.memo_of([self.entry(use.name) for each in scripts for use in name_uses(each)])

    def memo_of(self, entries: Sequence[Entry]) -> "Memo | None":
        """Return a cache for the results of code that uses the entries, or None if the board stores no numbers."""
        return self._scope.board.memo(entries)

    def is_fact(self, name: str) -> bool:
        """Return whether a name is the name of a fact."""
        return self._leaf_variables(name) is self._facts

    @property
    def is_numbered(self) -> bool:
        """Whether the entries of facts are stored as numbers."""
        return self._scope.board.is_numbered

    def fast_runner(
        self, program: Program, condition: Callable[[ScriptValue], bool] | None = None
    ) -> Callable[[], Any] | None:
        """Return a fast runner for a short program that uses only facts, or None for any other program.

        Args:
            program: The program.
            condition: Converts the value of a condition to its result; None if the program is not a condition.
        """
        if not all(self.is_fact(use.name) for use in name_uses(program.script)):
            return None
        usual = [partial(statement, self) for statement in program.statements]
        return compile_fast_script(program.script, self.entry, self.enums.numbers, usual, condition)

    def _write_unknown(self, name: str, value: object) -> ScriptValue | None:
        """Write a value if it is an unknown value, and return it. Otherwise write nothing, and return None."""
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
            # No facts are added after the first tick.
            is_fact = self._scope.resolve(name).exists
            known = self._known[name] = self._facts if is_fact else self._keys
        return known


class StubLeaf(SkippableLeaf):
    """A leaf that returns the outcomes that an outcome policy chooses.

    Args:
        name: The node's name.
        tag: The tag of the replaced leaf.
        outcomes: The possible outcomes of the replaced leaf, without placeholders in their scripts.
        variables: The variables of scripts: facts, and keys of the tree.
        enums: The named constants.

    Attributes:
        tag: The tag of the replaced leaf.
        outcomes: The possible outcomes.
        path: The names of all nodes from the root down to the leaf.
        number: The leaf's number in the tree, from 0 in pre-order.
        variables: The variables that the outcomes' scripts read and write.
        policy: Chooses the outcomes.
        events: The list to which events are appended; shared by all leaves of a tree.
    """

    def __init__(
        self, name: str, tag: str, outcomes: Sequence[Outcome], variables: FactVariables, enums: Enums
    ) -> None:
        super().__init__(name)
        self.tag = tag
        self.outcomes = tuple(outcomes)
        self.path: tuple[str, ...] = (name,)
        self.number = 0
        self.policy: OutcomePolicy = NominalPolicy()
        self.outcome_label = ""
        self.events: list[Event] = []
        self.variables = variables
        self._conditions = {a: Program(parse(a.when), enums.numbers) for a in self.outcomes if a.when}
        self._effects = {a: Program(parse(a.then), enums.numbers) for a in self.outcomes if a.then}
        self._memos: dict[Outcome | None, Memo | None] = {}
        self._fast_runners: dict[tuple[FactVariables, Program], Callable[[], Any] | None] = {}

    @property
    def is_random(self) -> bool:
        """Whether any outcome has a known probability or duration."""
        return any(outcome.p is not None or outcome.sec != (0.0, 0.0) for outcome in self.outcomes)

    def options(self) -> tuple[Outcome, ...]:
        """Return the outcomes that are possible now.

        Raises:
            StubLeafError: If no outcome is possible, or a condition cannot be evaluated.
        """
        if not self._conditions:
            return self.outcomes
        possible = tuple(outcome for outcome in self.outcomes if self.is_possible(outcome))
        if not possible:
            conditions = ", ".join(f"'{outcome.name}' when {outcome.when}" for outcome in self.outcomes)
            message = f"'{self.name}' ({self.tag}) has no possible outcome now ({conditions})"
            raise StubLeafError(self.name, message)
        return possible

    def change(self, outcome: Outcome) -> None:
        """Apply the effects of an outcome.

        Raises:
            StubLeafError: If the outcome's script fails.
        """
        effect = self._effects.get(outcome)
        if effect is not None:
            try:
                fast = self._fast_runner(effect)
                effect.run(self.variables) if fast is None else fast()
            except EvaluationError as error:
                raise self._script_error(outcome, "then", outcome.then, error) from error

    def entries(self, scripts: Iterable[str]) -> list[Entry]:
        """Return the blackboard entries that the given scripts of this leaf can read or write."""
        names = (use.name for script in scripts for use in name_uses(parse(script)))
        return [
            self.variables.entry(name) for name in names if name != UNKNOWN or self.variables.is_fact(name)
        ]

    def initialise(self) -> None:
        """Record the start of the leaf."""
        self.events.append(self.event(STARTED))

    def update(self) -> Status:
        """Apply the outcome that the policy chooses, and return the status of this outcome.

        Raises:
            StubLeafError: If no outcome is possible, or a script fails.
        """
        outcome = self.policy.choose(self, self._recall(None, self._conditions.values(), self.options))
        scripts = [self._effects[outcome]] if outcome in self._effects else []
        self.events.append(self._recall(outcome, scripts, partial(self._apply_outcome, outcome)))
        self.feedback_message, self.outcome_label = outcome.name, outcome.label
        return STATUSES[outcome.status]

    def terminate(self, new_status: Status) -> None:
        """Record the halt of the leaf if the leaf is running."""
        if new_status is Status.INVALID and self.status is Status.RUNNING:
            self.events.append(self.event(HALTED))

    def event(self, what: str, outcome: Outcome | None = None, facts: FactChanges = ()) -> Event:
        """Create an event of this leaf."""
        status, label = ("", "") if outcome is None else (outcome.status, outcome.label)
        return Event(self.path, self.number, what, status, label, facts)

    def _recall(self, what: Outcome | None, programs: Iterable[Program], run: Callable[[], T]) -> T:
        """Call *run*. If it was called before with the same variable values, return the cached result instead."""
        if what not in self._memos:
            self._memos[what] = self.variables.memo(each.script for each in programs)
        memo = self._memos[what]
        result: T = run() if memo is None else memo.call(run)
        return result

    def _apply_outcome(self, outcome: Outcome) -> Event:
        """Apply the effects of an outcome, and return the event.

        If an effect fails, record the event immediately.
        """
        before = self._facts_of(outcome)
        try:
            self.change(outcome)
        except StubLeafError:
            self.events.append(self._outcome_event(outcome, before))
            raise
        return self._outcome_event(outcome, before)

    def _outcome_event(self, outcome: Outcome, before: Mapping[str, object]) -> Event:
        return self.event(RETURNED, outcome, changes_in(before, self._facts_of(outcome)))

    def _facts_of(self, outcome: Outcome) -> dict[str, object]:
        """Return the current facts that an outcome's script uses."""
        effect = self._effects.get(outcome)
        return (
            {} if effect is None else self.variables.values_of(use.name for use in name_uses(effect.script))
        )

    def is_possible(self, outcome: Outcome) -> bool:
        """Return whether an outcome is possible now.

        Raises:
            StubLeafError: If the outcome's condition cannot be evaluated.
        """
        condition = self._conditions.get(outcome)
        if condition is None:
            return True
        try:
            fast = self._fast_runner(condition, condition.as_condition)
            return condition.holds(self.variables) if fast is None else bool(fast())
        except EvaluationError as error:
            raise self._script_error(outcome, "when", outcome.when, error) from error

    def _fast_runner(
        self, program: Program, condition: Callable[[ScriptValue], bool] | None = None
    ) -> Callable[[], Any] | None:
        """Return the fast runner of one of the leaf's scripts, or None if the script has no fast runner."""
        if self.variables.is_numbered:
            return None
        wanted = self.variables, program
        if wanted not in self._fast_runners:
            self._fast_runners[wanted] = self.variables.fast_runner(program, condition)
        return self._fast_runners[wanted]

    def _script_error(
        self, outcome: Outcome, part: str, script: str, error: EvaluationError
    ) -> StubLeafError:
        hint = f"; {error.hint}" if error.hint else ""
        message = f"'{self.name}' ({self.tag}), outcome '{outcome.name}': {part} '{script}': {error}{hint}"
        return StubLeafError(self.name, message)
