"""Matching of the nodes of two tree files."""

import bisect
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import NamedTuple

from sar_compiler.tree.model import EDITOR_ATTRIBUTES, MODEL_TAG, ROOT_TAG, Element, TreeFile
from sar_compiler.tree.yaml_fields import EXPLICIT_TAGS

_NAMES = ("name", "ID", "path")


@dataclass(eq=False)
class ComparedNode:
    """An element of a compared tree file.

    Attributes:
        element: The element.
        parent: The parent node; None for the root.
        type: The element's tag, or the ID of an element in the explicit form (`<Action ID="Say"/>`).
        attributes: The element's attributes, without editor attributes of the root.
        ordered: Whether the order of the children is significant.
        children: The child nodes.
        number: The index among the siblings, from 0.
        mark: A number that is equal for all equal elements of both files.
        size: The number of elements in the subtree, including this element.
        label: The node's name in a path.
        partner: The matching node of the other file; None if there is no match.
    """

    element: Element
    parent: "ComparedNode | None"
    type: str
    attributes: Mapping[str, str]
    ordered: bool
    children: "list[ComparedNode]" = field(default_factory=list)
    number: int = 0
    mark: int = 0
    size: int = 1
    label: str = ""
    partner: "ComparedNode | None" = None

    @property
    def name(self) -> str:
        """The value of `name`, `ID` or `path`; empty if the node has none of these attributes."""
        return next((self.attributes[key] for key in _NAMES if key in self.attributes), "")

    @property
    def identity(self) -> tuple[str, str]:
        """The type and the name."""
        return self.type, self.name

    @property
    def path(self) -> str:
        """The labels from the root's child down to the node, joined by slashes.

        The path of the root is the root's own label.
        """
        labels = []
        node: ComparedNode | None = self
        while node is not None and node.parent is not None:
            labels.append(node.label)
            node = node.parent
        return "/".join(reversed(labels)) or self.label

    def iterate(self) -> "Iterator[ComparedNode]":
        """Yield the node and its descendants, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.iterate()


Key = Callable[[ComparedNode], Hashable | None]
"""A function that returns the key of a node.

Two nodes are paired only if their keys are equal and not None.
"""


def match(old: TreeFile, new: TreeFile) -> tuple[ComparedNode, ComparedNode]:
    """Match the elements of two versions of a file.

    Elements are paired in three steps: first elements at the same position with equal content or an equal name, then
    moved elements, and last elements at the same position with similar content but another name or tag.

    Returns:
        The roots of both files; each node's `partner` is the matching node of the other file.
    """
    marks: dict[Hashable, int] = {}
    first, second = (_node(tree_file.root, None, marks, ordered=True) for tree_file in (old, new))
    _pair(first, second)
    _align(first, second)
    _find_moved(first, second)
    _find_renamed(first)
    return first, second


def pairs_in_order(old: ComparedNode, new: ComparedNode) -> list[tuple[ComparedNode, ComparedNode]]:
    """Return pairs of matching children that have the same order in both nodes."""
    there = {child.partner: child for child in old.children}
    pairs = [(there[child], child) for child in new.children if child in there]
    if not old.ordered:
        return pairs
    common = common_subsequence([one.number for one in old.children], [one.number for one, _ in pairs])
    return [pairs[j] for _, j in common]


def _node(
    element: Element, parent: ComparedNode | None, marks: dict[Hashable, int], *, ordered: bool
) -> ComparedNode:
    """Create a node from an element. Equal elements get equal marks."""
    kind, attributes = element.tag, dict(element.attributes)
    if kind in EXPLICIT_TAGS and "ID" in attributes and ordered:
        kind = attributes.pop("ID")
    if parent is None:
        attributes = {k: v for k, v in attributes.items() if not k.startswith(EDITOR_ATTRIBUTES)}
    # Trees and node models are identified by name, so their order is insignificant.
    inside = ordered and element.tag != MODEL_TAG
    node = ComparedNode(element, parent, kind, attributes, inside and element.tag != ROOT_TAG)
    node.children = [_node(child, node, marks, ordered=inside) for child in element.children]
    node.size += sum(child.size for child in node.children)
    node.label = node.name or node.type
    _number(node.children)
    below = [child.mark for child in node.children]
    content = (
        kind,
        frozenset(attributes.items()),
        element.text,
        tuple(below if node.ordered else sorted(below)),
    )
    node.mark = marks.setdefault(content, len(marks))
    return node


def _number(nodes: list[ComparedNode]) -> None:
    """Number siblings, and make their labels unique."""
    counts = Counter(node.label for node in nodes)
    numbers: Counter[str] = Counter()
    for number, node in enumerate(nodes):
        node.number = number
        numbers[node.label] += 1
        if counts[node.label] > 1:
            node.label = f"{node.label}[{numbers[node.label]}]"


def _pair(old: ComparedNode, new: ComparedNode) -> None:
    old.partner, new.partner = new, old


def _pair_equal(old: ComparedNode, new: ComparedNode) -> None:
    """Pair two equal nodes, with all their descendants."""
    if old.partner is not None or new.partner is not None:
        return
    _pair(old, new)
    if old.ordered:
        below = zip(old.children, new.children, strict=True)
    else:
        below = zip(*(sorted(node.children, key=lambda n: n.mark) for node in (old, new)), strict=True)
    for one, other in below:
        _pair_equal(one, other)


_mark: Key = attrgetter("mark")
_identity: Key = attrgetter("identity")


def _content(node: ComparedNode) -> Hashable | None:
    return tuple(child.mark for child in node.children) or None


def _align(old: ComparedNode, new: ComparedNode) -> None:
    """Pair the children of two matching nodes, first by mark, then by identity, then by content."""
    if not old.ordered:
        for key in (_mark, _identity):
            _pair_by_key(_without_pair(old.children), _without_pair(new.children), key)
        return
    gaps = [(_without_pair(old.children), _without_pair(new.children))]
    for key in (_mark, _identity, _content):
        gaps = [smaller for gap in gaps for smaller in _align_gap(*gap, key)]


def _align_gap(
    old: list[ComparedNode],
    new: list[ComparedNode],
    key: Key,
    accept: Callable[[ComparedNode, ComparedNode], bool] = lambda _old, _new: True,
) -> list[tuple[list[ComparedNode], list[ComparedNode]]]:
    """Pair nodes of two lists that have equal keys in the same order.

    Returns the sublists between the pairs.
    """
    keys = [[key(node) for node in nodes] for nodes in (old, new)]
    pairs = [(i, j) for i, j in common_subsequence(*keys) if accept(old[i], new[j])]
    for i, j in pairs:
        _join(old[i], new[j])
    return [gap for gap in _ranges_between(old, new, pairs) if gap[0] and gap[1]]


def _ranges_between(
    old: list[ComparedNode], new: list[ComparedNode], pairs: Sequence[tuple[int, int]]
) -> Iterator[tuple[list[ComparedNode], list[ComparedNode]]]:
    """Yield the sublists of two lists that are before, between and after the given pairs."""
    i = j = 0
    for next_i, next_j in [*pairs, (len(old), len(new))]:
        yield old[i:next_i], new[j:next_j]
        i, j = next_i + 1, next_j + 1


def _join(old: ComparedNode, new: ComparedNode) -> None:
    if old.mark == new.mark:
        _pair_equal(old, new)
    else:
        _pair(old, new)
        _align(old, new)


def _without_pair(nodes: list[ComparedNode]) -> list[ComparedNode]:
    return [node for node in nodes if node.partner is None]


def _pair_by_key(
    old: list[ComparedNode], new: list[ComparedNode], old_key: Key, new_key: Key | None = None
) -> None:
    """Pair nodes that have equal keys, at any position.

    Several nodes with the same key are paired in order.
    """
    by_key: dict[Hashable, deque[ComparedNode]] = defaultdict(deque)
    for node in new:
        by_key[(new_key or old_key)(node)].append(node)
    for node in old:
        key = old_key(node)
        candidates = by_key.get(key) if key is not None else None
        while candidates and candidates[0].partner is not None:
            candidates.popleft()
        if candidates and node.partner is None:
            _join(node, candidates.popleft())


def _find_moved(old: ComparedNode, new: ComparedNode) -> None:
    """Pair the remaining nodes by content or name.

    Large nodes, and nodes whose parents match, are paired first.
    """
    left, right = (
        sorted(_without_pair(list(root.iterate())), key=lambda node: -node.size) for root in (old, new)
    )
    _pair_by_key(
        left,
        right,
        lambda node: (node.mark, _parent_id(node, other=True)),
        lambda node: (node.mark, _parent_id(node)),
    )
    _pair_by_key(left, right, _mark)
    _pair_by_key(left, right, lambda node: node.identity if node.name else None)


def _parent_id(node: ComparedNode, *, other: bool = False) -> int:
    return id(node.parent.partner if other and node.parent else node.parent)


def _find_renamed(old: ComparedNode) -> None:
    """Pair nodes that have the same position in both files, but different names or tags."""
    for node in old.iterate():
        if node.partner is None or node.mark == node.partner.mark:
            continue
        stayed = pairs_in_order(node, node.partner) if node.ordered else []
        numbers = [(one.number, other.number) for one, other in stayed]
        gaps = [
            (_without_pair(one), _without_pair(other))
            for one, other in _ranges_between(node.children, node.partner.children, numbers)
        ]
        for key in (lambda one: one.type, lambda one: one.name or None, _shape):
            gaps = [smaller for gap in gaps for smaller in _align_gap(*gap, key, _are_similar)]


def _shape(node: ComparedNode) -> Hashable | None:
    return "parent" if node.children else None


def _are_similar(old: ComparedNode, new: ComparedNode) -> bool:
    """Return whether at least half of the content of two nodes is equal."""
    if old.children and new.children:
        ours, theirs = (Counter(child.identity for child in node.children) for node in (old, new))
        return 2 * sum((ours & theirs).values()) >= max(len(old.children), len(new.children))
    if old.children or new.children:
        return False
    if old.type != new.type:
        return old.name == new.name
    names = {*old.attributes, *new.attributes} - {"name"}
    return 2 * sum(old.attributes.get(name) == new.attributes.get(name) for name in names) >= len(names)


_NEAR = 8
"""The number of positions that are tried before and after the expected position of a repeated key."""


class _Link(NamedTuple):
    pair: tuple[int, int]
    before: "_Link | None"


def common_subsequence(
    old: Sequence[Hashable | None], new: Sequence[Hashable | None]
) -> list[tuple[int, int]]:
    """Return a long common subsequence as pairs of indices in the two lists.

    It is the longest common subsequence unless a key is repeated very often. The running time is little more than
    linear (Hunt-Szymanski algorithm).

    Args:
        old: The keys of the first list; None matches no key.
        new: The keys of the second list.
    """
    head = _common_head(old, new)
    tail = _common_head(old[head:][::-1], new[head:][::-1])
    middle = _chain_pairs(old[head : len(old) - tail], new[head : len(new) - tail])
    return [
        *((index, index) for index in range(head)),
        *((head + i, head + j) for i, j in middle),
        *((len(old) - tail + index, len(new) - tail + index) for index in range(tail)),
    ]


def _common_head(old: Sequence[Hashable | None], new: Sequence[Hashable | None]) -> int:
    count = 0
    for one, other in zip(old, new, strict=False):
        if one is None or one != other:
            break
        count += 1
    return count


def _chain_pairs(old: Sequence[Hashable | None], new: Sequence[Hashable | None]) -> list[tuple[int, int]]:
    places: dict[Hashable, list[int]] = defaultdict(list)
    for j, key in enumerate(new):
        if key is not None:
            places[key].append(j)
    met: Counter[Hashable] = Counter()
    # For each length of a chain, the earliest position in *new* at which such a chain ends, and the chain.
    ends: list[int] = []
    chains: list[_Link] = []
    for i, key in enumerate(old):
        if key is None or key not in places:
            continue
        nth = met[key]
        met[key] += 1
        # Positions are tried from last to first, so that no chain uses two positions for the same key.
        for j in reversed(places[key][max(nth - _NEAR, 0) : nth + _NEAR + 1]):
            length = bisect.bisect_left(ends, j)
            link = _Link((i, j), chains[length - 1] if length else None)
            ends[length : length + 1] = [j]
            chains[length : length + 1] = [link]
    pairs: list[tuple[int, int]] = []
    last = chains[-1] if chains else None
    while last is not None:
        pairs.append(last.pair)
        last = last.before
    return pairs[::-1]
