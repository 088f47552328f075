"""Generation of a palette for undescribed nodes and trees, with guessed kinds, types and directions."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from sar_compiler.nodes.binding.attributes import CONDITIONS, KIND_TAGS
from sar_compiler.nodes.binding.binder import OF_ANY, is_node_of_other_library
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.cpp_names import ANY, TEXT, normalize
from sar_compiler.nodes.models import ENUM_TAG, FROM_USE, METADATA_TAG, NodeModels, can_be_tag, read_models
from sar_compiler.nodes.registry import Registry, is_library_tag
from sar_compiler.nodes.spec import Direction, Kind
from sar_compiler.tree.display_text import shorten
from sar_compiler.tree.guessing import Guesses
from sar_compiler.tree.model import (
    INCLUDE_TAG,
    MODEL_TAG,
    SUBTREE_TAG,
    TREE_TAG,
    Element,
    TreeFile,
    synthetic_element,
)

_KEY = re.compile(r"\{(@?[^{}\s]+)\}")
_MADE_BY_SCRIPT = re.compile(r"(?<![\w@])(@?[A-Za-z_]\w*)\s*:?=(?!=)", re.ASCII)
_SCRIPTS = (*CONDITIONS, "code", "if")
"""The attributes of BehaviorTree.CPP's nodes that contain scripts."""
_TEXTS = re.compile(r"'[^']*'|\"[^\"]*\"")
_CAPITALS = re.compile(r"(?<![\w@])[A-Z][A-Z0-9_]*(?!\w)")
_NOT_NODES = (SUBTREE_TAG, TREE_TAG, INCLUDE_TAG, MODEL_TAG)
_TYPES = (
    ("bool", re.compile(r"true|false", re.IGNORECASE)),
    ("int", re.compile(r"[+-]?\d{1,9}")),
    ("double", re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)),
    ("std::string", re.compile(".*", re.DOTALL)),
)
_NOTE = synthetic_element(METADATA_TAG, children=[synthetic_element("Metadata", FROM_USE)])


class _PortUse(NamedTuple):
    """The use of a port at one location.

    Attributes:
        text: The written text.
        is_key: Whether the text is a key.
        makes_key: Whether the node probably writes the key: a later node in the tree uses the key, but no earlier node
            does.
        cpp: The C++ type of a known port that has the same key in the tree; empty if there is no such port.
    """

    text: str
    is_key: bool
    makes_key: bool
    cpp: str = ""


class _NodeUse:
    """The uses of a node in trees.

    Attributes:
        kinds: The number of uses by kind, for uses in explicit form.
        children: The largest number of children.
        ports: The uses of each port.
    """

    def __init__(self) -> None:
        self.kinds: Counter[str] = Counter()
        self.children = 0
        self.ports: dict[str, list[_PortUse]] = {}

    def add(self, node: Element, made: Collection[str], types: Mapping[str, str]) -> None:
        """Add a use of the node.

        Args:
            node: The element.
            made: The keys of the element that a later node uses, but no earlier node uses.
            types: The C++ types of the keys of known ports in the tree.
        """
        self.kinds.update([node.tag] if node.tag in KIND_TAGS else [])
        self.children = max(self.children, len(node.children))
        for name, text in node.attributes.items():
            if name not in OF_ANY and not name.startswith("_") and can_be_tag(name):
                key = _KEY.fullmatch(text.strip())
                cpp = types.get(key[1], "") if key is not None else ""
                self.ports.setdefault(name, []).append(
                    _PortUse(text, key is not None, bool(key and key[1] in made), cpp)
                )

    @property
    def kind(self) -> str:
        """The kind of the node, inferred from its uses.

        A leaf that may be an action or a condition is regarded as an action.
        """
        fitting = [kind for kind, _ in self.kinds.most_common() if Kind(kind).takes(self.children)]
        guess = {0: Kind.ACTION, 1: Kind.DECORATOR}.get(self.children, Kind.CONTROL)
        return fitting[0] if fitting else str(guess.value)


class UndescribedNodes:
    """Collector of the nodes and trees that are used but not described."""

    def __init__(self) -> None:
        self._guesses = Guesses()
        self._used: dict[str, _NodeUse] = {}
        self._trees: set[str] = set()
        self._used_trees: set[str] = set()
        self._capitals: set[str] = set()
        self._keys: set[str] = set()

    def add(self, tree_file: TreeFile, palettes: Iterable[TreeFile], registry: Registry) -> None:
        """Collect the nodes and trees in a file that are neither registered nor described by any model."""
        models = read_models([tree_file, *palettes], FindingCollector())
        described = models.nodes
        self._trees.update(models.subtrees, (tree.attributes.get("ID", "") for tree in tree_file.trees))
        handed_over = _handed_over(tree_file)
        self._used_trees.update(handed_over)
        self._keys.update(models.enums, *handed_over.values())
        for node in tree_file.root.iterate():
            self._keys.update(_keys_of(node))
            scripts = (_TEXTS.sub("", node.attributes.get(name, "")) for name in _SCRIPTS)
            self._capitals.update(name for script in scripts for name in _CAPITALS.findall(script))
        for tree in tree_file.trees:
            order = list(tree.iterate())[1:]
            types = _types_of_keys(order, models, registry)
            before = set(handed_over.get(tree.attributes.get("ID", ""), ()))
            last = {key: place for place, node in enumerate(order) for key in _keys_of(node)}
            for place, node in enumerate(order):
                tag = node.attributes.get("ID", "") if node.tag in KIND_TAGS else node.tag
                if tag and tag not in described and not self._is_known(tag, node, registry):
                    made = {key for key in _keys_of(node) if key not in before and last[key] > place}
                    self._used.setdefault(tag, _NodeUse()).add(node, made, types)
                before.update(_keys_of(node))

    def models(self, only: str | None = None) -> Element:
        """Return the `TreeNodesModel` of the collected nodes, sorted by name.

        If *only* is given, the result describes only this node.
        """
        used = [(tag, self._used[tag]) for tag in sorted(self._used) if only in (None, tag)]
        # Ports of subtrees are not guessed, because every use would have to set a port without a default.
        trees = [
            synthetic_element(SUBTREE_TAG, {"ID": tree_id}, [_NOTE])
            for tree_id in sorted(self._used_trees - self._trees - {""})
            if only in (None, tree_id)
        ]
        # A name in capitals that a script reads and no tree writes is a named constant. Only the C++ code has its number.
        enums = [
            synthetic_element(ENUM_TAG, {"ID": name})
            for name in sorted(self._capitals - self._keys)
            if only in (None, name)
        ]
        return synthetic_element(
            MODEL_TAG, children=[*(_model(tag, use) for tag, use in used), *trees, *enums]
        )

    def _is_known(self, tag: str, node: Element, registry: Registry) -> bool:
        if tag in _NOT_NODES:
            return True
        variants = registry.variants(tag)
        return bool(variants) and not (
            is_library_tag(tag) and is_node_of_other_library(node, variants, self._guesses)
        )


def _types_of_keys(nodes: Iterable[Element], models: NodeModels, registry: Registry) -> Mapping[str, str]:
    """Return the C++ types of the keys in known ports of a tree. Strings are left out."""
    types: dict[str, str] = {}
    for node in nodes:
        tag = node.attributes.get("ID", "") if node.tag in KIND_TAGS else node.tag
        model = models.nodes.get(tag)
        for name, text in node.attributes.items():
            key = _KEY.fullmatch(text.strip())
            if key is None:
                continue
            named = {
                parameter.value_type.cpp
                for spec in registry.variants(tag)
                if (parameter := spec.parameters.get(name)) is not None and parameter.direction is not None
            }
            if model is not None and name in model.ports and not model.is_from_use:
                named = {model.ports[name].type_name}
            for cpp in map(normalize, named):
                if cpp not in {"", ANY, TEXT}:
                    types.setdefault(key[1], cpp)
    return types


def _handed_over(tree_file: TreeFile) -> Mapping[str, set[str]]:
    """Return the keys that are passed to each subtree of a file."""
    keys: dict[str, set[str]] = {}
    for node in tree_file.root.iterate():
        if node.tag == SUBTREE_TAG:
            keys.setdefault(node.attributes.get("ID", ""), set()).update(node.attributes)
    return keys


def _keys_of(node: Element) -> Iterator[str]:
    for name, text in node.attributes.items():
        yield from _KEY.findall(text)
        yield from _MADE_BY_SCRIPT.findall(text)
        if name == "output_key":  # SetBlackboard's
            yield text


def _model(tag: str, use: _NodeUse) -> Element:
    ports = [_port(name, uses) for name, uses in use.ports.items()]
    return synthetic_element(use.kind, {"ID": tag, "editable": "true"}, [*ports, _NOTE])


def _port(name: str, uses: Sequence[_PortUse]) -> Element:
    values = [each.text for each in uses if not each.is_key]
    makes = bool(uses) and all(each.makes_key for each in uses)
    direction = Direction.OUTPUT if makes and not values else Direction.INPUT
    shared = {each.cpp for each in uses if each.cpp}
    cpp = next(iter(shared)) if len(shared) == 1 else ""
    if values:
        # For an integer, the type of other ports with the same key is more precise: `unsigned int`, `double`.
        guess = next(name for name, form in _TYPES if all(map(form.fullmatch, values)))
        cpp = cpp if cpp and guess == "int" else guess
    attributes = {"name": name, **({"type": cpp} if cpp else {})}
    example = shorten((values or [each.text for each in uses])[0])
    return synthetic_element(
        direction.value, attributes, text=f"guessed from {example}" if example else "guessed"
    )
