"""Rules of BehaviorTree.CPP for the C++ types of ports: which types can share a key, and which can be read.

BehaviorTree.CPP compares types twice. When it creates a tree, the first node that names a key gives the entry its type
(`src/xml_parsing.cpp`, `createNodeFromXML`), and a port of another type is rejected. When it ticks the tree, a value is
converted to the type of the port that reads it (`utils/safe_any.hpp`), which is possible only between types of numbers.
"""

import re

from sar_compiler.nodes.btcpp import LISTS, NUMBERS, Version
from sar_compiler.nodes.cpp_names import ANY, INT, LONG, REAL, STATUS, TEXT, UNSIGNED_INT, normalize
from sar_compiler.nodes.values import JSON, STATUSES, TRUTH_VALUES, literal_value, type_of_cpp_name

_INT_RANGE = range(-(2**31), 2**31)
_UNTYPED = ("", ANY)
_INTEGERS = ("int8_t", "uint8_t", "int16_t", "uint16_t", INT, UNSIGNED_INT, LONG, "uint64_t")
_NUMBERS = frozenset((*_INTEGERS, "float", REAL, "bool", "long long", "unsigned long long"))
# Integer types that 4.8 to 4.10 do not convert to each other, because they do not compare the ranges.
_KEPT_BY = {
    INT: (UNSIGNED_INT, "uint64_t", "int16_t"),
    UNSIGNED_INT: (INT, "int16_t"),
    LONG: (INT, "uint64_t", "int16_t"),
    "uint64_t": (INT, LONG, "int16_t"),
    "int16_t": (UNSIGNED_INT, "uint64_t", "uint16_t"),
    "uint16_t": ("int16_t",),
}
_QUEUE = r"std::(?:vector|shared_ptr<std::deque)<([^<>]*)>>?"
_ITEMS = {"LoopInt": INT, "LoopDouble": REAL, "LoopBool": "bool", "LoopString": TEXT}
_QUEUE_NAME = "queue."
_LIST = r"std::vector<(.*)>"
_POINTER, _POINTER_TO_TEXT = "std::shared_ptr<", "std::shared_ptr<std::deque<"
# The formats of std::from_chars and std::stod.
_NUMBER = r"(?i)-?(\.?\d|inf|nan)"
_OLD_REAL = r"(?i)\s*[+-]?(\.?\d|inf|nan)"


def may_share(first: str, later: str) -> bool:
    """Return whether BehaviorTree.CPP accepts a tree in which ports of two types share a key.

    A port without a type matches every other port. A port for strings matches every later port. Unknown types are compared
    by name. `Pose` may be short for `geometry_msgs::msg::Pose`.

    Args:
        first: The normalised type of the first port in the expanded tree.
        later: The normalised type of the other port.
    """
    return first in _UNTYPED or later in _UNTYPED or first == TEXT or is_same(first, later)


def is_same(first: str, second: str) -> bool:
    """Return whether two type names are equal. The names may differ in that one lacks the namespace."""
    return first == second or first.endswith(f"::{second}") or second.endswith(f"::{first}")


def is_untyped(cpp: str) -> bool:
    """Return whether a port of a type accepts values of every type."""
    return cpp in _UNTYPED


def is_number(cpp: str) -> bool:
    """Return whether the values of a type are numbers for BehaviorTree.CPP."""
    return cpp in _NUMBERS or cpp == STATUS


def is_whole(cpp: str) -> bool:
    """Return whether BehaviorTree.CPP treats the values of a type as integers. This includes bools."""
    return cpp in _INTEGERS or cpp == "bool"


def is_loop_queue(name: str) -> bool:
    """Return whether the name of a `ValueType` is that of a loop's queue."""
    return name.startswith(_QUEUE_NAME)


def can_be_read(written: str, port: str, version: Version) -> bool:
    """Return whether a port may read values of another type, although some of these values may be invalid.

    Args:
        written: The normalised type of the value.
        port: The normalised type of the port, or the name of a loop's queue type.
        version: The version of BehaviorTree.CPP; before 4.9.0, a loop accepted neither lists nor strings from an entry.
    """
    if is_loop_queue(port):
        item = _ITEMS[port.removeprefix(_QUEUE_NAME)]
        match = re.fullmatch(_QUEUE, written)
        is_list = match is not None and match[1] == item
        if version < LISTS.since:
            return is_untyped(written) or (is_list and written.startswith("std::shared_ptr"))
        return written == TEXT or is_untyped(written) or is_list
    if may_share(written, port):
        return written != TEXT or not _is_pointer(port)
    return is_number(written) and (is_number(port) or port == TEXT)


def can_be_converted(value: object, port: str, version: Version) -> bool:
    """Return whether BehaviorTree.CPP can convert a value to the type of a port.

    The user's C++ code is assumed to convert strings to its own types, except for pointers.

    Args:
        value: The string or number.
        port: The normalised type of the port, or the name of a loop's queue type.
        version: The version of BehaviorTree.CPP.
    """
    if not isinstance(value, str):
        is_whole_number = not isinstance(value, float) or value.is_integer()
        return _is_in_range(value, port) and (port != STATUS or is_whole_number)
    item, items = port, [value]
    if is_loop_queue(port):
        item, items = _ITEMS[port.removeprefix(_QUEUE_NAME)], value.split(";") if value else []
    elif match := re.fullmatch(_LIST, port):
        if value.startswith(JSON):
            return version >= LISTS.since
        item, items = match[1], value.split(";") if value else []
    words = {STATUS: STATUSES, "bool": TRUTH_VALUES}.get(item)
    if words is not None:
        return all(each in words for each in items)
    if item in _NUMBERS:
        is_old_real = item not in _INTEGERS and version < LISTS.since
        number = _OLD_REAL if is_old_real else _NUMBER
        return all(re.match(number, each) and _is_in_range(literal_value(each), item) for each in items)
    return not _is_pointer(item)


def needs_converter(cpp: str) -> bool:
    """Return whether reading a type from a string requires the user's `convertFromString`."""
    match = re.fullmatch(_LIST, cpp)
    item = match[1] if match else cpp
    known = is_untyped(cpp) or item == TEXT or is_number(item) or is_loop_queue(cpp)
    return not known and not _is_pointer(cpp)


def _is_in_range(value: object, cpp: str) -> bool:
    """Return whether a value is within the range of an integer type; True for other types."""
    kind = type_of_cpp_name(cpp) if isinstance(value, int) else None
    if kind is None or kind.least is None or kind.most is None:
        return True
    return kind.least <= value <= kind.most  # type: ignore[operator]


def _is_pointer(cpp: str) -> bool:
    """Return whether a type is a pointer, which cannot be read from a string."""
    return cpp.startswith(_POINTER) and not cpp.startswith(_POINTER_TO_TEXT)


def can_replace(written: str, held: str) -> bool:
    """Return whether a port can overwrite a value of another type in an entry without a fixed type.

    Args:
        written: The normalised type of the port that writes.
        held: The normalised type of the existing value.
    """
    if is_untyped(written) or is_untyped(held) or is_same(written, held):
        return True
    if held not in _NUMBERS or (held == "bool" and written in _NUMBERS):
        # A string can replace a list, as it can replace a number.
        return written == TEXT and held.startswith("std::vector<")
    return written == TEXT or (written in _NUMBERS and written not in _KEPT_BY.get(held, ()))


def can_be_copied(written: str, entry: str) -> bool:
    """Return whether `SetBlackboard` can copy a value of one type to an entry of another type."""
    return written == TEXT or is_untyped(written) or is_untyped(entry) or is_same(written, entry)


def type_of_constant(text: str, version: Version) -> str:
    """Return the C++ type that a subtree's constant gives an entry; empty for a string, which gives none."""
    value = literal_value(text) if version >= NUMBERS.since else text
    if isinstance(value, float):
        return REAL
    if isinstance(value, int):
        return INT if value in _INT_RANGE else LONG
    return ""


def type_of_port(type_name: str, cpp: str, version: Version) -> str:
    """Return the normalised C++ type of a port.

    Args:
        type_name: The name of the port's `ValueType`.
        cpp: The port's declared C++ type.
        version: The version of BehaviorTree.CPP; before 4.9.0, the queue of a loop had a type.
    """
    if is_loop_queue(type_name) and version < LISTS.since:
        return f"std::shared_ptr<std::deque<{_ITEMS[type_name.removeprefix(_QUEUE_NAME)]}>>"
    return normalize(cpp)
