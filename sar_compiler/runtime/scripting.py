"""Scripts of nodes: where their variables are, and what is said if one cannot be run."""

import functools
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from py_trees.common import Status

from sar_compiler.errors import NodeError
from sar_compiler.runtime.blackboard import Entry, MissingEntryError, Scope
from sar_compiler.runtime.entry_types import value_of, value_to_assign
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.expressions import Access, Script, name_uses
from sar_compiler.runtime.ports import Input, PortError
from sar_compiler.runtime.script_code import quick_script
from sar_compiler.runtime.variables import Enums, ScriptValue, UnknownVariableError, VariableError

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.entry_cells import Memo

T = TypeVar("T")
V = TypeVar("V")


class NodeScriptError(NodeError):
    """A node's script cannot be run.

    Attributes:
        attribute: The attribute that has the script.
        start: Where the part begins that is at fault, in characters of the script; None if all of it is.
        end: Where that part ends.
    """

    def __init__(self, message: str, node: str, attribute: str, start: int | None, end: int | None) -> None:
        super().__init__(message, node)
        self.attribute = attribute
        self.start = start
        self.end = end


class ScopeVariables:
    """The entries of a scope, as a script's variables.

    An entry keeps its type: what is assigned to it is converted where nothing is lost, else refused. One that a
    port has named, and that nobody has written, takes any value that its type can have.

    Args:
        scope: The scope of the node that has the script.
        enums: The names that stand for numbers.
        named: Entries with names of their own, whose keys no script can write.
    """

    def __init__(self, scope: Scope, enums: Enums, named: Mapping[str, Entry] | None = None) -> None:
        self._scope = scope
        self._numbers = enums.numbers
        self._entries = {**(named or {})}

    def read(self, name: str) -> ScriptValue:
        """Return an entry's value.

        Raises:
            UnknownVariableError: If nothing was written to it.
            VariableError: If it is nothing that a script can calculate with.
        """
        return _as_script_value(name, self._read_entry(name))

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write an entry, which is made if there is none; return what is stored.

        Raises:
            VariableError: If the entry holds something that the value cannot replace.
        """
        self.entry(name).declare()
        return self.assign(name, value)

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write an entry that exists, or that a port has named; return what is stored.

        Raises:
            UnknownVariableError: If there is none.
            VariableError: If it holds something that the value cannot replace.
        """
        entry = self.entry(name)
        is_open = entry.is_unknown or (entry.is_declared and not entry.exists)
        held = None if is_open else self._read_entry(name)
        stored = value_to_assign(held, entry.kind, value, self._numbers)
        entry.write(stored)
        return _as_script_value(name, stored)

    def entry(self, name: str) -> Entry:
        """Return the entry that a name means."""
        entry = self._entries.get(name)
        if entry is None:
            entry = self._entries[name] = self._scope.resolve(name)
        return entry

    def _read_entry(self, name: str) -> object:
        try:
            return self.entry(name).read()
        except MissingEntryError as error:
            raise UnknownVariableError(name) from error


class NodeScript:
    """A node's script, ready to be run in the node's scope.

    Args:
        code: The script; if it comes from the blackboard, it is read again whenever it is run.
        node: The node's name.
        attribute: The attribute that has the script.
        scope: Where its variables are.
        enums: The names that stand for numbers.

    Attributes:
        is_remembered: Whether somebody else remembers what it does.
        run: Runs it and returns its value. Raises a `NodeScriptError` with the node, the attribute and the place if it cannot be run.
        holds: Runs it and returns whether its value is true; raises likewise, and if its value is neither true nor false. From the first
            call on, the quick forms are in place of both where they are known (see `script_code`).
    """

    def __init__(self, code: Input[Script], node: str, attribute: str, scope: Scope, enums: Enums) -> None:
        self._code = code
        self._node = node
        self._attribute = attribute
        self._enums = enums
        self._scope = scope
        self._program: Program | None = None
        self.run: Callable[[], ScriptValue] = self._run
        self.holds: Callable[[], bool] = self._holds
        self.is_remembered = False
        self._memos: dict[Callable[..., Any], Memo | None] = {}

    @functools.cached_property
    def _variables(self) -> ScopeVariables:
        return ScopeVariables(self._scope, self._enums)

    @property
    def entry(self) -> Entry | None:
        """The only entry that it uses, and does not write; None if there are others, or it writes."""
        if self._code.entry is not None:
            return None
        uses = list(name_uses(self._code.get()))
        entries = {self._variables.entry(use.name) for use in uses}
        return entries.pop() if len(entries) == 1 and all(use.access is Access.READ for use in uses) else None

    def _run(self) -> ScriptValue:
        quick: Callable[[], ScriptValue] | None = self._quick()
        if quick is None:
            return self._recall(Program.run)
        self.run = quick
        return quick()

    def _holds(self) -> bool:
        quick: Callable[[], bool] | None = self._quick(self._answer)
        if quick is None:
            return self._recall(Program.holds)
        self.holds = quick
        return quick()

    def quick_update(self, success: Status, failure: Status | None) -> Callable[[], Status] | None:
        """Return what runs it and answers with a status; None where `run` and `holds` have no quick form.

        Args:
            success: The status if its value is true.
            failure: The status if it is false; None if the script is no condition, and any value a success.
        """
        return self._quick(None if failure is None else self._answer, (success, failure))

    def _quick(
        self,
        condition: Callable[[ScriptValue], bool] | None = None,
        answers: tuple[object, object] | None = None,
    ) -> Callable[[], Any] | None:
        """Return its quick form; None if it may be another one in the next tick, if entries are numbers, or if it is too long."""
        if self._code.entry is not None or self._scope.board.is_numbered:
            return None
        script = self._code.get()
        usual = [functools.partial(self._evaluate, at) for at in range(len(script.statements))]
        return quick_script(script, self._variables.entry, self._enums.numbers, usual, condition, answers)

    def _evaluate(self, at: int) -> ScriptValue:
        """Evaluate a statement in the usual way."""
        return self._explained(self._current_program().statements[at], self._variables)

    def _answer(self, value: ScriptValue) -> bool:
        return self._explained(self._current_program().as_condition, value)

    def _recall(self, run: Callable[[Program, ScopeVariables], T]) -> T:
        """Run it; on a numbered board it is not run twice where its variables have the same values."""
        if self._code.entry is not None or self.is_remembered:
            return self._run_or_explain(run)
        if run not in self._memos:
            entries = [self._variables.entry(use.name) for use in name_uses(self._code.get())]
            self._memos[run] = self._scope.board.memo(entries)
        memo = self._memos[run]
        answer: T = (
            self._run_or_explain(run) if memo is None else memo.call(lambda: self._run_or_explain(run))
        )
        return answer

    def _run_or_explain(self, run: Callable[[Program, ScopeVariables], T]) -> T:
        try:
            program = self._current_program()
        except PortError as error:
            message = f"'{self._node}': {error}"
            raise NodeScriptError(message, self._node, self._attribute, None, None) from error
        return self._explained(functools.partial(run, program), self._variables)

    def _explained(self, evaluate: Callable[[V], T], value: V) -> T:
        try:
            return evaluate(value)
        except EvaluationError as error:
            raise self._failure(error) from error

    def _current_program(self) -> Program:
        script = self._code.get()
        if self._program is None or self._program.script is not script:
            self._program = Program(script, self._enums.numbers)
        return self._program

    def _failure(self, error: EvaluationError) -> NodeScriptError:
        assert self._program is not None  # noqa: S101 - it has failed
        hint, text = f"; {error.hint}" if error.hint else "", self._program.script.text
        message = f"'{self._node}': {self._attribute}, {_place(text, error.start)}: {error}{hint}"
        return NodeScriptError(message, self._node, self._attribute, error.start, error.end)


def _as_script_value(name: str, value: object) -> ScriptValue:
    seen = value_of(value)
    if seen is None:
        if value is None:
            raise UnknownVariableError(name)
        raise VariableError(
            f"'{name}' holds a value of type {type(value).__name__}, with which a script cannot calculate"
        )
    return seen


def _place(text: str, offset: int) -> str:
    line, column = text.count("\n", 0, offset) + 1, offset - (text.rfind("\n", 0, offset) + 1) + 1
    return f"column {column}" if "\n" not in text else f"line {line}, column {column}"
