"""Leaves that run scripts and change blackboard entries, and the pre- and postconditions of nodes.

py_trees has leaves that check or set a single blackboard variable, but no expressions.
"""

from collections.abc import Callable, Mapping
from types import SimpleNamespace

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.blackboard import ROOT_SIGN, Entry, Scope
from sar_compiler.runtime.entry_types import read_as, value_to_keep
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.kernel.cells import FAILURE, INVALID, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.turning import ConditionsNode
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.scripting import NodeScript
from sar_compiler.runtime.ticking import Decorator
from sar_compiler.runtime.variables import Enums, RefusedValueError, describe_value

# Stored in variables, because access to a member of an enumeration is slow.
_SUCCESS, _FAILURE = Status.SUCCESS, Status.FAILURE
_NUMBERS = (int, float)


class EntryTypeError(SarError):
    """Raised if a value cannot be written to a blackboard entry, or a key is not a string."""


class _ScriptLeaf(Behaviour):
    """Runs a script.

    Args:
        name: The node's name.
        code: The script.
        scope: The scope of the script's variables.
        enums: The named constants.

    Attributes:
        script: The runnable script.
    """

    is_condition = False

    def __init__(self, name: str, code: Input[Script], scope: Scope, enums: Enums) -> None:
        super().__init__(name)
        self.script = NodeScript(code, name, "code", scope, enums)
        self._quick: Callable[[], Status] | None = None

    def update(self) -> Status:
        """Run the script. If the script has a compiled form, this form replaces the method at the first call."""
        if self._quick is None:
            self._quick = self.script.fast_update(_SUCCESS, _FAILURE if self.is_condition else None)
        quick = self._quick
        if quick is not None:
            # The method stays if a subclass or another wrapper has replaced it.
            if type(self).update is _ScriptLeaf.update and "update" not in vars(self):
                setattr(self, "update", quick)  # noqa: B010 - for the type checker
            return quick()
        if self.is_condition:
            return _SUCCESS if self.script.holds() else _FAILURE
        self.script.run()
        return _SUCCESS


class RunScript(_ScriptLeaf):
    """Runs a script, and succeeds."""


class ScriptCondition(_ScriptLeaf):
    """Runs a script. The node succeeds if the script's value is true (1), and fails if the value is false (0)."""

    is_condition = True


class SetBlackboard(Behaviour):
    """Writes a string or the value of another entry to an entry. The node fails if the other entry has no value.

    An entry keeps the type that a port, a literal or the mission has declared. An entry without a type gets the type of
    the new value. py_trees' SetBlackboardVariable supports neither scopes nor ports.

    Args:
        name: The node's name.
        value: The string or the other entry.
        output_key: The key of the entry to write, without braces. A key in braces names another entry, which contains the key of the entry
            to write.
        scope: The scope in which the key is looked up.
        enums: The named constants.
    """

    def __init__(
        self, name: str, value: Input[object], output_key: Input[object], scope: Scope, enums: Enums
    ) -> None:
        super().__init__(name)
        self._value = value
        self._output_key = output_key
        self._scope = scope
        self._enums = enums
        self._known: Entry | None = None

    def update(self) -> Status:
        """Write the entry."""
        entry, source = self._known, self._value.entry
        if entry is None or entry.board.is_numbered:
            return self._write_any()
        board, name = entry.board, entry.name
        try:
            value = self._value.get() if source is None else board.storage[source.name]
            kind, count = board.kinds[name], board.stamps[name] + 1
            if kind is not None and not _is_kept(value, kind, board.storage[name]):
                return self._write_any()
        except KeyError:  # one of the entries does not exist or is not declared yet
            return self._write_any()
        board.storage[name], board.stamps[name] = value, count
        if self.feedback_message:
            self.feedback_message = ""
        return _SUCCESS

    def _write_any(self) -> Status:
        entry, source = self._target(), self._value.entry
        if source is not None and source.is_declared and not source.exists:
            entry.declare(source.kind)
            self.feedback_message = f"the key '{source.key}' has no value yet"
            return _FAILURE
        self.feedback_message = ""
        is_copied = source is not None and source.is_unknown
        value = source.board.get(source.name) if source is not None and is_copied else self._value.get()
        entry.declare(str if source is None else source.kind)
        try:
            kind = None if is_copied else entry.kind
            entry.write(value if kind is None else self._convert(entry, kind, value))
        except RefusedValueError as error:
            raise EntryTypeError(f"'{self.name}': {entry.key}: {error}") from error
        return _SUCCESS

    def _target(self) -> Entry:
        if self._known is not None:
            return self._known
        key = self._output_key.get()
        if not isinstance(key, str):
            raise EntryTypeError(f"'{self.name}': output_key: {describe_value(key)} is not a key")
        entry = self._scope.resolve(key)
        if self._output_key.entry is None:
            self._known = entry
        return entry

    def _convert(self, entry: Entry, kind: type, value: object) -> object:
        if isinstance(value, str):
            return read_as(value, kind)
        current = entry.board.get(entry.name) if entry.exists else None
        return value_to_keep(current, value, self._enums.numbers)


def _is_kept(value: object, kind: type, current: object) -> bool:
    """Return whether a new value certainly needs no conversion, given an entry's type and current value."""
    given = type(value)
    return given is kind is str or (given in _NUMBERS and given is type(current))


class UnsetBlackboard(Behaviour):
    """Removes an entry of the tree that contains the node. Entries of outer trees are not removed.

    py_trees' UnsetBlackboardVariable does not support scopes.

    Args:
        name: The node's name.
        key: The entry's key, without braces.
        scope: The scope in which the key is looked up.
    """

    def __init__(self, name: str, key: Input[str], scope: Scope) -> None:
        super().__init__(name)
        self._key = key
        self._scope = scope
        self._known: Entry | None = None

    def update(self) -> Status:
        """Remove the entry, if it exists."""
        key = self._key.get()
        if key.startswith(ROOT_SIGN):
            self.feedback_message = f"'{key}' is not removed, because a tree can only remove its own keys, which are written without {ROOT_SIGN}"
            return _SUCCESS
        if self._known is None or self._known.key != key:
            # The scope of the same instance, but without remapping.
            self._known = Scope(self._scope.board, self._scope.path).resolve(key)
        self._known.remove()
        return _SUCCESS


class Conditions(Decorator):
    """A decorator for the pre- and postconditions of a node. The decorator and the node share one status.

    The decorators of py_trees cannot skip a node, and cannot run a script when a node ends.

    Args:
        child: The node.
        scripts: The conditions, by attribute.
        scope: The scope of the scripts' variables.
        enums: The named constants.
    """

    node_class = ConditionsNode
    is_its_child = True

    def __init__(
        self, name: str, child: Behaviour, scripts: Mapping[str, Script], scope: Scope, enums: Enums
    ) -> None:
        # Set first, because the base constructor sets the status, and the child stores it.
        self.decorated = child
        super().__init__(name, child)
        ready = {
            attribute: NodeScript(Input(script), child.name, attribute, scope, enums)
            for attribute, script in scripts.items()
        }
        before = (("_failureIf", FAILURE), ("_successIf", SUCCESS), ("_skipIf", SKIPPED))
        self._before: list[tuple[NodeScript | SimpleNamespace, str, int]] = [
            (ready[each], each, outcome) for each, outcome in before if each in ready
        ]
        self._while = ready.get("_while")
        after = ((SUCCESS, "_onSuccess"), (FAILURE, "_onFailure"), (INVALID, "_onHalted"))
        self._after = {outcome: ready.get(each) for outcome, each in after}
        self._post: dict[int, NodeScript | None] = dict.fromkeys(
            (SUCCESS, FAILURE, INVALID), ready.get("_post")
        )
        self.runs_after = any(self._post.values()) or any(self._after.values())

    @property
    def has_while(self) -> bool:
        """Whether the node has the precondition `_while`."""
        return self._while is not None

    def run_after(self, outcome: int) -> None:
        """Run the postconditions for an outcome. INVALID means that the node was halted while running."""
        for script in (self._after[outcome], self._post[outcome]):
            if script is not None:
                script.run()

    def omit_post_after_halts(self) -> None:
        """Never run `_post` after a halt. BehaviorTree.CPP does not run `_post` either, despite its documentation."""
        self._post[INVALID] = None

    def ignore(self) -> None:
        """Ignore all conditions except `_onHalted`, as BehaviorTree.CPP does for a ThreadedAction."""
        self._before, self._while = [], None
        self._after = {**dict.fromkeys((SUCCESS, FAILURE)), INVALID: self._after[INVALID]}
        self._post = dict.fromkeys(self._post)

    def evaluate_while_at_start(self) -> None:
        """Evaluate `_while` only before the node starts, as BehaviorTree.CPP does for a CoroActionNode."""
        condition = self._while
        if condition is not None:
            negated = SimpleNamespace(holds=lambda: not condition.holds())
            self._before.append((negated, "_while", SKIPPED))
            self._while = None

    @property
    def status(self) -> Status:
        """The node's status."""
        return self.decorated.status

    @status.setter
    def status(self, status: Status) -> None:
        self.decorated.status = status
