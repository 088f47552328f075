"""Reads the sections `facts:`, `outcomes:` and `controls:` of a scenario or properties file.

The section `controls:` names replacements for controls and decorators whose behaviour is unknown.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from sar_compiler.analysis.leaf_vocabulary import LeafVocabulary, parse_word, report_script, unknown_names
from sar_compiler.analysis.simulated_tree import (
    Assumptions,
    SimulatedTree,
    described_parents,
    replace_nodes,
    self_ticking_parents,
)
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.documents.located import Document, Value
from sar_compiler.errors import SarError
from sar_compiler.nodes.binding.bound import Binding, BoundNode
from sar_compiler.nodes.models import described_specs
from sar_compiler.nodes.outcomes import SELF, find_script_error, is_fact_name, placeholders
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import NodeSpec, ParameterRole
from sar_compiler.runtime.expressions import name_uses
from sar_compiler.runtime.outcomes import STATUSES, Fact, Outcome
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.tokens import ScriptError
from sar_compiler.runtime.variables import UNKNOWN
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.model import TreeFile

# Tolerance for the sum of rounded probabilities.
_ROUNDING = 1e-3
_TYPES: Mapping[type, str] = {bool: "true or false", int: "an integer", float: "a number", str: "a string"}


@dataclass(frozen=True)
class StartValues:
    """The initial values of runs, from a mission's parameters.

    Scenario and properties files override these values.

    Attributes:
        parameters: The values of the root blackboard's keys.
        facts: The facts that the parameters determine. Facts unknown to a tree are ignored.
        period_sec: The time between two ticks, in seconds; None if it is not set.
    """

    parameters: Mapping[str, object] = field(default_factory=dict)
    facts: Mapping[str, Fact] = field(default_factory=dict)
    period_sec: float | None = None


class DisputedFactError(SarError):
    """Raised if leaves declare different initial values for a fact, and no file sets the fact's initial value."""


def raise_disputes(simulated: SimulatedTree) -> None:
    """Raise an error if leaves of a tree declare different initial values for a fact.

    Raises:
        DisputedFactError: If leaves declare different initial values.
    """
    if simulated.disputes:
        raise DisputedFactError(". ".join(simulated.disputes.values()))


def start_assumptions(start: StartValues, simulated: SimulatedTree) -> Assumptions:
    """Return the initial facts from a mission's parameters, omitting facts that the tree does not have."""
    known = simulated.fact_values()
    return Assumptions({name: fact for name, fact in start.facts.items() if name in known})


def read_assumptions(
    document: Document, facts: Value | None, outcomes: Value | None, simulated: SimulatedTree
) -> Assumptions:
    """Read a file's assumptions about facts and outcomes, and report errors in the file as findings.

    Args:
        document: The file.
        facts: The value of the file's `facts:`; None if missing.
        outcomes: The value of the file's `outcomes:`; None if missing.
        simulated: The tree, simulated without these assumptions.
    """
    assumed = {} if outcomes is None else _read_outcomes(outcomes, LeafVocabulary(document, simulated))
    used = {use for options in assumed.values() for outcome in options for use in _names_in(outcome)}
    values = {} if facts is None else _read_facts(document, facts, simulated.fact_values(), used)
    return Assumptions(values, assumed)


def _read_facts(
    document: Document, value: Value, known: Mapping[str, Fact], used: set[str]
) -> dict[str, Fact]:
    facts: dict[str, Fact] = {}
    for key, inner in value.entries or ():
        name, fact = key.text or "", inner.data
        if not is_fact_name(name) or placeholders(name):
            document.report("wrong-name", "the name of a fact may only contain letters, digits and _", key)
        elif name not in known and name not in used:
            listed = ", ".join(known) or "none"
            message = f"no leaf of this tree declares a fact '{name}' (known: {listed})"
            document.report("unknown-fact", message, key, suggestion=nearest(name, known))
        else:
            kind = type(known.get(name, fact))
            if type(fact) is kind or (kind is float and type(fact) is int):
                facts[name] = kind(fact)
            else:
                message = f"the fact '{name}' must be {_TYPES[kind]}, but is {inner.kind}"
                document.report("wrong-value", message, inner)
    return facts


def _read_outcomes(value: Value, words: LeafVocabulary) -> dict[str, tuple[Outcome, ...]]:
    assumed: dict[str, tuple[Outcome, ...]] = {}
    for key, inner in value.entries or ():
        leaves = words.find(key)
        specs = list({id(spec): spec for spec in map(words.spec, leaves)}.values())
        named = [item for item in inner.as_list if "outcome" in item.mapping]
        options = [_parse_outcome(words.document, item, specs) for item in inner.as_list if item not in named]
        declared = _declared_outcomes(words, key, named, leaves, specs) if named else ()
        found = tuple(dict.fromkeys((*declared, *(option for option in options if option is not None))))
        _check_probabilities(words.document, inner, found)
        assumed[key.text or ""] = found
    return assumed


def _declared_outcomes(
    words: LeafVocabulary,
    key: Value,
    items: Sequence[Value],
    leaves: Sequence[StubLeaf],
    specs: Sequence[NodeSpec],
) -> tuple[Outcome, ...]:
    """Return the outcomes that leaves declare, with the probabilities and durations that a file sets."""
    if len(specs) != 1:
        message = f"'{key.text}' names leaves that declare different outcomes"
        if specs:
            words.document.report(
                "wrong-value", message, key, hint="list the leaves separately, by path or tag"
            )
        return ()
    outcomes = list(specs[0].outcomes)
    listed: set[int] = set()
    for item in items:
        for part in item.mapping.keys() & {"status", "label", "when", "then"}:
            message = f"'outcome' refers to a declared outcome, and the declaration already sets '{part}'. Remove '{part}'"
            words.document.report("conflicting-keys", message, item.mapping[part])
        name = words.parse_outcome(item.mapping["outcome"], leaves)
        for place, outcome in enumerate(outcomes):
            if name is not None and name in (outcome.label, outcome.status):
                if place in listed:
                    message = f"the outcome '{name}' of this leaf is listed twice"
                    words.document.report("wrong-value", message, item.mapping["outcome"])
                listed.add(place)
                p, sec = _probability(words.document, item.mapping)
                outcomes[place] = replace(outcome, p=p, sec=sec)
                break
    return tuple(outcomes)


def _probability(
    document: Document, parts: Mapping[str, Value]
) -> tuple[tuple[float, float] | None, tuple[float, float]]:
    """Return the bounds that a file sets for an outcome's probability and duration."""
    return _interval(document, parts.get("p")), _interval(document, parts.get("sec")) or (0.0, 0.0)


def _interval(document: Document, value: Value | None) -> tuple[float, float] | None:
    if value is None:
        return None
    numbers = [float(each.data) for each in value.as_list]
    if numbers[-1] < numbers[0]:
        document.report("wrong-value", "the lower number of an interval must come first", value)
    return numbers[0], numbers[-1]


def _check_probabilities(document: Document, value: Value, outcomes: Sequence[Outcome]) -> None:
    """Report probabilities whose sum is impossible, and durations of leaves that never return RUNNING."""
    ending = [outcome for outcome in outcomes if outcome.status != "RUNNING"]
    known = [outcome.p for outcome in ending if outcome.p is not None]
    least, most = sum(p[0] for p in known), sum(p[1] for p in known)
    if least > 1.0 + _ROUNDING:
        document.report(
            "wrong-value", f"the probabilities p of these outcomes add up to {least:g}, not to 1", value
        )
    elif known and len(known) == len(ending) and most < 1.0 - _ROUNDING:
        message = f"the probabilities p of these outcomes add up to at most {most:g}, but one of the outcomes must occur"
        document.report("wrong-value", message, value)
    if any(outcome.sec[1] for outcome in ending) and len(ending) == len(outcomes):
        hint = "omit 'sec', or add an outcome with the status RUNNING"
        document.report(
            "wrong-value",
            "none of these outcomes has the status RUNNING, so the leaf takes no time",
            value,
            hint=hint,
        )


def check_outcomes(value: Value | None, words: LeafVocabulary) -> None:
    """Report unknown names in the assumed outcomes of leaves.

    Args:
        value: The value of the file's `outcomes:`; None if missing.
        words: The vocabulary of the tree, simulated with all assumptions of the file.
    """
    items = [item for _, inner in (value.entries if value else None) or () for item in inner.as_list]
    for item in items:
        for part in [
            item.mapping[name] for name in ("when", "then") if item.entries and name in item.mapping
        ]:
            text = part.text or ""
            if placeholders(text):
                continue  # they are replaced for each leaf
            with suppress(ScriptError):  # reported already
                for typo in unknown_names(parse(text), words.names):
                    if text[slice(*typo.place)] != UNKNOWN:
                        words.document.report(
                            "unknown-fact", typo.message, part, typo.place, suggestion=typo.suggestion
                        )


def _parse_outcome(document: Document, value: Value, specs: Sequence[NodeSpec]) -> Outcome | None:
    outcomes = [status for status in STATUSES if all(_can_return(spec, status) for spec in specs)]
    parts = value.mapping or {"status": value}
    status = parse_word(document, parts["status"], outcomes, "the status of an outcome")
    label, when, then = (
        parts[part].text or "" if part in parts else "" for part in ("label", "when", "then")
    )
    outcome = Outcome(status or "", label, when, then, *_probability(document, parts))
    usable = all(_scripts_fit(document, parts, outcome, spec) for spec in specs)
    return outcome if status is not None and usable else None


def _can_return(spec: NodeSpec, status: str) -> bool:
    """Return whether a leaf can return a status.

    A leaf without declared outcomes can return any status except SKIPPED.
    """
    return status in (spec.statuses or ("SUCCESS", "FAILURE", "RUNNING"))


def _scripts_fit(document: Document, parts: Mapping[str, Value], outcome: Outcome, spec: NodeSpec) -> bool:
    known = [SELF, *(p.name for p in spec.parameters.values() if p.role is ParameterRole.REFERENCE)]
    mistake = find_script_error(
        outcome, known, [p.name for p in spec.parameters.values() if p.is_integer_parameter]
    )
    if mistake is not None:
        part, _, error = mistake
        report_script(document, parts[part], error)
    return mistake is None


def _names_in(outcome: Outcome) -> set[str]:
    """Return the names that an outcome's scripts use; scripts with placeholders are ignored."""
    scripts = [parse(text) for text in (outcome.when, outcome.then) if text and not placeholders(text)]
    return {use.name for script in scripts for use in name_uses(script)}


def apply_controls(
    document: Document, controls: Value, binding: Binding, registry: Registry, files: Iterable[TreeFile]
) -> None:
    """Replace nodes of unknown behaviour by the nodes that a file names, and report errors as findings.

    Args:
        document: The file.
        controls: The value of the file's `controls:`.
        binding: The tree, which is changed.
        registry: The registered nodes.
        files: The tree files and palettes whose models describe nodes.
    """
    own = self_ticking_parents(binding)
    known = [spec.tag for spec in described_specs(files, registry) if not spec.kind.is_leaf]
    known += dict.fromkeys(node.spec.tag for node in own)
    replacements: dict[str, NodeSpec] = {}
    for key, value in controls.entries or ():
        tag = key.text or ""
        if tag not in known:
            listed = ", ".join(known) or "none"
            message = f"'{tag}' needs no replacement here. Only these controls and decorators need a replacement: {listed}"
            document.report("unknown-node", message, key, suggestion=nearest(tag, known))
            continue
        nodes = [node for node in (*described_parents(binding), *own) if node.spec.tag == tag]
        spec = _find_replacement(document, value, tag, nodes, registry)
        # After a finding, any suitable node is the replacement, so that further findings are reported.
        fits = (each for each in registry if not _replacement_fault(each, nodes))
        replacements[tag] = spec or next(fits)
    replace_nodes(binding, replacements)


def _find_replacement(
    document: Document, value: Value, wanted: str, nodes: Sequence[BoundNode], registry: Registry
) -> NodeSpec | None:
    """Return the replacement that a file names for nodes tagged *wanted*, or report that it is unsuitable."""
    tag = value.text or ""
    variants = registry.variants(tag)
    if not variants:
        parents = [spec.tag for spec in registry if not spec.kind.is_leaf]
        message = f"unknown control or decorator '{tag}'"
        hint = "list them with: sar-compile nodes"
        document.report("unknown-node", message, value, suggestion=nearest(tag, parents), hint=hint)
        return None
    faults = [_replacement_fault(spec, nodes) for spec in variants]
    if "" in faults:
        return variants[faults.index("")]
    message = f"<{tag}> cannot replace <{wanted}>: {faults[0]}"
    document.report(
        "wrong-value", message, value, hint="show a node's attributes with: sar-compile nodes TAG"
    )
    return None


def _replacement_fault(spec: NodeSpec, nodes: Sequence[BoundNode]) -> str:
    """Return the reason why a node cannot replace the given nodes, or an empty string if it can."""
    if spec.kind.is_leaf:
        return "it is a leaf"
    needed = [each.name for each in (*spec.required_attributes, *spec.references) if each.required]
    if needed:
        return f"it requires a value for {', '.join(dict.fromkeys(needed))}, but a replacement has only default values"
    least, most = spec.child_count
    for node in nodes:
        count = len(node.children)
        if count < least or (most is not None and count > most):
            children = "one child" if count == 1 else f"{count} children"
            return f"'{node.name}' in line {node.element.line} has {children}"
    return ""
