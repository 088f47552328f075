"""Adapters that make py_trees' own nodes usable in a tree file.

The nodes keep their names, their arguments, and their treatment of unusual values (a count of 0 or below), as
documented for each attribute. Only values that would raise an error in the middle of a run are refused.
The differences: their keys are the tree's, and none of their children may be one that can be skipped.
"""

from collections.abc import Callable
from typing import Any, TypeVar

from py_trees import behaviours, decorators
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Client
from py_trees.common import Access
from py_trees.version import __version__ as py_trees_version

from sar_compiler.errors import SarError
from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Rule, Signature
from sar_compiler.nodes.values import ValueType
from sar_compiler.runtime.blackboard import Entry, Scope
from sar_compiler.runtime.ports import Input

B = TypeVar("B", bound=Behaviour)


class TooOldError(SarError):
    """The installed py_trees does not have a node yet."""


class ScopedClient(Client):
    """A client of py_trees' blackboard that works on the entries of a tree.

    It replaces a stock node's own client, which would bypass the tree: it would write to a py_trees namespace
    that all trees share, and the board would not count the writes.

    Args:
        stock: The client to replace; it is signed off.
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
        # One after the other: py_trees stumbles over a key that is both read and written.
        for name in {*stock.read, *stock.write}:
            stock.unregister_key(name, clear=False)
        stock.unregister(clear=False)

    def set(self, name: str, value: Any, overwrite: bool = True) -> bool:
        """Write an entry or an attribute of its object; either counts as one write of the entry."""
        written = bool(super().set(name, value, overwrite))
        if written:
            entry = self._entry(name)
            entry.write(entry.read())
        return written

    def unset(self, key: str) -> bool:
        """Remove an entry; return whether there was one."""
        removed = bool(super().unset(key))
        self._entry(key).remove()
        return removed

    def _entry(self, name: str) -> Entry:
        key, _, _ = name.partition(".")
        return self.entries[key if key.startswith("/") else f"{self.namespace}/{key}"]


class Keys:
    """The keys that one stock node uses.

    Args:
        scope: The scope in which they are looked up.
    """

    def __init__(self, scope: Scope) -> None:
        self._scope = scope
        self._entries: dict[str, Entry] = {}

    def variable(self, port: Input[object]) -> str:
        """Return py_trees' name for a key, or for an attribute of the object in it (`battery.percentage`).

        Args:
            port: The key: `key` or `{key}`.
        """
        key, dot, inner = _text(port).partition(".")
        return f"{self._name(key)}{dot}{inner}"

    def key(self, port: Input[object]) -> str:
        """Return py_trees' name for a key without an attribute; see `variable`."""
        return self._name(_text(port))

    def numbered(self, port: Input[object], count: int) -> str:
        """Return py_trees' name for a namespace with the keys `1`, `2` and so on; see `variable`."""
        folder = _text(port)
        for number in range(1, count + 1):
            key = f"{folder}/{number}"
            self._entries[f"/{key}"] = self._scope.resolve(key)
        return f"/{folder}"

    def given_to(self, behaviour: B) -> B:
        """Connect a stock node that was created with these names to the tree's keys."""
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
        # To py_trees a dot precedes an attribute of the object, even within the name of a tree.
        name = entry.name.replace(".", "_")
        self._entries[name] = entry
        return name


def made_by(
    tag: str,
    factory: Callable[..., Behaviour],
    *outcomes: str,
    kind: Kind = Kind.ACTION,
    effects: str = "",
    rule: "Rule | None" = None,
    semantics: Semantics | None = None,
    **types: ValueType,
) -> NodeSpec:
    """Return a py_trees node whose arguments cannot be written in a file as they are: a factory creates it.

    A node that the installed py_trees lacks is registered nevertheless: whether a file is correct does not depend
    on the machine. The factory refuses to create it.
    """
    is_decorator = kind is Kind.DECORATOR
    module, base = (decorators, decorators.Decorator) if is_decorator else (behaviours, Behaviour)
    return NodeSpec(
        tag,
        getattr(module, tag, base),
        kind,
        frozenset(outcomes),
        effects,
        semantics=semantics or Semantics(),
        signature=Signature(factory, types=types),
        rule=rule,
    )


def since_2_4(module: object, name: str) -> Callable[..., Any]:
    """Return a class that py_trees has had since its version 2.4.

    Raises:
        TooOldError: If the installed one is older.
    """
    if not hasattr(module, name):
        message = f"py_trees {py_trees_version} does not have {name}; it takes 2.4 or later"
        raise TooOldError(message)
    made: Callable[..., Any] = getattr(module, name)
    return made


def _text(port: Input[object]) -> str:
    """Return the key that an attribute names, with or without braces."""
    return str(port.get()) if port.entry is None else port.entry.key
