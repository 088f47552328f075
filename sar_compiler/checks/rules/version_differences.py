"""What depends on the version of BehaviorTree.CPP that trees are for, and that binding has not found."""

import itertools
from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext, warning
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.binding.tree_ids import fault_of, refused_in
from sar_compiler.nodes.btcpp.versions import NAMES, QUOTES, STATEMENTS, SUMS, VERSIONS
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.expressions import Expression, Literal, Operation, Script, children
from sar_compiler.tree.diagnostic import Diagnostic

_SIGNS = ("+", "-")


def check_versions(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield names and texts of scripts that newer versions refuse, and what older ones do not have, or do otherwise."""
    collector = Collector(context.btcpp)
    for tree in (tree for tree_file in context.forest.files for tree in tree_file.trees):
        fault = fault_of(tree.attributes.get("ID", ""))
        if fault is not None:
            span = tree.value_span("ID")
            collector.refused_since(NAMES, tree, span, fault.message, fault.hint, cause=fault.cause)
    _report_tags(context, collector)
    for bound, attribute, script in _scripts(context):
        if '"' in script.text:
            _report_quotes(bound, attribute, script, collector)
        if context.btcpp < SUMS.since and "-" in script.text:
            yield from _sums(context, bound, attribute, script)
        if context.btcpp < STATEMENTS.since:
            yield from _touching(context, bound, attribute, script)
    yield from collector.findings
    yield from _newer_nodes(context)


def _report_tags(context: CheckContext, collector: Collector) -> None:
    refused = {spec.tag: refused_in(spec.tag) for spec in context.bound.specs}
    refused = {tag: part for tag, part in refused.items() if part}
    for bound in (bound for tree in context.trees for bound in tree.nodes if refused):
        element, part = bound.element, refused.get(bound.element.tag)
        if part:
            message, hint = f"the name '{element.tag}' of a node has {part} in it", f"leave {part} out"
            collector.refused_since(NAMES, element, element.tag_span(), message, hint)


def _scripts(context: CheckContext) -> Iterator[tuple[BoundNode, str, Script]]:
    scripted = {id(spec) for spec in context.bound.specs if _has_script(spec)}
    for tree in context.trees:
        for bound in tree.nodes if scripted or tree.wrappers else ():
            if not bound.conditions and id(bound.spec) not in scripted:
                continue
            for attribute, script in (*bound.conditions.items(), *bound.values.items()):
                if isinstance(script, Script):
                    yield bound, attribute, script


def _has_script(spec: NodeSpec) -> bool:
    types = (parameter.value_type for parameter in spec.parameters.values())
    return any(value_type is not None and value_type.python is Script for value_type in types)


def _parts(script: Script) -> Iterator[Expression]:
    left = [*script.statements]
    while left:
        expression = left.pop()
        yield expression
        left += children(expression)


def _report_quotes(bound: BoundNode, attribute: str, script: Script, collector: Collector) -> None:
    for literal in _parts(script):
        if isinstance(literal, Literal) and script.text[literal.start] == '"':
            inside = script.text[literal.start + 1 : literal.end - 1]
            message = f"{attribute}: a text is written in double quotation marks"
            hint = "write '...'; the text itself cannot contain a single quotation mark"
            span = bound.element.within_value(attribute, literal.start, literal.end)
            suggestion = None if "'" in inside else f"'{inside}'"
            collector.refused_since(QUOTES, bound.element, span, message, hint, suggestion)


def _sums(context: CheckContext, bound: BoundNode, attribute: str, script: Script) -> Iterator[Diagnostic]:
    """Yield sums in which something is added to a difference, or taken from it, without parentheses."""
    for each in _parts(script):
        steps = each.steps if isinstance(each, Operation) else ()
        for step, following in itertools.pairwise(steps):
            if step.operator == "-" and following.operator in _SIGNS:
                message = f"{attribute}: BehaviorTree.CPP {context.btcpp} begins this sum from the right, as in a - (b + c)"
                span = bound.element.within_value(attribute, step.start, step.end)
                yield warning("btcpp-version", message, bound, span, hint="write parentheses: (a - b) + c")
                break


def _touching(
    context: CheckContext, bound: BoundNode, attribute: str, script: Script
) -> Iterator[Diagnostic]:
    """Yield statements with no `;` between them and the one before."""
    for before, statement in itertools.pairwise(script.statements):
        if ";" not in script.text[before.end : statement.start]:
            message = f"{attribute}: BehaviorTree.CPP {context.btcpp} refuses a statement that follows another without ;"
            span = bound.element.within_value(attribute, statement.start, statement.end)
            yield warning("btcpp-version", message, bound, span, hint="write ; between the two")


def _newer_nodes(context: CheckContext) -> Iterator[Diagnostic]:
    since = {spec.tag: spec.semantics.counterpart.since for spec in context.bound.specs}
    later = {tag for tag, version in since.items() if version and VERSIONS[version] > context.btcpp}
    for bound in (bound for tree in context.trees for bound in tree.nodes if later):
        tag = bound.spec.tag
        if tag in later:
            message = (
                f"BehaviorTree.CPP has <{tag}> since {since[tag]}, and these trees are for {context.btcpp}"
            )
            yield warning(
                "btcpp-version", message, bound, hint="do without it, or have them run by a newer one"
            )
