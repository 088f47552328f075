"""What each element of a tree means, and everything that keeps one from meaning something.

Binding joins the elements of a file with the registry: tags become specs, texts become values, names
become references. The checks report what it finds; the compiler builds from what it made.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from py_trees.common import OneShotPolicy

from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, Role
from sar_compiler.nodes.values import ConversionError, blackboard_key, nearest, value_type_of
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.model import TREE_TAG, Element, TreeFile
from sar_compiler.tree.source import Span

ONESHOT = "oneshot"
"""The attribute that any node may have: wraps it in a OneShot with the policy it names."""

_oneshot_type = value_type_of(OneShotPolicy)
if _oneshot_type is None:  # pragma: no cover
    raise TypeError(OneShotPolicy)
ONESHOT_TYPE = _oneshot_type


@dataclass(eq=False)
class BoundNode:
    """An element and what it means.

    Attributes:
        element: The element.
        spec: What its tag means.
        name: The node's name.
        values: The values written for constructor parameters.
        keys: The blackboard keys written for constructor parameters (`{key}`).
        references: The nodes that constructor parameters refer to.
        children: The nodes in it.
        oneshot: The policy of the OneShot to wrap it in.
    """

    element: Element
    spec: NodeSpec
    name: str
    values: dict[str, object] = field(default_factory=dict)
    keys: dict[str, str] = field(default_factory=dict)
    references: "dict[str, BoundNode]" = field(default_factory=dict)
    children: "list[BoundNode]" = field(default_factory=list)
    oneshot: OneShotPolicy | None = None

    def iterate(self) -> "Iterator[BoundNode]":
        """Yield it and everything below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.iterate()


@dataclass(frozen=True)
class Binding:
    """A whole tree, bound.

    Attributes:
        tree: The `BehaviorTree` element.
        root: The bound tree; None where there is nothing to bind.
        findings: What is wrong; the tree can be compiled only if there is nothing.
    """

    tree: Element
    root: BoundNode | None
    findings: tuple[Diagnostic, ...]


def find_main_tree(tree_file: TreeFile, tree_id: str | None = None) -> Element:
    """Return the tree to execute.

    Args:
        tree_file: The file.
        tree_id: The ID asked for; None leaves the choice to the file.

    Raises:
        TreeError: If there is no such tree, or the file does not say which of several it is.
    """
    tree = tree_file.main_tree(tree_id)
    if tree is not None:
        return tree
    root = tree_file.root
    ids = [tree.attributes["ID"] for tree in tree_file.trees if "ID" in tree.attributes]
    there = f"the file has {', '.join(ids)}" if ids else "the file has no tree with an ID"
    named = tree_file.main_tree_name
    if tree_id is not None:
        finding = Diagnostic(
            "missing-main-tree", f"there is no tree '{tree_id}'; {there}", tree_file.source, root.tag_span()
        )
    elif named is not None:
        finding = Diagnostic(
            "missing-main-tree",
            f"main_tree_to_execute names the tree '{named}', which is not there; {there}",
            tree_file.source,
            root.value_span("main_tree_to_execute"),
            suggestion=nearest(named, ids),
        )
    elif not tree_file.trees:
        finding = Diagnostic(
            "no-tree",
            "the file has no tree",
            tree_file.source,
            root.tag_span(),
            hint='write a <BehaviorTree ID="..."> in it',
        )
    else:
        finding = Diagnostic(
            "no-main-tree",
            f"the file has {len(tree_file.trees)} trees and does not say which one to execute",
            tree_file.source,
            root.tag_span(),
            hint=f'write main_tree_to_execute="{ids[0] if ids else "..."}"',
        )
    raise TreeError([finding])


def bind(tree: Element, registry: Registry) -> Binding:
    """Bind a `BehaviorTree` element.

    Args:
        tree: The element.
        registry: What tags mean.

    Returns:
        The bound tree and everything that is wrong with it, in the order of the file.
    """
    binder = _Binder(registry)
    root = binder.tree(tree)
    if root is not None:
        binder.resolve_references(root)
    findings = sorted(binder.findings, key=lambda finding: (finding.span.line, finding.span.column))
    return Binding(tree, root, tuple(findings))


class _Binder:
    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self.findings: list[Diagnostic] = []
        self._unknown_names: set[str] = set()

    def report(self, element: Element, span: Span, code: str, message: str, **advice: str | None) -> None:
        self.findings.append(Diagnostic(code, message, element.source, span, **advice))  # type: ignore[arg-type]

    def tree(self, tree: Element) -> BoundNode | None:
        if not tree.children:
            self.report(tree, tree.tag_span(), "missing-child", f"<{TREE_TAG}> has no node in it")
            return None
        for extra in tree.children[1:]:
            message = f"<{TREE_TAG}> holds one node; this is another"
            hint = "put them together in a Sequence or a Selector"
            self.report(extra, extra.tag_span(), "too-many-children", message, hint=hint)
        bound = [self.node(child) for child in tree.children]
        return bound[0]

    def node(self, element: Element) -> BoundNode | None:
        spec = self._registry.get(element.tag)
        children = [self.node(child) for child in element.children]
        if spec is None:
            self._unknown_node(element)
            spec = self._registry.get(self._registry.nearest(element.tag) or "")
            self._unknown_names.add(element.attributes.get("name", element.tag))
            if spec is None:
                return None
            # Taken for what was probably meant, so that one slip does not bring a finding for every
            # reference to the node as well.
            return BoundNode(
                element, spec, element.attributes.get("name", spec.tag), children=_bound(children)
            )
        bound = BoundNode(
            element, spec, element.attributes.get("name", element.tag), children=_bound(children)
        )
        self._attributes(bound)
        self._count_children(bound)
        return bound

    def _unknown_node(self, element: Element) -> None:
        if element.tag == TREE_TAG:
            message = f"a <{TREE_TAG}> cannot stand inside another"
            advice: dict[str, str | None] = {}
        else:
            message = f"no node is called '{element.tag}'"
            advice = {
                "suggestion": self._registry.nearest(element.tag),
                "hint": "sar-compile nodes lists them; --nodes adds a module of leaves",
            }
        self.report(element, element.tag_span(), "unknown-node", message, **advice)

    def _attributes(self, bound: BoundNode) -> None:
        element, spec = bound.element, bound.spec
        for name, text in element.attributes.items():
            parameter = spec.parameters.get(name)
            if name == ONESHOT and parameter is None:
                bound.oneshot = self._convert(element, name, ONESHOT_TYPE.convert)
            elif parameter is None or parameter.role not in (Role.NAME, Role.ATTRIBUTE, Role.REFERENCE):
                self._unknown_attribute(bound, name)
            elif parameter.role is Role.NAME and not text:
                self.report(
                    element, element.value_span(name), "wrong-value", "a node's name must not be empty"
                )
            elif parameter.role is Role.ATTRIBUTE:
                self._value(bound, parameter, text)
        for parameter in spec.parameters.values():
            written = parameter.role is Role.ATTRIBUTE and parameter.name not in spec.fixed
            if written and parameter.required and parameter.name not in element.attributes:
                label = parameter.value_type.label if parameter.value_type else "a value"
                message = f"<{element.tag}> needs the attribute '{parameter.name}'"
                hint = f'write {parameter.name}="..." ({label})'
                self.report(element, element.tag_span(), "missing-attribute", message, hint=hint)

    def _unknown_attribute(self, bound: BoundNode, name: str) -> None:
        element = bound.element
        known = [parameter.name for parameter in bound.spec.attributes] + [ONESHOT]
        message = f"<{element.tag}> has no attribute '{name}'; it has {', '.join(known)}"
        span = element.name_span(name)
        self.report(element, span, "unknown-attribute", message, suggestion=nearest(name, known))

    def _value(self, bound: BoundNode, parameter: Parameter, text: str) -> None:
        key = blackboard_key(text)
        if key is not None and parameter.name not in bound.spec.fixed:
            bound.keys[parameter.name] = key
            return
        assert parameter.value_type is not None  # noqa: S101 - every attribute has one
        value = self._convert(bound.element, parameter.name, parameter.value_type.convert)
        fixed = bound.spec.fixed.get(parameter.name, value)
        if value is not None and value != fixed:
            tag, name = bound.element.tag, parameter.name
            message = f'<{tag}> says {name}="{_as_text(fixed)}" by its name, and {name}="{text}" here'
            span = bound.element.value_span(name)
            self.report(bound.element, span, "conflicting-attributes", message, suggestion=_as_text(fixed))
        bound.values[parameter.name] = value

    def _convert(self, element: Element, name: str, convert: Any) -> Any:
        try:
            return convert(element.attributes[name])
        except ConversionError as error:
            message = f"{name}: {error.message}"
            span = element.value_span(name)
            self.report(element, span, "wrong-value", message, suggestion=error.suggestion)
            return None

    def _count_children(self, bound: BoundNode) -> None:
        element, kind = bound.element, bound.spec.kind
        if kind.is_leaf:
            for child in element.children:
                message = f"<{element.tag}> is a leaf ({kind.value.lower()}) and has no children"
                self.report(child, child.tag_span(), "child-of-leaf", message)
        elif not element.children and kind is Kind.DECORATOR:
            message = f"the decorator <{element.tag}> needs a child"
            self.report(element, element.tag_span(), "missing-child", message, hint="put one node in it")
        elif not element.children:
            message = f"<{element.tag}> has no children"
            hint = "put nodes in it, or delete it"
            self.report(element, element.tag_span(), "empty-control", message, hint=hint)
        elif kind is Kind.DECORATOR:
            for extra in element.children[1:]:
                message = f"the decorator <{element.tag}> takes one child; this is another"
                hint = "put them together in a Sequence or a Selector"
                self.report(extra, extra.tag_span(), "too-many-children", message, hint=hint)

    def resolve_references(self, root: BoundNode) -> None:
        """Find the node that each reference means, within this tree."""
        nodes = list(root.iterate())
        for bound in nodes:
            for parameter in bound.spec.parameters.values():
                if parameter.role is Role.REFERENCE:
                    self._resolve(bound, parameter, nodes)
        self._report_circles(nodes)

    def _resolve(self, bound: BoundNode, parameter: Parameter, nodes: list[BoundNode]) -> None:
        target = parameter.target
        assert target is not None  # noqa: S101 - every reference has one
        fitting = [node for node in nodes if issubclass(node.spec.cls, target) and node is not bound]
        named = bound.element.attributes.get(parameter.name)
        if named is None:
            self._resolve_unnamed(bound, parameter, fitting)
            return
        found = [node for node in fitting if node.name == named]
        if len(found) == 1:
            bound.references[parameter.name] = found[0]
            return
        if not found and named in self._unknown_names:
            return
        element, what = bound.element, target.__name__
        advice: dict[str, str | None]
        namesakes = [node for node in nodes if node.name == named]
        if found:
            code = "ambiguous-reference"
            message = (
                f"{parameter.name}: {len(found)} {what} nodes are called '{named}' (lines {_lines(found)})"
            )
            advice = {"hint": "give each a name of its own"}
        elif namesakes:
            code = "wrong-reference"
            message = f"{parameter.name}: '{named}' is a {namesakes[0].element.tag}, not a {what}"
            advice = {
                "suggestion": fitting[0].name if len(fitting) == 1 else None,
                "hint": _choices(fitting, what),
            }
        else:
            code = "unknown-reference"
            message = f"{parameter.name}: no node in this tree is called '{named}'"
            suggestion = nearest(named, [node.name for node in fitting])
            advice = {"suggestion": suggestion, "hint": _choices(fitting, what)}
        self.report(element, element.value_span(parameter.name), code, message, **advice)

    def _resolve_unnamed(self, bound: BoundNode, parameter: Parameter, fitting: list[BoundNode]) -> None:
        if not parameter.required:
            return  # a default is the author's word for "nothing unless it is written"
        element, tag = bound.element, bound.element.tag
        what = parameter.target.__name__ if parameter.target else ""
        if len(fitting) == 1:
            bound.references[parameter.name] = fitting[0]
        elif fitting:
            message = f"<{tag}> can mean {len(fitting)} {what} nodes (lines {_lines(fitting)})"
            hint = f'write {parameter.name}="{fitting[0].name}"'
            self.report(element, element.tag_span(), "ambiguous-reference", message, hint=hint)
        else:
            message = f"<{tag}> needs a {what} in the same tree ({parameter.name}); there is none"
            self.report(element, element.tag_span(), "missing-reference", message, hint=_choices([], what))

    def _report_circles(self, nodes: list[BoundNode]) -> None:
        for bound in nodes:
            passed: list[BoundNode] = []
            following = list(bound.references.values())
            while following:
                node = following.pop()
                if node is bound:
                    message = f"'{bound.name}' refers to itself by way of {', '.join(n.name for n in passed)}"
                    self.report(bound.element, bound.element.tag_span(), "circular-reference", message)
                    break
                if node not in passed:
                    passed.append(node)
                    # A node is made after those it refers to, and after those in it.
                    following.extend([*node.references.values(), *node.children])


def _bound(children: list[BoundNode | None]) -> list[BoundNode]:
    return [child for child in children if child is not None]


def _lines(nodes: list[BoundNode]) -> str:
    return ", ".join(str(node.element.line) for node in nodes)


def _choices(fitting: list[BoundNode], what: str) -> str:
    names = [f"'{node.name}'" for node in fitting]
    return f"{what} nodes of this tree: {', '.join(names)}" if names else f"add a <{what}> to the tree"


def _as_text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
