"""Attributes whose values are YAML: the fields of messages, which `nodes.ros_fields` reads."""

import re
from collections.abc import Mapping

from sar_compiler.tree.diagnostic import LINE_END

FIELD_ATTRIBUTES: Mapping[str, tuple[str, ...]] = {
    "RosAction": ("goal", "fields", "feedback"),
    "RosPublish": ("message",),
    "RosService": ("request", "fields"),
    "RosTopic": ("fields",),
}
"""The attributes that take message fields, by the node's tag.

A tree file is read without node models, so this repeats the ports of `nodes.ros_leaves`; a test compares them.
"""
EXPLICIT_TAGS = ("Action", "Condition", "Control", "Decorator")
"""The tags of nodes in explicit form, which are named by their ID."""

# In YAML, no scalar begins with `@`, but a key may, and the brackets of a field such as `poses[0]` end it between braces.
# Private-use characters replace them while YAML is parsed, so that all offsets stay the same.
_MASKS = {ord("@"): "\ue000", ord("["): "\ue001", ord("]"): "\ue002"}
_UNMASKS = {ord(after): chr(before) for before, after in _MASKS.items()}
_MASKED = re.compile(r"(?<=\{)\s*@(?=\w)|(?<=\w)\[\d+\](?=[\w.\[\]]*\s*:)")


def is_fields_attribute(tag: str, attributes: Mapping[str, str], name: str) -> bool:
    """Return whether an attribute of an element takes YAML."""
    return name in FIELD_ATTRIBUTES.get(attributes.get("ID", "") if tag in EXPLICIT_TAGS else tag, ())


def mask(text: str) -> str:
    """Return a text with replacements for the characters in keys and fields that YAML does not accept."""
    return _MASKED.sub(lambda match: match[0].translate(_MASKS), text)


def unmask(text: str) -> str:
    """Return a part of a masked text with its original characters."""
    return text.translate(_UNMASKS)


def dedent(text: str, column: int) -> str:
    """Return a part of a file as a separate text.

    Args:
        text: The part.
        column: The column of its first character, from 1; at most *column* - 1 blanks are removed from each other line.
    """
    first, *rest = LINE_END.split(text)
    blanks = re.compile(f" {{0,{column - 1}}}")
    return "\n".join([first, *(blanks.sub("", line, count=1) for line in rest)])


def end_of_block(text: str, start: int, end: int, value: str) -> int:
    """Return the end offset of a block scalar, excluding blank lines that are not part of its value."""
    last = start + len(text[start:end].rstrip())
    ends = [*LINE_END.finditer(text, last, end)]
    if not ends:
        return end
    breaks = len(value) - len(value.rstrip("\n"))
    return ends[min(breaks, len(ends)) - 1].end() if breaks else ends[0].start()
