"""Expansion of subtrees into instances, each with its keys and its resolved references."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.references import ReferenceCandidates, report_missing_reference
from sar_compiler.nodes.btcpp import NAMES
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.spec import Parameter
from sar_compiler.nodes.values import literal_value
from sar_compiler.runtime.blackboard import STROKE, Board, Scope


@dataclass(eq=False, repr=False)
class TreeInstance:
    """One use of a tree, as the main tree or as a subtree.

    Attributes:
        tree: The tree.
        scope: The scope in which the keys of this instance are looked up.
        around: The enclosing instance; None for the main tree.
        place: The `SubTree` node in the enclosing instance that refers to this instance; None for the main tree.
        inner: The instances in this instance, by `SubTree` node.
        references: The nodes to which the open references of the tree are resolved, with their instances.
        texts: The keys whose constants look like numbers, although a port reads these constants as strings.
    """

    tree: BoundTree
    scope: Scope
    around: "TreeInstance | None" = None
    place: BoundNode | None = None
    inner: "dict[BoundNode, TreeInstance]" = field(default_factory=dict)
    references: "dict[tuple[BoundNode, str], tuple[TreeInstance, BoundNode]]" = field(default_factory=dict)
    texts: set[str] = field(default_factory=set)

    def constants(self) -> Iterator[tuple[str, int | float | str]]:
        """Yield each key for which the `SubTree` node provides a constant, with the constant."""
        for key, text in self.place.remapping.constants.items() if self.place is not None else ():
            yield key, text if key in self.texts else literal_value(text)

    def target_of(self, bound: BoundNode, name: str) -> "tuple[TreeInstance, BoundNode] | None":
        """Return the node to which a reference resolves, with the node's instance; None without a reference."""
        target = bound.references.get(name)
        return (self, target) if target is not None else self.references.get((bound, name))

    def chain(self) -> "Iterator[TreeInstance]":
        """Yield this instance and the enclosing instances, from the inside out."""
        instance: TreeInstance | None = self
        while instance is not None:
            yield instance
            instance = instance.around

    def iterate(self) -> "Iterator[TreeInstance]":
        """Yield this instance and all instances in it."""
        yield self
        for instance in self.inner.values():
            yield from instance.iterate()

    def in_place(self) -> "Iterator[tuple[TreeInstance, BoundNode]]":
        """Yield each node of `BoundTree.demanding` with its instance.

        The nodes of a subtree follow their `SubTree` node.
        """
        for bound in self.tree.demanding:
            yield self, bound
            if bound in self.inner:
                yield from self.inner[bound].in_place()


def expand(main: BoundTree, collector: FindingCollector) -> TreeInstance:
    """Expand every subtree.

    Args:
        main: The tree to execute; it must be within the limits (`nesting.check_size_limits`).
        collector: The collector of findings about unresolved references and subtrees with the same name.

    Returns:
        The main tree's instance.
    """
    expansion = _SubtreeExpander(collector)
    top = TreeInstance(main, Scope(Board(main.name)))
    expansion.fill(top)
    expansion.resolve(top)
    for inner, key in _numbers_read_as_strings(top):
        inner.texts.add(key)
    return top


class _SubtreeExpander:
    def __init__(self, collector: FindingCollector) -> None:
        self._collector = collector
        self._candidates: dict[BoundTree, ReferenceCandidates] = {}
        self._count = 0

    def fill(self, instance: TreeInstance) -> None:
        """Create the instances inside an instance, and number the nodes in the order of the file."""
        names: set[str] = set()
        for bound in instance.tree.nodes:
            self._count += 1
            if bound.subtree is None:
                continue
            name = bound.element.attributes.get("name") or f"{bound.subtree.name}::{self._count}"
            if name in names:
                message, hint = (
                    f"two subtrees in this tree are named '{name}'",
                    "give each subtree a unique name",
                )
                self._collector.report_rejected_since(NAMES, bound.element, message, value="name", hint=hint)
                name = f"{name}::{self._count}"  # so that each subtree has separate keys
            names.add(name)
            inner = instance.inner[bound] = TreeInstance(
                bound.subtree, _scope(instance.scope, name, bound), instance, bound
            )
            self.fill(inner)

    def resolve(self, top: TreeInstance) -> None:
        """Resolve the open references, whose nodes are in enclosing trees."""
        reported: set[tuple[BoundNode, str]] = set()
        for instance in top.iterate():
            for bound, parameter in instance.tree.open_references:
                self._resolve(instance, bound, parameter, reported)

    def _resolve(
        self,
        instance: TreeInstance,
        bound: BoundNode,
        parameter: Parameter,
        reported: set[tuple[BoundNode, str]],
    ) -> None:
        place = (bound, parameter.name)
        named = bound.element.attributes.get(parameter.name)
        for outer in list(instance.chain())[1:]:
            found = self._nodes(outer.tree).resolve(bound, parameter)
            if isinstance(found, BoundNode):
                instance.references[place] = (outer, found)
                self._report_circle(instance, bound, found, outer)
            if found is not None or named in outer.tree.unknown_names:
                return
        if place not in reported:
            reported.add(place)
            within = [self._nodes(each.tree) for each in instance.chain()]
            report_missing_reference(bound, parameter, within)

    def _report_circle(
        self, instance: TreeInstance, bound: BoundNode, found: BoundNode, outer: TreeInstance
    ) -> None:
        """Report a reference to a node that can be created only after the instance with the reference."""
        places = {each.place for each in instance.chain() if each.around is outer}
        passed, waiting = set(), [found]
        while waiting:
            node = waiting.pop()
            if node in places:
                message = f"'{bound.name}' refers to '{found.name}', which is created after the subtree of '{bound.name}'"
                self._collector.add("circular-reference", message, bound.element)
                return
            if node not in passed:
                passed.add(node)
                waiting.extend([*node.references.values(), *node.children])

    def _nodes(self, tree: BoundTree) -> ReferenceCandidates:
        if tree not in self._candidates:
            self._candidates[tree] = ReferenceCandidates(tree.nodes, self._collector)
        return self._candidates[tree]


def _scope(around: Scope, name: str, bound: BoundNode) -> Scope:
    remapping = bound.remapping
    name = name.replace("/", STROKE)
    path = f"{around.path}/{name}" if around.path else name
    own = frozenset(remapping.constants)
    return Scope(around.board, path, around, remapping.keys, autoremap=remapping.autoremap, own=own)


def _numbers_read_as_strings(top: TreeInstance) -> Iterator[tuple[TreeInstance, str]]:
    """Yield the instances and keys of constants that look like numbers but are read as strings."""
    numbers = {
        (inner.scope, key): inner
        for instance in top.iterate()
        for bound, inner in instance.inner.items()
        for key, text in bound.remapping.constants.items()
        if not isinstance(literal_value(text), str)
    }
    for instance in top.iterate() if numbers else ():
        for bound in instance.tree.keyed:
            for name, key in bound.keys.items():
                parameter, entry = bound.spec.parameters[name], instance.scope.owner(key)
                if (
                    parameter.direction is not None
                    and parameter.value_type.python is str
                    and entry in numbers
                ):
                    yield numbers[entry], entry[1]
