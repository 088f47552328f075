"""What each bound node can answer, whether that can take time, and what is done again when it is ticked anew.

Worked out once for all rules, from the inside out: what leaves declare, and what controls and decorators make of it
(`nodes.semantics`). Of a node that only a model describes, or that declares nothing, nothing is concluded: it may answer
anything, and is known to be able to answer nothing.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.language.py_trees_nodes import REMOVES, WRITES
from sar_compiler.nodes.outcome_sets import ALL, ALLOWED, SURE, F, K, R, S, bits
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Kind, NodeSpec

_YES_OR_NO: tuple[frozenset[str], ...] = (frozenset(), frozenset({"SUCCESS", "FAILURE"}))
_SHIFT = 4
_UNKNOWN = ALL
_POSSIBLE = {"_failureIf": F, "_successIf": S, "_skipIf": K, "_while": K}
"""What conditions add."""

OutcomeSets = int
"""What a node may answer, in the lower bits, and what it is known to be able to answer, above them."""


@dataclass(frozen=True)
class Found:
    """A leaf that was looked for.

    Attributes:
        leaf: The leaf.
        place: Where it stands in the tree that was searched: the leaf itself, or the `SubTree` that has it.
    """

    leaf: BoundNode
    place: BoundNode

    @property
    def name(self) -> str:
        """What to call it: the leaf's name, with the subtree where that is another tree."""
        inside = (
            "" if self.leaf is self.place else f" in the tree '{self.place.element.attributes.get('ID')}'"
        )
        return f"'{self.leaf.name}'{inside}"


class PossibleOutcomes:
    """The outcomes of all nodes of some trees.

    Args:
        trees: The trees, the inner ones first.
        broken: Nodes of which nothing is to be concluded.

    Attributes:
        blocked: The sequences and selectors in which no tick comes to the end.
        running: Those in which something is known to take time.
    """

    def __init__(self, trees: Iterable[BoundTree], broken: Collection[BoundNode] = ()) -> None:
        self._broken = broken
        self._leaves: dict[int, OutcomeSets] = {}
        self._known: dict[BoundNode, OutcomeSets] = {}
        self._alike: dict[object, tuple[OutcomeSets, bool, bool]] = {}
        self.blocked: list[BoundNode] = []
        self.running: list[BoundNode] = []
        for tree in trees:
            self._look_at(tree)

    def may_return(self, bound: BoundNode) -> int:
        """Return everything that a tick of a node could answer."""
        return self._of(bound) & ALL

    def known_to_return(self, bound: BoundNode) -> int:
        """Return what a tick of a node is known to be able to answer."""
        return self._of(bound) >> _SHIFT

    def takes_time(self, bound: BoundNode) -> bool:
        """Say whether a node is known to run for more than a tick."""
        return bool(self.known_to_return(bound) & R)

    def begun_again(self, bound: BoundNode, wanted: Callable[[BoundNode], bool]) -> Found | None:
        """Return the first leaf that is begun again whenever a node is, if one is as wanted.

        What depends on an answer is passed over: what stands behind the first child of a selector, in a branch, or
        under a condition. So is what is done once.
        """
        if bound.oneshot is not None or bound.conditions or bound in self._broken:
            return None
        if bound.subtree is not None:
            inner = self.begun_again(bound.subtree.root, wanted) if bound.subtree.root else None
            return None if inner is None else Found(inner.leaf, bound)
        if not bound.children:
            return Found(bound, bound) if bound.spec.kind.is_leaf and wanted(bound) else None
        means = bound.spec.semantics
        if means.order is not Order.IN_ORDER and not means.steady:
            return None
        first = bound.children if means.is_sequence else bound.children[:1]
        return next((found for child in first if (found := self.begun_again(child, wanted))), None)

    def anywhere(self, bound: BoundNode, wanted: Callable[[BoundNode], bool]) -> Found | None:
        """Return the first leaf in a node that is as wanted."""
        if bound.subtree is not None:
            inner = self.anywhere(bound.subtree.root, wanted) if bound.subtree.root else None
            return None if inner is None else Found(inner.leaf, bound)
        if bound.spec.kind.is_leaf:
            return Found(bound, bound) if wanted(bound) else None
        return next((found for child in bound.children if (found := self.anywhere(child, wanted))), None)

    def acts_at_once(self, leaf: BoundNode) -> bool:
        """Say whether a leaf does something to the world, and is done with it in the same tick."""
        return acts(leaf) and not self.takes_time(leaf)

    def works(self, leaf: BoundNode) -> bool:
        """Say whether a leaf takes time from its beginning whenever it is started."""
        return self.takes_time(leaf) and leaf.spec.kind is Kind.ACTION and not leaf.spec.semantics.resumes

    def is_work(self, leaf: BoundNode) -> bool:
        """Say whether a leaf does something to the world, and takes time for it."""
        return acts(leaf) and self.works(leaf)

    def _of(self, bound: BoundNode) -> OutcomeSets:
        return self._known.get(bound) or self._leaves.get(id(bound.spec)) or self._leaf(bound)

    def _look_at(self, tree: BoundTree) -> None:
        if tree.wrappers or self._broken:
            for node in tree.nodes:
                if not node.children and (node.conditions or node in self._broken):
                    self._known[node] = self._conditioned(node, self._leaf(node))
        for use in tree.uses:
            root = use.subtree.root if use.subtree is not None else None
            self._known[use] = self._conditioned(use, _UNKNOWN if root is None else self._of(root))
        # Inlined: a large tree has little else that costs time here.
        known, leaves, leaf = self._known.get, self._leaves.get, self._leaf
        for parent in tree.parents:
            children = tuple(
                [known(child) or leaves(id(child.spec)) or leaf(child) for child in parent.children]
            )
            if len(children) != len(parent.element.children):
                self._known[parent] = _UNKNOWN
                continue
            if parent.spec.semantics.order is Order.IN_ORDER:
                outcome_sets = self._ordered(parent, children)
            else:
                outcome_sets = _made_of(parent, children)
            if parent.conditions or parent in self._broken:
                outcome_sets = self._conditioned(parent, outcome_sets)
            self._known[parent] = outcome_sets

    def _ordered(self, bound: BoundNode, children: tuple[OutcomeSets, ...]) -> OutcomeSets:
        """Return the outcome_sets of a sequence or selector, which depends on its children alone."""
        # Of a reactive one it matters which children are leaves.
        leaves = bound.is_reactive and tuple(child.spec.kind.is_leaf for child in bound.children)
        key = (id(bound.spec), children, leaves)
        known = self._alike.get(key)
        if known is None:
            passing = bound.spec.semantics.goes_on | K
            known = self._alike[key] = (
                _made_of(bound, children),
                any(not child & passing for child in children[:-1]),
                any(child >> _SHIFT & R for child in children),
            )
        outcome_sets, is_blocked, is_running = known
        if is_blocked:
            self.blocked.append(bound)
        if is_running:
            self.running.append(bound)
        return outcome_sets

    def _leaf(self, bound: BoundNode) -> OutcomeSets:
        """Return the outcome_sets of a leaf without conditions; nodes without the children that they need are unknown."""
        spec = bound.spec
        if not spec.kind.is_leaf:
            return _UNKNOWN
        outcome_sets = _made_of(bound, ())
        if spec.semantics.possible is None:
            self._leaves[id(spec)] = outcome_sets
        return outcome_sets

    def _conditioned(self, bound: BoundNode, outcome_sets: OutcomeSets) -> OutcomeSets:
        if bound in self._broken:
            return _UNKNOWN
        for condition in bound.conditions:
            outcome_sets |= _POSSIBLE.get(condition, 0)
        return outcome_sets


def is_telling(spec: NodeSpec) -> bool:
    """Say whether anything may follow from a node: of one that says yes or no at once, or nothing, nothing does."""
    if not spec.kind.is_leaf:
        return spec.semantics.order is not Order.IN_ORDER
    outcomes = spec.outcomes if spec.cls is not None else frozenset()
    return bool(spec.effects or spec.uses) or outcomes not in _YES_OR_NO


def acts(leaf: BoundNode) -> bool:
    """Say whether a leaf is known to do something to the world; the blackboard is none of it."""
    spec = leaf.spec
    if spec.cls is None:
        return False
    return (bool(spec.effects) and spec.effects not in (WRITES, REMOVES)) or _drives(spec)


def is_question(leaf: BoundNode) -> bool:
    """Say whether a leaf only asks something."""
    return leaf.spec.kind is Kind.CONDITION and leaf.spec.cls is not None


def consequence(leaf: BoundNode) -> str:
    """Return what it would mean to begin a leaf again in every tick: "would be sent a new goal in every tick"."""
    if _drives(leaf.spec):
        return "would be sent a new goal in every tick"
    verb, _, rest = leaf.spec.effects.partition(" ")
    if not verb.endswith("s") or not rest:
        return "would be started again in every tick"
    return f"would {_infinitive(verb)} {rest} in every tick"


def _infinitive(verb: str) -> str:
    """Return the first word of what a leaf does as it stands behind "would": drive, search, carry."""
    if verb.endswith("ies"):
        return f"{verb[:-3]}y"
    return verb[:-2] if verb.endswith(("ches", "shes", "sses", "xes", "oes")) else verb[:-1]


def _drives(spec: NodeSpec) -> bool:
    return any(use.kind == "action" for use in spec.uses)


def _made_of(bound: BoundNode, children: Sequence[OutcomeSets]) -> OutcomeSets:
    """Return the outcome_sets of a node without conditions."""
    spec, possible = bound.spec, bound.spec.semantics.possible
    if possible is None:
        # Somebody's own: it may do anything with its children.
        known = bits(spec.outcomes)
        return known | known << _SHIFT if known and spec.cls is not None else _UNKNOWN
    least, most = spec.child_count
    if not least <= len(children) <= (most or len(children)):
        return _UNKNOWN
    may = possible(bound, [child & ALL for child in children], ALLOWED)
    return may | possible(bound, [child >> _SHIFT for child in children], SURE) << _SHIFT
