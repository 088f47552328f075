"""Nodes that work with one entry of the blackboard."""

from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.blackboard import ROOT_SIGN, Entry, Scope
from sar_compiler.runtime.entry_types import kept, read_as
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.kernel.cells import RUNNING, SKIPPED
from sar_compiler.runtime.kernel.leaf_nodes import UpdateCheckNode
from sar_compiler.runtime.kernel.turning import UpdateGuardNode
from sar_compiler.runtime.parents import Built, OwnDecorator
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.variables import RefusedValueError, said


class EntryTypeError(SarError):
    """An entry is given a value that it cannot take."""


class SetBlackboard(Behaviour):
    """Writes an entry: another entry's value, with its type, or a text; fails if the other entry is empty.

    An entry with a type keeps it: a port's, that of a literal, or the mission's. Any other takes the new one.
    py_trees' SetBlackboardVariable knows neither scopes nor ports.

    Args:
        name: The node's name.
        value: What to write.
        output_key: The entry's key, without braces; or a key with them, of an entry that has it.
        scope: Where the key is looked up.
        enums: The names that stand for numbers.
    """

    def __init__(
        self, name: str, value: Input[object], output_key: Input[object], scope: Scope, enums: Enums
    ) -> None:
        super().__init__(name)
        self._value = value
        self._output_key = output_key
        self._scope = scope
        self._enums = enums

    def update(self) -> Status:
        """Write the entry."""
        entry, source = self._target(), self._value.entry
        if source is not None and source.declared and not source.exists:
            entry.declare(source.kind)
            self.feedback_message = f"nothing has been written to '{source.key}' yet"
            return Status.FAILURE
        self.feedback_message = ""
        value = self._value.get()
        entry.declare(str if source is None else source.kind)
        try:
            entry.write(value if entry.kind is None else self._as_before(entry, entry.kind, value))
        except RefusedValueError as error:
            message = f"'{self.name}': {entry.key}: {error}"
            raise EntryTypeError(message) from error
        return Status.SUCCESS

    def _target(self) -> Entry:
        key = self._output_key.get()
        if not isinstance(key, str):
            message = f"'{self.name}': output_key: {said(key)} is no key"
            raise EntryTypeError(message)
        return self._scope.resolve(key)

    def _as_before(self, entry: Entry, kind: type, value: object) -> object:
        if isinstance(value, str):
            return read_as(value, kind)
        return kept(entry.read() if entry.exists else None, value, self._enums.numbers)


class UnsetBlackboard(Behaviour):
    """Removes an entry of its own tree instance; one that belongs to another instance stays.

    py_trees' UnsetBlackboardVariable knows no scopes.

    Args:
        name: The node's name.
        key: The entry's key, without braces.
        scope: Where the key is looked up.
    """

    def __init__(self, name: str, key: Input[str], scope: Scope) -> None:
        super().__init__(name)
        self._key = key
        self._scope = scope

    def update(self) -> Status:
        """Remove the entry, if there is one."""
        key = self._key.get()
        if key.startswith(ROOT_SIGN):
            self.feedback_message = (
                f"'{key}' stays: only keys of its own tree are removed, written without {ROOT_SIGN}"
            )
            return Status.SUCCESS
        # The same instance without its remapping.
        Scope(self._scope.board, self._scope.path).resolve(key).remove()
        return Status.SUCCESS


class WasEntryUpdated(Built):
    """Succeeds if an entry was written since this node last looked, else fails.

    py_trees has nothing like it: its blackboard does not count writes.
    """

    node_class = UpdateCheckNode

    def __init__(self, name: str, entry: Input[object], scope: Scope) -> None:
        super().__init__(name)
        self.entry = entry
        self.scope = scope


@dataclass(eq=False, repr=False)
class SkipUnlessUpdated(OwnDecorator):
    """Ticks its child if an entry was written since this node last looked, and is skipped if not.

    While the child runs, it does not look. py_trees has nothing like it: its blackboard does not count writes.

    Attributes:
        entry: The entry, or its key without braces.
    """

    node_class = UpdateGuardNode
    otherwise = SKIPPED
    entry: Input[object]
    scope: Scope


class WaitValueUpdate(SkipUnlessUpdated):
    """Ticks its child once an entry was written since this node last looked, and waits until then."""

    otherwise = RUNNING
