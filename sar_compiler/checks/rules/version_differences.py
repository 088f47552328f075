"""What depends on the version of BehaviorTree.CPP that trees are for, and that binding has not found."""

import itertools
from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.nodes.binding.attributes import KIND_TAGS
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.binding.tree_ids import fault_of, refused_in
from sar_compiler.nodes.btcpp.versions import DROPS_EXPLICIT, NAMES, NEWEST, QUOTES, VERSIONS, Version
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.expressions import Literal, Script, parts
from sar_compiler.tree.diagnostic import Advice, Cause, Diagnostic


def check_versions(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield names and texts of scripts that newer versions refuse, and what older ones do not have, or do otherwise."""
    collector = Collector(context.btcpp)
    for tree in (tree for tree_file in context.forest.files for tree in tree_file.trees):
        fault = fault_of(tree.attributes.get("ID", ""))
        if fault is not None:
            advice = Advice(hint=fault.hint, common_cause=fault.cause)
            collector.refused_since(NAMES, tree, fault.message, value="ID", **advice)
    _report_tags(context, collector)
    _report_ports(context, collector)
    for bound, attribute, script in _scripts(context):
        if '"' in script.text:
            _report_quotes(bound, attribute, script, collector)
        if context.btcpp < NEWEST:
            yield from _read_otherwise(bound, attribute, script, context.btcpp)
    yield from collector.findings
    yield from _newer_nodes(context)
    yield from _explicit(context)


def _read_otherwise(
    bound: BoundNode, attribute: str, script: Script, version: Version
) -> Iterator[Diagnostic]:
    from sar_compiler.checks.rules.older_scripts import older_readings

    for start, end, what, hint in older_readings(script, version):
        span = bound.element.within_value(attribute, start, end)
        message = f"{attribute}: BehaviorTree.CPP {version} {what}"
        yield bound.element.finding("btcpp-version", message, span, hint=hint)


def _report_tags(context: CheckContext, collector: Collector) -> None:
    refused = {spec.tag: refused_in(spec.tag) for spec in context.bound.specs}
    refused = {tag: part for tag, part in refused.items() if part}
    for bound in (bound for tree in context.trees for bound in tree.nodes if refused):
        element, part = bound.element, refused.get(bound.element.tag)
        if part:
            message, hint = f"the name '{element.tag}' of a node has {part} in it", f"leave {part} out"
            collector.refused_since(NAMES, element, message, hint=hint)


def _report_ports(context: CheckContext, collector: Collector) -> None:
    for bound in (bound for tree in context.trees for bound in dict.fromkeys((*tree.demanding, *tree.uses))):
        given = (*bound.remapping.keys, *bound.remapping.constants, *bound.spec.parameters)
        for name in bound.element.attributes:
            part = refused_in(name) if name in given and not name.isidentifier() else None
            if part:
                message, hint = f"the name '{name}' of a port has {part} in it", f"leave {part} out"
                cause = Cause(f"names of ports have {part} in them", name)
                advice = Advice(hint=hint, common_cause=cause)
                collector.refused_since(NAMES, bound.element, message, name=name, **advice)


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


def _report_quotes(bound: BoundNode, attribute: str, script: Script, collector: Collector) -> None:
    for literal in itertools.chain.from_iterable(map(parts, script.statements)):
        if isinstance(literal, Literal) and script.text[literal.start] == '"':
            inside = script.text[literal.start + 1 : literal.end - 1]
            message = f"{attribute}: a text is written in double quotation marks"
            hint = "write '...'; the text itself cannot contain a single quotation mark"
            span = bound.element.within_value(attribute, literal.start, literal.end)
            suggestion = None if "'" in inside else f"'{inside}'"
            advice = Advice(suggestion=suggestion, hint=hint)
            collector.refused_since(QUOTES, bound.element, message, span, **advice)


def _newer_nodes(context: CheckContext) -> Iterator[Diagnostic]:
    since = {spec.tag: spec.semantics.counterpart.since for spec in context.bound.specs}
    later = {tag for tag, version in since.items() if version and VERSIONS[version] > context.btcpp}
    for bound in (bound for tree in context.trees for bound in tree.nodes if later):
        tag = bound.spec.tag
        if tag in later:
            message = (
                f"BehaviorTree.CPP has <{tag}> since {since[tag]}, and these trees are for {context.btcpp}"
            )
            hint = "do without it, or have them run by a newer one"
            yield bound.element.finding("btcpp-version", message, hint=hint)


def _explicit(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield nodes in explicit form where BehaviorTree.CPP does not find them."""
    around = any(spec.tag == DROPS_EXPLICIT for spec in context.bound.specs)
    for control in (each for tree in context.trees for each in tree.nodes if around):
        for bound in control.children if control.spec.tag == DROPS_EXPLICIT else ():
            tag = bound.element.tag
            if tag in KIND_TAGS and "ID" in bound.element.attributes:
                message = f"BehaviorTree.CPP does not find <{tag}> directly in a <{DROPS_EXPLICIT}>"
                cause = Cause(message, bound.spec.tag)
                hint = f"write <{bound.spec.tag}>, without ID"
                yield bound.element.finding("explicit-node", message, hint=hint, common_cause=cause)
