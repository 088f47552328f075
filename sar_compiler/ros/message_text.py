"""The definitions of messages as text, read off their Python classes: what readers of a recording know them by."""

from importlib import import_module
from typing import Any

# What a class calls a type, where a definition has another word.
_WORDS = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
_BETWEEN = f"{'=' * 80}\nMSG: "


def type_name(kind: Any) -> str:
    """Return the full name of a message's type, such as `nav2_msgs/msg/BehaviorTreeLog`."""
    package, folder, *_ = kind.__module__.split(".")
    return f"{package}/{folder}/{kind.__name__}"


def message_text(kind: Any) -> str:
    """Return the definition of a message in the form `ros2msg`, with those of all messages in it."""
    inner: dict[str, Any] = {}
    parts = [_fields(kind, inner)]
    # More of them come to light in those that are written down.
    seen: set[str] = set()
    while left := [name for name in inner if name not in seen]:
        for name in left:
            seen.add(name)
            parts.append(f"{_BETWEEN}{name}\n{_fields(inner[name], inner)}")
    return "".join(parts)


def _fields(kind: Any, inner: dict[str, Any]) -> str:
    """Return the lines of a message's fields, and note the messages in it."""
    for slot in kind.SLOT_TYPES:
        slot = getattr(slot, "value_type", slot)  # noqa: PLW2901 - of an array, what it has in it
        if hasattr(slot, "namespaces"):
            # The parts of an action are beside it.
            beside, there = (import_module(name) for name in (kind.__module__, ".".join(slot.namespaces)))
            found = getattr(there, slot.name, None) or getattr(beside, slot.name)
            inner.setdefault(f"{slot.namespaces[0]}/{slot.name}", found)
    return "".join(f"{_written(text)} {name}\n" for name, text in kind.get_fields_and_field_types().items())


def _written(text: str) -> str:
    """Return a field's type as a definition has it: `float64[36]`, `string[<=10]`, `geometry_msgs/Pose[]`."""
    if text.startswith("sequence<"):
        item, _, most = text.removeprefix("sequence<").removesuffix(">").partition(", ")
        return f"{_written(item)}[{f'<={most}' if most else ''}]"
    if text.endswith("]"):
        item, _, count = text.partition("[")
        return f"{_written(item)}[{count}"
    word, bound, most = text.partition("<")
    if bound:
        return f"{word}<={most.removesuffix('>')}"
    return _WORDS.get(text, text)
