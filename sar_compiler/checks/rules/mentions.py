"""What the nodes of a tree do with keys of the blackboard: ports, names of keys, scripts, subtrees."""

import enum
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from sar_compiler.nodes.attributes import CONDITIONS
from sar_compiler.nodes.bound import BoundNode, BoundTree
from sar_compiler.nodes.spec import Direction, NodeSpec
from sar_compiler.runtime.blackboard import ROOT_SIGN, Scope
from sar_compiler.runtime.expressions import Access, Script, name_uses
from sar_compiler.tree.source import Span


class Deed(enum.Enum):
    """What is done with a key."""

    READ = "read"
    LOOK = "look"
    """Asked for, and done without where nothing has been written."""
    WRITE = "write"
    CHANGE = "change"
    """A script's `=` and the like: the key must have been written, or have a port."""
    BOTH = "both"
    """A port that is both: whoever has it may read first, or write first."""
    FIXED = "fixed"
    """Read when the tree is compiled: a parameter of the mission, or a constant."""


class Moment(enum.IntEnum):
    """When a node does it, seen from the nodes in it."""

    BEFORE = 0
    AFTER = 1


@dataclass(frozen=True)
class Mention:
    """A node's use of a key.

    Attributes:
        bound: The node.
        attribute: The attribute that has it.
        key: The key, as the node's tree calls it.
        deed: What is done with it.
        moment: Whether that is before or after the nodes in it are ticked.
        place: Where it stands in the attribute's value; None for all of it.
        is_certain: Whether it is done whenever the node is ticked.
    """

    bound: BoundNode
    attribute: str
    key: str
    deed: Deed
    moment: Moment = Moment.BEFORE
    place: tuple[int, int] | None = None
    is_certain: bool = True

    def span(self) -> Span:
        """Return where it stands in the file."""
        element = self.bound.element
        if self.place is None:
            return element.value_span(self.attribute)
        return element.within_value(self.attribute, *self.place)


@dataclass(frozen=True)
class Mentions:
    """All that the nodes of a tree do with keys, without its subtrees.

    Attributes:
        mentions: In the order of the file.
        is_open: Whether some node may do with any key what the file does not say.
    """

    mentions: tuple[Mention, ...]
    is_open: bool


_DEEDS = {Direction.INPUT: Deed.READ, Direction.OUTPUT: Deed.WRITE, Direction.INOUT: Deed.BOTH}
_ACCESSES = {Access.READ: Deed.READ, Access.CREATE: Deed.WRITE, Access.CHANGE: Deed.CHANGE}
_OTHER_DEEDS: Mapping[tuple[str, str], Deed | None] = {
    ("CheckBlackboardVariableExists", "variable_name"): Deed.LOOK,
    ("CheckBlackboardVariableValue", "variable"): Deed.LOOK,
    ("CompareBlackboardVariables", "var1_key"): Deed.LOOK,
    ("CompareBlackboardVariables", "var2_key"): Deed.LOOK,
    ("WaitForBlackboardVariable", "variable_name"): Deed.LOOK,
    ("WaitForBlackboardVariableValue", "variable"): Deed.LOOK,
    ("WasEntryUpdated", "entry"): Deed.LOOK,
    ("SkipUnlessUpdated", "entry"): Deed.LOOK,
    ("WaitValueUpdate", "entry"): Deed.LOOK,
    **{(f"Loop{kind}", "queue"): Deed.LOOK for kind in ("Int", "Double", "Bool", "String")},
    ("ForEach", "target_key"): Deed.WRITE,
    ("StatusToBlackboard", "variable_name"): Deed.WRITE,
    ("SetBlackboardVariable", "variable_name"): Deed.WRITE,
    ("UnsetBlackboardVariable", "key"): None,
    ("UnsetBlackboard", "key"): None,
}
"""Where the direction of a port does not say all."""
_BY_NAME: Mapping[tuple[str, str], Deed] = {
    ("SetBlackboard", "output_key"): Deed.WRITE,
    ("WasEntryUpdated", "entry"): Deed.LOOK,
    ("SkipUnlessUpdated", "entry"): Deed.LOOK,
    ("WaitValueUpdate", "entry"): Deed.LOOK,
}
"""Ports of texts that name a key when they are written without braces."""
_POST = ("_onSuccess", "_onFailure", "_onHalted", "_post")
_OUR_OWN = ("sar_compiler.", "py_trees.")


def mentions_of(tree: BoundTree) -> Mentions:
    """Return what the nodes of a tree do with keys."""
    involved = dict.fromkeys([*tree.keyed, *tree.demanding])
    if tree.wrappers:
        involved.update(dict.fromkeys(node for node in tree.nodes if node.conditions))
    mentions = [mention for bound in involved for mention in _of_node(bound)]
    mentions.sort(key=lambda mention: (mention.bound.element.line, mention.bound.element.column))
    return Mentions(tuple(mentions), any(_is_open(bound) for bound in involved))


def _of_node(bound: BoundNode) -> Iterator[Mention]:
    if bound.conditions:
        for attribute in CONDITIONS:
            if attribute in bound.conditions:
                moment = Moment.AFTER if attribute in _POST else Moment.BEFORE
                # The scripts after a node belong to one answer each, and may never be run.
                yield from _of_script(bound, attribute, bound.conditions[attribute], moment)
    for name, key in bound.keys.items():
        yield from _of_port(bound, name, key)
    for name, value in bound.values.items():
        if isinstance(value, Script):
            yield from _of_script(bound, name, value, Moment.BEFORE)
        elif isinstance(value, str):
            yield from _of_text(bound, name, value)
    if bound.spec.tag == "CheckBlackboardVariableValues":
        yield from _of_checks(bound)


def _of_port(bound: BoundNode, name: str, key: str) -> Iterator[Mention]:
    parameter = bound.spec.parameters.get(name)
    if parameter is None:
        return
    if parameter.value_type is not None and parameter.value_type.names_key:
        key = _entry(key)
    deed: Deed | None = _DEEDS[parameter.direction] if parameter.direction else Deed.FIXED
    deed = _OTHER_DEEDS.get((bound.spec.tag, name), deed)
    if deed is not None:
        yield Mention(bound, name, key, deed)


def _of_text(bound: BoundNode, name: str, text: str) -> Iterator[Mention]:
    place = (bound.spec.tag, name)
    parameter = bound.spec.parameters.get(name)
    if place in _BY_NAME:
        yield Mention(bound, name, text, _BY_NAME[place])
    elif parameter is not None and parameter.value_type is not None and parameter.value_type.names_key:
        deed = _DEEDS[parameter.direction] if parameter.direction else Deed.FIXED
        known = _OTHER_DEEDS.get(place, deed)
        if known is not None:
            yield Mention(bound, name, _entry(text), known)


def _of_checks(bound: BoundNode) -> Iterator[Mention]:
    checks = bound.values.get("checks")
    for check in checks if isinstance(checks, list) else ():
        words = str(check).split()
        if words:
            yield Mention(bound, "checks", _entry(words[0]), Deed.LOOK)


def _of_script(bound: BoundNode, attribute: str, script: Script, moment: Moment) -> Iterator[Mention]:
    for use in name_uses(script):
        place = (use.start, use.end)
        yield Mention(bound, attribute, use.name, _ACCESSES[use.access], moment, place, use.certain)


def _entry(variable: str) -> str:
    """Return the key of a variable such as `key.attribute`."""
    return variable.partition(".")[0]


def _is_open(bound: BoundNode) -> bool:
    """Say whether a node may do with keys what its attributes do not say."""
    if bound.spec.tag == "Script" and "code" in bound.keys:
        return True
    if bound.spec.tag == "SetBlackboard" and "output_key" in bound.keys:
        return True
    return _has_scope(bound.spec)


def _has_scope(spec: NodeSpec) -> bool:
    made_by = (spec.factory or spec.cls).__module__ if spec.cls is not None else ""
    own = made_by.startswith(_OUR_OWN)
    return not own and any(parameter.target is Scope for parameter in spec.handed_over)


def is_of_root(key: str) -> bool:
    """Say whether a key is written as one of the main tree: `@key`."""
    return key.startswith(ROOT_SIGN)
