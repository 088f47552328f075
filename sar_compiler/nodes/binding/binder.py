"""Binding of a tree's elements to node specs, with a finding for each unknown element.

Binding combines the elements of a file with the registry: it resolves tags to specs, texts to values, names to
references, and subtrees to the trees that they refer to. The checks report the findings of binding, and the compiler
builds the bound tree.
"""

import functools
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from sar_compiler.gc_pause import gc_paused
from sar_compiler.nodes.binding.attributes import AUTOREMAP, KIND_TAGS, ONESHOT, AttributeBinder
from sar_compiler.nodes.binding.bound import (
    Binding,
    BoundNode,
    BoundTree,
    Remapping,
    is_skippable_itself,
    report_misread_skips,
)
from sar_compiler.nodes.binding.instances import TreeInstance, expand
from sar_compiler.nodes.binding.key_types import EntryTypes, report_key_types
from sar_compiler.nodes.binding.nesting import check_size_limits, cut_cycles, trees_in
from sar_compiler.nodes.binding.references import resolve_references
from sar_compiler.nodes.btcpp import Version
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.models import NodeModel, NodeModels, compare_models, read_models, registry_without
from sar_compiler.nodes.palettes import palettes_containing
from sar_compiler.nodes.registry import Registry, is_library_tag, subtree
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.nodes.values import blackboard_key, join_with_commas
from sar_compiler.tree.diagnostic import Advice, Cause, Diagnostic, Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import Guesses
from sar_compiler.tree.model import INCLUDE_TAG, MODEL_TAG, ROOT_TAG, SUBTREE_TAG, TREE_TAG, Element, TreeFile

_KEYS = r"(?a)\{(@?[A-Za-z_]\w*)\}|(?<![\w@])(@?[A-Za-z_]\w*)\s*:="

OF_ANY = ("ID", "name", ONESHOT)
"""Attributes that are common to several libraries, so that they do not indicate the library of a node."""
_UNKNOWN = "there are no nodes of these names"
_REMAP = "remap"
_UNKNOWN_HINT = (
    "list the known nodes with sar-compile nodes, or add a module with --nodes or a palette with --model"
)
_LIKE_UNUSED = 0.9
"""The minimum similarity of an unknown tag to a suggested tag of an installed module that the file does not use."""

_Vocabulary = tuple[Registry, NodeModels, dict[str, list[NodeSpec]], dict[str, str | None]]
"""The registry and the models of a file, the specs of its tags, and for each unknown tag the intended tag."""


class BoundForest(NamedTuple):
    """The bound trees of a forest, together with the findings of the binding.

    Attributes:
        trees: The trees, in the order of the files, followed by the used trees of other files of the set.
        tops: The main tree and the trees that no tree uses, with subtrees expanded, except for trees that are too large.
        key_types: The types of the blackboard entries, for each tree in *tops*.
        models: The models of nodes that are not registered, and of subtrees.
        specs: All specs of the tags in the trees.
        findings: The findings of binding: errors, and warnings about models and versions.
    """

    trees: Sequence[BoundTree]
    tops: Sequence[TreeInstance]
    key_types: Mapping[TreeInstance, EntryTypes]
    models: NodeModels
    specs: Sequence[NodeSpec]
    findings: tuple[Diagnostic, ...]


def bind(forest: Forest, registry: Registry, tree: Element, palettes: Iterable[TreeFile] = ()) -> Binding:
    """Bind a tree and the trees that it uses.

    Returns:
        The bound tree and its findings, in the order of the file.
    """
    collector = FindingCollector()
    palettes = tuple(palettes)
    models = read_models([*forest.files, *palettes], FindingCollector())
    binder = Binder(forest, registry, models, collector, palettes)
    with gc_paused(_characters(forest)):
        main = binder.tree(tree)
    cut_cycles([main], collector)
    if check_size_limits(main, collector) is not None:
        report_key_types(expand(main, collector), collector)
        report_misread_skips(trees_in(main), collector)
    enums = {name: number for name, number in models.enums.items() if number is not None}
    return Binding(main, _sorted_findings(forest, collector.findings), enums)


def bind_all(
    forest: Forest,
    registry: Registry,
    palettes: Iterable[TreeFile] = (),
    btcpp: Version | None = None,
) -> BoundForest:
    """Bind every tree of a forest, including trees that are never executed.

    Args:
        forest: The files.
        registry: The registered nodes.
        palettes: Further files with models of nodes.
        btcpp: The configured version of BehaviorTree.CPP; None if no version is configured.

    Returns:
        The bound trees and their findings, in the order of the files.
    """
    collector, palettes = FindingCollector(btcpp), tuple(palettes)
    models = read_models([*forest.files, *palettes], collector)
    compare_models(models, registry_without(registry, models), collector)
    binder = Binder(forest, registry, models, collector, palettes)
    with gc_paused(_characters(forest)):
        own = [binder.tree(tree) for tree in forest.iterate()]
    trees = list(dict.fromkeys([*own, *binder.trees]))
    cut_cycles(trees, collector)
    used = {node.subtree for tree in trees for node in tree.subtrees()}
    # References to nodes of enclosing trees can be resolved only in the expanded trees. The main tree has no enclosing tree.
    main, count = forest.main_tree(), 0
    tops: list[TreeInstance] = []
    key_types: dict[TreeInstance, EntryTypes] = {}
    for tree in own:
        if tree not in used or tree.element is main:
            size = check_size_limits(tree, collector, count)
            if size is not None:
                count += size
                tops.append(expand(tree, collector))
                key_types[tops[-1]] = report_key_types(tops[-1], collector)
                report_misread_skips(trees_in(tree), collector)
    all_models = models._replace(subtrees=binder.subtrees)
    return BoundForest(
        trees, tops, key_types, all_models, binder.specs, _sorted_findings(forest, collector.findings)
    )


def _characters(forest: Forest) -> int:
    return sum(len(tree_file.source.text) for tree_file in forest.files)


def _sorted_findings(forest: Forest, findings: list[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the distinct findings about the forest's files, sorted by file, line and column.

    Findings about palettes are left out.
    """
    order = {id(tree_file.source): number for number, tree_file in enumerate((*forest.files, *forest.others))}
    unique = [finding for finding in dict.fromkeys(findings) if id(finding.source) in order]
    return tuple(sorted(unique, key=lambda f: (order[id(f.source)], f.span.line, f.span.column)))


class Binder:
    """Binder of the trees of a forest; each tree is bound once."""

    def __init__(
        self,
        forest: Forest,
        registry: Registry,
        models: NodeModels,
        collector: FindingCollector,
        palettes: tuple[TreeFile, ...] = (),
    ) -> None:
        self._forest = forest
        self._palettes = palettes
        self._registered = registry
        self._registry = registry_without(registry, models)
        self._models = models
        self._collector = collector
        self._guesses = collector.guesses
        self._attributes = AttributeBinder(collector, lambda: self._keys)
        self._trees: dict[int, BoundTree] = {}
        self._waiting: list[BoundTree] = []
        self._level = 1
        self._meanings: dict[str, list[NodeSpec]] = {}
        self._meant: dict[str, str | None] = {}
        self._home: Forest | None = None
        # By the forest to which a tree belongs; None for the trees of this forest.
        self._words: dict[Forest | None, _Vocabulary] = {
            None: (self._registry, models, self._meanings, self._meant)
        }

    @property
    def trees(self) -> Iterable[BoundTree]:
        """The trees bound so far."""
        return self._trees.values()

    @property
    def specs(self) -> list[NodeSpec]:
        """All specs of the tags bound so far."""
        return [
            spec
            for _, _, meanings, _ in self._words.values()
            for specs in meanings.values()
            for spec in specs
        ]

    @property
    def subtrees(self) -> Mapping[str, NodeModel]:
        """The models of subtrees by tree ID, from all files; models in the file itself take precedence."""
        return {
            name: model
            for _, models, *_ in reversed(self._words.values())
            for name, model in models.subtrees.items()
        }

    def _vocabulary_of(self, home: Forest | None) -> _Vocabulary:
        if home not in self._words:
            models = read_models(
                [*(home.files if home is not None else ()), *self._palettes], FindingCollector()
            )
            self._words[home] = registry_without(self._registered, models), models, {}, {}
        return self._words[home]

    def _enter(self, tree: BoundTree) -> None:
        """Make a tree the current tree, and its file's models the current models."""
        home = self._forest.homes.get(id(tree.element))
        if home is not self._home:
            self._registry, self._models, self._meanings, self._meant = self._vocabulary_of(home)
            self._home = home
            self.__dict__.pop("_tags", None)
        self._current = tree

    def tree(self, element: Element) -> BoundTree:
        """Bind a `BehaviorTree` element and the trees that it uses."""
        tree = self._tree_of(element)
        while self._waiting:
            self._enter(self._waiting.pop())
            self._bind_content(self._current)
            resolve_references(self._current, self._collector)
        return tree

    def _tree_of(self, element: Element) -> BoundTree:
        """Return the bound tree of a `BehaviorTree` element. If it is not bound yet, schedule its binding."""
        tree = self._trees.get(id(element))
        if tree is None:
            name = element.attributes.get("ID", f"{TREE_TAG}_{len(self._trees) + 1}")
            tree = self._trees[id(element)] = BoundTree(element, name)
            self._waiting.append(tree)
        return tree

    def _bind_content(self, tree: BoundTree) -> None:
        element = tree.element
        children = self._children_without_remaps(element, tree.name)
        if not children:
            self._collector.add("missing-child", f"<{TREE_TAG}> is empty, but must contain a node", element)
            return
        for extra in children[1:]:
            message = f"<{TREE_TAG}> can have only one child, so this node is not allowed"
            hint = "put all nodes of the tree in one Sequence or Selector"
            self._collector.add("too-many-children", message, extra, hint=hint)
        tree.nesting = self._level
        bound = [self._node(child) for child in children]
        tree.root = bound[0]

    def _node(self, element: Element) -> BoundNode | None:
        tag = element.tag
        if tag == SUBTREE_TAG:
            return self._subtree(element)
        if tag in KIND_TAGS:  # the explicit form
            tag = element.attributes.get("ID", tag)
        variants = self._meanings.get(tag)
        if variants is None:
            variants = self._meanings[tag] = self._variants(tag)
        if tag in KIND_TAGS and not self._is_node_intended(element, tag, variants):
            variants = []
        if not variants:
            return self._report_unknown(element, tag)
        spec = variants[0] if len(variants) == 1 else _best_variant(variants, element, self._guesses)
        if (
            spec.required_attributes
            and is_library_tag(tag)
            and is_node_of_other_library(element, variants, self._guesses)
        ):
            self._report_node_of_other_library(element, spec)
            return None
        bound = self._bind_own_tag(element, tag, spec, variants)
        if bound.spec.is_plain and not (element.children or bound.keys or bound.conditions or bound.oneshot):
            self._current.nodes.append(bound)
            return bound
        self._index_node(bound)
        self._append_node(bound)
        self._count_children(bound)
        if bound.spec.rule is not None:
            bound.spec.rule(bound, self._collector)
        return bound

    def _bind_own_tag(
        self, element: Element, tag: str, spec: NodeSpec, variants: Sequence[NodeSpec]
    ) -> BoundNode:
        """Bind an element, but not its children, to the spec of its own tag."""
        bound = BoundNode(element, spec, element.attributes.get("name") or tag)
        if tag != element.tag:
            self._check_kind(bound)
        others = () if len(variants) == 1 else [other for other in variants if other is not spec]
        self._attributes.bind(bound, others)
        return bound

    def _is_node_intended(self, element: Element, tag: str, variants: Sequence[NodeSpec]) -> bool:
        """Return whether a tag refers to a node of this name, although the tag is also the name of a kind.

        For example, `Condition` is both the name of a kind and of a py_trees node.
        """
        if "ID" not in element.attributes:
            return tag in self._registry
        return element.tag != tag or any(
            each.kind.value == tag or each.is_only_described for each in variants
        )

    def _variants(self, tag: str) -> list[NodeSpec]:
        variants = self._registry.variants(tag)
        if not variants and tag in self._models.nodes:
            return [self._models.nodes[tag].spec()]
        return variants

    def _append_node(self, bound: BoundNode) -> None:
        """Add a node to the current tree, and bind its children."""
        tree = self._current
        tree.nodes.append(bound)
        if bound.spec.skips_by_itself:
            tree.skips = tree.skips or is_skippable_itself(bound)
        if bound.element.children:
            self._level += 1
            tree.nesting = max(tree.nesting, self._level)
            children = map(self._node, bound.element.children)
            bound.children = [child for child in children if child is not None]
            tree.parents.append(bound)
            self._level -= 1

    def _index_node(self, bound: BoundNode) -> None:
        """Add a node to the lists of nodes with rare features, so that rules need not search all nodes."""
        tree, spec = self._current, bound.spec
        if bound.keys:
            tree.keyed.append(bound)
        if spec.takes_script or bound.conditions:
            tree.scripted.append(bound)
        if spec.references:
            tree.referring.append(bound)
        if spec.needs_context or bound.keys or bound.subtree is not None:
            tree.demanding.append(bound)
        if bound.conditions or bound.oneshot is not None:
            tree.wrappers += bool(bound.conditions) + (bound.oneshot is not None)
            tree.skips = tree.skips or is_skippable_itself(bound)

    def _check_kind(self, bound: BoundNode) -> None:
        element, kind = bound.element, bound.spec.kind.value
        if element.tag == kind:
            return
        article = "an" if kind == Kind.ACTION.value else "a"
        message = f"'{bound.spec.tag}' is {article} {kind}, but is written as <{element.tag}>"
        # BehaviorTree.CPP checks the number of children by the written kind, and everything else by the node.
        severity = Severity.WARNING if Kind(element.tag).takes(len(element.children)) else Severity.ERROR
        self._collector.add("wrong-kind", message, element, suggestion=kind, severity=severity)

    def _report_unknown(self, element: Element, tag: str) -> BoundNode | None:
        """Report an unknown tag, and continue with the tag that was probably meant."""
        self._current.unknown_names.add(element.attributes.get("name", tag))
        near = self._intended_tag(element, tag)
        if near == tag:  # this is the tag of a py_trees decorator, so suggesting it would not help
            near = None
        if element.tag == TREE_TAG:
            self._collector.add(
                "unknown-node", f"a <{TREE_TAG}> is not allowed inside another <{TREE_TAG}>", element
            )
        elif element.tag in (INCLUDE_TAG, MODEL_TAG):
            hint = f"move it directly into <{ROOT_TAG}>"
            message = f"<{element.tag}> is not allowed in a tree"
            self._collector.add("unknown-node", message, element, hint=hint)
            return None
        elif element.tag in KIND_TAGS and not element.attributes.get("ID"):
            self._report_without_id(element, f"<{element.tag}> does not name a node", "the node's name")
        else:
            message, near, hint, cause = self._no_such_node(tag, near)
            span = element.tag_span() if tag == element.tag else element.value_span("ID")
            advice = Advice(suggestion=near, hint=hint, common_cause=None if near else Cause(cause, tag))
            self._collector.add("unknown-node", message, element, span, **advice)
        variants = self._variants(
            element.attributes["ID"] if near in KIND_TAGS and "ID" in element.attributes else near or ""
        )
        if not variants:
            for child in element.children:
                self._node(child)
            return None
        # The element is bound to the tag that was probably intended, so that a typo does not also cause a finding for each
        # reference to the node.
        bound = BoundNode(element, variants[0], element.attributes.get("name", variants[0].tag))
        self._append_node(bound)
        return bound

    def _report_node_of_other_library(self, element: Element, spec: NodeSpec) -> None:
        """Report another library's node that has the name of a py_trees node."""
        needed = " and ".join(f"'{each.name}'" for each in spec.required_attributes)
        message = f"<{spec.tag}> of py_trees needs {needed}, so this node is probably from another library"
        hint = "describe this node in a palette (--model), which takes precedence over py_trees"
        self._collector.add("unknown-node", message, element, hint=hint)
        for child in element.children:
            self._node(child)

    def _no_such_node(self, tag: str, near: str | None) -> tuple[str, str | None, str, str]:
        """Return the message, the suggested tag, the hint and the common cause for an unknown tag."""
        message = f"there is no node '{tag}'{self._former_name(tag, near)}"
        if tag in self._forest.known_ids:
            hint = f'write <{SUBTREE_TAG} ID="{tag}"/>'
            return f"{message}, but there is a tree of this name", None, hint, "these are trees, not nodes"
        from sar_compiler.nodes.language.other_engines import REPLACEMENTS

        if other := REPLACEMENTS.get(tag):
            hint = f"{other.hint}. If this is your own node, add the node's module (--nodes) or palette (--model)"
            return f"{message}, which is known from {other.engine}", None, hint, f"these are like <{tag}>"
        if known := palettes_containing(tag):
            names = " or ".join(known)
            return (
                message,
                None,
                f"add a palette that describes it: --model {names}",
                f"these are nodes of {names}",
            )
        return message, near, _UNKNOWN_HINT, _UNKNOWN

    def _children_without_remaps(self, element: Element, tree_id: str) -> Sequence[Element]:
        """Report each `<remap>` of BehaviorTree.CPP 3, and return the other children."""
        if not any(child.tag == _REMAP for child in element.children) or self._variants(_REMAP):
            return element.children
        where = "this" if element.tag == SUBTREE_TAG else "each"
        for child in (child for child in element.children if child.tag == _REMAP):
            inner, outer = (
                child.attributes.get(name, default)
                for name, default in (("internal", "INNER"), ("external", "OUTER"))
            )
            message = f"<{_REMAP}> belongs to BehaviorTree.CPP 3: since version 4, keys are attributes of <{SUBTREE_TAG}>"
            hint = f'delete this element, and write {where} use of the tree as <{SUBTREE_TAG} ID="{tree_id}" {inner}="{{{outer}}}"/>'
            self._collector.add("unknown-node", message, child, hint=hint)
        return [child for child in element.children if child.tag != _REMAP]

    def _report_without_id(self, element: Element, message: str, what: str) -> None:
        """Report an element without its required ID."""
        written = [name for name in element.attributes if name.upper() == "ID"]
        if not written and element.tag == SUBTREE_TAG:
            named = [name for name, value in element.attributes.items() if value in self._forest.known_ids]
            written = [name for name in named if name != "name" and not name.startswith("_")][:1]
        if written and written != ["ID"]:
            message = f"<{element.tag}> has no attribute '{written[0]}'. Write {what} in the attribute ID"
            self._collector.add("unknown-attribute", message, element, name=written[0], suggestion="ID")
            return
        span = element.value_span("ID") if written else element.tag_span()
        self._collector.add("missing-attribute", message, element, span, hint=f'write {what}: ID="..."')

    def _intended_tag(self, element: Element, tag: str) -> str | None:
        """Return the tag that was probably meant by an unknown tag."""
        if "ID" in element.attributes and tag == element.tag and tag not in KIND_TAGS:
            explicit = self._guesses.nearest(tag, sorted(KIND_TAGS))
            if explicit is not None:
                return explicit
        if tag not in self._meant:
            today = SUBTREE_TAG if tag in subtree().former_tags else self._registry.current_tag(tag)
            self._meant[tag] = today or self._similar_tag(tag)
        return self._meant[tag]

    def _similar_tag(self, tag: str) -> str | None:
        """Return the tag that is similar to an unknown tag; None without a similar tag.

        A tag of an installed module that the file does not use must be almost equal to the unknown tag.
        """
        near = self._guesses.nearest(tag, self._tags if tag != SUBTREE_TAG else self._tags[:-1])
        return near or self._guesses.nearest(tag, list(self._registry.tags), _LIKE_UNUSED)

    def _former_name(self, tag: str, today: str | None) -> str:
        """Return the end of a message about a tag of BehaviorTree.CPP 3; empty for other tags."""
        spec = subtree() if today == SUBTREE_TAG else self._registry.get(today or "")
        former = spec is not None and tag in spec.former_tags and spec.semantics.counterpart.built_in
        return " any more, only in BehaviorTree.CPP 3" if former else ""

    @functools.cached_property
    def _keys(self) -> frozenset[str]:
        """The blackboard keys in the files, in braces or in scripts."""
        elements = [element for tree in self._forest.iterate() for element in tree.iterate()]
        texts = (text for element in elements for text in element.attributes.values())
        written = (name for text in texts for pair in re.findall(_KEYS, text) for name in pair)
        named = (
            element.attributes.get(attribute, "")
            for element in elements
            for spec in self._meanings.get(element.tag, ())
            for attribute in spec.semantics.keys
        )
        return frozenset(filter(None, (*written, *named)))

    @functools.cached_property
    def _tags(self) -> list[str]:
        """The tags that may be suggested for an unknown tag."""
        elements = (element for tree in self._forest.iterate() for element in tree.iterate())
        used = {
            element.attributes.get("ID", element.tag) if element.tag in KIND_TAGS else element.tag
            for element in elements
        }
        return [*self._registry.tags_like(used), *self._models.nodes, SUBTREE_TAG]

    def _count_children(self, bound: BoundNode) -> None:
        element = bound.element
        least, most = bound.spec.child_count
        count = len(element.children)
        if least <= count and (most is None or count <= most):
            return
        kind, tag = bound.spec.kind, bound.spec.tag
        if kind.is_leaf:
            for child in element.children:
                message = f"<{tag}> is a leaf ({kind.value.lower()}) and cannot have children"
                self._collector.add("child-of-leaf", message, child)
        elif not count and kind is Kind.DECORATOR:
            message = f"the decorator <{tag}> needs a child"
            self._collector.add("missing-child", message, element, hint="put one node into it")
        elif not count:
            message = f"<{tag}> has no children"
            self._collector.add(
                "empty-control", message, element, hint="put nodes into this element, or delete it"
            )
        elif count < least:
            message = f"<{tag}> needs {_count_in_words(least, most)}, but has {count}"
            self._collector.add("missing-child", message, element)
        else:
            for extra in element.children[most:]:
                what = "the decorator " if kind is Kind.DECORATOR else ""
                message = (
                    f"{what}<{tag}> can have {_count_in_words(least, most)}, so this node is not allowed"
                )
                hint = "put all nodes of the tree in one Sequence or Selector"
                self._collector.add("too-many-children", message, extra, hint=hint)

    def _subtree(self, element: Element) -> BoundNode:
        tree_id = element.attributes.get("ID")
        bound = BoundNode(element, subtree(), element.attributes.get("name") or tree_id or SUBTREE_TAG)
        self._current.nodes.append(bound)
        self._current.uses.append(bound)
        for child in self._children_without_remaps(element, tree_id or "..."):
            message = f"<{SUBTREE_TAG}> cannot have children, because it refers to a tree"
            hint = f"move them into that <{TREE_TAG}>"
            self._collector.add("child-of-leaf", message, child, hint=hint)
        if not tree_id:
            self._report_without_id(element, f"<{SUBTREE_TAG}> does not name a tree", "the tree's name")
            return bound
        target = self._forest.target(element, tree_id)
        _, theirs, *_ = self._vocabulary_of(self._forest.homes.get(id(target)))
        model = self._models.subtrees.get(tree_id) or theirs.subtrees.get(tree_id)
        bound.remapping = self._remap(bound, model)
        if target is not None:
            bound.subtree = self._tree_of(target)
        elif model is not None:
            self._bind_described(bound, model)
        else:
            trees = self._forest.known_ids
            message, near = f"there is no tree '{tree_id}'", self._guesses.nearest(tree_id, trees)
            hint = f"known trees: {join_with_commas(trees)}. To add trees of other files, use <include>, or trees under [project] in sar.toml"
            cause = None if near else Cause("there are no such trees", tree_id)
            advice = Advice(suggestion=near, hint=hint, common_cause=cause)
            self._collector.add("unknown-tree", message, element, value="ID", **advice)
        self._index_node(bound)
        return bound

    def _bind_described(self, bound: BoundNode, model: NodeModel) -> None:
        """Bind a `SubTree` whose tree only a model describes. It becomes a leaf with the ports of the model."""
        bound.spec = spec = model.spec()
        bound.keys = {name: key for name, key in bound.remapping.keys.items() if name in spec.parameters}
        self._current.skips = True  # the root of the unknown tree may be skipped

    def _remap(self, bound: BoundNode, model: NodeModel | None) -> Remapping:
        element = bound.element
        keys: dict[str, str] = {}
        constants: dict[str, str] = {}
        for name, text in element.attributes.items():
            if name in bound.spec.former_attributes:
                self._attributes.report_former_name(element, name, bound.spec.former_attributes[name])
            elif name in ("ID", "name", AUTOREMAP) or self._attributes.common(bound, name):
                continue
            elif name.startswith("_"):
                self._unknown_of_subtree(element, name)
            else:
                # As in BehaviorTree.CPP, `=` is a string here. In a port, it refers to the key with the port's name.
                key = None if text == "=" else blackboard_key(text, name)
                (constants if key is None else keys)[name] = text if key is None else key
        autoremap = self._attributes.flag(element, AUTOREMAP)
        for port in model.ports.values() if model else ():
            if autoremap or port.name in keys or port.name in constants:
                continue
            if port.default:
                key = blackboard_key(port.default, port.name)
                (constants if key is None else keys)[port.name] = port.default if key is None else key
            else:
                message = f"the tree '{element.attributes['ID']}' needs '{port.name}', according to its model"
                self._collector.add("missing-attribute", message, element, hint=f'write {port.name}="..."')
        return Remapping(keys, constants, autoremap)

    def _unknown_of_subtree(self, element: Element, name: str) -> None:
        message = f"<{SUBTREE_TAG}> has no attribute '{name}', because key names cannot begin with _"
        near = self._attributes.typo_in_note(name)
        self._collector.add("unknown-attribute", message, element, name=name, suggestion=near)


def _best_variant(variants: list[NodeSpec], element: Element, guesses: Guesses) -> NodeSpec:
    """Return the spec of a tag whose parameters fit the written attributes best.

    In case of a tie, the first written attribute decides.
    """
    written = list(element.attributes)

    def misfit(spec: NodeSpec) -> tuple[int, int, int]:
        unknown = [name for name in written if name not in spec.parameters]
        dissimilar = sum(guesses.nearest(name, spec.parameters) is None for name in unknown)
        return len(unknown), dissimilar, -written.index(unknown[0]) if unknown else 0

    return min(variants, key=misfit)


def is_node_of_other_library(element: Element, variants: Sequence[NodeSpec], guesses: Guesses) -> bool:
    """Return whether no attribute of an element resembles an attribute of the tag's specs.

    The result is False for an element with fewer than two attributes.
    """
    written = [name for name in element.attributes if name not in OF_ANY and not name.startswith("_")]
    known = {name for spec in variants for name in spec.parameters}
    return len(written) > 1 and not any(
        name in known or guesses.nearest(name, known) is not None for name in written
    )


def _count_in_words(least: int, most: int | None) -> str:
    if most is None:
        return f"at least {least} children"
    if least == most:
        return "one child" if most == 1 else f"{most} children"
    return f"{least} to {most} children"
