"""Factories of py_trees nodes for the nodes in a tree file.

The nodes keep their names, their arguments, and their treatment of unusual values (a count of 0 or below), as
described in each spec. Only values that would raise an error in the middle of a run are rejected.
The nodes differ from those of py_trees in two ways: they use the keys of the tree, and their children must not be skippable.

A node that the installed py_trees lacks also has a spec, because the result of a check must not depend on the machine.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard, Client
from py_trees.common import Access, OneShotPolicy, ParallelPolicy, Status
from py_trees.version import __version__ as py_trees_version

from sar_compiler.errors import SarError
from sar_compiler.nodes.binding.attributes import ONESHOT_TYPE
from sar_compiler.nodes.language.narrow_types import (
    COMPARISONS,
    JUNCTIONS,
    KEY,
    STATUS_NAME,
    STATUS_NAMES,
    VARIABLE,
    Comparison,
    Junction,
    PolicyName,
    constant,
    expression,
    parse_comparison,
)
from sar_compiler.nodes.language.node_rules import EMPTY_QUEUE, HOW_TO_SELECT, index_of_child, policy_conflict
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.nodes.values import ANYTHING, CONDITION, require_value_type
from sar_compiler.runtime.blackboard import Entry, Scope
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.runtime.ports import InOut, Input
from sar_compiler.runtime.scripting import NodeScript
from sar_compiler.runtime.variables import Enums, UnknownValue, UnknownValueError

B = TypeVar("B", bound=Behaviour)


class ScopedClient(Client):
    """A py_trees blackboard client for the entries of a tree.

    It replaces the client of a stock node. The stock client would write to a namespace that all trees share, and its
    writes would not be counted.

    Args:
        stock: The client to replace, which is unregistered.
        entries: The entry for each name that the client has registered.
    """

    entries: dict[str, Entry]

    def __init__(self, stock: Client, entries: dict[str, Entry]) -> None:
        super().__init__(name=stock.name, namespace=stock.namespace)
        # Plain assignments to a client are writes to the blackboard.
        object.__setattr__(self, "entries", entries)
        for access, names in ((Access.READ, stock.read), (Access.WRITE, stock.write)):
            for name in sorted(names):
                self.register_key(name, access, remap_to=entries[name].name)
        # In two steps: py_trees raises an error for a key that is both read and written.
        for name in {*stock.read, *stock.write}:
            stock.unregister_key(name, clear=False)
        stock.unregister(clear=False)

    def __getattr__(self, name: str) -> Any:
        """Return an entry's value; raises `UnknownValueError` if it is unknown."""
        with self._on_blackboard(name):
            value = super().__getattr__(name)
        if isinstance(value, UnknownValue):
            raise UnknownValueError(value)
        return value

    def set(self, name: str, value: Any, overwrite: bool = True) -> bool:
        """Write an entry, or an attribute of the object in the entry.

        Both count as one write of the entry.
        """
        with self._on_blackboard(name):
            written = bool(super().set(name, value, overwrite))
            if written:
                entry = self._entry(name)
                entry.write(Blackboard.storage[entry.name])
        return written

    def unset(self, key: str) -> bool:
        """Remove an entry, and return whether the entry existed."""
        with self._on_blackboard(key):
            removed = bool(super().unset(key))
        self._entry(key).remove()
        return removed

    @contextlib.contextmanager
    def _on_blackboard(self, name: str) -> Iterator[None]:
        """Copy an entry to py_trees' blackboard for the duration of a block.

        This is done only if the entry's own board counts its writes.
        """
        entry = self._entry(name)
        if not entry.board.is_numbered or entry.name in Blackboard.storage:
            yield
            return
        if entry.exists:
            Blackboard.storage[entry.name] = entry.board.get(entry.name)
        try:
            yield
        finally:
            Blackboard.storage.pop(entry.name, None)

    def _entry(self, name: str) -> Entry:
        key, _, _ = name.partition(".")
        return self.entries[key if key.startswith("/") else f"{self.namespace}/{key}"]


class StockNodeKeys:
    """The keys that one py_trees node uses.

    Args:
        scope: The scope in which the keys are looked up.
    """

    def __init__(self, scope: Scope) -> None:
        self._scope = scope
        self._entries: dict[str, Entry] = {}

    def variable(self, port: Input[object]) -> str:
        """Return py_trees' name for a key or an attribute, such as `percentage` of the object in `battery`.

        Args:
            port: The port with the key: `key` or `{key}`.
        """
        key, dot, inner = _text(port).partition(".")
        return f"{self._name(key)}{dot}{inner}"

    def key(self, port: Input[object]) -> str:
        """Return py_trees' name for a key without an attribute; see `variable`."""
        return self._name(_text(port))

    def number_keys(self, port: Input[object], count: int) -> str:
        """Return py_trees' name for the namespace that contains the keys `1`, `2` and so on; see `variable`."""
        folder = _text(port)
        for number in range(1, count + 1):
            key = f"{folder}/{number}"
            self._entries[f"/{key}"] = self._scope.resolve(key)
        return f"/{folder}"

    def connect_to(self, behaviour: B) -> B:
        """Connect a py_trees node to the tree's keys.

        The node must have been created with the names that this object returned.
        """
        for attribute, client in list(vars(behaviour).items()):
            if isinstance(client, Client):
                scoped = ScopedClient(client, self._entries)
                setattr(behaviour, attribute, scoped)
                behaviour.blackboards = [
                    scoped if attached is client else attached for attached in behaviour.blackboards
                ]
        return behaviour

    def _name(self, key: str) -> str:
        entry = self._scope.resolve(key)
        # py_trees treats a dot as the beginning of an object's attribute, even within the name of a tree.
        name = entry.name.replace(".", "_")
        self._entries[name] = entry
        return name


def _text(port: Input[object]) -> str:
    """Return the key that an attribute names, with or without braces."""
    return str(port.get()) if port.entry is None else port.entry.key


class PyTreesTooOldError(SarError):
    """An error about a node that the installed version of py_trees does not have."""


# The conversions of values for py_trees, by the name of the value type.
_CONVERSIONS: Mapping[str, Callable[[Any], object]] = {
    STATUS_NAME.name: lambda word: Status[word],
    STATUS_NAMES.name: lambda words: [Status[word] for word in words],
    ONESHOT_TYPE.name: lambda word: OneShotPolicy[word],
    require_value_type(Comparison).name: lambda word: COMPARISONS[word],
    ANYTHING.name: lambda port: constant(port) if port.entry is None else port.get,
}


def stock(
    spec: NodeSpec, name: str, scope: Scope | None = None, enums: Enums | None = None, **written: Any
) -> Behaviour:
    """Create a node by calling its class.

    Args:
        spec: The node's spec.
        name: The node's name.
        scope: The scope in which the keys are looked up, if the node has keys.
        enums: The named constants, if the node has a script.
        **written: The values of the other parameters.

    Raises:
        PyTreesTooOldError: If the installed version of py_trees does not have the node.
    """
    keys = StockNodeKeys(scope) if scope is not None else None
    arguments: dict[str, Any] = {}
    for parameter, value in written.items():
        kind = spec.parameters[parameter].value_type.name
        if keys is not None and kind in (KEY.name, VARIABLE.name):
            value = keys.key(value) if kind == KEY.name else keys.variable(value)  # noqa: PLW2901
        elif scope is not None and enums is not None and kind == CONDITION.name:
            value = NodeScript(value, name, parameter, scope, enums).holds  # noqa: PLW2901
        elif kind in _CONVERSIONS and value is not None:
            value = _CONVERSIONS[kind](value)  # noqa: PLW2901
        arguments[parameter] = value
    made: Behaviour = _class_of(spec)(name=name, **arguments)
    return made if keys is None else keys.connect_to(made)


def status_queue(spec: NodeSpec, name: str, queue: list[str], eventually: str | None = None) -> Behaviour:
    """Create a StatusQueue.

    Raises:
        ValueError: If there are no statuses.
    """
    if not queue and eventually is None:
        raise ValueError(EMPTY_QUEUE)
    return stock(spec, name, queue=queue, eventually=eventually)


def parallel(
    _spec: NodeSpec,
    name: str,
    children: list[Behaviour],
    policy: PolicyName,
    synchronise: bool | None = None,
    selected: list[str] | None = None,
) -> composites.Parallel:
    """Create a Parallel with one of py_trees' policies.

    Raises:
        ValueError: If a name does not match exactly one child, or an attribute conflicts with the policy.
    """
    clash = policy_conflict(policy, synchronise, is_selected=selected is not None)
    if clash is not None:
        raise ValueError(": ".join(clash))
    if policy == "SuccessOnOne":
        return composites.Parallel(name, ParallelPolicy.SuccessOnOne(), children)
    waits = synchronise is not False
    if policy == "SuccessOnAll":
        return composites.Parallel(name, ParallelPolicy.SuccessOnAll(waits), children)
    if not selected:
        raise ValueError(f"selected: no child is named ({HOW_TO_SELECT})")
    names = [_written_name(child) for child in children]
    chosen = [children[index_of_child(text, names)] for text in selected]
    return composites.Parallel(name, ParallelPolicy.SuccessOnSelected(chosen, waits), children)


def create_comparison(
    spec: NodeSpec,
    name: str,
    variable: Input[object],
    operator: Comparison,
    value: Input[object],
    scope: Scope,
) -> Behaviour:
    """Create a node that compares a key with a value."""
    keys = StockNodeKeys(scope)
    return keys.connect_to(_class_of(spec)(name, expression(keys.variable(variable), operator, value)))


def check_values(
    spec: NodeSpec,
    name: str,
    checks: list[str],
    operator: Junction,
    scope: Scope,
    namespace: InOut[object] | None = None,
) -> Behaviour:
    """Create a CheckBlackboardVariableValues."""
    keys = StockNodeKeys(scope)
    expressions = [
        expression(keys.variable(Input(check.variable)), check.comparison, Input(check.value))
        for check in map(parse_comparison, checks)
    ]
    folder = None if namespace is None else keys.number_keys(namespace, len(expressions))
    return keys.connect_to(_class_of(spec)(name, expressions, JUNCTIONS[operator], folder))


def _written_name(child: Behaviour) -> str:
    """Return a child's name as written in the file.

    The wrappers that `oneshot` and conditions add to the child have other names.
    """
    if isinstance(child, Conditions):
        return child.decorated.name
    if isinstance(child, decorators.OneShot):
        inner = _written_name(child.decorated)
        return inner if child.name == f"{inner}OneShot" else child.name
    return child.name


def _class_of(spec: NodeSpec) -> Callable[..., Behaviour]:
    """Return the class of a node.

    Raises:
        PyTreesTooOldError: If the installed version of py_trees does not have the node.
    """
    try:
        found = spec.cls
    except AttributeError:
        message = f"py_trees {py_trees_version} does not have {spec.tag}, which needs 2.4 or later"
        raise PyTreesTooOldError(message) from None
    assert found is not None  # noqa: S101 - it has a path
    return found
