"""Binding of an element's attributes to values, to blackboard keys and to conditions."""

import re
from collections.abc import Callable, Collection, Sequence
from typing import Any, Literal, TypeAlias

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.collector import FindingCollector, text_of_output
from sar_compiler.nodes.numbers import convert_with_unit, unit_name, unit_of_key
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, ParameterRole, Provenance, any_port
from sar_compiler.nodes.values import (
    CONDITION,
    ConversionError,
    ValueType,
    join_with_commas,
    require_value_type,
)
from sar_compiler.runtime.expressions import (
    Assignment,
    ComparisonChain,
    Name,
    Operation,
    Prefix,
    Script,
    parts,
)
from sar_compiler.tree.diagnostic import Advice, Cause, Severity
from sar_compiler.tree.guessing import Guesses, unit_suffix
from sar_compiler.tree.model import SUBTREE_TAG, Element

ONESHOT = "oneshot"
"""The attribute that wraps any node in a OneShot with the given policy."""
ONESHOT_HELP = "Runs the node until it has completed once. From then on, returns the same result without running the node. An interrupted node starts over."

CONDITIONS = {
    "_failureIf": "If this condition is true when the node is about to start, the node fails instead.",
    "_successIf": "If this condition is true when the node is about to start, the node succeeds instead.",
    "_skipIf": "If this condition is true when the node is about to start, the node is skipped.",
    "_while": "While this condition is false, the node is skipped. If the node is running, it is interrupted.",
    "_onSuccess": "A script that runs when the node has succeeded.",
    "_onFailure": "A script that runs when the node has failed.",
    "_onHalted": "A script that runs when the node is interrupted.",
    "_post": "A script that runs when the node has ended or is interrupted.",
}
"""The attributes for scripts that run before and after any node, with their descriptions."""

AUTOREMAP = "_autoremap"
"""The attribute of a `SubTree` that remaps every key to the outer key of the same name."""

NOTES = ("_description", "_uid", "_fullpath", "_collapsed", "_favorite", "_hardcoded", "_subtreeOnly")
"""The notes of BehaviorTree.CPP and of editors that the schemas list.

Tree files may contain other notes: an attribute that begins with `_` and is not a condition is a note.
"""
_TEXT_NOTES = frozenset(
    {*NOTES, "_comment", "_note", "_notes", "_todo", "_doc", "_label", "_title", "_color", "_style"}
)
"""Notes that may contain any text; other notes are checked for conditions."""
_LIKE_CONDITION = r"_(?:(?:skip|fail|failure|success|while|on|post)[A-Z]\w*|(?:(?:only|run|do)_?)?[iI]f|unless|when|(?:pre|post)?_?[cC]onditions?)"
"""A regular expression for notes that are probably meant as conditions.

It matches `_skipWhen`, but not `_skip_list`.
"""
_DECORATORS = {
    "timeout": "<Timeout>",
    "delay": "<Delay>",
    "repeat": "<Repeat>",
    "retry": "<RetryUntilSuccessful>",
    "retries": "<RetryUntilSuccessful>",
    "attempts": "<RetryUntilSuccessful>",
    "invert": "<Inverter>",
    "negate": "<Inverter>",
    "runonce": "<RunOnce>",
    "forcesuccess": "<ForceSuccess>",
    "forcefailure": "<ForceFailure>",
}
"""The decorator that the author of a note probably wanted to use, by a word in the note's name."""
_LIKE_DECORATOR = r"(?i)_((?:timeout|delay|repeat|retry|retries|attempts|invert|negate|run_?once|force_?(?:success|failure)))"
_NEGATED = frozenset({"_if", "_onlyIf", "_only_if", "_runIf", "_run_if", "_doIf", "_do_if", "_when"})
"""Names of notes that suggest a condition for running the node. `_skipIf` needs the negated condition."""


OneShotPolicyName: TypeAlias = Literal["ON_COMPLETION", "ON_SUCCESSFUL_COMPLETION"]
"""The names of the py_trees policies for OneShot."""
ONESHOT_TYPE = require_value_type(OneShotPolicyName)
# Looked up once, because access to enumeration members is slow in Python 3.11, and every attribute needs these.
_NAME, _ATTRIBUTE, _REFERENCE = ParameterRole.NAME, ParameterRole.ATTRIBUTE, ParameterRole.REFERENCE
_OUTPUT, _INOUT = Direction.OUTPUT, Direction.INOUT
_BOOL_TYPE = require_value_type(bool)
KIND_TAGS = frozenset(kind.value for kind in Kind)
"""The tags of nodes in explicit form."""
_TEXTS = (str, None)
"""The Python types of attributes that accept any text."""
_NAME_OF_KEY = r"(?a) *(?P<sign>\$?)(?P<open>[{(]?)(?P<name>@?[A-Za-z_]\w*)(?(open)[})]?) *"
_UNCLOSED = r" *(?:\{([^{}\s]+)|([^{}\s]+)\}) *"


class AttributeBinder:
    """Binder of the attributes of nodes."""

    def __init__(
        self, collector: FindingCollector, known_keys: Callable[[], Collection[str]] = tuple
    ) -> None:
        self._collector = collector
        self._option_errors: dict[str, str | None] = {}
        self._known_keys = known_keys

    def bind(self, bound: BoundNode, other_variants: Sequence[NodeSpec]) -> None:
        """Bind every attribute of a node, and report missing attributes."""
        parameters = bound.spec.parameters
        meant: set[str | None] = set()
        unknown: list[str] = []
        for name, text in bound.element.attributes.items():
            parameter = parameters.get(name)
            role = parameter and parameter.role
            if role is _NAME:
                pass  # an empty name means the tag
            elif parameter is not None and role is _ATTRIBUTE:
                self._value(bound, parameter, text)
            elif role is _REFERENCE:
                pass  # resolved when all nodes are known
            elif not self.common(bound, name) and not (name == "ID" and _is_explicit(bound)):
                unknown.append(name)
        for name in unknown:
            meant.add(self._report_unknown(bound, name, other_variants, is_only=len(unknown) == 1))
        for parameter in bound.spec.required_attributes:
            # A misspelt attribute is not also reported as missing.
            if parameter.name not in meant:
                self._require(bound, parameter, other_variants)

    def common(self, bound: BoundNode, name: str) -> bool:
        """Bind an attribute that every node may have, and return True.

        For any other attribute, return False.
        """
        if name == ONESHOT:
            bound.oneshot = self.convert(bound.element, name, ONESHOT_TYPE)
        elif name in CONDITIONS:
            script = self.convert(bound.element, name, CONDITION)
            if script is not None:
                bound.conditions = {**bound.conditions, name: script}
        elif not name.startswith("_") or self.typo_in_note(name) is not None:
            return False
        elif name not in _TEXT_NOTES:
            self._check_note(bound.element, name)
        return True

    def _check_note(self, element: Element, name: str) -> None:
        """Report an ignored attribute that looks like a condition or a decorator."""
        text = element.attributes[name]
        decorator = re.match(_LIKE_DECORATOR, name)
        if decorator:
            word = decorator[1].lower().replace("_", "")
            hint = f"put the node into a decorator: {_DECORATORS[word]}"
        elif name in _NEGATED and _read_condition(text):
            hint = f'write _skipIf="!({text})"'
        elif name == "_unless" and _read_condition(text):
            hint = f'write _skipIf="{text}"'
        elif re.fullmatch(_LIKE_CONDITION, name) or self._has_condition(text):
            hint = f"known conditions: {join_with_commas(CONDITIONS)}"
        else:
            return
        message = f"'{name}' has no effect: attributes that begin with '_' are ignored, except conditions"
        advice = Advice(hint=hint, severity=Severity.WARNING)
        self._collector.add("unknown-attribute", message, element, name=name, **advice)

    def _has_condition(self, text: str) -> bool:
        """Return whether an ignored attribute contains a tree's key, or a script that compares or assigns."""
        script = _read_condition(text)
        # Several words that happen to parse as several statements are prose, not a script.
        if script is None or len(script.statements) != 1:
            return False
        all_parts = list(parts(script.statements[0]))
        if isinstance(all_parts[0], Name):
            return all_parts[0].name in self._known_keys()
        return any(isinstance(part, Name) for part in all_parts) and any(
            isinstance(part, (ComparisonChain, Assignment))
            or (isinstance(part, Prefix) and part.operator == "!")
            or (isinstance(part, Operation) and part.steps[0].operator in {"&&", "||"})
            for part in all_parts
        )

    def typo_in_note(self, name: str) -> str | None:
        """Return the attribute for which a name beginning with `_` is probably a typo; None for a note."""
        if name not in self._option_errors:
            self._option_errors[name] = typo_in_note(name, self._collector.guesses)
        return self._option_errors[name]

    def report_former_name(self, element: Element, name: str, today: str) -> str:
        """Report an attribute of BehaviorTree.CPP 3, and return its current name."""
        message = f"<{element.tag}> has no attribute '{name}'; this attribute is from BehaviorTree.CPP 3"
        self._collector.add("unknown-attribute", message, element, name=name, suggestion=today)
        return today

    def flag(self, element: Element, name: str) -> bool:
        """Return the value of a Boolean attribute; False if it is missing or invalid."""
        return bool(name in element.attributes and self.convert(element, name, _BOOL_TYPE))

    def _is_unclosed(self, element: Element, name: str) -> bool:
        """Return whether the text is a key that lacks one of its braces. If it is, report it."""
        suggestion = complete_key_braces(element.attributes[name])
        if suggestion is not None:
            message = f"{name}: a key needs two braces, but '{element.attributes[name]}' has one"
            self._collector.add("wrong-value", message, element, value=name, suggestion=suggestion)
        return suggestion is not None

    def convert(self, element: Element, name: str, value_type: ValueType, *, takes_keys: bool = False) -> Any:
        """Convert an attribute's text to a value. If the text is invalid, report it and return None."""
        try:
            return value_type.convert(element.attributes[name])
        except ConversionError as error:
            code = "script-error" if value_type.python is Script else "wrong-value"
            key = (
                self._intended_key(element.attributes[name]) if takes_keys and not error.suggestion else None
            )
            if key is not None:
                error = ConversionError(error.message, key)
            elif not error.suggestion and value_type.python in (int, float) and not value_type.unit:
                error = _in_unit_of_name(error, name, element.attributes[name], value_type)
            self._collector.wrong_value(element, name, error, code)
            return None

    def _intended_key(self, text: str) -> str | None:
        """Return the key, in braces, that was probably meant by an invalid value; None if no key was meant."""
        match = re.fullmatch(_NAME_OF_KEY, text)
        if match is None or not (match["sign"] or match["name"] in self._known_keys()):
            return None
        return f"{{{match['name']}}}"

    def _check_key_name(self, element: Element, name: str, value_type: ValueType, key: str) -> None:
        """Report a key in braces if the attribute does not accept the name of the key."""
        try:
            value_type.convert(key)
        except ConversionError as error:
            begin = max(element.attributes[name].find(key), 0)
            span = element.value_part_span(name, begin, begin + len(key))
            self._collector.add("wrong-value", f"{name}: {error.message}", element, span, hint=error.hint)

    def _value(self, bound: BoundNode, parameter: Parameter, text: str, *, is_listed: bool = True) -> None:
        name = parameter.name
        key = parameter.value_type.key_in(text, name)
        if key is not None and name not in bound.spec.implied_values:
            bound.keys = {**bound.keys, name: key}
            if parameter.value_type.names_key:
                self._check_key_name(bound.element, name, parameter.value_type, key)
            return
        may_be_text = parameter.value_type.python in _TEXTS and parameter.direction is not _OUTPUT
        if not may_be_text and self._is_unclosed(bound.element, name):
            return
        if parameter.direction is _OUTPUT and not parameter.required and text.strip(" ") in ("", "{}"):
            message = f"{name}: the output has no effect, because no key is given"
            advice = Advice(suggestion="", hint=f'remove {name}, or write {name}="{{key}}"')
            self._collector.add("ignored-attribute", message, bound.element, name=name, **advice)
            return
        if parameter.direction is _OUTPUT:
            self._collector.findings.append(text_of_output("wrong-value", bound.element, name, text))
            return
        takes_keys = name not in bound.spec.implied_values and parameter.value_type.python is not Script
        value = self.convert(bound.element, name, parameter.value_type, takes_keys=takes_keys)
        fixed = bound.spec.implied_values.get(name)
        if None not in (value, fixed) and value != fixed:
            tag = bound.spec.tag
            message = f'<{tag}> implies {name}="{_as_text(fixed)}", but has {name}="{text}" here'
            near = _as_text(fixed)
            self._collector.add("conflicting-attributes", message, bound.element, value=name, suggestion=near)
        is_written = parameter.direction is _INOUT and is_listed and not parameter.value_type.names_key
        if is_written and value is not None:
            self._constant_to_write(bound, name, text)
        bound.values = {**bound.values, name: value}

    def _constant_to_write(self, bound: BoundNode, name: str, text: str) -> None:
        """Report a constant for a port that the node also writes.

        If the port's direction is only guessed, report nothing.
        """
        if bound.spec.provenance is not Provenance.FROM_USE:
            message = f"{name}: the node also writes this port, but '{text}' is not a key, so writing raises an error"
            cause = Cause(
                "nodes also write these ports, but the ports contain a string instead of a key", name
            )
            hint = f'write {name}="{{key}}", and set this key in an earlier node'
            advice = Advice(hint=hint, severity=Severity.WARNING, common_cause=cause)
            self._collector.add("wrong-value", message, bound.element, value=name, **advice)

    def _require(self, bound: BoundNode, parameter: Parameter, other_variants: Sequence[NodeSpec]) -> None:
        element, name = bound.element, parameter.name
        if name in element.attributes:
            return
        message = f"<{bound.spec.tag}> needs the attribute '{name}'"
        if not any(written in bound.spec.parameters for written in element.attributes if written != "name"):
            others = [p.name for spec in other_variants for p in spec.attributes if p.required]
            message += "".join(f" or '{other}'" for other in others)
        self._collector.add(
            "missing-attribute", message, element, hint=f'write {name}="..." ({parameter.value_type.label})'
        )

    def _report_unknown(
        self, bound: BoundNode, name: str, other_variants: Sequence[NodeSpec], *, is_only: bool
    ) -> str | None:
        """Report an unknown attribute of a node, and return the attribute that was probably meant."""
        element, spec = bound.element, bound.spec
        former = [
            each.former_attributes[name] for each in (spec, *other_variants) if name in each.former_attributes
        ]
        if former:
            return self.report_former_name(element, name, former[0])
        if any(name in (parameter.name for parameter in other.attributes) for other in other_variants):
            written = [other for other in element.attributes if other in spec.parameters and other != "name"]
            message = f"'{name}' conflicts with {' and '.join(written)} of this <{bound.spec.tag}>"
            advice = Advice(hint="write only one of these attributes")
            self._collector.add("conflicting-attributes", message, element, name=name, **advice)
            return None
        known = [parameter.name for parameter in spec.attributes] + [ONESHOT]
        message = f"<{bound.spec.tag}> has no attribute '{name}' (known: {join_with_commas(known)})"
        if name.startswith("_"):
            near = self.typo_in_note(name)
            if near == name:
                message = (
                    f"<{bound.spec.tag}> has no attribute '{name}'; only <{SUBTREE_TAG}> has this attribute"
                )
                near = None
        else:
            free = [other for other in known if other not in element.attributes]
            near = self._collector.guesses.nearest(name, free) or intended_condition(name)
        if spec.is_only_described:
            self._report_unlisted(bound, name, message, near)
            return near
        missing = [p.name for p in spec.required_attributes if p.name not in element.attributes]
        if near is not None or not is_only or len(missing) != 1:
            hint = convert_to_attribute_unit(name, element.attributes[name], spec)
            self._collector.add("unknown-attribute", message, element, name=name, suggestion=near, hint=hint)
            return near
        # The unknown attribute was probably meant to be the attribute that is missing for this or another variant of the tag.
        others = [p.name for other in other_variants for p in other.attributes if p.required]
        unit = _unit_of(spec.parameters[missing[0]])
        suggestion = missing[0] if not others and unit == unit_suffix(name) else None
        hint = convert_to_attribute_unit(name, element.attributes[name], spec)
        hint = hint or f"write {' or '.join([*missing, *others])} instead{unit and f', in {unit_name(unit)}'}"
        advice = Advice(suggestion=suggestion, hint=hint)
        self._collector.add("unknown-attribute", message, element, name=name, **advice)
        return missing[0]

    def _report_unlisted(self, bound: BoundNode, name: str, message: str, near: str | None) -> None:
        """Report an attribute that the model does not list, and bind it as a port unless it is likely a typo."""
        severity = bound.spec.provenance.severity_of_unlisted(is_near=near is not None)
        hint = "if the node has this port, add the port to the node's description"
        advice = Advice(suggestion=near, hint=hint, severity=severity)
        self._collector.add("unknown-attribute", message, bound.element, name=name, **advice)
        if near is None:
            port = any_port(name)
            bound.spec = bound.spec.with_port(port)
            self._value(bound, port, bound.element.attributes[name], is_listed=False)


def _in_unit_of_name(error: ConversionError, name: str, text: str, value_type: ValueType) -> ConversionError:
    """Return the error for a number whose unit differs from the attribute's, with a converted number."""
    unit = unit_of_key(name)
    meant = convert_with_unit(text, unit) if unit else None
    try:
        value_type.convert(meant or "")
    except ConversionError:
        return error
    if unit == unit_suffix(name):
        return ConversionError(error.message, meant)
    return ConversionError(error.message, hint=f"write {meant} if '{name}' is in {unit_name(unit)}")


def convert_to_attribute_unit(name: str, text: str, spec: NodeSpec) -> str | None:
    """Return a hint that replaces an attribute by one in another unit; None if no such attribute exists.

    For example, the hint for `sec="5"` is `msec="5000"`.
    """
    written = unit_suffix(name)
    numbers = {
        p.name: convert_with_unit(f"{text}{written}", unit) for p in spec.attributes if (unit := _unit_of(p))
    }
    known = [f'write {other}="{number}"' for other, number in numbers.items() if number is not None]
    return known[0] if written and len(known) == 1 else None


def _unit_of(parameter: Parameter) -> str:
    """Return the unit of an attribute's plain numbers; an empty string if it is unknown."""
    return parameter.value_type.unit or unit_suffix(parameter.name)


def typo_in_note(name: str, guesses: Guesses) -> str | None:
    """Return the attribute for which a name beginning with `_` is probably a typo; None for a note."""
    return None if name in NOTES else guesses.nearest(name, [*CONDITIONS, AUTOREMAP, ONESHOT])


def _read_condition(text: str) -> Script | None:
    """Parse a text as a condition; return None if it is not a script."""
    try:
        script = CONDITION.convert(text)
    except ConversionError:
        return None
    return script if isinstance(script, Script) else None


def _is_explicit(bound: BoundNode) -> bool:
    """Return whether a node is in explicit form.

    The ID may equal the tag: `<Condition ID="Condition"/>` is in explicit form.
    """
    tag = bound.element.tag
    return tag != bound.spec.tag or (bound.spec.is_only_described and tag in KIND_TAGS)


def intended_condition(name: str) -> str | None:
    """Return the condition for which a name probably lacks the leading underscore; None for other names."""
    return next((known for known in CONDITIONS if known[1:].lower() == name.lower()), None)


def complete_key_braces(text: str) -> str | None:
    """Return the key in a text that lacks one of its braces, with both braces; None for other texts."""
    if text[:1] not in "{ " and text[-1:] not in "} ":
        return None
    match = re.fullmatch(_UNCLOSED, text)
    return f"{{{match[1] or match[2]}}}" if match else None


def _as_text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
