"""Attributes whose values are message fields in YAML. `nodes.ros_fields` parses these values."""

import re
from collections.abc import Mapping

from sar_compiler.tree.diagnostic import LINE_END

FIELD_ATTRIBUTES: Mapping[str, tuple[str, ...]] = {
    "RosAction": ("goal", "fields", "feedback"),
    "RosPublish": ("message",),
    "RosService": ("request", "fields"),
    "RosTopic": ("fields",),
}
"""The attributes that contain message fields, by the node's tag.

A tree file is read without node models, so this table repeats the ports of `nodes.ros_leaves`. A test
compares both.
"""
EXPLICIT_TAGS = ("Action", "Condition", "Control", "Decorator")
"""The tags of nodes in explicit form, whose ID is the name of the node."""

# A YAML scalar cannot begin with `@`, but a blackboard key can. Within braces, the brackets of a field such as `poses[0]` end
# the scalar. Private-use characters replace these characters while YAML is parsed, so that all offsets stay the same.
_MASKS = {ord("@"): "\ue000", ord("["): "\ue001", ord("]"): "\ue002"}
_UNMASKS = {ord(after): chr(before) for before, after in _MASKS.items()}
_MASKED = re.compile(r"(?<=\{)\s*@(?=\w)|(?<=\w)\[\d+\](?=[\w.\[\]]*\s*:)")


def is_fields_attribute(tag: str, attributes: Mapping[str, str], name: str) -> bool:
    """Return whether an attribute of an element contains message fields in YAML."""
    return name in FIELD_ATTRIBUTES.get(attributes.get("ID", "") if tag in EXPLICIT_TAGS else tag, ())


def mask(text: str) -> str:
    """Replace characters that YAML does not accept in keys and fields by private-use characters."""
    return _MASKED.sub(lambda match: match[0].translate(_MASKS), text)


def unmask(text: str) -> str:
    """Restore the original characters in a part of a masked text."""
    return text.translate(_UNMASKS)


def dedent(text: str, column: int) -> str:
    """Remove the common indentation from a part of a file.

    Args:
        text: The part.
        column: The column of the part's first character, from 1. Up to *column* - 1 spaces are removed from each later
            line.
    """
    first, *rest = LINE_END.split(text)
    blanks = re.compile(f" {{0,{column - 1}}}")
    return "\n".join([first, *(blanks.sub("", line, count=1) for line in rest)])


def end_of_block(text: str, start: int, end: int, value: str) -> int:
    """Return the end of a block scalar. Blank lines that are not part of its value are excluded."""
    last = start + len(text[start:end].rstrip())
    ends = [*LINE_END.finditer(text, last, end)]
    if not ends:
        return end
    breaks = len(value) - len(value.rstrip("\n"))
    return ends[min(breaks, len(ends)) - 1].end() if breaks else ends[0].start()
