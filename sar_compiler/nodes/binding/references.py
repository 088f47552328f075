"""Resolution of references by name, within one tree."""

from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.collector import Collector, file_of
from sar_compiler.nodes.spec import Parameter
from sar_compiler.nodes.values import nearest
from sar_compiler.tree.model import Element

_MOST_PLACES = 10


class Candidates:
    """The nodes of a tree, indexed by class and name.

    Args:
        nodes: The nodes, in the order of the file.
    """

    def __init__(self, nodes: list[BoundNode]) -> None:
        self.nodes = nodes
        self._fitting: dict[str, list[BoundNode]] = {}

    def of(self, target: str) -> list[BoundNode]:
        """Return the nodes of a class with a given import path."""
        if target not in self._fitting:
            self._fitting[target] = [node for node in self.nodes if target in node.spec.ancestry]
        return self._fitting[target]

    def called(self, name: str) -> list[BoundNode]:
        """Return the nodes of a name."""
        return [node for node in self.nodes if node.name == name]


def resolve_references(tree: BoundTree, collector: Collector) -> None:
    """Resolve the references of a tree; those to nodes outside it are left open."""
    referring = tree.referring
    if not referring:
        return
    candidates = Candidates(tree.nodes)
    for bound in referring:
        for parameter in bound.spec.references:
            _resolve(tree, bound, parameter, candidates, collector)
    _report_circles(referring, collector)


def choose(
    bound: BoundNode, parameter: Parameter, candidates: Candidates, collector: Collector
) -> BoundNode | bool | None:
    """Return the node among the candidates that a reference refers to.

    Returns:
        The node; None if there is none of that name and class; False if there is a finding about it.
    """
    fitting = [node for node in candidates.of(parameter.target_path) if node is not bound]
    named = bound.element.attributes.get(parameter.name)
    found = fitting if named is None else [node for node in fitting if node.name == named]
    if len(found) == 1:
        return found[0]
    if not found:
        return None
    element, what = bound.element, parameter.target_name
    if named is None:
        message = f"<{bound.spec.tag}> can mean {len(found)} {what} nodes ({_places(found, element)})"
        hint = f'write {parameter.name}="{found[0].name}"'
        collector.tag(element, "ambiguous-reference", message, hint=hint)
    else:
        message = (
            f"{parameter.name}: {len(found)} {what} nodes are called '{named}' ({_places(found, element)})"
        )
        hint = "give each a name of its own"
        collector.value(element, parameter.name, "ambiguous-reference", message, hint=hint)
    return False


def report_missing(
    bound: BoundNode, parameter: Parameter, within: list[Candidates], collector: Collector
) -> None:
    """Report a reference to a node that is not in any of the visible trees.

    Args:
        bound: The node that refers.
        parameter: The reference.
        within: The nodes of its own tree and of the enclosing ones.
        collector: Collects the findings.
    """
    element, what = bound.element, parameter.target_name
    named = element.attributes.get(parameter.name)
    where = "this tree" if len(within) == 1 else "this tree or one around it"
    fitting = [
        node for candidates in within for node in candidates.of(parameter.target_path) if node is not bound
    ]
    if named is None:
        message = f"<{bound.spec.tag}> needs a {what} in {where} ({parameter.name}); there is none"
        collector.tag(element, "missing-reference", message, hint=_choices([], what))
        return
    namesakes = [node for candidates in within for node in candidates.called(named)]
    if namesakes:
        message = f"{parameter.name}: '{named}' is a {namesakes[0].spec.tag}, not a {what}"
        suggestion = fitting[0].name if len(fitting) == 1 else None
        code = "wrong-reference"
    else:
        message = f"{parameter.name}: no node in {where} is called '{named}'"
        suggestion = nearest(named, [node.name for node in fitting])
        code = "unknown-reference"
    hint = _choices(fitting, what)
    collector.value(element, parameter.name, code, message, suggestion=suggestion, hint=hint)


def _resolve(
    tree: BoundTree, bound: BoundNode, parameter: Parameter, candidates: Candidates, collector: Collector
) -> None:
    named = bound.element.attributes.get(parameter.name)
    if named is None and not parameter.required:
        return  # a default is the author's word for "nothing unless it is written"
    found = choose(bound, parameter, candidates, collector)
    if isinstance(found, BoundNode):
        bound.references = {**bound.references, parameter.name: found}
    elif found is None and named not in tree.unknown_names:
        tree.open_references.append((bound, parameter))


def _report_circles(nodes: list[BoundNode], collector: Collector) -> None:
    for bound in nodes:
        if not bound.references:
            continue
        passed: list[BoundNode] = []
        following = list(bound.references.values())
        while following:
            node = following.pop()
            if node is bound:
                message = f"'{bound.name}' refers to itself by way of {', '.join(n.name for n in passed)}"
                collector.tag(bound.element, "circular-reference", message)
                break
            if node not in passed:
                passed.append(node)
                # A node is made after those it refers to, and after those in it.
                following.extend([*node.references.values(), *node.children])


def _places(nodes: list[BoundNode], seen_from: Element) -> str:
    """Describe the places of nodes of one tree; of many only the first ones."""
    lines = ", ".join(str(node.element.line) for node in nodes[:_MOST_PLACES])
    more = f" and {len(nodes) - _MOST_PLACES} more" if len(nodes) > _MOST_PLACES else ""
    return f"lines {lines}{more}{file_of(nodes[0].element, seen_from)}"


def _choices(fitting: list[BoundNode], what: str) -> str:
    names = [f"'{node.name}'" for node in fitting]
    return f"{what} nodes of this tree: {', '.join(names)}" if names else f"add a <{what}> to the tree"
