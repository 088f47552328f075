"""The accesses of a tree's nodes to blackboard keys: by ports, names of keys, scripts and subtrees."""

import enum
import functools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from sar_compiler.nodes.binding.attributes import CONDITIONS
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.semantics import AccessKind, KeyRole
from sar_compiler.nodes.spec import Direction, NodeSpec, Parameter, path_of
from sar_compiler.runtime.blackboard import ROOT_SIGN, Scope, entry_of
from sar_compiler.runtime.expressions import Access, Script, name_uses
from sar_compiler.tree.source import Span


class AccessTime(enum.IntEnum):
    """The time of an access relative to the ticks of the node's children."""

    BEFORE = 0
    AFTER = 1


class KeyAccess(NamedTuple):
    """An access of a node to a key.

    Attributes:
        bound: The node.
        attribute: The attribute that contains it.
        key: The key, by its name in the node's tree.
        kind: The kind of access.
        time: Whether it happens before or after the children are ticked.
        place: Its place in the attribute's value; None for all of it.
        is_certain: Whether it happens whenever the node is ticked.
        turn: Its number among those of its script, in the order in which they happen.
    """

    bound: BoundNode
    attribute: str
    key: str
    kind: AccessKind
    time: AccessTime = AccessTime.BEFORE
    place: tuple[int, int] | None = None
    is_certain: bool = True
    turn: int = 0

    def span(self) -> Span:
        """Return its place in the file."""
        element = self.bound.element
        if self.place is None:
            return element.value_span(self.attribute)
        return element.within_value(self.attribute, *self.place)


@dataclass(frozen=True)
class KeyAccesses:
    """All accesses of a tree's nodes to keys, without its subtrees.

    Attributes:
        accesses: The accesses, in the order of the file.
        is_open: Whether a node may access any key in ways that the file does not show.
    """

    accesses: tuple[KeyAccess, ...]
    is_open: bool

    @functools.cached_property
    def keys(self) -> frozenset[str]:
        """The keys, by their names in the tree."""
        return frozenset(access.key for access in self.accesses)


_BY_DIRECTION = {
    Direction.INPUT: KeyRole(AccessKind.READ),
    Direction.OUTPUT: KeyRole(AccessKind.WRITE),
    Direction.INOUT: KeyRole(AccessKind.BOTH),
    None: KeyRole(AccessKind.FIXED),
}
_BY_ACCESS = {
    Access.READ: AccessKind.READ,
    Access.CREATE: AccessKind.WRITE,
    Access.CHANGE: AccessKind.CHANGE,
}
_POST = ("_onSuccess", "_onFailure", "_onHalted", "_post")
_SCOPE = path_of(Scope)
_OUR_OWN = ("sar_compiler.", "py_trees.")


def key_accesses_of(tree: BoundTree) -> KeyAccesses:
    """Return the accesses of a tree's nodes to keys."""
    involved = dict.fromkeys([*tree.keyed, *tree.demanding])
    if tree.wrappers:
        involved.update(dict.fromkeys(node for node in tree.nodes if node.conditions))
    accesses = [access for bound in involved for access in _of_node(bound)]
    accesses.sort(key=attrgetter("bound.element.place"))
    return KeyAccesses(tuple(accesses), any(_is_open(bound) for bound in involved))


def _of_node(bound: BoundNode) -> Iterator[KeyAccess]:
    if bound.conditions:
        for attribute in CONDITIONS:
            if attribute in bound.conditions:
                time = AccessTime.AFTER if attribute in _POST else AccessTime.BEFORE
                # The scripts after a node belong to one answer each, and may never be run.
                yield from _of_script(bound, attribute, bound.conditions[attribute], time)
    for name, key in bound.keys.items():
        parameter = bound.spec.parameters.get(name)
        if parameter is not None:
            names_key = parameter.value_type is not None and parameter.value_type.names_key
            role = _role(bound, parameter)
            # A key that holds the name of the one that is meant is only read.
            kind = AccessKind.READ if role.indirect else role.kind
            yield from _accesses(bound, name, [entry_of(key) if names_key else key], kind)
    for name, value in bound.values.items():
        if isinstance(value, Script):
            yield from _of_script(bound, name, value, AccessTime.BEFORE)
        elif value is not None:  # as it is after a finding
            kind = _role(bound, bound.spec.parameters[name]).kind
            yield from _accesses(bound, name, _keys_in(bound, name, value), kind)


def _accesses(bound: BoundNode, name: str, keys: Iterable[str], kind: AccessKind) -> Iterator[KeyAccess]:
    if kind is not AccessKind.NONE:
        yield from (KeyAccess(bound, name, key, kind) for key in keys)


def _role(bound: BoundNode, parameter: Parameter) -> KeyRole:
    return bound.spec.semantics.keys.get(parameter.name) or _BY_DIRECTION[parameter.direction]


def _keys_in(bound: BoundNode, name: str, value: object) -> Iterable[str]:
    """Return the keys named by a value that is not a key in braces."""
    parameter = bound.spec.parameters[name]
    value_type = parameter.value_type
    if value_type is not None and value_type.keys_in is not None:
        return value_type.keys_in(value)
    if not isinstance(value, str):
        return ()
    if value_type is not None and value_type.names_key:
        return (entry_of(value),)
    return (value,) if _role(bound, parameter).by_name else ()


def _of_script(bound: BoundNode, attribute: str, script: Script, time: AccessTime) -> Iterator[KeyAccess]:
    for turn, use in enumerate(name_uses(script)):
        place = (use.start, use.end)
        yield KeyAccess(bound, attribute, use.name, _BY_ACCESS[use.access], time, place, use.certain, turn)


def _is_open(bound: BoundNode) -> bool:
    """Return whether a node may access keys that its attributes do not name."""
    return any(_is_told_by(bound, name) for name in bound.keys) or _has_scope(bound.spec)


def _is_told_by(bound: BoundNode, name: str) -> bool:
    """Return whether a key holds the script that a node runs, or the name of the key that it uses."""
    parameter = bound.spec.parameters.get(name)
    if parameter is None:
        return False
    is_script = parameter.value_type is not None and parameter.value_type.python is Script
    return is_script or _role(bound, parameter).indirect


def _has_scope(spec: NodeSpec) -> bool:
    own = spec.maker_path.startswith(_OUR_OWN)
    return not own and any(parameter.target_path == _SCOPE for parameter in spec.handed_over)


def is_of_root(key: str) -> bool:
    """Return whether a key is written as a key of the main tree: `@key`."""
    return key.startswith(ROOT_SIGN)
