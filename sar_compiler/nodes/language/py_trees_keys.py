"""The tree's keys for py_trees' own nodes."""

import contextlib
from collections.abc import Iterator
from typing import Any, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard, Client
from py_trees.common import Access

from sar_compiler.runtime.blackboard import Entry, Scope
from sar_compiler.runtime.ports import Input

B = TypeVar("B", bound=Behaviour)


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

    def __getattr__(self, name: str) -> Any:
        """Return an entry's value."""
        with self._on_blackboard(name):
            return super().__getattr__(name)

    def set(self, name: str, value: Any, overwrite: bool = True) -> bool:
        """Write an entry or an attribute of its object; either counts as one write of the entry."""
        with self._on_blackboard(name):
            written = bool(super().set(name, value, overwrite))
            if written:
                entry = self._entry(name)
                entry.write(Blackboard.storage[entry.name])
        return written

    def unset(self, key: str) -> bool:
        """Remove an entry; return whether there was one."""
        with self._on_blackboard(key):
            removed = bool(super().unset(key))
        self._entry(key).remove()
        return removed

    @contextlib.contextmanager
    def _on_blackboard(self, name: str) -> Iterator[None]:
        """Have an entry on py_trees' blackboard for a while: those of a numbered board are elsewhere."""
        entry = self._entry(name)
        if not entry.board.is_numbered or entry.name in Blackboard.storage:
            yield
            return
        if entry.exists:
            Blackboard.storage[entry.name] = entry.read()
        try:
            yield
        finally:
            Blackboard.storage.pop(entry.name, None)

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

    def number_keys(self, port: Input[object], count: int) -> str:
        """Return py_trees' name for a namespace with the keys `1`, `2` and so on; see `variable`."""
        folder = _text(port)
        for number in range(1, count + 1):
            key = f"{folder}/{number}"
            self._entries[f"/{key}"] = self._scope.resolve(key)
        return f"/{folder}"

    def give_to(self, behaviour: B) -> B:
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


def _text(port: Input[object]) -> str:
    """Return the key that an attribute names, with or without braces."""
    return str(port.get()) if port.entry is None else port.entry.key
