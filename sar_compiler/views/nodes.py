"""Descriptions of registered nodes as text and as JSON."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.models.palette import value_text
from sar_compiler.nodes.outcome_sets import ALLOWED, K
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, ParameterRole, SkipPossibility
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.tree.model import synthetic_element
from sar_compiler.tree.plain import as_json, to_json_value, value_as_script

# The fields of an outcome that are not written to JSON.
_PROBABILITIES = ("p", "sec")


def nodes_as_text(specs: Sequence[NodeSpec]) -> str:
    """Return one line for each node. If all nodes have the same tag, return their full descriptions."""
    if len({spec.tag for spec in specs}) == 1:
        return "\n\nor\n\n".join(_full_description(spec) for spec in specs)
    width = max(len(spec.tag) for spec in specs)
    return "\n".join(f"{spec.tag:{width}}  {spec.kind.value.lower():9}  {spec.doc}" for spec in specs)


def nodes_as_json(specs: Sequence[NodeSpec]) -> str:
    """Return node specs as a JSON array."""
    return as_json([_as_dict(spec) for spec in specs])


def _full_description(spec: NodeSpec) -> str:
    lines = [f"<{spec.tag}>  {spec.kind.value.lower()}", "", *([spec.doc, ""] if spec.doc else [])]
    lines += _outcome_texts(spec)
    if spec.effects:
        lines.append(f"effects:  {spec.effects}")
    if spec.uses:
        lines.append(f"needs:    {', '.join(f'{use.kind} {use.name}'.strip() for use in spec.uses)}")
    if spec.facts:
        lines.append(
            f"facts:    {', '.join(f'{name} = {value_as_script(value)}' for name, value in spec.facts.items())}"
        )
    for label, names in (("reads:   ", spec.reads), ("writes:  ", spec.writes)):
        if names:
            lines.append(f"{label} {', '.join(names)}")
    lines += ["attributes:", *(_attribute(spec, parameter) for parameter in spec.attributes)]
    return "\n".join(lines)


def _outcome_texts(spec: NodeSpec) -> list[str]:
    """Return the lines that list the possible outcomes of a node."""
    if not any(outcome.label or outcome.when or outcome.then for outcome in spec.outcomes):
        statuses = spec.statuses and ({outcome.status for outcome in spec.outcomes} or spec.statuses)
        outcomes = [*sorted(statuses), *_skip_conditions(spec)]
        return [f"outcomes: {', '.join(outcomes)}"] if outcomes else []
    return [
        f"{'outcomes:' if not index else '':9} {_outcome_text(outcome)}"
        for index, outcome in enumerate(spec.outcomes)
    ]


def _skip_conditions(spec: NodeSpec) -> Iterator[str]:
    """Yield `SKIPPED` and the conditions for a skip, if a control or decorator can be skipped."""
    skipping = spec.skipping
    if skipping.possible is SkipPossibility.NEVER:
        return
    when = []
    if skipping.only_if is not None:
        name, value = skipping.only_if
        by_default = " as by default" if spec.parameters[name].default == value else ""
        when.append(f'with {name}="{value_text(value)}"{by_default}')
    if skipping.possible is SkipPossibility.FROM_CHILD or (when and _is_skipped_with_child(spec)):
        when.append(f"if its {'child is' if spec.kind is Kind.DECORATOR else 'children are'} skipped")
    yield f"SKIPPED ({', or '.join(when)})" if when else "SKIPPED"


def _is_skipped_with_child(spec: NodeSpec) -> bool:
    """Return whether a node is skipped if its child is skipped."""
    element = synthetic_element(spec.tag)
    possible = spec.semantics.possible
    return possible is not None and bool(possible(BoundNode(element, spec, spec.tag), [K], ALLOWED) & K)


def _outcome_text(outcome: Outcome) -> str:
    label = f" '{outcome.label}'" if outcome.label else ""
    when = f" when {outcome.when}" if outcome.when else ""
    then = f", then {outcome.then}" if outcome.then else ""
    return f"{outcome.status}{label}{when}{then}"


def _attribute(spec: NodeSpec, parameter: Parameter) -> str:
    label = parameter.value_type.label
    if parameter.role is ParameterRole.REFERENCE:
        label = f"the name of a {parameter.target_name} in the same tree. Optional if the tree has only one such node"
    if parameter.direction is not None:
        label = f"{parameter.direction.message_name}; {label}"
    if parameter.role is ParameterRole.NAME:
        notes = f"default: {spec.tag}"
    elif parameter.name in spec.implied_values:
        notes = f"always {value_text(spec.implied_values[parameter.name])}"
    elif parameter.required:
        notes = "required" if parameter.role is ParameterRole.ATTRIBUTE else ""
    else:
        notes = "optional" if parameter.default is None else f"default: {value_text(parameter.default)}"
    description = ". ".join(part for part in (label, notes, parameter.doc) if part)
    return f"  {parameter.name}: {description}"


def _as_dict(spec: NodeSpec) -> dict[str, object]:
    return {
        "tag": spec.tag,
        "kind": spec.kind.value,
        "class": spec.class_path.replace(":", ".") or None,
        "doc": spec.doc,
        "statuses": sorted(spec.statuses),
        "skipped": list(_skip_conditions(spec)),
        "effects": spec.effects,
        "uses": [{"kind": use.kind, "name": use.name} for use in spec.uses],
        "outcomes": [
            {name: value for name, value in asdict(outcome).items() if name not in _PROBABILITIES}
            for outcome in spec.outcomes
        ],
        "facts": dict(spec.facts),
        "reads": list(spec.reads),
        "writes": list(spec.writes),
        "attributes": [_parameter(spec, parameter) for parameter in spec.attributes],
    }


def _parameter(spec: NodeSpec, parameter: Parameter) -> dict[str, object]:
    default = (
        spec.tag
        if parameter.role is ParameterRole.NAME
        else spec.implied_values.get(parameter.name, parameter.default)
    )
    return {
        "name": parameter.name,
        "role": parameter.role.value,
        "direction": parameter.direction.value.removesuffix("_port") if parameter.direction else None,
        "type": parameter.value_type.label or None,
        "refers_to": parameter.target_name or None,
        "required": parameter.required and parameter.name not in spec.implied_values,
        "default": to_json_value(default),
        "doc": parameter.doc,
    }
