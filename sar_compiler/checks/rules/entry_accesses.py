"""The accesses to each blackboard entry, with all subtrees expanded."""

import functools
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from sar_compiler.checks.rules.key_accesses import (
    AccessTime,
    KeyAccess,
    KeyAccesses,
    is_of_root,
    key_accesses_of,
)
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.instances import Instance
from sar_compiler.nodes.semantics import AccessKind, Order
from sar_compiler.runtime.blackboard import Scope

Step = tuple[Instance, BoundNode]
_READS = (AccessKind.READ, AccessKind.PEEK, AccessKind.BOTH, AccessKind.FIXED)


@dataclass(eq=False)
class EntryAccess:
    """An access to an entry by a node in one instance of a tree."""

    instance: Instance
    access: KeyAccess
    way: "PathFinder"

    @functools.cached_property
    def path(self) -> tuple[Step, ...]:
        """The nodes from the root of the main tree down to this one."""
        return self.way.to(self.instance, self.access.bound)

    @property
    def bound(self) -> BoundNode:
        """The node."""
        return self.access.bound


@dataclass(eq=False)
class EntryAccesses:
    """All accesses to an entry, in the order of the tree.

    Attributes:
        scope: The scope that its key belongs to.
        key: The key there.
        uses: The nodes' accesses to it.
        given: The `SubTree` nodes that pass a constant for it.
        is_parameter: Whether it is read as a parameter of the mission.
    """

    scope: Scope
    key: str
    uses: list[EntryAccess] = field(default_factory=list)
    given: list[BoundNode] = field(default_factory=list)
    is_parameter: bool = False

    def of(self, *kinds: AccessKind) -> list[EntryAccess]:
        """Return the uses of given kinds."""
        return [use for use in self.uses if use.access.kind in kinds]

    # An entry may have as many uses as its tree has nodes, so these are put together once, when all uses are there.
    @functools.cached_property
    def writers(self) -> list[EntryAccess]:
        """The uses that may write it first; a script's `=` may do so if a port has the key."""
        has_port = any(use.access.place is None for use in self.uses)
        return self.of(AccessKind.WRITE, AccessKind.BOTH, *((AccessKind.CHANGE,) if has_port else ()))

    @property
    def is_made(self) -> bool:
        """Whether any node may write it."""
        return bool(self.given or self.writers)

    @functools.cached_property
    def readers(self) -> list[EntryAccess]:
        """The uses that may read it."""
        return self.of(*_READS)


class PathFinder:
    """The path from the root to each node of a tree with its subtrees expanded."""

    def __init__(self) -> None:
        self._parents: dict[BoundTree, dict[BoundNode, BoundNode]] = {}

    def to(self, instance: Instance, bound: BoundNode) -> tuple[Step, ...]:
        """Return a node after its ancestors, each with its instance, from the outside in."""
        steps: list[Step] = []
        here: Instance | None = instance
        node: BoundNode | None = bound
        while here is not None:
            parents = self._of(here.tree)
            while node is not None:
                steps.append((here, node))
                node = parents.get(node)
            node, here = here.place, here.around
        return tuple(reversed(steps))

    def _of(self, tree: BoundTree) -> dict[BoundNode, BoundNode]:
        if tree not in self._parents:
            self._parents[tree] = {child: node for node in tree.parents for child in node.children}
        return self._parents[tree]


@dataclass(frozen=True)
class EntryTable:
    """All entries of a tree with its subtrees expanded.

    Attributes:
        top: The tree.
        entries: The entries, in the order in which the tree names them.
        is_open: Whether a node may access any key in ways that the file does not show.
        is_foreign: Whether a node is only described: the tree runs elsewhere, where other programs may write as well.
    """

    top: Instance
    entries: Sequence[EntryAccesses]
    is_open: bool
    is_foreign: bool


def entry_table_of(top: Instance, known: dict[BoundTree, KeyAccesses]) -> EntryTable:
    """Collect the accesses to each entry.

    Args:
        top: A tree with its subtrees expanded.
        known: The key accesses of trees analysed so far; is added to.
    """
    entries: dict[tuple[Scope, str], EntryAccesses] = {}
    paths, is_open, is_foreign = PathFinder(), False, False
    for instance in top.iterate():
        if instance.tree not in known:
            known[instance.tree] = key_accesses_of(instance.tree)
        of_tree = known[instance.tree]
        is_open = is_open or of_tree.is_open
        is_foreign = is_foreign or any(bound.spec.is_only_described for bound in instance.tree.demanding)
        for access in of_tree.accesses:
            entry = _entry(entries, instance.scope, access.key)
            entry.uses.append(EntryAccess(instance, access, paths))
            at_root = instance.around is None and access.kind is AccessKind.FIXED
            entry.is_parameter = entry.is_parameter or at_root or is_of_root(access.key)
        for place, inner in instance.inner.items():
            for key in place.remapping.constants:
                _entry(entries, inner.scope, key).given.append(place)
            for key in place.remapping.keys.values():
                if is_of_root(key):
                    _entry(entries, instance.scope, key).is_parameter = True
    return EntryTable(top, tuple(entries.values()), is_open, is_foreign)


def _entry(entries: dict[tuple[Scope, str], EntryAccesses], scope: Scope, key: str) -> EntryAccesses:
    owner = scope.owner(key)
    if owner not in entries:
        entries[owner] = EntryAccesses(*owner)
    return entries[owner]


def argument_of(use: EntryAccess, entry: EntryAccesses) -> tuple[BoundNode, str] | None:
    """Return the outermost `SubTree` that passes an entry to the tree of a use, and its attribute for this.

    None if the use is in the tree that the entry belongs to, or no attribute is written for it.
    """
    found = None
    instance, key = use.instance, use.access.key
    while instance.scope is not entry.scope and instance.place is not None and instance.around is not None:
        place = instance.place
        if key in place.remapping.keys and key in place.element.attributes:
            found = place, key
        key, instance = place.remapping.keys.get(key, key), instance.around
    return found


def parting(first: EntryAccess, second: EntryAccess) -> int:
    """Return the number of steps from the root that two uses have in common."""
    together = 0
    for mine, theirs in zip(first.path, second.path, strict=False):
        if mine != theirs:
            break
        together += 1
    return together


def comes_first(first: EntryAccess, second: EntryAccess) -> bool:
    """Return whether the first use has certainly happened when the second happens for the first time."""
    if not first.access.is_certain:
        return False
    if first.path == second.path:
        return _comes_first_in_node(first.access, second.access)
    together = parting(first, second)
    if together == len(second.path):
        return second.access.time is AccessTime.AFTER and _is_straight(first, together - 1)
    if not _is_straight(first, together):
        return False
    return (
        first.access.time is AccessTime.BEFORE
        if together == len(first.path)
        else _precedes(first, second, together)
    )


def _comes_first_in_node(first: KeyAccess, second: KeyAccess) -> bool:
    if first.attribute == second.attribute and first.place and second.place:
        # `x := x + 1` writes its target last, although it comes first in the text.
        return first.kind is AccessKind.READ and (
            first.place[0] > second.place[0] or second.kind is not AccessKind.WRITE
        )
    return first.time < second.time


def _precedes(first: EntryAccess, second: EntryAccess, together: int) -> bool:
    """Return whether a use comes before another in their common ancestor."""
    around = first.path[together - 1][1]
    if _place(first, together, around) >= _place(second, together, around):
        return False
    means = around.spec.semantics
    if means.is_sequence:
        return True
    return (means.is_selector or means.order is Order.TOGETHER) and _is_first(first, together)


def _place(use: EntryAccess, together: int, around: BoundNode) -> int:
    child = use.path[together][1]
    return next((index for index, each in enumerate(around.children) if each is child), 0)


def _is_straight(use: EntryAccess, together: int) -> bool:
    """Return whether the nodes between a use and a common ancestor continue only after the use has happened."""
    inner = [bound for _, bound in use.path[together:]]
    for number, bound in enumerate(inner):
        if bound.oneshot is not None or (bound.conditions and not (bound is inner[-1] and _asks(use))):
            return False
        means = bound.spec.semantics
        if bound is inner[-1] or means.is_sequence or means.always_ends_with_child(bound):
            continue
        # In a selector, only the first access of its first child is certain.
        return (
            means.is_selector
            and _is_first(use, together + number)
            and _is_straight(use, together + number + 1)
        )
    return True


def _asks(use: EntryAccess) -> bool:
    """Return whether a use is in the first script that its node runs."""
    return use.access.attribute == next(iter(use.bound.conditions), None)


def _is_first(use: EntryAccess, together: int) -> bool:
    """Return whether a use happens first in all the nodes around it, below a common ancestor."""
    steps = use.path[together:]
    return all(
        not outer.children or outer.children[0] is inner
        for (_, outer), (_, inner) in itertools.pairwise(steps)
    )


def between(first: EntryAccess, second: EntryAccess) -> Iterator[BoundNode]:
    """Yield the nodes between two uses in the same sequence, including that of the first use."""
    together = parting(first, second)
    around = first.path[together - 1][1]
    start, end = _place(first, together, around), _place(second, together, around)
    yield from around.children[start:end]
