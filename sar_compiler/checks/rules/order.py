"""Leaves that come before the ones they depend on, by the facts that their registrations declare."""

import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from sar_compiler.checks.rules.check_context import CheckContext, warning
from sar_compiler.checks.rules.entry_accesses import EntryAccess, PathFinder, comes_first, parting
from sar_compiler.checks.rules.key_accesses import KeyAccess
from sar_compiler.nodes.answers import SELF, filled_text, number_text
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.instances import Instance
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.answers import Fact
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.expressions import Access, Script, name_uses
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.variables import PlainVariables
from sar_compiler.tree.diagnostic import Diagnostic

_UNKNOWN = "unknown"
_DOING_AND_UNDOING = 2


def check_order(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield leaves that can only fail at their place, and those that depend on an effect undone before them."""
    if not context.sound:
        return
    reported: set[BoundNode] = set()
    for top in context.bound.tops:
        leaves = list(_leaves(top))
        changing: dict[str, list[_Leaf]] = {}
        for leaf in leaves:
            for fact in leaf.words.changes:
                changing.setdefault(fact, []).append(leaf)
        for leaf in leaves:
            finding = _too_early(leaf, changing) or _undone(leaf, changing, leaves)
            if finding is not None and leaf.use.bound not in reported:
                reported.add(leaf.use.bound)
                yield finding


class _Words:
    """The declarations of a leaf's registration about facts, with placeholders replaced.

    Args:
        spec: The spec of the leaf.
        names: The replacement of each placeholder.
    """

    def __init__(self, spec: NodeSpec, names: Mapping[str, str]) -> None:
        def filled(text: str) -> str:
            return filled_text(text, names)

        self.facts = {filled(name): value for name, value in spec.facts.items()}
        self.results = [filled(answer.then) for answer in spec.answers if answer.then]
        self.reads = frozenset(map(filled, spec.reads))
        self.writes = frozenset(map(filled, spec.writes))
        self.conditions = [filled(answer.when) for answer in spec.answers if answer.status != "FAILURE"]
        if any(not script or _holds(script, _variables(self.facts)) for script in self.conditions):
            self.conditions = []  # it may do something from the start
        self.needs = frozenset(use.name for script in self.conditions for use in name_uses(_parsed(script)))
        uses = (use for script in self.results for use in name_uses(_parsed(script)))
        self.changes = self.writes | {use.name for use in uses if use.access is not Access.READ}

    def enables(self, other: "_Words") -> bool:
        """Return whether an effect of this leaf, on the initial facts, allows another leaf a result other than failure."""
        for script in self.results:
            facts = _variables({**self.facts, **other.facts})
            if _run(script, facts) and any(_holds(condition, facts) for condition in other.conditions):
                return True
        return False


class _Leaf(NamedTuple):
    """A leaf with facts, in one instance of its tree."""

    use: EntryAccess
    words: _Words


def _leaves(top: Instance) -> Iterator[_Leaf]:
    numbers: dict[tuple[Instance, BoundNode], str] = {}
    known: dict[tuple[object, ...], _Words] = {}

    def identifier(instance: Instance, bound: BoundNode) -> str:
        return numbers.setdefault((instance, bound), f"node{len(numbers)}")

    paths = PathFinder()
    for instance in top.iterate():
        for bound in instance.tree.demanding:
            spec = bound.spec
            if not (spec.facts or spec.reads or spec.writes):
                continue
            own = any(f"{{{SELF}}}" in fact for fact in (*spec.facts, *spec.reads, *spec.writes))
            names = {**({SELF: identifier(instance, bound)} if own else {}), **_numbers(bound)}
            for parameter in spec.references:
                referred = instance.referred(bound, parameter.name)
                if referred is not None:
                    names[parameter.name] = identifier(*referred)
            key = (id(spec), *names.items())
            if key not in known:
                known[key] = _Words(spec, names)
            words = known[key]
            if words.needs or words.reads or words.changes:
                yield _Leaf(EntryAccess(instance, KeyAccess(bound, "", "", AccessKind.READ), paths), words)


def _numbers(bound: BoundNode) -> dict[str, str]:
    """Return the replacements of a leaf's whole numbers, by their attributes' names."""
    numbers = (parameter for parameter in bound.spec.plain if parameter.is_whole_number)
    return {
        # The value of a key is unknown here: it becomes a name that no script can evaluate.
        each.name: _UNKNOWN
        if each.name in bound.keys
        else number_text(bound.values.get(each.name, each.default))
        for each in numbers
    }


def _variables(facts: Mapping[str, Fact]) -> PlainVariables:
    return PlainVariables(
        {name: float(value) if isinstance(value, bool) else value for name, value in facts.items()}
    )


@functools.lru_cache(maxsize=256)
def _parsed(script: str) -> Script:
    return parse(script)


def _holds(script: str, facts: PlainVariables) -> bool:
    """Return whether a script over facts is true or cannot be evaluated."""
    try:
        return Program(_parsed(script)).holds(facts)
    except EvaluationError:
        return True


def _run(script: str, facts: PlainVariables) -> bool:
    """Apply a script to facts; return whether it could be evaluated."""
    try:
        Program(_parsed(script)).run(facts)
    except EvaluationError:
        return False
    return True


def _too_early(leaf: _Leaf, changing: Mapping[str, list[_Leaf]]) -> Diagnostic | None:
    others = {other: None for fact in leaf.words.needs for other in changing.get(fact, ())}
    givers = [other for other in others if other is not leaf and other.words.enables(leaf.words)]
    if not givers or not all(comes_first(leaf.use, giver.use) for giver in givers):
        return None
    giver = givers[0].use.bound
    message = (
        f"'{leaf.use.bound.name}' can only fail here: it needs what '{giver.name}' (line {giver.element.line}) does, "
        "which comes after it"
    )
    return warning("wrong-order", message, leaf.use.bound, hint=f"put it behind '{giver.name}'")


def _undone(leaf: _Leaf, changing: Mapping[str, list[_Leaf]], leaves: Sequence[_Leaf]) -> Diagnostic | None:
    """Return a finding about a leaf in a sequence that depends on an effect of an earlier leaf that another one undid."""
    others = {other: None for fact in leaf.words.reads for other in changing.get(fact, ())}
    before = [other for other in others if _leads_to(other, leaf)]
    if len(before) < _DOING_AND_UNDOING:
        return None
    doing, undoing = before[-2:]
    facts = doing.words.changes & undoing.words.changes & leaf.words.reads
    between = (other for other in leaves if other.words.reads & facts and _leads_to(doing, other))
    if not facts or not undoing.words.writes or any(_leads_to(other, undoing) for other in between):
        return None
    name, other = leaf.use.bound.name, undoing.use.bound
    message = (
        f"'{name}' works with what '{doing.use.bound.name}' did, and '{other.name}' (line {other.element.line}), which "
        "comes between them, undoes it"
    )
    return warning("wrong-order", message, leaf.use.bound, hint=f"put it before '{other.name}'")


def _leads_to(first: _Leaf, second: _Leaf) -> bool:
    """Return whether two leaves are in one sequence, the first before the second."""
    together = parting(first.use, second.use)
    inside = 0 < together < min(len(first.use.path), len(second.use.path))
    if not inside or not first.use.path[together - 1][1].spec.semantics.is_sequence:
        return False
    return comes_first(first.use, second.use)
