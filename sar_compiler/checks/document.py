"""The frame of a file: its root element, its trees and which one is executed."""

from collections.abc import Iterator

from sar_compiler.nodes.binding import find_main_tree
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.values import nearest
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.model import MODEL_TAG, ROOT_TAG, TREE_TAG, Element, TreeFile

ROOT_ATTRIBUTES = ("BTCPP_format", "main_tree_to_execute")
TREE_ATTRIBUTES = ("ID",)
FORMAT = "4"


def check_document(tree_file: TreeFile, _registry: Registry) -> Iterator[Diagnostic]:
    """Yield what is wrong outside the trees."""
    root = tree_file.root
    if root.tag != ROOT_TAG:
        message = f"the outermost element is <{root.tag}>; a tree file has <{ROOT_TAG}> there"
        hint = f'put everything in <{ROOT_TAG} BTCPP_format="{FORMAT}">'
        yield _finding(root, "wrong-root", message, hint=hint)
        return
    yield from _unknown_attributes(root, ROOT_ATTRIBUTES)
    yield from _format(root)
    for child in root.children:
        if child.tag not in (TREE_TAG, MODEL_TAG):
            message = f"<{child.tag}> cannot stand directly in <{ROOT_TAG}>"
            near = nearest(child.tag, (TREE_TAG, MODEL_TAG))
            yield _finding(
                child, "unknown-element", message, suggestion=near, hint=f"nodes stand in a <{TREE_TAG}>"
            )
    yield from _tree_ids(tree_file)
    try:
        find_main_tree(tree_file)
    except TreeError as error:
        yield from error.findings


def _format(root: Element) -> Iterator[Diagnostic]:
    written = root.attributes.get("BTCPP_format", FORMAT)
    if written != FORMAT:
        message = f"BTCPP_format is '{written}'; this reads format {FORMAT}"
        span = root.value_span("BTCPP_format")
        yield Diagnostic("wrong-format", message, root.source, span, suggestion=FORMAT)


def _tree_ids(tree_file: TreeFile) -> Iterator[Diagnostic]:
    first: dict[str, Element] = {}
    for tree in tree_file.trees:
        yield from _unknown_attributes(tree, TREE_ATTRIBUTES)
        tree_id = tree.attributes.get("ID")
        if tree_id is None and len(tree_file.trees) > 1:
            message = f"this <{TREE_TAG}> has no ID, so nothing can name it"
            yield _finding(tree, "missing-tree-id", message, hint='write ID="..."')
        elif tree_id == "":
            span = tree.value_span("ID")
            yield Diagnostic("missing-tree-id", "the ID of a tree must not be empty", tree.source, span)
        elif tree_id is not None and tree_id in first:
            message = f"the tree ID '{tree_id}' is taken by the tree in line {first[tree_id].line}"
            span = tree.value_span("ID")
            yield Diagnostic("duplicate-tree-id", message, tree.source, span, hint="give each tree its own")
        elif tree_id is not None:
            first[tree_id] = tree


def _unknown_attributes(element: Element, known: tuple[str, ...]) -> Iterator[Diagnostic]:
    for name in element.attributes:
        # Editors find the schema by the attributes of these namespaces.
        if name not in known and not name.startswith(("xmlns", "xsi:")):
            message = f"<{element.tag}> has no attribute '{name}'; it has {', '.join(known)}"
            span = element.name_span(name)
            suggestion = nearest(name, known)
            yield Diagnostic("unknown-attribute", message, element.source, span, suggestion=suggestion)


def _finding(element: Element, code: str, message: str, **advice: str | None) -> Diagnostic:
    return Diagnostic(code, message, element.source, element.tag_span(), **advice)  # type: ignore[arg-type]
