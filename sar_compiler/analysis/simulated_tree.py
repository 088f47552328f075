"""Compiles a tree with stub leaves instead of the real leaves, so that the tree runs without a robot.

Controls, decorators and the leaves of the tree language are the real nodes, on a simulated clock. Every other leaf,
whether it is installed or only described by a model, becomes a `StubLeaf`, whose outcomes an outcome policy chooses.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any

from py_trees import decorators
from py_trees.behaviour import Behaviour

from sar_compiler.analysis.stub_leaf import FactVariables, OutcomePolicy, StubLeaf
from sar_compiler.compiler import Arguments, Builder, CompiledTree, Construction, compile_with
from sar_compiler.errors import SarError, UndecidableError
from sar_compiler.nodes.binding.bound import (
    Binding,
    BoundNode,
    SkipAnalysis,
    is_skippable_itself,
    report_misread_skips,
)
from sar_compiler.nodes.binding.instances import TreeInstance
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.language import leaves as language
from sar_compiler.nodes.outcome_sets import ALLOWED, WORD_OF, F, R, S
from sar_compiler.nodes.outcomes import (
    NOBODY,
    SELF,
    Identifiers,
    fill_outcome,
    fill_placeholders,
    number_text,
)
from sar_compiler.nodes.palettes import palettes_containing
from sar_compiler.nodes.semantics import AccessKind, Order, Semantics
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter
from sar_compiler.runtime import stock
from sar_compiler.runtime.blackboard import Board, Entry, Scope
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.runtime.context import preview_of
from sar_compiler.runtime.events import Event
from sar_compiler.runtime.expressions import Access, name_uses
from sar_compiler.runtime.kernel.table import is_known_class
from sar_compiler.runtime.kernel.timing import TimeoutNode
from sar_compiler.runtime.kernel.turning import SubTreeNode, TurningNode
from sar_compiler.runtime.leaf_protocol import NoStatusError
from sar_compiler.runtime.outcomes import Fact, Outcome
from sar_compiler.runtime.parents import EngineParent
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.ticking import OwnDecorator, behaviour_class
from sar_compiler.runtime.variables import UNKNOWN
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import SUBTREE_TAG

Substitute = Callable[..., Behaviour]
"""Creates the replacement for a node. The arguments are the node's `name` and the node's `children` or `child`."""


class UnknownBehaviourError(UndecidableError):
    """Raised if the behaviour of some controls or decorators is unknown, and no replacement is given for them.

    Attributes:
        findings: A finding for each tag of such nodes.
    """

    def __init__(self, nodes: list[BoundNode]) -> None:
        self.findings = tuple(
            map(_unknown_behaviour, {node.spec.tag: node for node in reversed(nodes)}.values())
        )[::-1]
        super().__init__("\n".join(finding.render() for finding in self.findings))


def _unknown_behaviour(bound: BoundNode) -> Diagnostic:
    tag, element = bound.spec.tag, bound.element
    replace = f"name a replacement for <{tag}> in the scenario or properties file: controls: {{{tag}: ...}}"
    if not bound.spec.is_foreign:
        message = (
            f"<{tag}> has its own methods ({bound.spec.factory_path.replace(':', '.')}), and its registered semantics do "
            f"not define exactly when <{tag}> ticks its children"
        )
        hint = f"derive it from sar_compiler.{bound.spec.kind.value} with the methods begin and resume, register it with semantics, or {replace}"
        return element.finding("only-described", message, hint=hint)
    message = f"<{tag}> is only described by a model. A model does not define when a node ticks its children"
    palettes = " or ".join(palettes_containing(tag))
    known = f", or the palette that describes it (--model {palettes})" if palettes else ""
    hint = f"load the module that defines it (--nodes PKG.MOD){known}, or {replace}"
    return element.finding("only-described", message, hint=hint)


def described_parents(binding: Binding) -> list[BoundNode]:
    """Return a tree's controls and decorators that have a model, but no implementation."""
    return [
        node for node in binding.all_nodes() if node.spec.is_only_described and not node.spec.kind.is_leaf
    ]


def self_ticking_parents(binding: Binding) -> list[BoundNode]:
    """Return the controls and decorators whose behaviour is defined only by the methods of a user's class."""
    return [
        node
        for node in binding.all_nodes()
        if not node.spec.kind.is_leaf and node.spec.cls is not None and not is_known_class(node.spec.cls)
    ]


def by_semantics(bound: BoundNode, clock: Clock) -> Substitute | None:
    """Return a constructor for a node that follows the registered semantics, or None if it is impossible.

    Args:
        bound: The node, without children that can be skipped.
        clock: The clock for time limits.
    """
    semantics = bound.spec.semantics
    if semantics.possible is None or semantics.once or bound.spec.references:
        return None
    if bound.spec.kind is Kind.CONTROL:
        return _sequence_substitute(bound, semantics)
    if semantics.limit_sec is not None:
        limit = semantics.limit_sec(bound)
        return None if limit is None else _limit_substitute(clock, limit)
    if semantics.repeats:
        rounds = semantics.rounds and semantics.rounds(bound)
        return partial(_repeat_substitute, semantics.repeats, rounds) if rounds else None
    return _mapping_substitute(bound, semantics)


def _sequence_substitute(bound: BoundNode, semantics: Semantics) -> Substitute | None:
    assert semantics.possible is not None  # noqa: S101 - checked by the caller
    if semantics.order is not Order.IN_ORDER:
        return None
    pauses = semantics.possible(bound, [semantics.goes_on] * len(bound.children), ALLOWED) & R
    if semantics.resumes:
        return stock.SequenceWithMemory if semantics.is_sequence else None
    if pauses:
        return stock.AsyncSequence if semantics.is_sequence else stock.AsyncFallback
    return partial(stock.Sequence if semantics.is_sequence else stock.Fallback, memory=not bound.is_reactive)


def _mapping_substitute(bound: BoundNode, semantics: Semantics) -> Substitute | None:
    assert semantics.possible is not None  # noqa: S101 - checked by the caller
    turned = [WORD_OF.get(semantics.possible(bound, [outcome], ALLOWED)) for outcome in (S, F, R)]
    if not semantics.steady or turned[2] != "RUNNING" or None in turned:
        return None
    return partial(behaviour_class(OwnDecorator, TurningNode), turned=(*turned[:2], "SKIPPED"))


def _limit_substitute(clock: Clock, seconds: float) -> Substitute:
    if seconds == math.inf:
        return behaviour_class(OwnDecorator, SubTreeNode)
    msec = Input(source=int(1000 * seconds))
    return partial(behaviour_class(OwnDecorator, TimeoutNode), msec=msec, clock=clock)


def _repeat_substitute(again: int, rounds: float, name: str, child: Behaviour) -> Behaviour:
    count = -1 if rounds == math.inf else int(rounds)
    return decorators.Retry(name, child, count) if again == F else decorators.Repeat(name, child, count)


def replace_nodes(binding: Binding, controls: Mapping[str, NodeSpec]) -> None:
    """Replace all nodes with the given tags by other nodes that have default attributes.

    Args:
        binding: The tree, which is changed.
        controls: The replacement for each tag; it must accept the children of all nodes with the tag.
    """
    for tree in binding.used_trees():
        for node in tree.nodes:
            if node.spec.tag in controls:
                node.spec, node.values, node.keys = controls[node.spec.tag], {}, {}
                tree.skips = tree.skips or is_skippable_itself(node)


# A leaf of the language with random outcomes would make every run different.
_RANDOM_LEAF = "py_trees.behaviours:ProbabilisticBehaviour"
_LANGUAGE = {(each.tag, each.class_path) for each in language.SPECS if each.class_path != _RANDOM_LEAF}


def needs_stub(spec: NodeSpec) -> bool:
    """Return whether a node becomes a stub leaf.

    Every leaf becomes a stub, except the leaves that the tree language defines.
    """
    return spec.kind.is_leaf and (spec.tag, spec.class_path) not in _LANGUAGE


@dataclass(frozen=True)
class Assumptions:
    """Assumptions about facts and leaf outcomes, in addition to the declarations of leaves.

    Attributes:
        facts: The start values of facts, which override or extend the facts that leaves declare.
        outcomes: The possible outcomes of leaves, by leaf path (`Patrol/MoveTo`), name or tag. If several keys match,
            the path precedes the name, and the name precedes the tag.
        written: The values that leaves may write to a key, as literals of scripts, by the names of leaf and key. By default a value
            that no outcome defines is unknown.
    """

    facts: Mapping[str, Fact] = field(default_factory=dict)
    outcomes: Mapping[str, tuple[Outcome, ...]] = field(default_factory=dict)
    written: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)

    def __or__(self, other: "Assumptions") -> "Assumptions":
        """Combine the assumptions with *other*, which has precedence."""
        return Assumptions(
            {**self.facts, **other.facts},
            {**self.outcomes, **other.outcomes},
            {**self.written, **other.written},
        )


@dataclass(eq=False)
class SimulatedTree:
    """A compiled tree whose leaves return the outcomes that an outcome policy chooses.

    Args:
        compiled: The compiled tree.
        facts: The facts.
        leaves: The stub leaves, in pre-order.
        clock: The simulated clock for all durations.
        disputes: A message for each fact that leaves declare with different start values, if no file sets the fact.
        by_semantics: The tags and classes of nodes that were replaced by their semantics; see `compile_simulated`.
        enums: The numbers of the named constants in scripts.
    """

    compiled: CompiledTree
    facts: Scope
    leaves: tuple[StubLeaf, ...]
    clock: ManualClock
    disputes: Mapping[str, str] = field(default_factory=dict)
    by_semantics: tuple[tuple[str, str], ...] = ()
    enums: Mapping[str, int] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list, init=False)
    """The events of the leaves, in order, since the list was last cleared."""

    def __post_init__(self) -> None:
        for number, each in enumerate(pre_order(self.root)):
            if isinstance(each, StubLeaf):
                each.number, each.events = number, self.events

    @property
    def root(self) -> Behaviour:
        """The root of the tree."""
        return self.compiled.root

    @property
    def policy(self) -> OutcomePolicy | None:
        """The policy that chooses the outcomes of leaves, or None if the tree has no stub leaves."""
        return self.leaves[0].policy if self.leaves else None

    @policy.setter
    def policy(self, policy: OutcomePolicy) -> None:
        for leaf in self.leaves:
            leaf.policy = policy

    def explain(self, error: BaseException) -> str:
        """Describe an exception that was raised in a tick."""
        if isinstance(error, NoStatusError):
            return f"'{error.behaviour.name}' ({type(error.behaviour).__name__}) failed: {error}"
        kind = "" if isinstance(error, SarError) else f"{type(error).__name__}: "
        return f"{kind}{error}"

    def fact_values(self) -> dict[str, Fact]:
        """Return the values of all facts by name, in the order of their creation."""
        values = self.facts.board.values()
        return {name: value for name, value in values.items() if isinstance(value, (bool, int, float, str))}


def compile_simulated(
    binding: Binding,
    parameters: Mapping[str, object],
    assumptions: Assumptions | None = None,
    *,
    all_runs: bool = False,
) -> SimulatedTree:
    """Compile a bound tree with stub leaves.

    Args:
        binding: The bound tree, which must have no errors.
        parameters: The values of the root blackboard's keys, from the parameters of the mission.
        assumptions: Assumptions in addition to the declarations of leaves.
        all_runs: Whether all runs of the tree will be explored. Then the clock cannot be read. Controls and decorators
            with their own methods are replaced by their semantics, because their states cannot be restored.

    Raises:
        TreeError: If the tree cannot be compiled; contains the findings.
        UnknownBehaviourError: If a control or decorator is only described by a model, or has its own methods and
            incomplete semantics (with *all_runs*).
    """
    clock = UnreadableClock() if all_runs else ManualClock()
    unknown = described_parents(binding)
    own = self_ticking_parents(binding) if all_runs else []
    stand_ins: dict[BoundNode, Substitute] = {}
    for node in own:
        made = by_semantics(node, clock)
        if made is None:
            unknown.append(node)
        else:
            stand_ins[node] = made
    if unknown:
        raise UnknownBehaviourError(unknown)
    collector = FindingCollector()
    arguments = SimulationArguments({Clock: clock}, parameters, collector, binding.enums)
    arguments.stand_ins = stand_ins
    builder = SimulationBuilder(binding, arguments, collector, assumptions or Assumptions())
    compiled = compile_with(binding, builder, parameters, collector)
    builder.start_facts()
    leaves = tuple(each for each in compiled.root.iterate() if isinstance(each, StubLeaf))
    named = dict.fromkeys((node.spec.tag, node.spec.factory_path.replace(":", ".")) for node in stand_ins)
    return SimulatedTree(
        compiled, builder.facts, leaves, clock, builder.disputes, tuple(named), binding.enums
    )


class UnreadableClock(ManualClock):
    """The clock for exploring all possible runs, in which time is unknown.

    Reading the time raises an error.
    """

    def now(self) -> float:
        """Raise an error, because the time is unknown.

        Raises:
            UndecidableError: Always.
        """
        raise UndecidableError(
            "a control or decorator reads the clock, but the time is unknown while all possible runs are explored. To measure time, "
            "use the tick's methods start_timer() and time_is_up() instead"
        )


class SimulationArguments(Arguments):
    """Provides the constructor arguments of real nodes. Stub leaves need no such arguments.

    Attributes:
        stand_ins: The constructors of nodes that are replaced by their semantics.
    """

    stand_ins: Mapping[BoundNode, Substitute] = MappingProxyType({})
    parameter_advice = (
        "set it with --params FILE, or with parameters: {{{name}: ...}} in the scenario or properties file"
    )

    def node_arguments(self, instance: TreeInstance, bound: BoundNode) -> dict[str, Any]:
        """Return the constructor arguments of a node, by parameter name."""
        if bound in self.stand_ins or bound.spec.stand_in:
            return {"name": bound.name}
        if not needs_stub(bound.spec):
            return super().node_arguments(instance, bound)
        ports: dict[str, Any] = {}
        for parameter in bound.spec.ports:
            self._port(instance, bound, parameter, ports)
        return ports

    def _handed_over(self, instance: TreeInstance, bound: BoundNode, parameter: Parameter) -> object:
        target = parameter.target
        if parameter.required and target is not None and target not in self._context:
            self._context[target] = preview_of(target)
        return super()._handed_over(instance, bound, parameter)


class SimulationBuilder(Builder):
    """Creates a simulated tree, in which stub leaves replace the real leaves.

    Args:
        binding: The bound tree.
        arguments: Provides the constructor arguments.
        collector: Receives the errors that prevent the creation of the tree.
        assumptions: Assumptions in addition to the declarations of leaves.

    Attributes:
        facts: The facts.
        disputes: A message for each fact that leaves declare with different start values.
    """

    def __init__(
        self,
        binding: Binding,
        arguments: SimulationArguments,
        collector: FindingCollector,
        assumptions: Assumptions,
    ) -> None:
        super().__init__(binding, arguments, collector)
        self._stand_ins = arguments.stand_ins
        said = [
            key
            for key, outcomes in assumptions.outcomes.items()
            if any(a.status == "SKIPPED" for a in outcomes)
        ]
        skipped = [node for node in binding.all_nodes() if needs_stub(node.spec) and _can_name(said, node)]
        if skipped:
            # Classes that mistake a skipped child for an interruption are reported.
            self._skipping = SkipAnalysis(binding.used_trees(), skipped)
            report_misread_skips(binding.used_trees(), collector, skipped)
        self.facts = Scope(Board("facts"))
        self.disputes: dict[str, str] = {}
        self._assumptions = assumptions
        self._places = NodePaths(binding)
        self._identifiers = Identifiers()
        self._names: dict[tuple[TreeInstance, BoundNode], str] = {}
        self._outcomes: dict[tuple[TreeInstance, BoundNode], tuple[Outcome, ...]] = {}
        self._integer_texts: dict[tuple[TreeInstance, BoundNode], dict[str, str]] = {}
        self._start: dict[str, tuple[Fact, str]] = {}

    def prepare(self, instance: TreeInstance) -> None:
        """Determine the names and outcomes of the leaves in a tree instance, and check the nodes' arguments."""
        for bound in instance.tree.nodes:
            if bound.spec.kind.is_leaf or bound.spec.has_world_leaf:
                self._names[instance, bound] = self._identifiers.make_unique(bound.name)
            if needs_stub(bound.spec) or bound.spec.has_world_leaf:
                path = self._places.path(instance, bound)
                said = self._outcomes[instance, bound] = outcomes_for(
                    self._assumptions.outcomes, path, bound.spec
                )
                self._integer_texts[instance, bound] = self._integers_in(said, instance, bound)
        super().prepare(instance)

    def _integers_in(
        self, said: Sequence[Outcome], instance: TreeInstance, bound: BoundNode
    ) -> dict[str, str]:
        """Return the text of the integer attributes that outcome scripts use as placeholders, by name."""
        scripts = [script for outcome in said for script in (outcome.when, outcome.then)]
        return {
            parameter.name: number_text(self._source.fixed_value(instance, bound, parameter))
            for parameter in bound.spec.parameters.values()
            if parameter.is_integer_parameter and any(f"{{{parameter.name}}}" in script for script in scripts)
        }

    def report_only_described(self, bound: BoundNode) -> None:
        """Report a subtree that has no tree file.

        Other nodes without an implementation are leaves, which become stubs.
        """
        if bound.element.tag == SUBTREE_TAG:
            super().report_only_described(bound)

    def _maker(self, bound: BoundNode) -> Any:
        """Return the constructor of a node or of the node's replacement."""
        if bound in self._stand_ins:
            return self._stand_ins[bound]
        return bound.spec.stand_in.maker if bound.spec.stand_in else super()._maker(bound)

    def start_facts(self) -> None:
        """Write the start values of declared and assumed facts, after all leaves were created."""
        values = {name: value for name, (value, _) in self._start.items()}
        for name, value in {**values, **self._assumptions.facts}.items():
            entry = self.facts.resolve(name)
            entry.declare(type(value))
            entry.write(value)

    def _make(self, instance: TreeInstance, bound: BoundNode, children: list[Behaviour]) -> Behaviour:
        if needs_stub(bound.spec):
            return self._create_stub(instance, bound)
        if not bound.spec.has_world_leaf:
            return super()._make(instance, bound, children)
        made = super()._make(instance, bound, children)
        assert isinstance(made, EngineParent)  # noqa: S101 - nodes with such a leaf are the project's own
        made.insert_leaf(self._create_stub(instance, bound))
        return made

    def _create_stub(self, instance: TreeInstance, bound: BoundNode) -> StubLeaf:
        """Create the stub leaf that replaces a leaf, or that provides external outcomes to another node."""
        names = {SELF: self._names[instance, bound], **self._integer_texts[instance, bound]}
        for parameter in bound.spec.references:
            target = instance.target_of(bound, parameter.name)
            names[parameter.name] = NOBODY if target is None else self._names.get(target, NOBODY)
        for fact, value in bound.spec.facts.items():
            self._add_fact(fill_placeholders(fact, names), value, bound.name)
        path = self._places.path(instance, bound)
        said = self._outcomes[instance, bound]
        enums = self._source.enums
        outputs = _Outputs(instance.scope, bound)
        variables = FactVariables(self.facts, instance.scope, enums, bound.name, outputs.named)
        outcomes = outputs.with_outputs(
            [fill_outcome(outcome, names) for outcome in said], self._assumptions.written
        )
        leaf = StubLeaf(bound.name, bound.spec.tag, outcomes, variables, enums)
        leaf.path = path
        self.constructions.append(Construction(leaf.id, instance, bound))
        return leaf

    def _add_fact(self, name: str, value: Fact, leaf: str) -> None:
        first, other = self._start.setdefault(name, (value, leaf))
        if first != value and name not in self._assumptions.facts:
            self.disputes[name] = (
                f"the leaf '{other}' declares the initial value {first!r} of the fact '{name}', but '{leaf}' declares {value!r}. "
                f"Set the value with facts: {{{name}: {first!r}}}"
            )


class _Outputs:
    """The entries that a leaf writes in a real run, through output ports or values such as `x: {key}`.

    The written values are unknown, unless the scripts of the leaf's outcomes define them.

    Args:
        scope: The scope of the leaf's tree.
        bound: The leaf.

    Attributes:
        named: The entries, by generated names for scripts, because a key may also be the name of a fact.
    """

    def __init__(self, scope: Scope, bound: BoundNode) -> None:
        self.named: dict[str, Entry] = {}
        self._scope, self._leaf = scope, bound.name
        # For each entry, the attribute that names its key.
        self._attributes: list[str] = []
        for parameter in bound.spec.parameters.values():
            name, role = parameter.name, bound.spec.semantics.keys.get(parameter.name)
            keys_in = parameter.value_type.keys_in
            if parameter.direction in (Direction.OUTPUT, Direction.INOUT) and name in bound.keys:
                self._add(name, bound.keys[name])
            elif role is not None and role.kind is AccessKind.WRITE and keys_in is not None:
                for key in keys_in(bound.values.get(name)):
                    self._add(name, key)

    def _add(self, attribute: str, key: str) -> None:
        self.named[f"_output_{len(self.named)}"] = self._scope.resolve(key)
        self._attributes.append(attribute)

    def with_outputs(
        self, outcomes: list[Outcome], assumed: Mapping[tuple[str, str], tuple[str, ...]]
    ) -> list[Outcome]:
        """Make outcomes write unknown or assumed values to the entries that no outcome's script writes.

        Args:
            outcomes: The outcomes.
            assumed: The assumed values, see `Assumptions.written`.
        """
        if not self.named:
            return outcomes
        uses = (use for outcome in outcomes if outcome.then for use in name_uses(parse(outcome.then)))
        said = {self._scope.resolve(use.name).name for use in uses if use.access is not Access.READ}
        written = [
            (attribute, self._effects(word, entry.key, assumed))
            for attribute, (word, entry) in zip(self._attributes, self.named.items(), strict=True)
            if entry.name not in said
        ]
        return [after for outcome in outcomes for after in _after_writing(outcome, written)]

    def _effects(self, word: str, key: str, assumed: Mapping[tuple[str, str], tuple[str, ...]]) -> list[str]:
        """Return a script for each possible effect on a key.

        A leaf need not write a key that has assumed values.
        """
        values = assumed.get((self._leaf, key))
        return [f"{word} := {UNKNOWN}"] if values is None else ["", *(f"{word} := {each}" for each in values)]


def _after_writing(outcome: Outcome, written: list[tuple[str, list[str]]]) -> Iterator[Outcome]:
    """Yield a copy of the outcome for each combination of effects on the attributes that it writes."""
    effects = [
        possible
        for attribute, possible in written
        if outcome.status != "SKIPPED" and (outcome.writes is None or attribute in outcome.writes)
    ]
    for chosen in itertools.product(*effects):
        yield replace(outcome, then="; ".join(filter(None, [outcome.then.rstrip().rstrip(";"), *chosen])))


class NodePaths:
    """The paths of the nodes of a bound tree."""

    def __init__(self, binding: Binding) -> None:
        self._around = {child: node for node in binding.all_nodes() for child in node.children}

    def path(self, instance: TreeInstance, bound: BoundNode) -> tuple[str, ...]:
        """Return the names of a node and its ancestors, from the root down."""
        names: list[str] = []
        place: tuple[TreeInstance, BoundNode] | None = (instance, bound)
        while place is not None:
            within, node = place
            names.append(node.name)
            around = self._around.get(node)
            if around is not None:
                place = (within, around)
            elif within.around is not None and within.place is not None:
                place = (within.around, within.place)
            else:
                place = None
        return tuple(reversed(names))


def match_rank(key: str, path: Sequence[str], tag: str) -> int:
    """Return how specifically a key names a leaf.

    Args:
        key: The leaf's name, its tag, or a path: the names of some ancestors of the leaf, in order, followed by its name
            or tag.
        path: The names of all nodes from the root down to the leaf.
        tag: The leaf's tag.

    Returns:
        3 for a path, 2 for the name, 1 for the tag, 0 if the key does not name the leaf.
    """
    if key == path[-1]:
        return 2
    if key == tag:
        return 1
    *parents, name = key.split("/")
    if not parents or name not in (path[-1], tag):
        return 0
    outer = iter(path[:-1])
    return 3 if all(part in outer for part in parents) else 0


def _can_name(keys: Iterable[str], bound: BoundNode) -> bool:
    """Return whether the last part of a key is a node's name or tag, so that the key may name the node."""
    return any(key.rpartition("/")[2] in (bound.name, bound.spec.tag) for key in keys)


def outcomes_for(
    assumed: Mapping[str, tuple[Outcome, ...]], path: Sequence[str], spec: NodeSpec
) -> tuple[Outcome, ...]:
    """Return the possible outcomes of a leaf: the assumed outcomes, or else the declared outcomes."""
    best = max(assumed, key=lambda key: match_rank(key, path, spec.tag), default="")
    return assumed[best] if best in assumed and match_rank(best, path, spec.tag) else spec.outcomes
