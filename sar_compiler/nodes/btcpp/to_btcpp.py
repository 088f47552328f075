"""Conversion of a tree file for BehaviorTree.CPP 4 and Groot2.

BehaviorTree.CPP rejects attributes that its nodes do not have. Therefore `memory`, `oneshot`, and the decorators of this
project and of py_trees are replaced by nodes of BehaviorTree.CPP. Nodes without a counterpart are kept and reported.
"""

import dataclasses
from collections.abc import Iterable, Iterator

from sar_compiler.nodes.binding.attributes import KIND_TAGS, ONESHOT, ONESHOT_TYPE
from sar_compiler.nodes.binding.nesting import RESERVED, invalid_id_part
from sar_compiler.nodes.btcpp import DROPS_EXPLICIT, NAMES, NEWEST, VERSIONS, Version
from sar_compiler.nodes.btcpp.draft import NodeDraft
from sar_compiler.nodes.btcpp.rewrites import NO_ONESHOT, Rewrite
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.cpp_names import normalize
from sar_compiler.nodes.models import NodeModel, read_models, registry_without
from sar_compiler.nodes.models.palette import description, inferred_model, is_built_in
from sar_compiler.nodes.numbers import convert_duration, parse_milliseconds
from sar_compiler.nodes.registry import Registry, is_library_tag, subtree
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, ParameterRole
from sar_compiler.nodes.values import (
    ConversionError,
    blackboard_key,
    items_of,
    parse_integer,
    type_of_cpp_name,
)
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import (
    INCLUDE_TAG,
    MODEL_TAG,
    SUBTREE_TAG,
    TREE_TAG,
    Element,
    TreeFile,
    synthetic_element,
)

_QUEUES = {("LoopInt", "queue"): "std::vector<int>"}
"""The port types that BehaviorTree.CPP and this project declare differently."""


def to_btcpp(
    tree_file: TreeFile, registry: Registry, palettes: Iterable[TreeFile] = (), btcpp: Version | None = None
) -> tuple[TreeFile, list[Diagnostic]]:
    """Rewrite a tree file for BehaviorTree.CPP 4 and Groot2.

    Args:
        tree_file: The file.
        registry: The registered nodes.
        palettes: Further files with models of nodes.
        btcpp: The target version; None for the newest version.

    Returns:
        The converted file, and findings in file order: warnings about content that BehaviorTree.CPP does not support,
        and notes about slight differences.
    """
    conversion = _BtcppConverter(registry, btcpp or NEWEST)
    root = conversion.root(tree_file, palettes)
    notes = sorted(conversion.notes.findings, key=lambda note: (note.span.line, note.span.column))
    return dataclasses.replace(tree_file, root=root), notes


@dataclasses.dataclass
class _Usage:
    """The use of a tag in a tree file."""

    children: int = 0
    ports: dict[str, None] = dataclasses.field(default_factory=dict)

    @property
    def kind(self) -> Kind:
        """The kind of the node, inferred from the number of children."""
        if not self.children:
            return Kind.ACTION
        return Kind.DECORATOR if self.children == 1 else Kind.CONTROL


class _BtcppConverter:
    def __init__(self, registry: Registry, btcpp: Version) -> None:
        self._registry = registry
        self._btcpp = btcpp
        self._used: dict[str, _Usage] = {}
        self._models: dict[str, NodeModel] = {}
        self._units: dict[str, str] = {}
        self._referring: set[tuple[str, str]] = set()
        self.notes = FindingCollector()

    def root(self, tree_file: TreeFile, palettes: Iterable[TreeFile]) -> Element:
        palettes = tuple(palettes)
        own = read_models([tree_file], FindingCollector()).nodes
        self._registry = registry_without(
            self._registry, read_models([tree_file, *palettes], FindingCollector())
        )
        root = tree_file.root
        others = read_models(palettes, FindingCollector()).nodes
        self._models = {**others, **own}
        self._units = self._units_of_keys(tree_file)
        children = [self._section(child) for child in root.children]
        for tree in tree_file.trees:
            self._tree_id(tree)
        missing = [tag for tag in self._used if tag not in own]
        if missing:
            models = [
                _copy(others[tag].element)
                if tag in others and tag not in self._registry
                else self._model(tag)
                for tag in missing
            ]
            children = _with_models(children, models)
        if len(children) > 1:
            # BehaviorTree.CPP accepts a tree without an ID only if the file has no other section.
            children = list(_with_ids(children))
        attributes = dict(root.attributes)
        if "BTCPP_format" not in attributes:
            attributes = {"BTCPP_format": "4", **attributes}
        return dataclasses.replace(root, attributes=attributes, children=tuple(children))

    def _section(self, element: Element) -> Element:
        if element.tag == INCLUDE_TAG:
            hint = "convert the included file, too, and include the result"
            self.notes.add("not-converted", "the included file is not converted", element, hint=hint)
        if element.tag != TREE_TAG:
            return element
        return dataclasses.replace(element, children=tuple(self._children(element, TREE_TAG)))

    def _tree_id(self, element: Element) -> None:
        tree_id = element.attributes.get("ID", "")
        refused = invalid_id_part(tree_id)
        if self._btcpp >= NAMES.since and (refused or tree_id in RESERVED):
            message = f"BehaviorTree.CPP rejects the ID '{tree_id}'"
            what = f"an ID without {refused}" if refused else "another ID"
            self.notes.add("no-counterpart", message, element, value="ID", hint=f"give the tree {what}")
        elif self._is_built_in(tree_id) or tree_id in self._used:
            message = f"BehaviorTree.CPP rejects the ID '{tree_id}', because a node has the same ID"
            self.notes.add("no-counterpart", message, element, value="ID", hint="give the tree another ID")

    def _children(self, element: Element, parent: str) -> Iterator[Element]:
        for child in element.children:
            yield self._node(child, parent)

    def _node(self, element: Element, parent: str) -> Element:
        draft = self._subtree(element) if element.tag == SUBTREE_TAG else self._draft(element)
        policy = self._remove_oneshot(draft)
        name = draft.attributes.get("name") or draft.attributes.get("ID") or draft.tag
        for rewrite in dict.fromkeys(self._rewrites(draft.tag)):
            rewrite(draft, self.notes)
        self._report_counterparts(draft)
        self._report_integer_ranges(draft)
        draft.explicit = self._is_explicit(draft, parent if policy is None else "")
        converted = self._element(draft)
        if policy is None:
            return converted
        # The compiler uses the same name for the OneShot that it creates from the attribute.
        return self._wrap_run_once(element, converted, f"{name}OneShot", policy)

    def _is_built_in(self, tag: str) -> bool:
        return is_built_in([subtree()] if tag == SUBTREE_TAG else self._registry.variants(tag))

    def _rewrites(self, tag: str) -> Iterator[Rewrite]:
        """Yield the rewrites for BehaviorTree.CPP that are declared in the specs of a tag."""
        for spec in self._registry.variants(tag):
            if spec.semantics.counterpart.rewrite is not None:
                yield spec.semantics.counterpart.rewrite

    def _draft(self, element: Element) -> NodeDraft:
        attributes = dict(element.attributes)
        explicit = element.tag in KIND_TAGS and "ID" in attributes
        tag = attributes.pop("ID") if explicit else element.tag
        for name, unit in self._durations(tag).items():
            if name in attributes:
                attributes[name] = convert_duration(attributes[name], unit)
        return NodeDraft(element, tag, attributes, explicit)

    def _durations(self, tag: str) -> dict[str, str]:
        """Return, for each duration attribute of a tag, the unit of numbers without a unit."""
        attributes = (each for spec in self._registry.variants(tag) for each in spec.attributes)
        return {each.name: each.value_type.unit for each in attributes if each.value_type.unit}

    def _units_of_keys(self, tree_file: TreeFile) -> dict[str, str]:
        """Return, for each key that an attribute reads as a duration, the unit of numbers without a unit."""
        units: dict[str, str] = {}
        for element in tree_file.root.iterate():
            tag = element.attributes.get("ID", "") if element.tag in KIND_TAGS else element.tag
            for name, unit in self._durations(tag).items():
                key = blackboard_key(element.attributes.get(name, ""), name)
                if key is not None:
                    units[key] = unit
        return units

    def _subtree(self, element: Element) -> NodeDraft:
        """Report durations with units that are passed to a subtree.

        BehaviorTree.CPP reads them as strings.
        """
        for name, text in element.attributes.items():
            if name in self._units and parse_milliseconds(text) is not None:
                message = f"{name}: BehaviorTree.CPP has no units and would read '{text}' as another number"
                hint = f"write {convert_duration(text, self._units[name])} instead of {text}"
                self.notes.add("no-counterpart", message, element, value=name, hint=hint)
        return NodeDraft(element, SUBTREE_TAG, dict(element.attributes), explicit=False, kept=True)

    def _remove_oneshot(self, draft: NodeDraft) -> str | None:
        """Remove the attribute `oneshot`, and return its policy; None if there is none."""
        if ONESHOT not in draft.attributes:
            return None
        try:
            policy = ONESHOT_TYPE.convert(draft.attributes[ONESHOT])
        except ConversionError as error:
            self.notes.wrong_value(draft.element, ONESHOT, error)
            draft.kept = True
            return None
        del draft.attributes[ONESHOT]
        return str(policy)

    def _wrap_run_once(self, element: Element, child: Element, name: str, policy: str) -> Element:
        attributes = {"name": name, "then_skip": "false"}
        tag = "RunOnce"
        if policy == "ON_SUCCESSFUL_COMPLETION":
            tag, attributes = "OneShot", {"name": name, "policy": policy}
            message = f"{ONESHOT}: BehaviorTree.CPP has no node that retries until the first success"
            self.notes.add("no-counterpart", message, element, value=ONESHOT, hint=NO_ONESHOT)
            self._record_use(tag, attributes, 1)
        return Element(tag, attributes, (child,), element.source, *element.position)

    def _report_counterparts(self, draft: NodeDraft) -> None:
        """Report missing counterparts, and remove the attributes that BehaviorTree.CPP would reject."""
        specs = self._registry.variants(draft.tag)
        refused = invalid_id_part(draft.tag)
        if refused and not draft.explicit and self._btcpp >= NAMES.since:
            message = f"BehaviorTree.CPP rejects the node '{draft.tag}'"
            hint = f"register the node under a name without {refused}"
            self.notes.add("no-counterpart", message, draft.element, hint=hint)
        if draft.kept or not specs:
            return
        spec = specs[0]
        since = spec.semantics.counterpart.since
        if since and self._btcpp < VERSIONS[since]:
            message = (
                f"BehaviorTree.CPP has <{draft.tag}> since {since}, but the target version is {self._btcpp}"
            )
            self.notes.add("no-counterpart", message, draft.element, hint=spec.semantics.counterpart.hint)
        built_in = is_built_in(specs)
        if not built_in:
            if spec.semantics.counterpart.hint and (not spec.kind.is_leaf or is_library_tag(draft.tag)):
                message = f"BehaviorTree.CPP has no <{draft.tag}>"
                self.notes.add("no-counterpart", message, draft.element, hint=spec.semantics.counterpart.hint)
            for parameter in spec.references:
                self._note_reference(draft.element, draft.tag, parameter)
        known = {name for each in specs for name in _ports(each, built_in=built_in)}
        for name in [name for name in draft.attributes if name not in known and not name.startswith("_")]:
            del draft.attributes[name]
            if name in draft.element.attributes:
                message = f"BehaviorTree.CPP's <{draft.tag}> has no attribute '{name}', so it is removed"
                self.notes.add("left-out", message, draft.element, name=name)

    def _note_reference(self, element: Element, tag: str, parameter: Parameter) -> None:
        """Report, once for each kind of node, that BehaviorTree.CPP treats a reference as a plain string."""
        if (tag, parameter.name) in self._referring:
            return
        self._referring.add((tag, parameter.name))
        what = parameter.target_name or "node"
        message = (
            f"{parameter.name}: in BehaviorTree.CPP, <{tag}> receives the name of a {what}, not the node"
        )
        hint = "in C++, pass the data through the blackboard"
        self.notes.add("reference", message, element, name=parameter.name, hint=hint)

    def _report_integer_ranges(self, draft: NodeDraft) -> None:
        """Report integers outside of the range of the port's C++ type."""
        for name, text in draft.attributes.items():
            type_name = normalize(self._type_name(draft.tag, name))
            kind = type_name.removeprefix("std::vector<").removesuffix(">")
            value_type = type_of_cpp_name(kind)
            least, most = (value_type.least, value_type.most) if value_type is not None else (None, None)
            if least is None or most is None or blackboard_key(text, name) is not None:
                continue
            try:
                numbers = items_of(text, parse_integer) if kind != type_name else [parse_integer(text)]
            except ConversionError:
                continue  # validation reports it
            beyond = next((number for number in numbers if not least <= number <= most), None)
            if beyond is not None:
                message = f"{name}: {beyond} does not fit into BehaviorTree.CPP's {kind}"
                hint = f"write a number from {least} to {most}"
                self.notes.add("no-counterpart", message, draft.element, value=name, hint=hint)

    def _type_name(self, tag: str, name: str) -> str:
        """Return the C++ type of an attribute; an empty string if the type is unknown."""
        model = self._models.get(tag)
        if model is not None and name in model.ports and not self._is_built_in(tag):
            return model.ports[name].type_name
        for spec in self._registry.variants(tag):
            if name in spec.parameters:
                return _QUEUES.get((tag, name), spec.parameters[name].value_type.cpp)
        return ""

    def _is_explicit(self, draft: NodeDraft, parent: str) -> bool:
        """Return whether a node must be written in explicit form."""
        if draft.tag in KIND_TAGS and draft.tag in self._registry:
            return True  # the compact tag would be read as the explicit form of another node
        if draft.explicit and parent == DROPS_EXPLICIT:
            message = (
                f"BehaviorTree.CPP 4.7 to 4.10 do not recognise <{draft.element.tag}> directly in <{parent}>"
            )
            if invalid_id_part(draft.tag) or draft.tag in KIND_TAGS:
                hint = "wrap it in a Sequence"
                self.notes.add("no-counterpart", message, draft.element, hint=hint)
                return True
            self.notes.add("differs", f"{message}, so it is written as <{draft.tag}>", draft.element)
            return False
        return draft.explicit

    def _element(self, draft: NodeDraft) -> Element:
        element = draft.element
        children = tuple(self._children(element, draft.tag)) or tuple(draft.children)
        if draft.tag != SUBTREE_TAG:
            self._record_use(draft.tag, draft.attributes, len(children))
        if not draft.explicit:
            return dataclasses.replace(element, tag=draft.tag, attributes=draft.attributes, children=children)
        spec = self._registry.get(draft.tag)
        tag = spec.kind.value if spec else element.tag
        attributes = {"ID": draft.tag, **draft.attributes}
        return dataclasses.replace(element, tag=tag, attributes=attributes, children=children)

    def _record_use(self, tag: str, attributes: Iterable[str], children: int) -> None:
        if self._is_built_in(tag):
            return
        usage = self._used.setdefault(tag, _Usage())
        usage.children = max(usage.children, children)
        usage.ports.update((name, None) for name in attributes if name != "name" and not name.startswith("_"))

    def _model(self, tag: str) -> Element:
        specs = self._registry.variants(tag)
        if specs:
            return description(specs)
        usage = self._used[tag]
        return inferred_model(usage.kind.value, tag, usage.ports)


def _ports(spec: NodeSpec, *, built_in: bool) -> Iterator[str]:
    """Yield the attributes that a node has in BehaviorTree.CPP."""
    for parameter in spec.attributes:
        if parameter.role is ParameterRole.NAME or parameter.direction is not None or not built_in:
            yield parameter.name


def _with_models(sections: list[Element], models: list[Element]) -> list[Element]:
    """Add models to the file's `TreeNodesModel`, or to a new section at the end."""
    for number, section in enumerate(sections):
        if section.tag == MODEL_TAG:
            extended = dataclasses.replace(section, children=(*section.children, *models))
            return [*sections[:number], extended, *sections[number + 1 :]]
    return [*sections, synthetic_element(MODEL_TAG, children=models)]


def _with_ids(sections: Iterable[Element]) -> Iterator[Element]:
    """Add generated IDs to trees without an ID."""
    number = 0
    for section in sections:
        number += section.tag == TREE_TAG
        if section.tag == TREE_TAG and "ID" not in section.attributes:
            attributes = {"ID": f"{TREE_TAG}_{number}", **section.attributes}
            yield dataclasses.replace(section, attributes=attributes)
        else:
            yield section


def _copy(element: Element) -> Element:
    """Copy an element and its content, but not its location in a file."""
    return synthetic_element(element.tag, element.attributes, map(_copy, element.children), element.text)
