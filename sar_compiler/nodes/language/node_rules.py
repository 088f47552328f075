"""Functions shared by the specs of built-in nodes, and rules about attributes and children."""

from typing import Any

from sar_compiler.nodes.btcpp import BUILT_IN
from sar_compiler.nodes.collector import FindingCollector, NodeView
from sar_compiler.nodes.declaring import node_spec
from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, SkipPossibility, SkipSupport
from sar_compiler.nodes.values import ConversionError, items_of
from sar_compiler.tree.guessing import nearest

HOW_TO_SELECT = 'write the names of the children that must succeed, for example selected="left;right"'
EMPTY_QUEUE = "queue: the list of statuses is empty (write for example RUNNING;SUCCESS)"


def report_excessive_counts(bound: NodeView, collector: FindingCollector) -> None:
    """Report attributes whose number of children exceeds the number of children in the file."""
    there = len(bound.element.children)
    for name in bound.counts:
        wanted = bound.values.get(name)
        if isinstance(wanted, int) and wanted > there > 0:
            message = f"{name}: the node needs {wanted} children, but has {there}"
            collector.add("out-of-reach", message, bound.element, value=name, hint=f"write {there} or fewer")


def report_interruptions(bound: NodeView, collector: FindingCollector) -> None:
    """Report the second AsyncSequence in a reactive sequence.

    Whenever the second one pauses, the first one starts over and interrupts the second one, so neither ends.
    """
    if bound.value("memory") is not False:
        return
    pausing = [child.element for child in bound.children if child.tag == "AsyncSequence"]
    for child in pausing[1:]:
        message = (
            f"a second AsyncSequence in '{bound.name}' never ends, because the first AsyncSequence is restarted "
            "in every tick and interrupts it"
        )
        collector.add("interrupted-child", message, child, hint="combine both in one AsyncSequence")


def report_empty_queue(bound: NodeView, collector: FindingCollector) -> None:
    """Report a queue without statuses."""
    if bound.values.get("queue") == [] and "eventually" not in bound.element.attributes:
        collector.add("wrong-value", EMPTY_QUEUE, bound.element, value="queue")


def report_policy(bound: NodeView, collector: FindingCollector) -> None:
    """Report attributes that conflict with a Parallel's policy, and selected children that do not exist."""
    element, policy = bound.element, bound.values.get("policy")
    if policy is None:  # a key, or an invalid value
        return
    written = element.attributes.get("selected")
    clash = policy_conflict(policy, bound.values.get("synchronise"), is_selected=written is not None)
    if clash is not None:
        attribute, message = clash
        collector.add("conflicting-attributes", f"{attribute}: {message}", element, name=attribute)
    elif policy != "SuccessOnSelected":
        return
    elif written is None:
        message = f"<{bound.tag}> needs the attribute 'selected' with SuccessOnSelected"
        collector.add("missing-attribute", message, element, hint=HOW_TO_SELECT)
    elif bound.values.get("selected") == []:
        message = "selected: no child is named"
        collector.add("wrong-value", message, element, value="selected", hint=HOW_TO_SELECT)
    elif "selected" in bound.values and len(bound.children) == len(element.children):
        _report_names(bound, written, collector)


def _report_names(bound: NodeView, written: str, collector: FindingCollector) -> None:
    names = [_bound_name(child) for child in bound.children]
    try:
        items_of(written, lambda text: index_of_child(text, names), blanks=True)
    except ConversionError as error:
        collector.wrong_value(bound.element, "selected", error)


def policy_conflict(policy: object, synchronise: object, *, is_selected: bool) -> tuple[str, str] | None:
    """Return the attribute that conflicts with a policy, and the reason; None without a conflict."""
    if is_selected and policy != "SuccessOnSelected":
        return "selected", f"requires the policy SuccessOnSelected instead of {policy}"
    if synchronise and policy == "SuccessOnOne":
        return "synchronise", "has no effect with SuccessOnOne, so remove it"
    return None


def index_of_child(name: str, names: list[str]) -> int:
    """Return the index of the child with a name.

    Raises:
        ConversionError: If no child or several children have the name.
    """
    count = names.count(name)
    if count == 1:
        return names.index(name)
    if count:
        raise ConversionError(f"{count} children are named '{name}'", hint="give each child a unique name")
    raise ConversionError(f"no child is named '{name}' (known: {', '.join(names)})", nearest(name, names))


def _bound_name(child: NodeView) -> str:
    """Return the result of `py_trees_nodes._written_name` for a bound child."""
    if child.tag == "OneShot" and child.children:
        inner = _bound_name(child.children[0])
        return inner if child.name == f"{inner}OneShot" else child.name
    return child.name


FROM_CHILD = SkipSupport(SkipPossibility.FROM_CHILD)
_PLAIN = Semantics()


def language_spec(
    kind: Kind,
    tag: str,
    path: str,
    doc: str,
    *parameters: Parameter,
    semantics: Semantics = _PLAIN,
    **more: Any,
) -> NodeSpec:
    """Return the spec of a built-in node. The nodes with tags in `BUILT_IN` also exist in BehaviorTree.CPP.

    *path* is the import path of the node's class in py_trees, or its path below `sar_compiler.runtime`.
    """
    if not path.startswith("py_trees."):
        path = f"sar_compiler.runtime.{path}"
    means = semantics._replace(counterpart=semantics.counterpart._replace(built_in=tag in BUILT_IN))
    return node_spec(kind, tag, path, doc, *parameters, semantics=means, **more)


def stock(
    kind: Kind, tag: str, doc: str, *parameters: Parameter, made_by: str = "", instead: str = "", **more: Any
) -> NodeSpec:
    """Return the spec of a py_trees node.

    Args:
        kind: The kind of the node.
        tag: The node's tag, which is also the name of its class.
        doc: The node's description.
        *parameters: The constructor parameters.
        made_by: The function of `py_trees_nodes` that creates the node; by default `stock`.
        instead: An equivalent node that supports skipped children.
        **more: Further fields of the spec.
    """
    module = {Kind.CONTROL: "composites", Kind.DECORATOR: "decorators"}.get(kind, "behaviours")
    factory = f"sar_compiler.nodes.language.py_trees_nodes:{made_by or 'stock'}" if parameters else ""
    skipping, path = SkipSupport(advice=instead), f"py_trees.{module}:{tag}"
    return node_spec(kind, tag, path, doc, *parameters, factory=factory, skipping=skipping, **more)
