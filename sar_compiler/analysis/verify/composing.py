"""Proofs of trees with parallel branches that share nothing, each of them apart.

The states of k branches side by side are the product of theirs. But what a branch shares nothing with sees of it only what comes of its ticks. So for
each question only those branches are searched that it speaks of, and the others stand for themselves (`branches`, `kernel.branch_nodes`):

- whether the leaves of a branch can run is asked with this branch as it is, and all others standing for themselves;
- a property is asked with those as they are whose leaves it names;
- errors and ends are asked with all standing for themselves. A branch in which a tick can raise never does.

Nothing is lost: a branch and its automaton are bisimilar, tick by tick, and what is waited for in the one is in the other. So verdicts are those of
the plain search, and so are the numbers of ticks that lead to what is wrong. A round without an end may be a longer one, since it is told of the
tree as it is: its ticks are put together of those of the branches, and played by what plays the whole tree.
"""

import copy
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

from py_trees.behaviour import Behaviour

from sar_compiler.analysis.state_search.graph import Graph
from sar_compiler.analysis.state_search.searching import Report
from sar_compiler.analysis.verify.branches import Assembly, Branch, branches_of, searched
from sar_compiler.analysis.verify.properties import Properties, PropertyAutomata, without_properties
from sar_compiler.analysis.verify.state import Prepared
from sar_compiler.analysis.verify.state_space import IsWanted, PlayedTick, StateSpace, Trace, played_again
from sar_compiler.analysis.verify.stepping import TreeStepper, plain_stepper
from sar_compiler.analysis.verify.unknown_values import explored
from sar_compiler.analysis.verify.verdicts import Questions, Verdict, Verification
from sar_compiler.runtime.events import TickRecord
from sar_compiler.runtime.kernel.counting import ParallelAllNode, ParallelNode
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.tree_nodes import TreeNode
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.walking import pre_order

_MOST_JOINED = 64
"""Of more neighbours, what they do would be told of branches within branches too deep."""
_FEWEST = 2
"""With one branch that stands for itself, the search in which it does not is the plain one."""


def proved_apart(
    prepared: Prepared,
    flat: FlatTree,
    properties: Properties,
    max_states: int,
    report: Report,
    so_far: Verification,
) -> Verification | None:
    """Return the answers to all questions from searches in which branches stand for themselves; None if that does not lead to answers.

    Args:
        prepared: The tree.
        flat: Its flat form.
        properties: What is asked.
        max_states: How many states to find at most in each search.
        report: Is told now and then how far it is, and when a property is broken.
        so_far: What is known if the search is stopped.
    """
    read = {entry.name for condition in properties.conditions for entry in condition.entries}
    branches = [] if properties.asks_for_idle else list(branches_of(prepared, flat, read))
    if len(branches) < _FEWEST:
        return None
    asked = _Asked(prepared, flat, properties, branches)
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


class _Asked:
    """What is asked of a tree, each with those branches as they are of which it speaks.

    Args:
        prepared: The tree.
        flat: Its flat form.
        properties: What is asked.
        branches: The branches that can stand for themselves.

    Attributes:
        numbers: The numbers of the properties that are asked with the same branches as they are, by these.
        spaces: What was found of each.
    """

    def __init__(
        self, prepared: Prepared, flat: FlatTree, properties: Properties, branches: Sequence[Branch]
    ) -> None:
        self._prepared, self._flat, self._properties = prepared, flat, properties
        self._arrangement = Arrangement(prepared, flat, branches)
        self._whole = TreeStepper(prepared, without_properties().rules)
        self.spaces: dict[frozenset[Behaviour], ComposedSpace] = {}
        roots = {each: branch.root for branch in branches for each in pre_order(branch.root)}
        self.numbers: dict[frozenset[Behaviour], list[int]] = {frozenset(): []}
        self.numbers |= {frozenset([branch.root]): [] for branch in branches}
        for number in range(len(properties.names)):
            leaves = [prepared.alphabet.answers[event][0] for event in properties.events(number)]
            named = frozenset(roots[leaf] for leaf in leaves if leaf in roots)
            self.numbers.setdefault(named, []).append(number)

    def search(self, concrete: frozenset[Behaviour], max_states: int, report: Report) -> Graph:
        """Search the tree with some branches as they are."""
        asked = self._properties.only(self.numbers[concrete])
        parts = self._arrangement.without(concrete, asked.rules)
        graph, unknown = explored(parts.stepper, max_states, report, asked.names)
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
        """Yield the answers."""
        explain = self._prepared.simulated.explain
        questions = {concrete: Questions(space, explain) for concrete, space in self.spaces.items()}
        whole = questions[frozenset()]
        yield whole.no_error()
        leaves = [node for node in self._flat.nodes if not node.children]
        steppers = [space.stepper for space in self.spaces.values()]
        ran = {stepper.flat.nodes[index].behaviour for stepper in steppers for index in stepper.ran}
        yield whole.every_leaf(leaves, {leaf.index for leaf in leaves if leaf.behaviour in ran})
        if self._properties.has_end:
            yield from whole.endings()
        answers = {
            number: verdict
            for concrete, numbers in self.numbers.items()
            for number, verdict in zip(
                numbers, questions[concrete].properties(self._properties.only(numbers)), strict=True
            )
        }
        yield from (answers[number] for number in sorted(answers))


class Arrangement:
    """Which branches stand for themselves, alone or together, while some are searched as they are.

    Args:
        prepared: The tree.
        flat: Its flat form.
        branches: The branches that can stand for themselves.
    """

    def __init__(self, prepared: Prepared, flat: FlatTree, branches: Iterable[Branch]) -> None:
        self._prepared = prepared
        self._branches = {branch.root: branch for branch in branches}
        self._parallels = [node.behaviour for node in flat.nodes if _needs_all(node)]
        self._joined: dict[tuple[Behaviour, Behaviour], Branch | None] = {}

    def without(self, concrete: Collection[Behaviour], rules: PropertyAutomata) -> Assembly:
        """Return the tree with some branches as they are.

        Args:
            concrete: The roots of these.
            rules: What is watched.
        """
        parts = {root: branch for root, branch in self._branches.items() if root not in concrete}
        joined: dict[Behaviour, list[Behaviour]] = {}
        for parallel in self._parallels:
            children = self._together(parallel, parts)
            if len(children) < len(parallel.children):
                joined[parallel] = children
        return Assembly.of(
            self._prepared, self._prepared.simulated.root, parts.values(), rules, joined=joined
        )

    def _together(self, parallel: Behaviour, parts: dict[Behaviour, Branch]) -> list[Behaviour]:
        """Return the children of a parallel node, neighbours that stand for themselves as one, which is added to the others."""
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
        """Return as few branches as possible for neighbours below a parallel node."""
        # From the end of the node on, so that what is joined serves again where the branch beside it is another one.
        is_first = run[0].root is parallel.children[0]
        found: list[Branch] = []
        for branch in run if is_first else reversed(run):
            before = found.pop() if found else None
            pair = [each for each in (before, branch) if each is not None]
            joined = self._join(parallel, pair if is_first else pair[::-1]) if before else branch
            found += pair if joined is None else [joined]
        return found if is_first else found[::-1]

    def _join(self, parallel: Behaviour, pair: Sequence[Branch]) -> Branch | None:
        """Return two branches as one; None if they can only stand for themselves alone."""
        roots = pair[0].root, pair[1].root
        if roots not in self._joined:
            self._joined[roots] = searched(self._prepared, copy.copy(parallel), pair)
        return self._joined[roots]


def _needs_all(node: TreeNode) -> bool:
    """Return whether a parallel node succeeds if all children have, and fails if one has."""
    behaviour, count = node.behaviour, len(node.children)
    if count > _MOST_JOINED:
        return False
    if isinstance(node, ParallelAllNode):
        return _constant(behaviour.max_failures) == 1
    if not isinstance(node, ParallelNode):
        return False
    needed, limit = _constant(behaviour.success_count), _constant(behaviour.failure_count)
    return needed in (count, -1) and (limit == -1 or 1 <= limit <= count)


def _constant(port: Input[int]) -> int:
    """Return the value of a port that never changes; 0 for one that may."""
    return port.get() if port.entry is None else 0


@dataclass(frozen=True, eq=False)
class ComposedSpace(StateSpace):
    """The states of a tree of which some branches stand for themselves; what is told of them are runs of the whole tree.

    Attributes:
        parts: The tree.
        whole: Ticks it with all branches as they are.
    """

    parts: Assembly = field(kw_only=True)
    whole: TreeStepper = field(kw_only=True)

    def _trace(self, steps: Iterable[tuple[int, IsWanted]], loop: int = 0) -> Trace:
        run, wanted = _WholeRun(self.parts, self.whole), [each for _, each in steps]
        stem = len(wanted) - loop
        for each in wanted[:stem]:
            run.go_on(each)
        # The tree as it is may need several rounds to come back to a state.
        known: dict[object, int] = {}
        while loop and run.position not in known:
            known[run.position] = len(run.ticks)
            for each in wanted[stem:]:
                run.go_on(each)
        ticks = run.ticks if self.plain is None else played_again(self.plain, run.found)
        return Trace(tuple(ticks), len(ticks) - known[run.position] if loop else 0)


class _WholeRun:
    """A run of a whole tree, after one of a tree of which some branches stand for themselves.

    Args:
        parts: That tree.
        whole: Ticks the whole one.

    Attributes:
        ticks: Its ticks so far.
        found: What was found of them.
    """

    def __init__(self, parts: Assembly, whole: TreeStepper) -> None:
        self.ticks: list[TickRecord] = []
        self.found: list[PlayedTick] = []
        self._parts, self._whole = parts, whole
        self._state: bytes | None = whole.steps.start()
        self._of_parts = parts.start()

    @property
    def position(self) -> object:
        """Where it is."""
        return self._state, self._of_parts

    def go_on(self, wanted: IsWanted) -> None:
        """Play a tick that is wanted."""
        whole, parts = self._whole, self._parts
        self._of_parts, choices = parts.go_on(self._of_parts, wanted)
        step = next(whole.ticks(self._state or b"", choices))
        if step.outcome != parts.stepper.steps.outcome:
            message = "the run of the whole tree is another one than that of its parts"
            raise AssertionError(message)
        self.found.append(PlayedTick(choices, step.outcome))
        self.ticks.append(whole.played(len(self.ticks) + 1))
        self._state = step.state
