"""The types of blackboard entries, and findings about ports that cannot share an entry."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.instances import TreeInstance
from sar_compiler.nodes.btcpp import NUMBERS, Version
from sar_compiler.nodes.btcpp.port_types import (
    is_loop_queue,
    is_number,
    may_share,
    type_of_constant,
    type_of_port,
)
from sar_compiler.nodes.collector import FindingCollector, file_of
from sar_compiler.nodes.cpp_names import TEXT
from sar_compiler.nodes.spec import Direction, Parameter
from sar_compiler.nodes.values import ConversionError, ValueType, literal_value
from sar_compiler.runtime.blackboard import ROOT_SIGN, Scope
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.diagnostic import Advice, Cause, Diagnostic, Severity, Span
from sar_compiler.tree.model import Element

_TEXTS = (str, Script, Path, None)
_NUMBERS = (int, float, bool, list)
_PLAIN_NUMBER = r"\d+(\.\d+)?"


class EntryType(NamedTuple):
    """The type of a blackboard entry, with the port or constant that determines it.

    Attributes:
        cpp: The normalised C++ type; empty for an entry that accepts values of any type.
        bound: The first node that names the entry, or the `SubTree` that passes a constant to it.
        name: The attribute of that node.
        parameter: The port; None for a constant.
    """

    cpp: str
    bound: BoundNode
    name: str
    parameter: Parameter | None

    def label(self, seen_from: Element) -> str:
        """Return an entry's type and port for a message, such as `int for value of 'LoopInt' (line 4)`."""
        return f"{self.cpp or 'of any type'} for {port_label(self.name, self.bound, seen_from)}"


EntryTypes = Mapping[tuple[Scope, str], EntryType]
"""The types of blackboard entries, by scope and key."""


def report_key_types(top: TreeInstance, collector: FindingCollector) -> EntryTypes:
    """Report the ports of an expanded tree that cannot share a key, and return the types of the entries.

    The first port in the order of the expanded tree, or a constant that is passed to a subtree, determines the type of an
    entry. A port for any value or for a string leaves the type open.
    """
    types: dict[tuple[Scope, str], EntryType] = {}
    # The pairs of types and ports that may share a key. Even a large tree has only few of them.
    sharing: set[tuple[str, int, int]] = set()
    for instance, bound in top.in_place():
        for name, key in bound.keys.items():
            parameter = bound.spec.parameters[name]
            if parameter.direction is None:
                continue
            entry = instance.scope.owner(key)
            known = types.get(entry)
            if known is None:
                types[entry] = EntryType(cpp_type(parameter, collector.version), bound, name, parameter)
            elif known.parameter is not parameter:
                pair = known.cpp, id(known.parameter), id(parameter)
                if pair in sharing:
                    continue
                later = EntryType(cpp_type(parameter, collector.version), bound, name, parameter)
                if _may_share(known, later, key, collector):
                    sharing.add(pair)
        inner = instance.inner.get(bound)
        for key, text in bound.remapping.constants.items() if inner is not None else ():
            assert inner is not None  # noqa: S101 - checked above
            types[inner.scope, key] = EntryType(type_of_constant(text, collector.version), bound, key, None)
    return types


def port_label(name: str, bound: BoundNode, seen_from: Element) -> str:
    """Return a port and its location for a message about *seen_from*: `value of 'LoopInt' (line 4)`."""
    element = bound.element
    return f"{name} of '{bound.name}' (line {element.line}{file_of(element, seen_from)})"


def unknown_conversion(
    element: Element, attribute: str, span: Span, cpp: str, meant: str | None = None
) -> Diagnostic:
    """Return the finding about a string for a type to which C++ may be unable to convert strings."""
    message = f"{attribute}: BehaviorTree.CPP reads a string as {cpp} only if {cpp} is an enumeration, or C++ code defines convertFromString<{cpp}>"
    cause = Cause(
        "strings are read as these types, so each type must be an enumeration or have a convertFromString",
        cpp,
    )
    advice = Advice(severity=Severity.INFO, common_cause=cause)
    if meant is not None:
        advice = Advice(severity=Severity.WARNING, suggestion=meant)
    return element.finding("cpp-type-mismatch", message, span, **advice)


def cpp_type(parameter: Parameter, version: Version) -> str:
    """Return the normalised C++ type of a port in a version of BehaviorTree.CPP."""
    return type_of_port(parameter.value_type.name, parameter.value_type.cpp, version)


def fits(value_type: ValueType, value: object) -> bool:
    """Return whether a port can read a value.

    The value is a string or, if the port is numeric, a number.

    For other ports, the C++ types determine whether a number can be converted.
    """
    if isinstance(value, str) and is_loop_queue(value_type.name):
        read: Callable[[str], object] = value_type.convert
    elif isinstance(value, str) or value_type.python in _NUMBERS:
        read = value_type.fit
    else:
        return True
    try:
        read(value)  # type: ignore[arg-type] # a string, if the port converts strings
    except ConversionError:
        return False
    return True


def _may_share(first: EntryType, later: EntryType, key: str, collector: FindingCollector) -> bool:
    """Return whether a port may share the key of an earlier port, and report a conflict."""
    assert later.parameter is not None  # noqa: S101 - a constant is always first
    if first.parameter is not None and not can_share_key(first.parameter, later.parameter):
        _report_type_conflict(first, later, key, collector)
    elif not may_share(first.cpp, later.cpp):
        if first.parameter is None:
            _report_constant(first, later, key, collector)
        else:
            _report_btcpp_type_conflict(first, later, key, collector)
    else:
        return True
    return False


def can_share_key(first: Parameter, later: Parameter) -> bool:
    """Return whether sar_compiler lets a port share an earlier port's key.

    The types must be equal, unless the later port accepts any value, or the earlier port is untyped or for strings.
    """
    known, other = first.value_type.python, later.value_type.python
    return other is None or known in _TEXTS or known is other


def _report_type_conflict(first: EntryType, later: EntryType, key: str, collector: FindingCollector) -> None:
    assert first.parameter is not None and later.parameter is not None  # noqa: S101, PT018 - both are ports
    message = (
        f"{later.name}: '{key}' is {later.parameter.value_type.label} here, but {first.parameter.value_type.label} for "
        f"{port_label(first.name, first.bound, later.bound.element)}"
    )
    collector.add("key-of-two-types", message, later.bound.element, value=later.name, hint="use two keys")


def _report_btcpp_type_conflict(
    first: EntryType, later: EntryType, key: str, collector: FindingCollector
) -> None:
    """Report a port type that sar_compiler accepts, but BehaviorTree.CPP rejects."""
    runs_here = not (first.bound.spec.is_foreign or later.bound.spec.is_foreign)
    message = (
        f"{later.name}: '{key}' is {later.cpp} here, but {first.label(later.bound.element)}, which BehaviorTree.CPP rejects"
        f"{', although sar_compiler can run the tree' if runs_here else ''}"
    )
    hint = "use two keys"
    if is_number(first.cpp) and (is_number(later.cpp) or later.cpp == TEXT):
        copy = f"{key.removeprefix(ROOT_SIGN)}_{later.name}"
        hint = f'copy it with <Script code="{copy} := {key}"/>, and write {later.name}="{{{copy}}}"'
    severity = btcpp_severity(collector.btcpp)
    collector.add(
        "cpp-type-mismatch", message, later.bound.element, value=later.name, hint=hint, severity=severity
    )


def btcpp_severity(btcpp: Version | None) -> Severity:
    """Return the severity of errors that only BehaviorTree.CPP reports.

    The severity is error if a version of BehaviorTree.CPP is configured.
    """
    return Severity.ERROR if btcpp is not None else Severity.WARNING


def _report_constant(first: EntryType, later: EntryType, key: str, collector: FindingCollector) -> None:
    """Report a port that could read a constant's text, but not a value of the constant's type."""
    assert later.parameter is not None  # noqa: S101 - a constant is always first
    written = first.bound.remapping.constants[first.name]
    is_read = later.parameter.direction is not Direction.OUTPUT
    if is_read and not fits(later.parameter.value_type, literal_value(written)):
        return
    message = (
        f"{later.name}: '{key}' is {later.cpp} here, but the subtree receives {written}, which is {first.cpp}"
    )
    is_plain = is_number(later.cpp) and re.fullmatch(_PLAIN_NUMBER, written)
    value = written if is_plain else f"'{written}'"
    hint = f'set it before the subtree with <Script code="k := {value}"/>, and write {first.name}="{{k}}"'
    severity = btcpp_severity(collector.btcpp)
    collector.report_rejected_since(
        NUMBERS, later.bound.element, message, value=later.name, hint=hint, severity=severity
    )
