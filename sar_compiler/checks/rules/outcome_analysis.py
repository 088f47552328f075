"""The possible results of each bound node, whether the node can take time, and the leaves that a restart repeats.

The results are computed once for all rules, from the leaves to the root. They follow from the declarations of leaves
and the semantics of controls and decorators (`nodes.semantics`). A node that declares nothing, or that only a model
describes, may return any status, but none is known to occur.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import NamedTuple

from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.collector import file_of
from sar_compiler.nodes.outcome_sets import ALL, ALLOWED, SURE, F, K, R, S, bits, constant_condition
from sar_compiler.nodes.semantics import REMOVES, WRITES, Order
from sar_compiler.nodes.spec import Kind, NodeSpec

_YES_OR_NO: tuple[frozenset[str], ...] = (frozenset(), frozenset({"SUCCESS", "FAILURE"}))
_SHIFT = 4
_UNKNOWN = ALL
_CONDITIONS = {"_failureIf": (True, F), "_successIf": (True, S), "_skipIf": (True, K), "_while": (False, K)}
"""For each condition attribute, the truth value that decides the node's result, and the resulting outcome set.

The attributes are listed in the order in which a node evaluates them.
"""

OutcomeSets = int
"""Two outcome sets in one integer.

The lower four bits are a node's possible results. The higher bits are the results that occur in some run.
"""


class FoundLeaf(NamedTuple):
    """A leaf below a searched node.

    Attributes:
        leaf: The leaf.
        place: The leaf itself, or the `SubTree` node of the searched tree that contains the leaf.
    """

    leaf: BoundNode
    place: BoundNode

    @property
    def name(self) -> str:
        """The leaf's name in messages, with the name of its tree if the leaf is in another tree."""
        inside = (
            "" if self.leaf is self.place else f" in the tree '{self.place.element.attributes.get('ID')}'"
        )
        return f"'{self.leaf.name}'{inside}"

    def name_next_to(self, other: BoundNode) -> str:
        """Return the leaf's name for a message that also names another node."""
        return self.name if self.leaf.name != other.name else name_next_to(self.leaf, other)


def name_next_to(bound: BoundNode, other: BoundNode) -> str:
    """Return a node's name for a message that also names another node.

    If the names are equal, add the node's line.
    """
    if bound.name != other.name:
        return f"'{bound.name}'"
    return f"'{bound.name}' (line {bound.element.line}{file_of(bound.element, other.element)})"


class PossibleOutcomes:
    """The possible outcomes of all nodes of a set of trees.

    Args:
        trees: The trees, subtrees first.
        broken: The nodes with errors, which may return any status.

    Attributes:
        blocked: The sequences and selectors that never continue after one of their children.
        running: The sequences and selectors with a child that is known to take time.
    """

    def __init__(self, trees: Iterable[BoundTree], broken: Collection[BoundNode] = ()) -> None:
        self._broken = broken
        self._leaves: dict[int, OutcomeSets] = {}
        self._known: dict[BoundNode, OutcomeSets] = {}
        self._alike: dict[object, tuple[OutcomeSets, bool, bool]] = {}
        self.blocked: list[BoundNode] = []
        self.running: list[BoundNode] = []
        for tree in trees:
            self._analyze(tree)

    def possible_results(self, bound: BoundNode) -> int:
        """Return all possible results of a node's tick."""
        return self._outcome_sets(bound) & ALL

    def certain_results(self, bound: BoundNode) -> int:
        """Return the results of a node's tick that are known to occur in some run."""
        return self._outcome_sets(bound) >> _SHIFT

    def takes_time(self, bound: BoundNode) -> bool:
        """Return whether a node is known to run for more than one tick in some run."""
        return bool(self.certain_results(bound) & R)

    def find_restarted(self, bound: BoundNode, wanted: Callable[[BoundNode], bool]) -> FoundLeaf | None:
        """Return the first leaf below a node that meets a condition and restarts whenever the node restarts.

        The search skips leaves that are ticked only after particular results: leaves after the first child of a selector,
        in a branch, or under a condition. It also skips nodes that are executed only once.
        """
        if bound.oneshot is not None or bound.conditions or bound in self._broken:
            return None
        if bound.subtree is not None:
            inner = self.find_restarted(bound.subtree.root, wanted) if bound.subtree.root else None
            return None if inner is None else FoundLeaf(inner.leaf, bound)
        if not bound.children:
            return FoundLeaf(bound, bound) if bound.spec.kind.is_leaf and wanted(bound) else None
        means = bound.spec.semantics
        if means.order is not Order.IN_ORDER and not means.steady:
            return None
        first = bound.children if means.is_sequence else bound.children[:1]
        return next((found for child in first if (found := self.find_restarted(child, wanted))), None)

    def find_leaf(self, bound: BoundNode, wanted: Callable[[BoundNode], bool]) -> FoundLeaf | None:
        """Return the first leaf below a node that meets a condition."""
        if bound.subtree is not None:
            inner = self.find_leaf(bound.subtree.root, wanted) if bound.subtree.root else None
            return None if inner is None else FoundLeaf(inner.leaf, bound)
        if bound.spec.kind.is_leaf:
            return FoundLeaf(bound, bound) if wanted(bound) else None
        return next((found for child in bound.children if (found := self.find_leaf(child, wanted))), None)

    def acts_at_once(self, leaf: BoundNode) -> bool:
        """Return whether a leaf affects the world, and the effect is complete within the tick."""
        return has_world_effect(leaf) and not self.takes_time(leaf)

    def always_takes_time(self, leaf: BoundNode) -> bool:
        """Return whether a leaf takes time after every start."""
        return self.takes_time(leaf) and leaf.spec.kind is Kind.ACTION and not leaf.spec.semantics.resumes

    def is_work(self, leaf: BoundNode) -> bool:
        """Return whether a leaf affects the world, and the effect takes time."""
        return has_world_effect(leaf) and self.always_takes_time(leaf)

    def _outcome_sets(self, bound: BoundNode) -> OutcomeSets:
        return self._known.get(bound) or self._leaves.get(id(bound.spec)) or self._leaf(bound)

    def _analyze(self, tree: BoundTree) -> None:
        if tree.wrappers or self._broken:
            for node in tree.nodes:
                if not node.children and (node.conditions or node in self._broken):
                    self._known[node] = self._apply_conditions(node, self._leaf(node))
        for use in tree.uses:
            root = use.subtree.root if use.subtree is not None else None
            self._known[use] = self._apply_conditions(
                use, _UNKNOWN if root is None else self._outcome_sets(root)
            )
        # `_outcome_sets` is inlined, because this loop dominates the time for a large tree.
        known, leaves, leaf = self._known.get, self._leaves.get, self._leaf
        for parent in tree.parents:
            children = tuple(
                [known(child) or leaves(id(child.spec)) or leaf(child) for child in parent.children]
            )
            if len(children) != len(parent.element.children):
                self._known[parent] = _UNKNOWN
                continue
            if parent.spec.semantics.order is Order.IN_ORDER:
                outcome_sets = self._ordered_outcomes(parent, children)
            else:
                outcome_sets = _outcomes_of_node(parent, children)
            if parent.conditions or parent in self._broken:
                outcome_sets = self._apply_conditions(parent, outcome_sets)
            self._known[parent] = outcome_sets

    def _ordered_outcomes(self, bound: BoundNode, children: tuple[OutcomeSets, ...]) -> OutcomeSets:
        """Compute the outcome sets of a sequence or selector from the outcome sets of its children."""
        # For a reactive control the result depends on which children are leaves.
        leaves = bound.is_reactive and tuple(child.spec.kind.is_leaf for child in bound.children)
        key = (id(bound.spec), children, leaves)
        known = self._alike.get(key)
        if known is None:
            passing = bound.spec.semantics.goes_on | K
            known = self._alike[key] = (
                _outcomes_of_node(bound, children),
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
        """Return the outcome sets of a leaf without conditions."""
        spec = bound.spec
        if not spec.kind.is_leaf:
            return _UNKNOWN
        outcome_sets = _outcomes_of_node(bound, ())
        if spec.semantics.possible is None:
            self._leaves[id(spec)] = outcome_sets
        return outcome_sets

    def _apply_conditions(self, bound: BoundNode, outcome_sets: OutcomeSets) -> OutcomeSets:
        if bound in self._broken:
            return _UNKNOWN
        added = 0
        for name, (deciding, result) in _CONDITIONS.items():
            script = bound.conditions.get(name)
            if script is None:
                continue
            truth = constant_condition(script)
            if truth is deciding:
                return added | result | result << _SHIFT
            added |= result if truth is None else 0
        return outcome_sets | added


def is_informative(spec: NodeSpec) -> bool:
    """Return whether a node declares more than an immediate success or failure."""
    if not spec.kind.is_leaf:
        return spec.semantics.order is not Order.IN_ORDER
    outcomes = spec.statuses if not spec.is_only_described else frozenset()
    return bool(spec.effects or spec.uses) or outcomes not in _YES_OR_NO


def has_world_effect(leaf: BoundNode) -> bool:
    """Return whether a leaf is known to have an effect on the world, not only on the blackboard."""
    spec = leaf.spec
    if spec.is_only_described:
        return False
    return (bool(spec.effects) and spec.effects not in (WRITES, REMOVES)) or _drives(spec)


def is_question(leaf: BoundNode) -> bool:
    """Return whether a leaf only evaluates a condition."""
    return leaf.spec.kind is Kind.CONDITION and not leaf.spec.is_only_described


def consequence(leaf: BoundNode) -> str:
    """Describe the consequence of restarting a leaf in every tick, such as "would be sent a new goal in every tick"."""
    if _drives(leaf.spec):
        return "would be sent a new goal in every tick"
    verb, _, rest = leaf.spec.effects.partition(" ")
    if not verb.endswith("s") or not rest:
        return "would be restarted in every tick"
    return f"would {_infinitive(verb)} {rest} in every tick"


def _infinitive(verb: str) -> str:
    """Return the infinitive of a verb in the third person: "carry" for "carries"."""
    if verb.endswith("ies"):
        return f"{verb[:-3]}y"
    return verb[:-2] if verb.endswith(("ches", "shes", "sses", "xes", "oes")) else verb[:-1]


def _drives(spec: NodeSpec) -> bool:
    return any(use.kind == "action" for use in spec.uses)


def _outcomes_of_node(bound: BoundNode, children: Sequence[OutcomeSets]) -> OutcomeSets:
    """Return the outcome sets of a node without conditions."""
    spec, possible = bound.spec, bound.spec.semantics.possible
    if possible is None:
        # A custom node may tick its children in any way.
        known = bits(spec.statuses)
        return known | known << _SHIFT if known and not spec.is_only_described else _UNKNOWN
    least, most = spec.child_count
    if not least <= len(children) <= (most or len(children)):
        return _UNKNOWN
    may = possible(bound, [child & ALL for child in children], ALLOWED)
    return may | possible(bound, [child >> _SHIFT for child in children], SURE) << _SHIFT
