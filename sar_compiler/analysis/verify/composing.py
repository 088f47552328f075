"""Proves properties of trees with independent parallel branches, one branch at a time.

The states of k parallel branches are the product of their states. But the rest of the tree observes only the results
of a branch's ticks if it shares nothing with the branch. So for each question, only the branches that the question
concerns are searched in full, and automata replace all other branches (`branches`, `state_search.branch_nodes`):

- Whether the leaves of a branch can run is decided with only this branch in full.
- A property is decided with the branches in full whose leaves the property names.
- Errors and ends are decided with all branches replaced. A branch in which a tick can raise an error is never replaced.

The result is exact: a branch and its automaton are bisimilar, tick by tick, and have the same pending obligations. So
the verdicts and the numbers of ticks to a violation are the same as in a plain search. Only an endless loop may be
longer, because the ticks of a run are composed of the ticks of the branches and played in the original tree.
"""

import copy
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

from py_trees.behaviour import Behaviour

from sar_compiler.analysis.state_search.graph import Graph
from sar_compiler.analysis.state_search.searching import Report
from sar_compiler.analysis.verify.branches import Branch, BranchAssembly, branches_of, search_branch
from sar_compiler.analysis.verify.properties import Properties, PropertyAutomata, without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.state_space import IsWanted, PlayedTick, StateSpace, Trace, replay_ticks
from sar_compiler.analysis.verify.stepping import TreeStepper, plain_stepper
from sar_compiler.analysis.verify.unknown_values import explore_decidable
from sar_compiler.analysis.verify.verdicts import ProofQuestions, Verdict, Verification
from sar_compiler.runtime.events import TickRecord
from sar_compiler.runtime.kernel.counting import ParallelAllNode, ParallelNode
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.tree_nodes import TreeNode
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.walking import pre_order

_MAX_JOINED = 64
"""The maximum number of children up to which the branches below a parallel node are joined."""
_MIN_BRANCHES = 2
"""The minimum number of replaceable branches. With a single branch, separate searches have no advantage."""


def prove_by_branches(
    prepared: PreparedTree,
    flat: FlatTree,
    properties: Properties,
    max_states: int,
    report: Report,
    so_far: Verification,
) -> Verification | None:
    """Decide all questions by searches in which automata replace branches, or return None if impossible.

    Args:
        prepared: The tree.
        flat: The flat form of the tree.
        properties: The properties of the tree.
        max_states: The maximum number of states to find in each search.
        report: Receives the progress, and each violation.
        so_far: The result of the plain search, on which the final result is based.
    """
    read = {entry.name for condition in properties.conditions for entry in condition.entries}
    branches = [] if properties.asks_for_idle else list(branches_of(prepared, flat, read))
    if len(branches) < _MIN_BRANCHES:
        return None
    asked = _BranchQuestions(prepared, flat, properties, branches)
    for concrete in asked.numbers:
        graph = asked.search(concrete, max_states, report)
        if not graph.complete:
            return replace(so_far, stopped=True) if graph.stopped else None
    graphs = [space.graph for space in asked.spaces.values()]
    return replace(
        so_far,
        verdicts=tuple(asked.verdicts()),
        states=sum(len(graph.states) for graph in graphs),
        steps=sum(graph.step_count for graph in graphs),
        depth=max(graph.depth for graph in graphs),
        complete=True,
        growing=(),
        searches=len(graphs),
        branches=len(branches),
    )


class _BranchQuestions:
    """The questions about a tree. Questions with the same irreplaceable branches form a group.

    Args:
        prepared: The tree.
        flat: The flat form of the tree.
        properties: The properties of the tree.
        branches: The branches that can be replaced.

    Attributes:
        numbers: The numbers of the properties of each group, by the roots of the branches that are not replaced.
        spaces: The states that were found, by the roots of the branches that were not replaced.
    """

    def __init__(
        self, prepared: PreparedTree, flat: FlatTree, properties: Properties, branches: Sequence[Branch]
    ) -> None:
        self._prepared, self._flat, self._properties = prepared, flat, properties
        self._arrangement = BranchArrangement(prepared, flat, branches)
        self._whole = TreeStepper(prepared, without_properties().rules)
        self.spaces: dict[frozenset[Behaviour], ComposedSpace] = {}
        roots = {each: branch.root for branch in branches for each in pre_order(branch.root)}
        self.numbers: dict[frozenset[Behaviour], list[int]] = {frozenset(): []}
        self.numbers |= {frozenset([branch.root]): [] for branch in branches}
        for number in range(len(properties.names)):
            leaves = [prepared.alphabet.outcomes[event][0] for event in properties.events(number)]
            named = frozenset(roots[leaf] for leaf in leaves if leaf in roots)
            self.numbers.setdefault(named, []).append(number)

    def search(self, concrete: frozenset[Behaviour], max_states: int, report: Report) -> Graph:
        """Search the tree with all branches replaced, except the branches whose roots are *concrete*."""
        asked = self._properties.select(self.numbers[concrete])
        parts = self._arrangement.without_branches(concrete, asked.rules)
        graph, unknown = explore_decidable(parts.stepper, max_states, report, asked.names)
        self.spaces[concrete] = ComposedSpace(
            parts.stepper,
            graph,
            unknown=unknown,
            plain=plain_stepper(self._prepared, without_properties().rules),
            parts=parts,
            whole=self._whole,
        )
        return graph

    def verdicts(self) -> Iterator[Verdict]:
        """Yield a verdict on each question."""
        explain = self._prepared.simulated.explain
        questions = {concrete: ProofQuestions(space, explain) for concrete, space in self.spaces.items()}
        whole = questions[frozenset()]
        yield whole.verdict_on_errors()
        leaves = [node for node in self._flat.nodes if not node.children]
        steppers = [space.stepper for space in self.spaces.values()]
        ran = {stepper.flat.nodes[index].behaviour for stepper in steppers for index in stepper.ran}
        yield whole.verdict_on_leaves(leaves, {leaf.index for leaf in leaves if leaf.behaviour in ran})
        if self._properties.has_end:
            yield from whole.endings()
        verdicts = {
            number: verdict
            for concrete, numbers in self.numbers.items()
            for number, verdict in zip(
                numbers, questions[concrete].properties(self._properties.select(numbers)), strict=True
            )
        }
        yield from (verdicts[number] for number in sorted(verdicts))


class BranchArrangement:
    """Replaces the branches of a tree, except given branches.

    Neighbouring branches are joined where possible.

    Args:
        prepared: The tree.
        flat: The flat form of the tree.
        branches: The branches that can be replaced.
    """

    def __init__(self, prepared: PreparedTree, flat: FlatTree, branches: Iterable[Branch]) -> None:
        self._prepared = prepared
        self._branches = {branch.root: branch for branch in branches}
        self._parallels = [node.behaviour for node in flat.nodes if _needs_all(node)]
        self._joined: dict[tuple[Behaviour, Behaviour], Branch | None] = {}

    def without_branches(self, concrete: Collection[Behaviour], rules: PropertyAutomata) -> BranchAssembly:
        """Replace all branches except the given ones, and return the resulting tree.

        Args:
            concrete: The roots of the branches that are not replaced.
            rules: The monitored properties.
        """
        parts = {root: branch for root, branch in self._branches.items() if root not in concrete}
        joined: dict[Behaviour, list[Behaviour]] = {}
        for parallel in self._parallels:
            children = self._join_neighbours(parallel, parts)
            if len(children) < len(parallel.children):
                joined[parallel] = children
        return BranchAssembly.from_branches(
            self._prepared, self._prepared.simulated.root, parts.values(), rules, joined=joined
        )

    def _join_neighbours(self, parallel: Behaviour, parts: dict[Behaviour, Branch]) -> list[Behaviour]:
        """Join neighbouring replaced branches below a parallel node, and return the node's remaining children."""
        can_join = {root for root, branch in parts.items() if branch.is_never_skipped}
        children: list[Behaviour] = []
        for joins, some in groupby(parallel.children, can_join.__contains__):
            run = list(some)
            if joins:
                joined = self._joined_neighbours(parallel, [parts[each] for each in run])
                parts |= {branch.root: branch for branch in joined}
                run = [branch.root for branch in joined]
            children += run
        return children

    def _joined_neighbours(self, parallel: Behaviour, run: list[Branch]) -> list[Branch]:
        """Join neighbouring branches below a parallel node into as few branches as possible."""
        # A row that does not begin with the first child is joined from the last child backwards. So joined branches are
        # reused if only the branch before the row differs.
        is_first = run[0].root is parallel.children[0]
        found: list[Branch] = []
        for branch in run if is_first else reversed(run):
            before = found.pop() if found else None
            pair = [each for each in (before, branch) if each is not None]
            joined = self._join(parallel, pair if is_first else pair[::-1]) if before else branch
            found += pair if joined is None else [joined]
        return found if is_first else found[::-1]

    def _join(self, parallel: Behaviour, pair: Sequence[Branch]) -> Branch | None:
        """Join two branches into one, or return None if the branches can only be replaced separately."""
        roots = pair[0].root, pair[1].root
        if roots not in self._joined:
            self._joined[roots] = search_branch(self._prepared, copy.copy(parallel), pair)
        return self._joined[roots]


def _needs_all(node: TreeNode) -> bool:
    """Return whether a parallel node requires all children to succeed, so that the children may be joined."""
    behaviour, count = node.behaviour, len(node.children)
    if count > _MAX_JOINED:
        return False
    if isinstance(node, ParallelAllNode):
        return _constant(behaviour.max_failures) == 1
    if not isinstance(node, ParallelNode):
        return False
    needed, limit = _constant(behaviour.success_count), _constant(behaviour.failure_count)
    return needed in (count, -1) and (limit == -1 or 1 <= limit <= count)


def _constant(port: Input[int]) -> int:
    """Return the value of a constant port, or 0 if the port reads an entry."""
    return port.get() if port.entry is None else 0


@dataclass(frozen=True, eq=False)
class ComposedSpace(StateSpace):
    """The states of a tree in which automata replace branches.

    Its runs are shown as runs of the original tree.

    Attributes:
        parts: The tree with replaced branches.
        whole: Ticks the original tree.
    """

    parts: BranchAssembly = field(kw_only=True)
    whole: TreeStepper = field(kw_only=True)

    def _trace(self, steps: Iterable[tuple[int, IsWanted]], loop: int = 0) -> Trace:
        run, wanted = _WholeRun(self.parts, self.whole), [each for _, each in steps]
        stem = len(wanted) - loop
        for each in wanted[:stem]:
            run.play_tick(each)
        # The original tree may need several rounds of the loop to return to a state.
        known: dict[object, int] = {}
        while loop and run.position not in known:
            known[run.position] = len(run.ticks)
            for each in wanted[stem:]:
                run.play_tick(each)
        ticks = run.ticks if self.plain is None else replay_ticks(self.plain, run.found)
        return Trace(tuple(ticks), len(ticks) - known[run.position] if loop else 0)


class _WholeRun:
    """A run of the original tree that corresponds to a run of the tree with replaced branches.

    Args:
        parts: The tree with replaced branches.
        whole: Ticks the original tree.

    Attributes:
        ticks: The ticks so far.
        found: The choices and results of these ticks.
    """

    def __init__(self, parts: BranchAssembly, whole: TreeStepper) -> None:
        self.ticks: list[TickRecord] = []
        self.found: list[PlayedTick] = []
        self._parts, self._whole = parts, whole
        self._state: bytes | None = whole.steps.start()
        self._of_parts = parts.start()

    @property
    def position(self) -> object:
        """The current position in the run. Runs with equal positions can continue in the same way."""
        return self._state, self._of_parts

    def play_tick(self, wanted: IsWanted) -> None:
        """Play the tick of the original tree that corresponds to a tick of the tree with replaced branches."""
        whole, parts = self._whole, self._parts
        self._of_parts, choices = parts.play_tick(self._of_parts, wanted)
        step = next(whole.ticks(self._state or b"", choices))
        if step.outcome != parts.stepper.steps.outcome:
            message = "the run of the whole tree differs from the run that was composed of its branches"
            raise AssertionError(message)
        self.found.append(PlayedTick(choices, step.outcome))
        self.ticks.append(whole.tick_record(len(self.ticks) + 1))
        self._state = step.state
