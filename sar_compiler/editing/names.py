"""The locations of a name in files.

The name belongs to a tree, to a blackboard key, or to a node to which other nodes refer.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from sar_compiler.checks.rules.entry_accesses import KeyAccess
from sar_compiler.editing.text_edits import EditError
from sar_compiler.nodes.binding.attributes import AUTOREMAP
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.project import ProjectTree
from sar_compiler.runtime.blackboard import ROOT_SIGN
from sar_compiler.tree.content import real_path
from sar_compiler.tree.diagnostic import Source, Span
from sar_compiler.tree.model import MODEL_TAG, SUBTREE_TAG, TREE_TAG, Element, TreeFile, last_element_before

_MAIN = "main_tree_to_execute"
_NAME = re.compile(r"@?[A-Za-z_]\w*", re.ASCII)
_KEY = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_TREE = re.compile(r"[\w.-]+")
_WRITES = (AccessKind.WRITE, AccessKind.BOTH, AccessKind.CHANGE)


class NameLocation(NamedTuple):
    """A location of a name.

    Attributes:
        source: The file that contains the name.
        span: The location in the file.
        is_origin: Whether the location is a definition: the tree or node itself, or a writer of the key.
    """

    source: Source
    span: Span
    is_origin: bool = False


class NamedThing(NamedTuple):
    """A tree, node or key with a name.

    Attributes:
        name: The name.
        spots: The locations of the name.
        refusal: The reason why the name cannot be changed; empty if it can be changed.
        taken: The names of other trees or keys, which cannot be the new name.
        is_key: Whether the name is a key. Scripts allow only letters, digits and '_' in keys.
    """

    name: str
    spots: tuple[NameLocation, ...]
    refusal: str = ""
    taken: frozenset[str] = frozenset()
    is_key: bool = False


class _PointedAttribute(NamedTuple):
    """An attribute value that contains an offset: its element, its attribute and the index in the value."""

    element: Element
    attribute: str
    character: int


def name_at(tree: ProjectTree, offset: int, beside: Sequence[ProjectTree] = ()) -> NamedThing | None:
    """Return the tree, node or key whose name is at an offset of a file; None if there is no name.

    Args:
        tree: The file.
        offset: The offset.
        beside: The other open files. They may include the file and use its trees.
    """
    main = tree.forest.main
    element = last_element_before(list(main.root.iterate()), main.source.position_of(offset))
    if element is None:
        return None
    pointed, files, name = (
        _attribute_at(element, offset),
        _affected_files(tree, beside),
        element.attributes.get("ID"),
    )
    if pointed is None:
        start, end = element.source.spans.tag(element)
        is_use = element.tag == SUBTREE_TAG and start <= offset <= end
        return _named_tree(files, name) if is_use and name else None
    # The tags whose `ID` contains the name of a node.
    explicit = {spec.kind.value for spec in tree.context.registry}
    if pointed.attribute == _MAIN or (pointed.attribute == "ID" and element.tag not in explicit):
        return _named_tree(files, element.attributes[pointed.attribute])
    return _thing_in_node(tree, files, pointed)


def _thing_in_node(
    tree: ProjectTree, files: Sequence[TreeFile], pointed: _PointedAttribute
) -> NamedThing | None:
    """Return the node or key whose name is in an attribute of a node."""
    bound, bound_tree = _find_bound(tree, pointed.element)
    if bound is None or bound_tree is None:
        return None
    target = bound.references.get(pointed.attribute)
    if target is not None:
        return _named_node(bound_tree, target)
    words = _NAME.finditer(pointed.element.attributes[pointed.attribute])
    word = next((each[0] for each in words if each.start() <= pointed.character <= each.end()), None)
    accesses = tree.context.key_accesses.get(bound_tree)
    return _named_key(tree, files, bound_tree, word) if word and accesses and word in accesses.keys else None


def _attribute_at(element: Element, offset: int) -> _PointedAttribute | None:
    source = element.source
    for name, (*_, start, end) in source.spans.attributes(element):
        first, last = source.spans.inside(source.text, start, end)
        if first <= offset <= last:
            return _PointedAttribute(element, name, offset - first)
    return None


def _find_bound(tree: ProjectTree, element: Element) -> tuple[BoundNode | None, BoundTree | None]:
    trees = (each for each in tree.context.bound_forest.trees if each.element.source is element.source)
    return next(
        ((node, each) for each in trees for node in each.nodes if node.element is element), (None, None)
    )


def _affected_files(tree: ProjectTree, beside: Iterable[ProjectTree]) -> list[TreeFile]:
    """Return the files that renaming in a file may affect.

    These are the file, the files that it includes, all files of its set, and the files that include it.
    """
    own, tree_set = real_path(tree.path), tree.project.tree_set
    users = (each.forest for each in beside if own in map(_real_path, each.forest.files))
    forests = (*users, *(tree_set.forests.values() if tree_set else ()), tree.forest)
    files = [each for forest in forests for each in (*forest.others, *forest.files)]
    return list({_real_path(each): each for each in files}.values())


def _real_path(tree_file: TreeFile) -> Path:
    return real_path(Path(tree_file.source.path))


def _named_tree(files: Sequence[TreeFile], name: str) -> NamedThing:
    taken = frozenset(
        each.attributes["ID"] for file in files for each in file.trees if "ID" in each.attributes
    )
    return NamedThing(name, tuple(_spots_of_tree(files, name)), taken=taken)


def _spots_of_tree(files: Iterable[TreeFile], name: str) -> Iterator[NameLocation]:
    for file in files:
        if file.main_tree_name == name:
            yield NameLocation(file.source, file.root.value_span(_MAIN))
        for each in file.root.iterate():
            if each.tag in (TREE_TAG, SUBTREE_TAG) and each.attributes.get("ID") == name:
                yield NameLocation(file.source, each.value_span("ID"), is_origin=each.tag == TREE_TAG)


def _named_node(tree: BoundTree, named: BoundNode) -> NamedThing:
    element = named.element
    own = element.value_span("name") if "name" in element.attributes else element.tag_span()
    spots = [NameLocation(element.source, own, is_origin=True)]
    for each in tree.referring:
        for attribute, target in each.references.items():
            if target is named and attribute in each.element.attributes:
                spots.append(NameLocation(each.element.source, each.element.value_span(attribute)))
    return NamedThing(named.name, tuple(spots), "scenarios and properties may also contain names of nodes")


def _named_key(tree: ProjectTree, files: Sequence[TreeFile], owner: BoundTree, key: str) -> NamedThing:
    accesses = tree.context.key_accesses[owner]
    spots = [spot for each in accesses.accesses if each.key == key for spot in _spots_of_access(each)]
    # Attributes that remap a port or remove a key are not accesses.
    for node in owner.nodes:
        spots += _key_locations(node, key)
    users = [*_users(files, owner.name)]
    spots += [NameLocation(each.source, each.name_span(key)) for each in users if key in each.attributes]
    spots += _port_descriptions(files, owner.name, key)
    inner = (use.element for use in owner.uses)
    refusal = ""
    if key.startswith(ROOT_SIGN):
        refusal = "a key of the root can be used by all trees, and may be a mission parameter"
    elif any(each.attributes.get(AUTOREMAP) == "true" for each in (*users, *inner)):
        refusal = f"with {AUTOREMAP}, keys with the same name in other trees refer to the same entry"
    elif accesses.is_open:
        refusal = "a node of this tree accesses keys that the file does not name"
    # Of several spots at one location, the first one is kept, because it may be the definition.
    unique = {(each.source.path, each.span): each for each in reversed(spots)}
    taken = frozenset({*accesses.keys, *(name for each in users for name in each.attributes)})
    return NamedThing(key, tuple(unique.values()), refusal, taken, is_key=True)


def _spots_of_access(access: KeyAccess) -> Iterator[NameLocation]:
    element, is_origin = access.bound.element, access.kind in _WRITES
    if access.place is not None or access.position_in_braces is not None:
        yield NameLocation(element.source, access.span(), is_origin)
        return
    text = element.attributes.get(access.attribute, "")
    found = next((each for each in _NAME.finditer(text) if each[0] == access.key), None)
    if found is not None:
        span = element.value_part_span(access.attribute, *found.span())
        yield NameLocation(element.source, span, is_origin)


def _key_locations(node: BoundNode, key: str) -> Iterator[NameLocation]:
    """Yield the locations of a key in a node's attributes.

    The key is in braces, or is the value of a port for key names.
    """
    element = node.element
    for attribute, text in element.attributes.items():
        parameter = node.spec.parameters.get(attribute)
        if parameter is not None and parameter.value_type.names_key and text == key:
            yield NameLocation(element.source, element.value_span(attribute))
        for found in re.finditer(rf"(?<=\{{){re.escape(key)}(?=\}})", text):
            yield NameLocation(element.source, element.value_part_span(attribute, *found.span()))


def _users(files: Iterable[TreeFile], name: str) -> Iterator[Element]:
    """Yield the `SubTree` elements that use a tree."""
    for tree in (each for file in files for each in file.trees):
        for element in tree.iterate():
            if element.tag == SUBTREE_TAG and element.attributes.get("ID") == name:
                yield element


def _port_descriptions(files: Iterable[TreeFile], name: str, key: str) -> Iterator[NameLocation]:
    """Yield the locations of a port's name in the models of a tree."""
    for models in (each for file in files for each in file.root.children if each.tag == MODEL_TAG):
        for model in models.children:
            if model.tag == SUBTREE_TAG and model.attributes.get("ID") == name:
                ports = (port for port in model.children if port.attributes.get("name") == key)
                yield from (NameLocation(port.source, port.value_span("name")) for port in ports)


def check_renaming(thing: NamedThing) -> None:
    """Check whether a tree, node or key can be renamed.

    Raises:
        EditError: If it cannot be renamed.
    """
    if thing.refusal:
        raise EditError(f"'{thing.name}' cannot be renamed: {thing.refusal}")


def rename_edits(thing: NamedThing, name: str) -> list[tuple[NameLocation, str]]:
    """Return the locations of a name, each together with the new name.

    Raises:
        EditError: If the name cannot be changed, or the new name is invalid or already exists.
    """
    check_renaming(thing)
    if not (_KEY if thing.is_key else _TREE).fullmatch(name):
        listed = "letters, digits and '_'" if thing.is_key else "letters, digits, '_', '.' or '-'"
        raise EditError(f"'{name}' is not a valid name. Use only {listed}")
    if name in thing.taken - {thing.name}:
        raise EditError(f"'{name}' already exists. Choose another name")
    return [(spot, name) for spot in thing.spots]
