"""The checks of a file's root element, of its tree IDs and of its main tree."""

from collections.abc import Iterator

from sar_compiler.checks.rules import CheckContext, is_misnamed
from sar_compiler.nodes.binding.attributes import typo_in_note
from sar_compiler.nodes.binding.nesting import find_main_tree, is_btcpp_node_id
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.models import read_models
from sar_compiler.nodes.registry import Registry, subtree
from sar_compiler.nodes.spec import Provenance
from sar_compiler.tree.diagnostic import Advice, Cause, Diagnostic, Form, Severity, TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import Guesses, nearest
from sar_compiler.tree.model import (
    INCLUDE_TAG,
    MODEL_TAG,
    PROJECT_ATTRIBUTE,
    ROOT_TAG,
    SECTIONS,
    SUBTREE_TAG,
    TREE_TAG,
    Element,
    TreeFile,
    is_groot2_project,
)

ROOT_ATTRIBUTES = ("BTCPP_format", "main_tree_to_execute")
TREE_ATTRIBUTES = ("ID",)
INCLUDE_ATTRIBUTES = ("path", "ros_pkg")
FORMAT = "4"
_TO_FORMAT = (
    f'write BTCPP_format="{FORMAT}". If the file was written for BehaviorTree.CPP 3, convert it first'
)


def check_document(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield the findings about the parts of a file that are outside its trees."""
    forest, registry = context.forest, context.registry
    guesses = Guesses()
    for tree_file in forest.files:
        yield from _check_root(tree_file, guesses)
    yield from _tree_ids(forest, registry, guesses)
    yield from _ids_of_palettes(context)
    yield from forest.clashes
    if forest.main.root.tag == ROOT_TAG and context.is_whole and not _is_palette(forest):
        try:
            find_main_tree(forest)
        except TreeError as error:
            # Only a program that executes a file must know which of several trees is the main tree.
            yield from (each for each in error.findings if each.code != "no-main-tree")


def _is_palette(forest: Forest) -> bool:
    """Return whether a file is a palette: it contains no tree and only describes nodes."""
    root = forest.main.root
    describes = any(child.tag == MODEL_TAG for child in root.children)
    names_tree = "main_tree_to_execute" in root.attributes
    return describes and not names_tree and not any(True for _ in forest.iterate())


def _check_root(tree_file: TreeFile, guesses: Guesses) -> Iterator[Diagnostic]:
    root = tree_file.root
    if root.tag != ROOT_TAG:
        message = f"the root element is <{root.tag}> instead of <{ROOT_TAG}>"
        hint = f'wrap the content in <{ROOT_TAG} BTCPP_format="{FORMAT}">'
        yield root.finding("wrong-root", message, suggestion=nearest(root.tag, [ROOT_TAG]), hint=hint)
        return
    own = (PROJECT_ATTRIBUTE,) if is_groot2_project(tree_file) else ()
    yield from _unknown_attributes(root, (*ROOT_ATTRIBUTES, *own), guesses)
    yield from _check_format(root)
    for child in root.children:
        if child.tag not in SECTIONS:
            message = f"<{child.tag}> is not allowed directly in <{ROOT_TAG}>"
            near = nearest(child.tag, SECTIONS)
            hint = f"move it into a <{TREE_TAG}>. BehaviorTree.CPP ignores it here"
            severity = Severity.ERROR if near else Severity.WARNING  # a typo, or an intentional element
            yield child.finding("unknown-element", message, suggestion=near, hint=hint, severity=severity)
        elif child.tag == INCLUDE_TAG and "path" in child.attributes:  # the forest reports a missing path
            yield from _unknown_attributes(child, INCLUDE_ATTRIBUTES, guesses)
    for extra in [child for child in root.children if child.tag == MODEL_TAG][1:]:
        yield extra.finding("duplicate-model", f"a file can have only one <{MODEL_TAG}>")


def _check_format(root: Element) -> Iterator[Diagnostic]:
    written = root.attributes.get("BTCPP_format")
    if written is None:
        # Only XML files exist in other versions of the format.
        is_xml = root.source.form is Form.XML
        if is_xml and any(child.tag in (TREE_TAG, INCLUDE_TAG) for child in root.children):
            message = f"BTCPP_format is missing, so {FORMAT} is assumed"
            yield root.finding("missing-format", message, hint=_TO_FORMAT)
    elif written != FORMAT:
        message = f"BTCPP_format is '{written}', but the file is read as format {FORMAT}"
        yield root.finding("wrong-format", message, value="BTCPP_format", hint=_TO_FORMAT)


def _tree_ids(forest: Forest, registry: Registry, guesses: Guesses) -> Iterator[Diagnostic]:
    first: dict[str, Element] = {}
    for tree_file in forest.files:
        for tree in tree_file.trees:
            yield from _unknown_attributes(tree, TREE_ATTRIBUTES, guesses)
            tree_id = tree.attributes.get("ID")
            if tree_id is None:
                yield from _check_missing_id(tree, tree_file)
            elif tree_id == "":
                message = "the ID of a tree must not be empty"
                yield tree.finding("missing-tree-id", message, value="ID")
            elif first.setdefault(tree_id, tree) is not tree:
                yield _duplicate_id(tree, first[tree_id])
            elif is_btcpp_node_id(tree_id, registry):
                message = f"'{tree_id}' is the name of a node and cannot be the ID of a tree"
                yield tree.finding("wrong-tree-id", message, value="ID", hint="rename the tree")


def _ids_of_palettes(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about trees whose ID is also the name of a node in a palette."""
    named = [palette for palette in context.palettes if palette.is_named]
    models = read_models(named, FindingCollector()).nodes if named else {}
    for tree in context.forest.iterate() if models else ():
        tree_id = tree.attributes.get("ID", "")
        model = models.get(tree_id)
        if model is not None and model.spec().provenance is not Provenance.FROM_USE:
            message = f"'{tree_id}' is a node of a palette, so BehaviorTree.CPP refuses a tree with this ID"
            advice = Advice(hint="rename the tree", severity=Severity.WARNING)
            yield tree.finding("wrong-tree-id", message, value="ID", **advice)


def _check_missing_id(tree: Element, tree_file: TreeFile) -> Iterator[Diagnostic]:
    if len(tree_file.trees) > 1 and not is_misnamed(tree):
        message = f"this <{TREE_TAG}> has no ID, so no <SubTree> can use it"
        yield tree.finding("missing-tree-id", message, hint='write ID="..."')


def _duplicate_id(tree: Element, first: Element) -> Diagnostic:
    file = "" if first.source is tree.source else f" of {first.source.path}"
    message = f"the tree ID '{tree.attributes['ID']}' is already used by the tree in line {first.line}{file}"
    return tree.finding("duplicate-tree-id", message, value="ID", hint="give each tree a unique ID")


def _unknown_attributes(element: Element, known: tuple[str, ...], guesses: Guesses) -> Iterator[Diagnostic]:
    for name in element.attributes:
        # Editors use the attributes of these namespaces to find the schema.
        if name in known or name.startswith(("xmlns", "xsi:")):
            continue
        message = f"<{element.tag}> has no attribute '{name}' (known: {', '.join(known)})"
        if element.tag == TREE_TAG and (renamed := subtree().former_attributes.get(name)):
            use = f'<{SUBTREE_TAG} ID="{element.attributes.get("ID", "...")}" {renamed}="true"/>'
            yield element.finding(
                "ignored-attribute",
                message,
                name=name,
                hint=f"to set this attribute in an element that uses the tree, write {use}",
            )
            continue
        is_note = name.startswith("_")
        near = None if is_note else guesses.nearest(name, known)
        if name == "name" and is_misnamed(element) and "ID" in known:
            near = "ID"
        if near is not None or (is_note and typo_in_note(name, guesses) is not None):
            yield element.finding("unknown-attribute", message, name=name, suggestion=near)
        elif not is_note:
            hint = (
                "delete this attribute, or begin its name with _. BehaviorTree.CPP ignores the attribute, too"
            )
            cause = Cause(f"<{element.tag}> has no such attribute", name)
            yield element.finding("ignored-attribute", message, name=name, hint=hint, common_cause=cause)
