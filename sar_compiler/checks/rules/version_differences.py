"""Rules about differences between BehaviorTree.CPP versions that affect a tree.

No other rule reports these differences.
"""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

from sar_compiler.checks.rules import CheckContext
from sar_compiler.nodes.binding.attributes import KIND_TAGS
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.key_types import btcpp_severity, unknown_conversion
from sar_compiler.nodes.binding.nesting import invalid_id_part, tree_id_fault
from sar_compiler.nodes.btcpp import (
    DROPS_EXPLICIT,
    NAMES,
    NEWEST,
    OPERATORS,
    ORDER,
    QUOTES,
    STATEMENTS,
    VERSIONS,
    Version,
)
from sar_compiler.nodes.btcpp.port_types import can_be_converted, is_loop_queue, needs_converter
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.cpp_names import ANY, TEXT, normalize
from sar_compiler.nodes.spec import Direction, NodeSpec, Provenance
from sar_compiler.runtime.expressions import Literal, Operation, Script, parts
from sar_compiler.runtime.tokens import TokenKind, tokenize
from sar_compiler.tree.diagnostic import Advice, Cause, Diagnostic


def check_versions(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about constructs that other BehaviorTree.CPP versions refuse, lack or read differently.

    Newer versions refuse some constructs. Older versions lack some, or read them differently.
    """
    collector = FindingCollector(context.btcpp)
    for tree in (tree for tree_file in context.forest.files for tree in tree_file.trees):
        fault = tree_id_fault(tree.attributes.get("ID", ""))
        if fault is not None:
            advice = Advice(hint=fault.hint, common_cause=fault.cause)
            collector.report_rejected_since(NAMES, tree, fault.message, value="ID", **advice)
    _report_tags(context, collector)
    _report_ports(context, collector)
    for bound, attribute, script in context.scripts:
        if '"' in script.text:
            _report_quotes(bound, attribute, script, collector)
        if context.version < NEWEST:
            for start, end, what, hint in older_readings(script, context.version):
                span = bound.element.value_part_span(attribute, start, end)
                message = f"{attribute}: BehaviorTree.CPP {context.version} {what}"
                yield bound.element.finding("btcpp-version", message, span, hint=hint)
    yield from collector.findings
    yield from _newer_nodes(context)
    yield from _explicit(context)


def check_literals(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about literals that sar_compiler can read as a port's type, but BehaviorTree.CPP cannot."""
    for bound, types in context.nodes_with(_readable_types):
        for name, cpp in types.items():
            text = bound.element.attributes.get(name)
            if not text or bound.values.get(name) is None:
                continue
            if can_be_converted(text, cpp, context.version):
                enums = context.bound_forest.models.enums
                is_open = needs_converter(cpp) and bound.spec.provenance is Provenance.DESCRIBED
                if is_open and text not in enums:
                    span, meant = bound.element.value_span(name), context.guesses.nearest(text, enums)
                    yield unknown_conversion(bound.element, name, span, cpp, meant)
                continue
            kind = "items" if is_loop_queue(cpp) else cpp
            message = f"{name}: BehaviorTree.CPP cannot read '{text}' as {kind}, although sar_compiler can"
            plain = text.replace("+", "")
            is_meant = plain and can_be_converted(plain, cpp, context.version)
            yield bound.element.finding(
                "cpp-type-mismatch",
                message,
                value=name,
                suggestion=plain if is_meant else None,
                hint=f"write a key whose value has the type {kind}",
                severity=btcpp_severity(context.btcpp),
            )


def _readable_types(spec: NodeSpec) -> dict[str, str]:
    """Return the C++ type of each port that a node reads.

    For a loop's queue, return the name of the queue type.
    """
    found = {}
    for port in spec.ports:
        kind = port.value_type
        cpp = kind.name if is_loop_queue(kind.name) else normalize(kind.cpp)
        if port.direction is not Direction.OUTPUT and cpp not in ("", ANY, TEXT):
            found[port.name] = cpp
    return found


def _report_tags(context: CheckContext, collector: FindingCollector) -> None:
    for bound, part in context.nodes_with(lambda spec: invalid_id_part(spec.tag)):
        element = bound.element
        if element.tag == bound.spec.tag:
            message, hint = f"the node name '{element.tag}' contains {part}", f"remove {part}"
            collector.report_rejected_since(NAMES, element, message, hint=hint)


def _report_ports(context: CheckContext, collector: FindingCollector) -> None:
    usual = {id(spec) for spec in context.bound_forest.specs if all(map(str.isidentifier, spec.parameters))}
    others = (bound for tree in context.trees for bound in tree.demanding if id(bound.spec) not in usual)
    for bound in dict.fromkeys((*others, *(use for tree in context.trees for use in tree.uses))):
        for name in itertools.filterfalse(str.isidentifier, bound.element.attributes):
            given = (*bound.remapping.keys, *bound.remapping.constants, *bound.spec.parameters)
            part = invalid_id_part(name) if name in given else None
            if part:
                message, hint = f"the port name '{name}' contains {part}", f"remove {part}"
                advice = Advice(hint=hint, common_cause=Cause(f"port names contain {part}", name))
                collector.report_rejected_since(NAMES, bound.element, message, name=name, **advice)


def _report_quotes(bound: BoundNode, attribute: str, script: Script, collector: FindingCollector) -> None:
    for literal in itertools.chain.from_iterable(map(parts, script.statements)):
        if isinstance(literal, Literal) and script.text[literal.start] == '"':
            inside = script.text[literal.start + 1 : literal.end - 1]
            message = f"{attribute}: a string is in double quotation marks"
            hint = (
                "write the string in single quotation marks: '...'. It cannot contain a single quotation mark"
            )
            span = bound.element.value_part_span(attribute, literal.start, literal.end)
            advice = Advice(suggestion=None if "'" in inside else f"'{inside}'", hint=hint)
            collector.report_rejected_since(QUOTES, bound.element, message, span, **advice)


def _newer_nodes(context: CheckContext) -> Iterator[Diagnostic]:
    for bound, since in context.nodes_with(lambda spec: spec.semantics.counterpart.since):
        if VERSIONS[since] > context.version:
            message = f"<{bound.spec.tag}> needs BehaviorTree.CPP {since}, but these trees are for {context.version}"
            hint = "replace it, or run the trees with a newer version"
            yield bound.element.finding("btcpp-version", message, hint=hint)


def _explicit(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about explicit nodes, such as `<Action ID="...">`, that BehaviorTree.CPP does not find."""
    for control, _ in context.nodes_with(lambda spec: spec.tag == DROPS_EXPLICIT):
        for bound in control.children:
            tag = bound.element.tag
            if tag in KIND_TAGS and "ID" in bound.element.attributes:
                message = f"BehaviorTree.CPP 4.7 to 4.10 do not find <{tag}> directly in a <{DROPS_EXPLICIT}>"
                cause = Cause(message, bound.spec.tag)
                hint = f"write <{bound.spec.tag}>, without ID"
                yield bound.element.finding("explicit-node", message, hint=hint, common_cause=cause)


_GROUPS = {
    **dict.fromkeys(("+", "-", "*", "/"), "numbers"),
    **dict.fromkeys(("~", "!", "&", "|", "^"), "bits"),
    "..": "strings",
}
_ASSIGNMENTS = (":=", "=", "+=", "-=", "*=", "/=")
_BOTH_LATER = ("evaluates this from the left, as (a || b) && c", "write a || (b && c)")
_IN_PARENTHESES = "put one of the operators in parentheses, together with its operands"
_FROM_THE_RIGHT = {"-": "+-", "/": "*/", "|": "^", "^": "|"}


class OlderReading(NamedTuple):
    """A part of a script that an older version rejects or evaluates differently.

    Attributes:
        start: The offset of the part's first character in the script's text.
        end: The offset after the part's last character.
        what: The behaviour of the older version, which completes the sentence "BehaviorTree.CPP 4.8 ...".
        hint: A remedy that has the same meaning in all versions.
    """

    start: int
    end: int
    what: str
    hint: str


def older_readings(script: Script, version: Version) -> Iterator[OlderReading]:
    """Yield the parts of a script for version 4.9 that older versions reject or evaluate differently."""
    if version < ORDER:
        yield from _right_associative(script)
    if version < STATEMENTS:
        yield from _missing_semicolons(script)
    if version < OPERATORS:
        yield from _operators(script)


def _right_associative(script: Script) -> Iterator[OlderReading]:
    for each in itertools.chain.from_iterable(map(parts, script.statements)):
        for step, following in itertools.pairwise(each.steps if isinstance(each, Operation) else ()):
            first, second = step.operator, following.operator
            if second in _FROM_THE_RIGHT.get(first, ()):
                what = f"evaluates this from the right, as a {first} (b {second} c)"
                yield OlderReading(step.start, step.end, what, f"write (a {first} b) {second} c")
                break


def _missing_semicolons(script: Script) -> Iterator[OlderReading]:
    for before, statement in itertools.pairwise(script.statements):
        if ";" not in script.text[before.end : statement.start]:
            what = "refuses a statement without ; between it and the previous statement"
            yield OlderReading(statement.start, statement.end, what, "write ; between the two")


class _FlatPart:
    """The operators found so far at one level of nested parentheses in an expression."""

    def __init__(self) -> None:
        self._first = ""
        self._is_either = self._is_chosen = self._is_assigned = False

    def read_operator(self, sign: str) -> tuple[str, str] | None:
        """Process the next operator.

        If older versions reject it, return a description and a remedy; otherwise, return None.
        """
        if sign == "?" or sign in _ASSIGNMENTS:
            return self._read_single(sign)
        if sign in {"||", "&&"}:
            both_later, self._is_either = self._is_either and sign == "&&", sign == "||" or self._is_either
            return _BOTH_LATER if both_later else None
        group = _GROUPS.get(sign)
        self._first = self._first or (sign if group else "")
        other = _GROUPS.get(self._first)
        if not group or group == other:
            return None
        what = f"refuses {sign} (for {group}) beside {self._first} (for {other}) without parentheses"
        return what, _IN_PARENTHESES

    def _read_single(self, sign: str) -> tuple[str, str] | None:
        is_second = self._is_chosen if sign == "?" else self._is_assigned
        if sign == "?":
            self._is_chosen, self._is_either = True, False
        else:
            self._is_assigned = True
        return (f"refuses a second {sign} in an expression", _IN_PARENTHESES) if is_second else None


def _operators(script: Script) -> Iterator[OlderReading]:
    starts = {statement.start for statement in script.statements}
    levels: list[_FlatPart] = []
    is_refused = False
    for token in tokenize(script.text):
        if token.start in starts:
            levels = [_FlatPart()]
        sign = token.text if token.kind is TokenKind.SIGN else ""
        if sign in {")", ":"}:
            levels.pop()
        wrong = levels[-1].read_operator(sign) if levels else None
        if wrong is not None and not (is_refused and wrong is not _BOTH_LATER):
            yield OlderReading(token.start, token.end, *wrong)
            is_refused = is_refused or wrong is not _BOTH_LATER
        if sign in {"(", "?"}:
            levels.append(_FlatPart())
