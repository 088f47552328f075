"""Rules about the order of leaves: a leaf must not run before a leaf whose declared effect it needs."""

import bisect
import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.rules.entry_accesses import (
    EntryAccess,
    KeyAccess,
    OrderedAccesses,
    PositionFinder,
    TreePosition,
    branching_position,
    comes_first,
    enclosing_sequences,
)
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.instances import TreeInstance
from sar_compiler.nodes.outcomes import SELF, fill_placeholders, number_text
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.expressions import Access, Script, name_uses
from sar_compiler.runtime.outcomes import Fact
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.variables import PlainVariables
from sar_compiler.tree.diagnostic import Diagnostic

_UNKNOWN = "unknown"
_DOING_AND_UNDOING = 2


def check_order(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about leaves that run before the effect that they need, or after it was undone."""
    if not context.is_complete:
        return
    reported: set[BoundNode] = set()
    for top in context.bound_forest.tops:
        leaves = list(_leaves(top))
        effects = _Effects(leaves)
        for leaf in leaves:
            finding = _check_too_early(leaf, effects) or _check_undone(leaf, effects)
            if finding is not None and leaf.use.node not in reported:
                reported.add(leaf.use.node)
                yield finding


class _LeafFacts:
    """The facts that a leaf's registration declares, with all placeholders replaced."""

    def __init__(self, spec: NodeSpec, names: Mapping[str, str]) -> None:
        def fill_attributes(text: str) -> str:
            return fill_placeholders(text, names)

        self.facts = {fill_attributes(name): value for name, value in spec.facts.items()}
        self.results = [fill_attributes(outcome.then) for outcome in spec.outcomes if outcome.then]
        self.reads = frozenset(map(fill_attributes, spec.reads))
        self.writes = frozenset(map(fill_attributes, spec.writes))
        self.conditions = [
            fill_attributes(outcome.when) for outcome in spec.outcomes if outcome.status != "FAILURE"
        ]
        if any(not script or _holds(script, _variables(self.facts)) for script in self.conditions):
            self.conditions = []  # the leaf need not fail with the initial facts
        self.needs = frozenset(use.name for script in self.conditions for use in name_uses(_parse(script)))
        uses = (use for script in self.results for use in name_uses(_parse(script)))
        self.changes = self.writes | {use.name for use in uses if use.access is not Access.READ}

    def enables(self, other: "_LeafFacts") -> bool:
        """Return whether an effect of this leaf on the initial facts enables an outcome of another leaf.

        Failures of the other leaf do not count.
        """
        for script in self.results:
            facts = _variables({**self.facts, **other.facts})
            if _run(script, facts) and any(_holds(condition, facts) for condition in other.conditions):
                return True
        return False


class _FactLeaf(NamedTuple):
    """A leaf that declares facts, in one instance of its tree."""

    use: EntryAccess
    declared: _LeafFacts


def _leaves(top: TreeInstance) -> Iterator[_FactLeaf]:
    numbers: dict[tuple[TreeInstance, BoundNode], str] = {}
    known: dict[tuple[object, ...], _LeafFacts] = {}

    def identifier(instance: TreeInstance, bound: BoundNode) -> str:
        return numbers.setdefault((instance, bound), f"node{len(numbers)}")

    places = PositionFinder(top)
    for instance in top.iterate():
        for bound in instance.tree.demanding:
            spec = bound.spec
            if not (spec.facts or spec.reads or spec.writes):
                continue
            own = any(f"{{{SELF}}}" in fact for fact in (*spec.facts, *spec.reads, *spec.writes))
            names = {**({SELF: identifier(instance, bound)} if own else {}), **_numbers(bound)}
            for parameter in spec.references:
                referred = instance.target_of(bound, parameter.name)
                if referred is not None:
                    names[parameter.name] = identifier(*referred)
            key = (id(spec), *names.items())
            if key not in known:
                known[key] = _LeafFacts(spec, names)
            declared = known[key]
            if declared.needs or declared.reads or declared.changes:
                access = KeyAccess(bound, "", "", AccessKind.READ)
                yield _FactLeaf(EntryAccess(instance, access, places), declared)


def _numbers(bound: BoundNode) -> dict[str, str]:
    """Return, for each integer attribute of a leaf, the strings that may replace the attribute's placeholder."""
    numbers = (parameter for parameter in bound.spec.constant_attributes if parameter.is_integer_parameter)
    return {
        # The value of a key is unknown. It is replaced by an unknown name, so that scripts with it cannot be evaluated.
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
def _parse(script: str) -> Script:
    return parse(script)


def _holds(script: str, facts: PlainVariables) -> bool:
    """Return whether a condition on facts is true or cannot be evaluated."""
    try:
        return Program(_parse(script)).holds(facts)
    except EvaluationError:
        return True


def _run(script: str, facts: PlainVariables) -> bool:
    """Execute a script that changes facts, and return whether the script could be evaluated."""
    try:
        Program(_parse(script)).run(facts)
    except EvaluationError:
        return False
    return True


class _Effects:
    """The leaves of a tree, indexed by the facts that they read and change."""

    def __init__(self, leaves: Sequence[_FactLeaf]) -> None:
        self._alike: dict[_LeafFacts, list[_FactLeaf]] = {}
        for leaf in leaves:
            self._alike.setdefault(leaf.declared, []).append(leaf)
        self._changing: dict[str, list[_LeafFacts]] = {}
        for declared in self._alike:
            for fact in declared.changes:
                self._changing.setdefault(fact, []).append(declared)
        self._enabling: dict[_LeafFacts, list[OrderedAccesses]] = {}
        self._readers = sorted((leaf for leaf in leaves if leaf.declared.reads), key=_number)
        self._untouched: dict[tuple[_FactLeaf, _FactLeaf, frozenset[str]], bool] = {}

    def enabling_leaves(self, declared: _LeafFacts) -> Sequence[OrderedAccesses]:
        """Return the leaves that enable a leaf with the given declaration, grouped by their own declarations."""
        if declared not in self._enabling:
            others = {each: None for fact in sorted(declared.needs) for each in self._changing.get(fact, ())}
            self._enabling[declared] = [
                OrderedAccesses([leaf.use for leaf in self._alike[each]])
                for each in others
                if each.enables(declared)
            ]
        return self._enabling[declared]

    @functools.cached_property
    def _leaves_before_readers(self) -> dict[tuple[str, TreePosition], list[_FactLeaf]]:
        """For each sequence and each fact that a leaf reads, the leaves in the sequence that change the fact."""
        read = {fact for leaf in self._readers for fact in leaf.declared.reads}
        changing = {declared: declared.changes & read for declared in self._alike if declared.changes & read}
        leading: dict[tuple[str, TreePosition], list[_FactLeaf]] = {}
        for leaf in sorted((leaf for declared in changing for leaf in self._alike[declared]), key=_number):
            for around in enclosing_sequences(leaf.use):
                if around is not None and around.bound.spec.semantics.is_sequence:
                    for fact in changing[leaf.declared]:
                        leading.setdefault((fact, around), []).append(leaf)
        return leading

    def last_two_before(self, leaf: _FactLeaf) -> list[_FactLeaf]:
        """Return the last two leaves, before a leaf in a sequence, that change a fact that the leaf reads."""
        found: dict[_FactLeaf, None] = {}
        inner, around = leaf.use.position, leaf.use.position.around
        while around is not None and len(found) < _DOING_AND_UNDOING:
            before: list[_FactLeaf] = []
            for fact in leaf.declared.reads:
                others = self._leaves_before_readers.get((fact, around), [])
                count = bisect.bisect_left(others, inner.number, key=_number)
                before += others[max(count - _DOING_AND_UNDOING, 0) : count]
            found.update(dict.fromkeys(sorted(before, key=_number, reverse=True)))
            inner, around = around, around.around
        return list(found)[:_DOING_AND_UNDOING][::-1]

    def is_read_between(self, first: _FactLeaf, second: _FactLeaf, facts: frozenset[str]) -> bool:
        """Return whether a leaf between two other leaves of a sequence reads one of the given facts."""
        key = (first, second, facts)
        if key not in self._untouched:
            start, end = (
                bisect.bisect_left(self._readers, _number(leaf), key=_number) for leaf in (first, second)
            )
            self._untouched[key] = any(
                other.declared.reads & facts and _leads_to(first, other) and _leads_to(other, second)
                for other in self._readers[start:end]
            )
        return self._untouched[key]


def _number(leaf: _FactLeaf) -> int:
    return leaf.use.position.number


def _check_too_early(leaf: _FactLeaf, effects: _Effects) -> Diagnostic | None:
    enabling = [
        each
        for each in effects.enabling_leaves(leaf.declared)
        if len(each.uses) > (leaf.use in each.uses[:1])
    ]
    if not enabling or not all(each.is_each_preceded(leaf.use) for each in enabling):
        return None
    uses = [next(use for use in each.uses if use is not leaf.use) for each in enabling]
    needed = min(uses, key=lambda use: use.position.number).node
    message = (
        f"'{leaf.use.node.name}' can only fail here: it needs the effect of '{needed.name}' (line {needed.element.line}), "
        "but that node is ticked later"
    )
    return leaf.use.node.element.finding("wrong-order", message, hint=f"move it after '{needed.name}'")


def _check_undone(leaf: _FactLeaf, effects: _Effects) -> Diagnostic | None:
    """Return a finding if a leaf needs the effect of an earlier leaf, but a leaf in between undoes this effect."""
    before = effects.last_two_before(leaf) if leaf.declared.reads else []
    if len(before) < _DOING_AND_UNDOING:
        return None
    doing, undoing = before
    facts = doing.declared.changes & undoing.declared.changes & leaf.declared.reads
    if not facts or not undoing.declared.writes or effects.is_read_between(doing, undoing, facts):
        return None
    name, other = leaf.use.node.name, undoing.use.node
    message = (
        f"'{name}' needs the effect of '{doing.use.node.name}', but '{other.name}' (line {other.element.line}) "
        "undoes this effect in between"
    )
    return leaf.use.node.element.finding("wrong-order", message, hint=f"move it before '{other.name}'")


def _leads_to(first: _FactLeaf, second: _FactLeaf) -> bool:
    """Return whether two leaves are in the same sequence, and the first leaf comes before the second."""
    around = branching_position(first.use, second.use)
    return (
        around is not None and around.bound.spec.semantics.is_sequence and comes_first(first.use, second.use)
    )
