"""Resolution of references to other nodes of the same tree."""

import itertools
from collections.abc import Collection, Mapping
from graphlib import CycleError, TopologicalSorter

from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.collector import FindingCollector, file_of
from sar_compiler.nodes.spec import Parameter
from sar_compiler.nodes.values import MOST_LISTED, join_with_commas


class ReferenceCandidates:
    """The nodes of a tree, indexed by class and name."""

    def __init__(self, nodes: list[BoundNode], collector: FindingCollector) -> None:
        self.collector = collector
        self._nodes = nodes
        # The nodes of each class in order, and the nodes of each class (None: all classes) by name.
        self._fitting: dict[str, dict[BoundNode, None]] = {}
        self._called: dict[str | None, dict[str, dict[BoundNode, None]]] = {}

    def candidates(self, parameter: Parameter) -> Collection[BoundNode]:
        """Return the nodes to which a parameter may refer."""
        target = parameter.target_path
        if target not in self._fitting:
            self._fitting[target] = {node: None for node in self._nodes if node.spec.is_class_of(parameter)}
        return self._fitting[target]

    def names(self, parameter: Parameter | None = None) -> Mapping[str, Collection[BoundNode]]:
        """Return the nodes to which a parameter may refer, by node name. Without a parameter, return all nodes."""
        target = parameter.target_path if parameter is not None else None
        if target not in self._called:
            by_name = self._called[target] = {}
            for node in self._nodes if parameter is None else self.candidates(parameter):
                by_name.setdefault(node.name, {})[node] = None
        return self._called[target]

    def resolve(self, bound: BoundNode, parameter: Parameter) -> BoundNode | bool | None:
        """Find the node to which a reference refers.

        Returns:
            The node; None if no node has the required name and class; False, after a finding, if several nodes have
            this name and class.
        """
        named = bound.element.attributes.get(parameter.name)
        found = self.candidates(parameter) if named is None else self.names(parameter).get(named, ())
        count = len(found) - (bound in found)
        first = list(itertools.islice((node for node in found if node is not bound), MOST_LISTED))
        if not count:
            return None
        if count == 1:
            return first[0]
        element, what = bound.element, parameter.target_name
        places = f"lines {join_with_commas([str(node.element.line) for node in first], count)}{file_of(first[0].element, element)}"
        if named is None:
            message = f"<{bound.spec.tag}> matches {count} {what} nodes ({places})"
            hint = f'write {parameter.name}="{first[0].name}"'
            self.collector.add("ambiguous-reference", message, element, hint=hint)
        else:
            message = f"{parameter.name}: {count} {what} nodes are named '{named}' ({places})"
            hint = "give each node a unique name"
            self.collector.add("ambiguous-reference", message, element, value=parameter.name, hint=hint)
        return False


def resolve_references(tree: BoundTree, collector: FindingCollector) -> None:
    """Resolve the references in a tree. References to nodes outside of the tree stay unresolved."""
    referring = tree.referring
    if not referring:
        return
    candidates = ReferenceCandidates(tree.nodes, collector)
    for bound in referring:
        for parameter in bound.spec.references:
            _resolve(tree, bound, parameter, candidates)
    _report_circles(referring, collector)


def report_missing_reference(
    bound: BoundNode, parameter: Parameter, within: list[ReferenceCandidates]
) -> None:
    """Report a reference to a node that no visible tree contains."""
    element, what, collector = bound.element, parameter.target_name, within[0].collector
    named = element.attributes.get(parameter.name)
    where = "this tree" if len(within) == 1 else "this tree or an enclosing tree"
    if named is None:
        message = f"<{bound.spec.tag}> needs a {what} in {where} ({parameter.name}), but there is none"
        collector.add("missing-reference", message, element, hint=f"add a <{what}> to the tree")
        return
    count = sum(len(each.candidates(parameter)) - (bound in each.candidates(parameter)) for each in within)
    fitting = (node for each in within for node in each.candidates(parameter) if node is not bound)
    names = [f"'{node.name}'" for node in itertools.islice(fitting, MOST_LISTED)]
    namesake = next((node for each in within for node in each.names().get(named, ())), None)
    if namesake is not None:
        message = f"{parameter.name}: '{named}' is a {namesake.spec.tag}, not a {what}"
        suggestion = names[0].strip("'") if count == 1 else None
        code = "wrong-reference"
    else:
        message = f"{parameter.name}: no node in {where} is named '{named}'"
        near = (collector.guesses.nearest(named, each.names(parameter)) for each in within)
        suggestion = next((name for name in near if name is not None), None)
        code = "unknown-reference"
    hint = (
        f"{what} nodes of this tree: {join_with_commas(names, count)}"
        if count
        else f"add a <{what}> to the tree"
    )
    collector.add(code, message, element, value=parameter.name, suggestion=suggestion, hint=hint)


def _resolve(
    tree: BoundTree, bound: BoundNode, parameter: Parameter, candidates: ReferenceCandidates
) -> None:
    named = bound.element.attributes.get(parameter.name)
    if named is None and not parameter.required:
        return  # an optional reference is resolved only if it is written
    found = candidates.resolve(bound, parameter)
    if isinstance(found, BoundNode):
        bound.references = {**bound.references, parameter.name: found}
    elif found is None and named not in tree.unknown_names:
        tree.open_references.append((bound, parameter))


def _report_circles(nodes: list[BoundNode], collector: FindingCollector) -> None:
    graph: dict[BoundNode, list[BoundNode]] = {}
    waiting = list(nodes)
    while waiting:
        node = waiting.pop()
        if node not in graph:
            # A node is created after its references and its children.
            graph[node] = [*node.references.values(), *node.children]
            waiting.extend(graph[node])
    try:
        TopologicalSorter(graph).prepare()
    except CycleError:
        for bound in nodes:
            _report_circle(bound, graph, collector)


def _report_circle(
    bound: BoundNode, graph: Mapping[BoundNode, list[BoundNode]], collector: FindingCollector
) -> None:
    passed: dict[BoundNode, None] = {}
    following = list(bound.references.values())
    while following:
        node = following.pop()
        if node is bound:
            message = (
                f"'{bound.name}' refers to itself through {join_with_commas([each.name for each in passed])}"
            )
            collector.add("circular-reference", message, bound.element)
            return
        if node not in passed:
            passed[node] = None
            following.extend(graph[node])
