"""The scripts of nodes. Blackboard entries are the variables of a script, and errors name the node."""

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
from sar_compiler.runtime.script_code import compile_fast_script
from sar_compiler.runtime.variables import Enums, ScriptValue, UnknownVariableError, VariableError

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.entry_cells import Memo

T = TypeVar("T")
V = TypeVar("V")


class NodeScriptError(NodeError):
    """Raised if the script of a node fails.

    Attributes:
        attribute: The attribute that contains the script.
        start: The offset in the script at which the faulty part starts; None if the location is not known.
        end: The offset directly after the faulty part; None if the location is not known.
    """

    def __init__(self, message: str, node: str, attribute: str, start: int | None, end: int | None) -> None:
        super().__init__(message, node)
        self.attribute = attribute
        self.start = start
        self.end = end


class ScopeVariables:
    """Gives a script access to the entries of a scope as variables.

    An entry keeps its type: an assigned value is converted to this type if no precision is lost, and rejected otherwise. An entry that a
    port has declared, but no node has written, accepts any value of its type.

    Args:
        scope: The scope of the script's node.
        enums: The named constants.
        named: Entries whose keys scripts cannot contain, by the names that replace the keys.
    """

    def __init__(self, scope: Scope, enums: Enums, named: Mapping[str, Entry] | None = None) -> None:
        self._scope = scope
        self._numbers = enums.numbers
        self._entries = {**(named or {})}

    def read(self, name: str) -> ScriptValue:
        """Return an entry's value.

        Raises:
            UnknownVariableError: If the entry has no value.
            VariableError: If scripts cannot calculate with the value.
        """
        return _as_script_value(name, self._read_entry(name))

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write an entry, create it if it does not exist, and return the stored value.

        Raises:
            VariableError: If the value cannot replace the entry's value.
        """
        self.entry(name).declare()
        return self.assign(name, value)

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write an entry that exists or is declared, and return the stored value.

        Raises:
            UnknownVariableError: If the entry neither exists nor is declared.
            VariableError: If the value cannot replace the entry's value.
        """
        entry = self.entry(name)
        is_open = entry.is_unknown or (entry.is_declared and not entry.exists)
        current = None if is_open else self._read_entry(name)
        stored = value_to_assign(current, entry.kind, value, self._numbers)
        entry.write(stored)
        return _as_script_value(name, stored)

    def entry(self, name: str) -> Entry:
        """Return the entry that a name in the script refers to."""
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
    """A script of a node. The script is run in the node's scope.

    Args:
        code: The script, or the blackboard entry that contains the script and is read before each run.
        node: The node's name.
        attribute: The attribute that contains the script.
        scope: The scope of the script's variables.
        enums: The named constants.

    Attributes:
        is_remembered: Whether the caller caches the effects of the script.
        run: Runs the script and returns its value, or raises a `NodeScriptError`. At the first call, the compiled form
            replaces this function if there is one (see `script_code`).
        holds: Runs the script and returns whether the script's value is true. Raises a `NodeScriptError` if the script fails, or if the
            value is neither true nor false. The compiled form replaces this function, too.
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
        """The only entry that the script uses, if the script only reads this entry; otherwise None."""
        if self._code.entry is not None:
            return None
        uses = list(name_uses(self._code.get()))
        entries = {self._variables.entry(use.name) for use in uses}
        return entries.pop() if len(entries) == 1 and all(use.access is Access.READ for use in uses) else None

    def _run(self) -> ScriptValue:
        quick: Callable[[], ScriptValue] | None = self._fast_runner()
        if quick is None:
            return self._recall(Program.run)
        self.run = quick
        return quick()

    def _holds(self) -> bool:
        quick: Callable[[], bool] | None = self._fast_runner(self._is_true)
        if quick is None:
            return self._recall(Program.holds)
        self.holds = quick
        return quick()

    def fast_update(self, success: Status, failure: Status | None) -> Callable[[], Status] | None:
        """Return a function that runs the compiled script and returns a status, or None without a compiled form.

        Args:
            success: The status if the script's value is true.
            failure: The status if the value is false; None if the script is not a condition. Such a script always succeeds.
        """
        return self._fast_runner(None if failure is None else self._is_true, (success, failure))

    def _fast_runner(
        self,
        condition: Callable[[ScriptValue], bool] | None = None,
        answers: tuple[object, object] | None = None,
    ) -> Callable[[], Any] | None:
        """Return the compiled form of the script, or None if the script cannot be compiled."""
        if self._code.entry is not None or self._scope.board.is_numbered:
            return None
        script = self._code.get()
        usual = [functools.partial(self._evaluate, at) for at in range(len(script.statements))]
        return compile_fast_script(
            script, self._variables.entry, self._enums.numbers, usual, condition, answers
        )

    def _evaluate(self, at: int) -> ScriptValue:
        """Evaluate the statement at an index without the compiled form of the script."""
        return self._explain(self._current_program().statements[at], self._variables)

    def _is_true(self, value: ScriptValue) -> bool:
        return self._explain(self._current_program().as_condition, value)

    def _recall(self, run: Callable[[Program, ScopeVariables], T]) -> T:
        """Return the result of the script. Reuse a cached result for the same values if the board has a cache."""
        if self._code.entry is not None or self.is_remembered:
            return self._run_or_explain(run)
        if run not in self._memos:
            entries = [self._variables.entry(use.name) for use in name_uses(self._code.get())]
            self._memos[run] = self._scope.board.memo(entries)
        memo = self._memos[run]
        result: T = (
            self._run_or_explain(run) if memo is None else memo.call(lambda: self._run_or_explain(run))
        )
        return result

    def _run_or_explain(self, run: Callable[[Program, ScopeVariables], T]) -> T:
        try:
            program = self._current_program()
        except PortError as error:
            message = f"'{self._node}': {error}"
            raise NodeScriptError(message, self._node, self._attribute, None, None) from error
        return self._explain(functools.partial(run, program), self._variables)

    def _explain(self, evaluate: Callable[[V], T], value: V) -> T:
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
        assert self._program is not None  # noqa: S101 - the program has just failed
        hint, text = f" ({error.hint})" if error.hint else "", self._program.script.text
        message = f"'{self._node}': {self._attribute}, {_position_text(text, error.start)}: {error}{hint}"
        return NodeScriptError(message, self._node, self._attribute, error.start, error.end)


def _as_script_value(name: str, value: object) -> ScriptValue:
    converted = value_of(value)
    if converted is None:
        if value is None:
            raise UnknownVariableError(name)
        raise VariableError(
            f"'{name}' has a value of type {type(value).__name__}, but scripts cannot calculate with this type"
        )
    return converted


def _position_text(text: str, offset: int) -> str:
    line, column = text.count("\n", 0, offset) + 1, offset - (text.rfind("\n", 0, offset) + 1) + 1
    return f"column {column}" if "\n" not in text else f"line {line}, column {column}"
