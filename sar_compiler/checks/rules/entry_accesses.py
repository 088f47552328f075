"""The accesses of nodes to blackboard keys and entries, and the order of these accesses, with all subtrees expanded.

Only the positions of two nodes decide whether an access of one node precedes an access of the other in every run.
"""

import bisect
import enum
import functools
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import NamedTuple

from sar_compiler.nodes.binding.attributes import CONDITIONS, complete_key_braces
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.instances import TreeInstance
from sar_compiler.nodes.semantics import AccessKind, KeyRole, Order
from sar_compiler.nodes.spec import Direction, NodeSpec, Parameter, path_of
from sar_compiler.runtime.blackboard import ROOT_SIGN, Scope, entry_of
from sar_compiler.runtime.expressions import Access, Script, name_uses
from sar_compiler.tree.diagnostic import Span


class AccessTime(enum.IntEnum):
    """The time at which a node accesses an entry, relative to the ticks of its children."""

    BEFORE = 0
    AFTER = 1


class KeyAccess(NamedTuple):
    """An access of a node to a key.

    Attributes:
        bound: The node.
        attribute: The attribute that contains the key.
        key: The key, by its name in the node's tree.
        kind: The kind of access.
        time: Whether the access happens before or after the children are ticked.
        place: The start and end of the key in a script; None if the key is not in a script.
        is_certain: Whether the access happens whenever the node is ticked.
        turn: The index of the access among the accesses of its script, from 0, in the order of execution.
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
        """Return the location of the key in the file."""
        element, place = self.bound.element, self.place or self.position_in_braces
        if place is None:
            return element.value_span(self.attribute)
        return element.value_part_span(self.attribute, *place)

    @property
    def position_in_braces(self) -> tuple[int, int] | None:
        """The start and end of the key in a value such as `x: {key}`; None if the value has no key in braces."""
        parameter = self.bound.spec.parameters.get(self.attribute)
        if parameter is None or not parameter.value_type.takes_braces:
            return None
        text = self.bound.element.attributes.get(self.attribute, "")
        found = re.search(rf"\{{\s*({re.escape(self.key)})\s*\}}", text)
        return None if found is None else found.span(1)


@dataclass(frozen=True, eq=False, repr=False)
class KeyAccesses:
    """All accesses of a tree's own nodes to keys. Accesses of its subtrees' nodes are not included.

    Attributes:
        accesses: The accesses, in the order of the file.
        is_open: Whether a node may access keys that the file does not name.
    """

    accesses: tuple[KeyAccess, ...]
    is_open: bool

    @functools.cached_property
    def keys(self) -> frozenset[str]:
        """The names that the tree uses for the accessed keys."""
        return frozenset(access.key for access in self.accesses)


_BY_DIRECTION = {
    Direction.INPUT: KeyRole(AccessKind.READ),
    Direction.OUTPUT: KeyRole(AccessKind.WRITE),
    Direction.INOUT: KeyRole(AccessKind.BOTH),
    None: KeyRole(AccessKind.FIXED),
}
_BY_ACCESS = {Access.READ: AccessKind.READ, Access.CREATE: AccessKind.WRITE, Access.CHANGE: AccessKind.CHANGE}
_POST = ("_onSuccess", "_onFailure", "_onHalted", "_post")
_SCOPE = path_of(Scope)
_OUR_OWN = ("sar_compiler.", "py_trees.")


def key_accesses_of(tree: BoundTree) -> KeyAccesses:
    """Return the accesses of a tree's nodes to keys."""
    involved = dict.fromkeys([*tree.keyed, *tree.demanding])
    if tree.wrappers:
        involved.update(dict.fromkeys(node for node in tree.nodes if node.conditions))
    accesses = [access for bound in involved for access in _node_accesses(bound)]
    accesses.sort(key=attrgetter("bound.element.position"))
    return KeyAccesses(tuple(accesses), any(_is_open(bound) for bound in involved))


def _node_accesses(bound: BoundNode) -> Iterator[KeyAccess]:
    if bound.conditions:
        for attribute in CONDITIONS:
            if attribute in bound.conditions:
                time = AccessTime.AFTER if attribute in _POST else AccessTime.BEFORE
                # Each script after a node belongs to one status, and may never run.
                yield from _script_accesses(bound, attribute, bound.conditions[attribute], time)
    for name, key in bound.keys.items():
        parameter = bound.spec.parameters.get(name)
        if parameter is not None:
            role = _role(bound, parameter)
            # A key that contains the name of another key is only read.
            kind = AccessKind.READ if role.indirect else role.kind
            yield from _accesses(
                bound, name, [entry_of(key) if parameter.value_type.names_key else key], kind
            )
    for name, value in bound.values.items():
        if isinstance(value, Script):
            yield from _script_accesses(bound, name, value, AccessTime.BEFORE)
        elif value is not None:  # a value with an error is None
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
    if value_type.keys_in is not None:
        return value_type.keys_in(value)
    if not isinstance(value, str):
        return ()
    if value_type.names_key:
        return (entry_of(value),)
    return (value,) if _role(bound, parameter).by_name else ()


def _script_accesses(
    bound: BoundNode, attribute: str, script: Script, time: AccessTime
) -> Iterator[KeyAccess]:
    for turn, use in enumerate(name_uses(script)):
        place = (use.start, use.end)
        yield KeyAccess(bound, attribute, use.name, _BY_ACCESS[use.access], time, place, use.certain, turn)


def _is_open(bound: BoundNode) -> bool:
    """Return whether a node may access keys that its attributes do not name."""
    return any(_is_indirect(bound, name) for name in bound.keys) or _has_scope(bound.spec)


def _is_indirect(bound: BoundNode, name: str) -> bool:
    """Return whether an attribute's key contains a script to run or the name of another key."""
    parameter = bound.spec.parameters.get(name)
    if parameter is None:
        return False
    return parameter.value_type.python is Script or _role(bound, parameter).indirect


def _has_scope(spec: NodeSpec) -> bool:
    own = spec.factory_path.startswith(_OUR_OWN)
    return not own and any(parameter.target_path == _SCOPE for parameter in spec.handed_over)


def is_root_key(key: str) -> bool:
    """Return whether a key has the form `@key`, which names a key of the main tree."""
    return key.startswith(ROOT_SIGN)


# Why the order of two accesses is derived from the tree, and how.
#
# Findings such as "this key is read before it is written" depend on one question: has access A certainly happened
# when access B happens for the first time? Exploring all runs, as `verify` does, would answer it exactly. `validate`
# cannot do that: it must respond while the user types, for trees with thousands of nodes and leaves of which only the
# ports are known. The answer is therefore derived from the positions of the two nodes alone, and errs on one side: it is
# True only if it holds in every run, whatever the leaves return. A wrong True causes a finding about a correct tree,
# while a wrong False only misses a finding.
#
# "For the first time" makes memory irrelevant: up to the tick in which B first happens, a control with memory and a
# reactive one have taken the same path to it. The answer depends on which children must have ended before the child
# with B is reached:
#
#   Sequence     A later child starts only after the earlier ones have succeeded. Everything that is certain to happen in a
#                child that succeeds has happened.
#   Selector     A later child starts after the earlier ones have *failed*, at any of their children. Only the access with
#                which every tick of the first child begins is certain (`_is_first` and `is_first`): each node on the path
#                down to A must be a first child.
#   Parallel     All children are ticked in the same tick, in order, without waiting for the end of the previous one. As in
#                a selector, only the beginning of the first child is certain.
#   others       (IfThenElse, switches, a user's class) Nothing is certain about one child when another one is reached.
#
# There may be further nodes between A and the node in which the paths to A and B part. Each of them must not advance
# before A has happened ("straight"): a sequence, a decorator that ends only with its child, a selector whose first
# child contains A. A node with a precondition may be skipped, so nothing in it is certain except the first script
# that it evaluates, which runs whenever the node is reached (`_is_in_first_script`). A node with `oneshot` may return a status
# without ticking its child.
#
# A node itself has accesses before its children are ticked (inputs, preconditions) and after (outputs by `_onSuccess`
# and similar). So an ancestor does not simply come earlier. Its access precedes those of its descendants only if it
# is BEFORE, and follows them only if it is AFTER. Each script after a node belongs to one outcome, and may never run.
#
# The second difficulty is size. An entry may have as many uses as the tree has nodes (a flag that every branch
# reads), and comparing all pairs takes quadratic time. Nodes are therefore numbered parents first, so that the
# descendants of a node form an interval from `number` to `last`, and uses are sorted by these numbers. `is_each_preceded`
# climbs from A to the root once. At each node it finds by bisection whether any use is left of the path (then that use
# may come first), or right of it (then this node must keep the order).
#
# All subtrees are expanded first: one element of the file has a position for each use of its tree, and a key belongs
# to the scope to which its remapping leads. A comparison of elements would mix the instances.

_READS = (AccessKind.READ, AccessKind.PEEK, AccessKind.BOTH, AccessKind.FIXED)


@dataclass(eq=False, repr=False, slots=True)
class TreePosition:
    """The position of a node in a tree with its subtrees expanded.

    Attributes:
        bound: The node.
        around: The position of the node's parent; None for the root.
        index: The node's index among its siblings, from 0.
        number: The index of the node among all nodes, in an order in which parents precede their children.
        last: The number of the last node below this node; for a leaf, the number of the leaf.
    """

    bound: BoundNode
    around: "TreePosition | None"
    index: int
    number: int
    last: int

    def contains(self, other: "TreePosition") -> bool:
        """Return whether this position contains another position, or is equal to it."""
        return self.number <= other.number <= self.last

    def child(self, inner: "TreePosition") -> "TreePosition":
        """Return the child of this position that contains a given inner position."""
        while inner.around is not None and inner.around is not self:
            inner = inner.around
        return inner


class PositionFinder:
    """The positions of all nodes of a tree with its subtrees expanded."""

    def __init__(self, top: TreeInstance) -> None:
        self._top = top

    def position_of(self, instance: TreeInstance, bound: BoundNode) -> TreePosition:
        """Return the position of a node in one instance of its tree."""
        return self._places[instance][bound]

    @functools.cached_property
    def _places(self) -> dict[TreeInstance, dict[BoundNode, TreePosition]]:
        places: dict[TreeInstance, dict[BoundNode, TreePosition]] = {each: {} for each in self._top.iterate()}
        in_order: list[TreePosition] = []
        waiting: list[tuple[TreeInstance, BoundNode | None, TreePosition | None, int]] = [
            (self._top, self._top.tree.root, None, 0)
        ]
        while waiting:
            instance, bound, around, index = waiting.pop()
            if bound is None:
                continue
            number = len(in_order)
            place = places[instance][bound] = TreePosition(bound, around, index, number, number)
            in_order.append(place)
            if bound.children:
                children = [(instance, child, place, index) for index, child in enumerate(bound.children)]
                waiting += reversed(children)
            elif bound in instance.inner:
                inner = instance.inner[bound]
                waiting.append((inner, inner.tree.root, place, 0))
        for place in reversed(in_order):
            if place.around is not None:
                place.around.last = max(place.around.last, place.last)
        return places


@dataclass(eq=False, repr=False, slots=True)
class EntryAccess:
    """An access to an entry by a node in one instance of a tree."""

    instance: TreeInstance
    access: KeyAccess
    places: PositionFinder

    @property
    def position(self) -> TreePosition:
        """The position of the node in the main tree with its subtrees expanded."""
        return self.places.position_of(self.instance, self.access.bound)

    @property
    def node(self) -> BoundNode:
        """The node that accesses the entry."""
        return self.access.bound


class OrderedAccesses:
    """Accesses ordered by the positions of their nodes, for queries about parts of the tree.

    Attributes:
        uses: The accesses, ordered by position.
    """

    def __init__(self, uses: Sequence[EntryAccess]) -> None:
        numbered = sorted(((use.position.number, index) for index, use in enumerate(uses)))
        self._numbers = [number for number, _ in numbered]
        self.uses = [uses[index] for _, index in numbered]

    def has_access_in(self, first: int, last: int) -> bool:
        """Return whether a node numbered from *first* to *last* accesses the entry."""
        index = bisect.bisect_left(self._numbers, first)
        return index < len(self._numbers) and self._numbers[index] <= last

    def _accesses_below(self, place: TreePosition) -> Sequence[EntryAccess]:
        start = bisect.bisect_left(self._numbers, place.number)
        return self.uses[start : bisect.bisect_right(self._numbers, place.number, start)]

    def is_each_preceded(self, first: EntryAccess) -> bool:
        """Return whether an access precedes all other accesses, as defined by `comes_first`."""
        place: TreePosition = first.position
        if self.uses and self._numbers[0] < place.number and not self.uses[0].position.contains(place):
            return False  # the most frequent case
        is_before = first.access.is_certain and first.access.time is AccessTime.BEFORE
        if self.has_access_in(place.number + 1, place.last) and not is_before:
            return False
        # Check a script's last access first: it is most likely to violate the order.
        if not all(
            comes_first(first, use) for use in reversed(self._accesses_below(place)) if use is not first
        ):
            return False
        inner = place
        while inner.around is not None:
            if not self._are_after(first, inner, inner.around):
                return False
            inner = inner.around
        return True

    def _are_after(self, first: EntryAccess, inner: TreePosition, around: TreePosition) -> bool:
        """Return whether an access in a child precedes all accesses in the parent and the other children."""
        return (
            not self.has_access_in(around.number + 1, inner.number - 1)
            and (not self.has_access_in(inner.last + 1, around.last) or _precedes(first, around))
            and all(comes_first(first, use) for use in self._accesses_below(around))
        )


@dataclass(eq=False, repr=False)
class EntryAccesses:
    """All accesses to an entry, in the order of the nodes in the tree.

    Attributes:
        scope: The scope that contains the entry.
        key: The entry's key in this scope.
        uses: The accesses of nodes to the entry.
        given: The `SubTree` nodes that pass a constant for the entry.
        is_parameter: Whether the entry's value may come from outside the tree, for example from a mission parameter.
    """

    scope: Scope
    key: str
    uses: list[EntryAccess] = field(default_factory=list)
    given: list[BoundNode] = field(default_factory=list)
    is_parameter: bool = False

    def of_kinds(self, *kinds: AccessKind) -> list[EntryAccess]:
        """Return the accesses of the given kinds."""
        return [use for use in self.uses if use.access.kind in kinds]

    # Computed once, after all uses have been added: an entry may have as many uses as its tree has nodes.
    @functools.cached_property
    def writers(self) -> list[EntryAccess]:
        """The accesses that may create the entry.

        The operator `=` in a script can create the entry only if a port uses the same key.
        """
        has_port = any(use.access.place is None for use in self.uses)
        return self.of_kinds(AccessKind.WRITE, AccessKind.BOTH, *((AccessKind.CHANGE,) if has_port else ()))

    @property
    def is_made(self) -> bool:
        """Whether any node may create the entry."""
        return bool(self.given or self.writers)

    @functools.cached_property
    def readers(self) -> list[EntryAccess]:
        """The accesses that may read the entry."""
        return self.of_kinds(*_READS)

    @functools.cached_property
    def ordered_writers(self) -> OrderedAccesses:
        """The accesses of `writers`, in the order of their positions."""
        return OrderedAccesses(self.writers)

    @functools.cached_property
    def ordered_readers(self) -> OrderedAccesses:
        """The accesses of `readers`, in the order of their positions."""
        return OrderedAccesses(self.readers)

    @functools.cached_property
    def possible_readers(self) -> frozenset[BoundNode]:
        """The nodes that may read the entry."""
        return frozenset(use.node for use in self.readers)


@dataclass(frozen=True, eq=False, repr=False)
class EntryTable:
    """All entries of a tree with its subtrees expanded.

    Attributes:
        top: The tree.
        entries: The entries, in the order in which the tree names them.
        accesses: The key accesses of each tree.
        is_open: Whether a node may access keys that the file does not name.
        is_foreign: Whether any node is known only from a model. If so, another program runs the tree and may write
            entries.
    """

    top: TreeInstance
    entries: Sequence[EntryAccesses]
    accesses: Mapping[BoundTree, KeyAccesses]
    is_open: bool
    is_foreign: bool

    @functools.cached_property
    def written_by_scope(self) -> Mapping[Scope, list[str]]:
        """The keys that nodes may write, grouped by scope."""
        return self._keys(is_made=True)

    @functools.cached_property
    def written_keys(self) -> frozenset[str]:
        """The keys that nodes may write, in all scopes."""
        return frozenset(itertools.chain.from_iterable(self.written_by_scope.values()))

    @functools.cached_property
    def unwritten(self) -> Mapping[Scope, list[str]]:
        """The keys that no node writes, grouped by scope."""
        return self._keys(is_made=False)

    def _keys(self, *, is_made: bool) -> Mapping[Scope, list[str]]:
        keys: dict[Scope, list[str]] = {}
        for entry in self.entries:
            if entry.is_made is is_made:
                keys.setdefault(entry.scope, []).append(entry.key)
        return keys

    @functools.cached_property
    def unused_arguments(self) -> frozenset[tuple[Scope, str]]:
        """The entries that are passed to a subtree under keys that the subtree does not use."""
        return frozenset(
            instance.scope.owner(key)
            for instance in self.top.iterate()
            for place, inner in instance.inner.items()
            for name, key in place.remapping.keys.items()
            if name not in self.accesses[inner.tree].keys
        )

    @functools.cached_property
    def unclosed_keys(self) -> Mapping[BoundTree, frozenset[str | None]]:
        """For each tree, the keys that are written with only one brace, completed with both braces."""
        return {
            tree: frozenset(
                complete_key_braces(text)
                for bound in tree.nodes
                for text in bound.element.attributes.values()
            )
            for tree in {instance.tree: None for instance in self.top.iterate()}
        }


def entry_table_of(top: TreeInstance, accesses: Mapping[BoundTree, KeyAccesses] | None = None) -> EntryTable:
    """Return the entries of an expanded tree. If *accesses* is None, the key accesses are computed."""
    if accesses is None:
        trees = dict.fromkeys(instance.tree for instance in top.iterate())
        accesses = {tree: key_accesses_of(tree) for tree in trees}
    entries: dict[tuple[Scope, str], EntryAccesses] = {}
    places, is_open, is_foreign = PositionFinder(top), False, False
    for instance in top.iterate():
        of_tree = accesses[instance.tree]
        is_open = is_open or of_tree.is_open
        is_foreign = is_foreign or any(bound.spec.is_foreign for bound in instance.tree.demanding)
        for access in of_tree.accesses:
            entry = _entry(entries, instance.scope, access.key)
            entry.uses.append(EntryAccess(instance, access, places))
            at_root = instance.around is None and access.kind is AccessKind.FIXED
            entry.is_parameter = entry.is_parameter or at_root or is_root_key(access.key)
        for place, inner in instance.inner.items():
            for key in place.remapping.constants:
                _entry(entries, inner.scope, key).given.append(place)
            for key in place.remapping.keys.values():
                if is_root_key(key):
                    _entry(entries, instance.scope, key).is_parameter = True
    return EntryTable(top, tuple(entries.values()), accesses, is_open, is_foreign)


def _entry(entries: dict[tuple[Scope, str], EntryAccesses], scope: Scope, key: str) -> EntryAccesses:
    owner = scope.owner(key)
    if owner not in entries:
        entries[owner] = EntryAccesses(*owner)
    return entries[owner]


def argument_of(use: EntryAccess, entry: EntryAccesses) -> tuple[BoundNode, str] | None:
    """Return the outermost `SubTree` that passes an entry to the accessing tree, and the attribute that passes it.

    The result is None if the access is in the tree to which the entry belongs, or if no attribute passes the entry.
    """
    found = None
    instance, key = use.instance, use.access.key
    while instance.scope is not entry.scope and instance.place is not None and instance.around is not None:
        place = instance.place
        if key in place.remapping.keys and key in place.element.attributes:
            found = place, key
        key, instance = place.remapping.keys.get(key, key), instance.around
    return found


def common_position(first: TreePosition, second: TreePosition) -> TreePosition:
    """Return the innermost position that contains two positions."""
    while first.around is not None and not first.contains(second):
        first = first.around
    return first


def branching_position(first: EntryAccess, second: EntryAccess) -> TreePosition | None:
    """Return the innermost position that contains two accesses, each in a different child.

    The result is None if one access is at or below the node of the other access.
    """
    place, other = first.position, second.position
    return None if place.contains(other) or other.contains(place) else common_position(place, other)


def comes_first(first: EntryAccess, second: EntryAccess) -> bool:
    """Return whether the first access always happens before the second access happens for the first time."""
    if not first.access.is_certain:
        return False
    place, other = first.position, second.position
    if place is other:
        return _comes_first_in_node(first.access, second.access)
    if other.contains(place):
        return second.access.time is AccessTime.AFTER and _is_straight(first, other.around)
    if other.number < place.number:
        return False
    around = common_position(place, other)
    return first.access.time is AccessTime.BEFORE if around is place else _precedes(first, around)


def _comes_first_in_node(first: KeyAccess, second: KeyAccess) -> bool:
    if first.attribute == second.attribute and first.place and second.place:
        return first.turn < second.turn
    return first.time < second.time


def _precedes(first: EntryAccess, around: TreePosition) -> bool:
    """Return whether an access precedes the accesses in later children of an ancestor."""
    if not first.access.is_certain or not _is_straight(first, around):
        return False
    means = around.bound.spec.semantics
    if means.is_sequence:
        return True
    return (means.is_selector or means.order is Order.TOGETHER) and _is_first(first.position, around)


def _is_straight(use: EntryAccess, around: TreePosition | None) -> bool:
    """Return whether an access always happens before its node's ancestors continue.

    Only the ancestors below *around* are checked.
    """
    return use.position is around or any(each is around for each in enclosing_sequences(use))


def enclosing_sequences(use: EntryAccess) -> Iterator[TreePosition | None]:
    """Yield the positions of a node's ancestors, up to the first that may continue without the access.

    Yields None after the root.
    """
    here: TreePosition = use.position
    place: TreePosition | None = here
    # In a selector, only the first access of its first child is certain.
    is_first = True
    while place is not None:
        bound, is_inner = place.bound, place is here
        if bound.oneshot is not None or (bound.conditions and not (is_inner and _is_in_first_script(use))):
            return
        means = bound.spec.semantics
        continues = is_inner or means.is_sequence or means.always_ends_with_child(bound)
        if not continues and not (means.is_selector and is_first):
            return
        is_first = is_first and not place.index
        place = place.around
        yield place


def _is_in_first_script(use: EntryAccess) -> bool:
    """Return whether an access is in the first script that its node runs."""
    return use.access.attribute == next(iter(use.node.conditions), None)


def _is_first(place: TreePosition, around: TreePosition) -> bool:
    """Return whether a node is in the first child of all its ancestors below *around*."""
    while place.around is not None and place.around is not around:
        if place.index:
            return False
        place = place.around
    return True


def nodes_between(first: EntryAccess, second: EntryAccess) -> Sequence[BoundNode]:
    """Return the children of a sequence from the child with the first access to that before the second access.

    The sequence is the innermost node that contains both accesses.
    """
    around = common_position(first.position, second.position)
    start, end = around.child(first.position), around.child(second.position)
    return around.bound.children[start.index : end.index]
