"""Finds independent branches below parallel nodes, and creates automata that can replace them.

Neighbouring branches that must all succeed are joined into one branch (`joined`). For example, a parallel node with
three such children is replaced by one with two children, the first of which joins two of the branches. The automaton of
two branches is minimised before a third branch is added. So twenty similar branches have about ten states.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Running

from sar_compiler.analysis.simulated_tree import SimulatedTree, needs_stub
from sar_compiler.analysis.state_search.branch_nodes import (
    Automaton,
    BranchDeed,
    BranchResult,
    FlatComposition,
)
from sar_compiler.analysis.state_search.graph import Graph
from sar_compiler.analysis.state_search.liveness import components, is_fair
from sar_compiler.analysis.state_search.searching import explore
from sar_compiler.analysis.verify.properties import PropertyAutomata, without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.state_space import IsWanted
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.checks.rules.entry_accesses import PositionFinder, entry_table_of
from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.runtime.blackboard import Entry
from sar_compiler.runtime.kernel.branching import TryCatchNode
from sar_compiler.runtime.kernel.cells import INVALID, RUNNING, SKIPPED
from sar_compiler.runtime.kernel.counting import CountingNode
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.user_nodes import UserNode

_MAX_STATES = 20_000
"""The maximum number of states of a branch. The search of a larger branch could take longer than the proof."""
_READS = (AccessKind.READ, AccessKind.PEEK, AccessKind.FIXED)
_OUTSIDE = -1
"""The number that stands for the properties among the node numbers that use an entry."""


def has_parallels(flat: FlatTree) -> bool:
    """Return whether a tree has parallel nodes whose branches can be searched separately."""
    own = any(isinstance(node, UserNode) for node in flat.nodes)
    return not own and any(isinstance(node, CountingNode) for node in flat.nodes)


class EntrySharing:
    """Determines which nodes of a tree use which blackboard entries and facts.

    Args:
        simulated: The tree.
        read: The names of the entries that properties read.

    Attributes:
        is_open: Whether a node may depend on other nodes by entries or references that are not known.
    """

    def __init__(self, simulated: SimulatedTree, read: Iterable[str]) -> None:
        self._origins = simulated.compiled.origins
        # The numbers of the nodes that use each entry.
        self._users: dict[str, set[int]] = {name: {_OUTSIDE} for name in read}
        self._changed: set[str] = set()
        top = simulated.compiled.instance
        self._places = PositionFinder(top)
        table = entry_table_of(top)
        self.is_open = table.is_open or any(
            # The table of accesses does not contain removals of entries.
            any(role.kind is AccessKind.NONE for role in bound.spec.semantics.keys.values())
            or (bound.references and not needs_stub(bound.spec))
            for tree in table.accesses
            for bound in tree.nodes
        )
        for use in (use for entry in table.entries for use in entry.uses):
            entry = use.instance.scope.resolve(use.access.key)
            self._add_uses([entry], use.position.number, changes=use.access.kind not in _READS)
        for leaf in simulated.leaves:
            made = self._origins.construction(leaf.id)
            number = self._places.position_of(made.instance, made.bound).number
            for outcome in leaf.outcomes:
                self._add_uses(leaf.entries(filter(None, [outcome.when])), number, changes=False)
                self._add_uses(leaf.entries(filter(None, [outcome.then])), number, changes=True)

    def _add_uses(self, entries: Iterable[Entry], number: int, *, changes: bool) -> None:
        for entry in entries:
            self._users.setdefault(entry.name, set()).add(number)
            if changes:
                self._changed.add(entry.name)

    def is_apart(self, branch: Behaviour) -> bool:
        """Return whether the changing entries of a branch are used only inside the branch, and by no property."""
        if branch.id not in self._origins:
            return False
        made = self._origins.construction(branch.id)
        place = self._places.position_of(made.instance, made.bound)
        inside = range(place.number, place.last + 1)
        users = (self._users[name] for name in self._changed)
        return all(len({number in inside for number in each}) == 1 for each in users)


@dataclass(frozen=True, eq=False)
class BranchAssembly:
    """A tree, or a single branch of a tree, in which automata replace some branches.

    Attributes:
        stepper: Ticks the tree or branch.
        results: The results of the replaced branches in the last tick.
        branches: The replaced branches, by the index of their node in the tree or branch.
    """

    stepper: TreeStepper
    results: list[BranchDeed]
    branches: "Mapping[int, Branch]"

    @classmethod
    def from_branches(
        cls,
        prepared: PreparedTree,
        root: Behaviour,
        branches: "Iterable[Branch]",
        rules: PropertyAutomata,
        *,
        around: Behaviour | None = None,
        joined: Mapping[Behaviour, list[Behaviour]] | None = None,
    ) -> "BranchAssembly":
        """Replace branches by automata in a tree or in a single branch of a tree.

        Args:
            prepared: The tree.
            root: The root of the tree or of the separate branch.
            branches: The branches to replace.
            rules: The monitored properties.
            around: The behaviour that ticks a separate branch; None for a tree.
            joined: The remaining children of parallel nodes whose neighbouring branches were joined.
        """
        known, results = {branch.root: branch for branch in branches}, list[BranchDeed]()
        automata = {root: branch.automaton for root, branch in known.items()}
        composed = FlatComposition(root, automata, joined or {}, around, results)
        stepper = TreeStepper(prepared, rules, composed.flat)
        nodes = enumerate(stepper.flat.nodes)
        found = {index: known[node.behaviour] for index, node in nodes if node.behaviour in known}
        return cls(stepper, results, found)

    def start(self) -> "BranchPosition":
        """Return the position at the start of a run."""
        return BranchPosition(
            self.stepper.steps.start(), tuple(branch.parts.start() for branch in self.branches.values())
        )

    def play_tick(
        self, position: "BranchPosition", wanted: IsWanted
    ) -> "tuple[BranchPosition, tuple[int, ...]]":
        """Play the first tick that *wanted* accepts.

        Return the new position and the choices in the original tree.
        """
        path = next(step for step in self.stepper.ticks(position.state) if wanted(step)).path()
        self.results.clear()
        state = next(self.stepper.ticks(position.state, path)).state or b""
        choices: list[int] = []
        behind, within = 0, dict(zip(self.branches, position.within, strict=True))
        for index, first, then, result in self.results:
            within[index], own = self.branches[index].play_tick(within[index], result)
            choices += [*path[behind:first], *own]
            behind = then
        return BranchPosition(state, tuple(within.values())), (*choices, *path[behind:])


@dataclass(frozen=True)
class BranchPosition:
    """A position in a run of a tree with replaced branches, and in the runs of these branches.

    Attributes:
        state: The state of the tree with replaced branches; empty after an error.
        within: The positions in the runs of the replaced branches.
    """

    state: bytes
    within: "tuple[BranchPosition, ...]"


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch that was searched separately from the rest of the tree.

    Attributes:
        root: The root of the branch.
        parts: The branch with its own replaced branches.
        classes: The state of the automaton for each state of the branch.
        automaton: The automaton, which describes the results that the branch's parent observes.
    """

    root: Behaviour
    parts: BranchAssembly
    classes: Mapping[bytes, int]
    automaton: Automaton

    @property
    def is_never_skipped(self) -> bool:
        """Whether no tick of the branch returns SKIPPED."""
        return all(outcome != SKIPPED for some in self.automaton.ticks for outcome, _ in some)

    def play_tick(
        self, position: BranchPosition, result: BranchResult
    ) -> tuple[BranchPosition, tuple[int, ...]]:
        """Play a tick that has the given result. Return the new position and the choices in the original tree."""
        classes, runs = self.classes, self.automaton.halts[self.classes[position.state]]
        after, choices = self.parts.play_tick(
            position, lambda step: (step.outcome, classes[step.state or b""]) == result
        )
        # For a running branch, the first choice is whether it is halted.
        return after, choices[1 if runs else 0 :]


def branches_of(prepared: PreparedTree, flat: FlatTree, read: Iterable[str]) -> Iterator[Branch]:
    """Yield the outermost branches of a tree that automata can replace.

    Args:
        prepared: The tree.
        flat: The flat form of the tree.
        read: The names of the entries that properties read.
    """
    sharing = EntrySharing(prepared.simulated, read)
    waiting = [] if sharing.is_open else [flat.nodes[0]]
    while waiting:
        around = waiting.pop()
        for node in around.children:
            is_candidate = isinstance(around, CountingNode) and sharing.is_apart(node.behaviour)
            branch = search_branch(prepared, node.behaviour) if is_candidate else None
            if branch is None:
                waiting.append(node)
            else:
                yield branch


def search_branch(prepared: PreparedTree, root: Behaviour, pair: Sequence[Branch] = ()) -> Branch | None:
    """Search a branch separately. Return None if no automaton can replace the branch.

    Args:
        prepared: The tree.
        root: The root of the branch.
        pair: The two branches that a joined branch consists of; empty for a branch of the tree.
    """
    rules, around = without_properties().rules, Running("around")
    try:
        joined = {root: [branch.root for branch in pair]} if pair else {}
        parts = BranchAssembly.from_branches(prepared, root, pair, rules, around=around, joined=joined)
        graph = explore(parts.stepper.steps, _MAX_STATES)
    except UndecidableError:
        return None
    # A branch that ticks leaves when it is halted makes choices whose order depends on the other branches.
    catches = any(isinstance(node, TryCatchNode) for node in parts.stepper.flat.nodes)
    if catches or not graph.complete or graph.error is not None:
        return None
    steps, child = parts.stepper.steps, parts.stepper.flat.nodes[0].children[0]
    runs: list[bool] = []
    outcomes: list[int] = []
    for state in graph.states:
        outcomes.append(steps.restore(state)[0])
        runs.append(parts.stepper.ticker.cells[child.status_cell] == RUNNING)
    if not _always_ends(graph, runs):
        return None
    results = [[(outcomes[target], target) for target, _ in graph.ticks(state)] for state in range(len(runs))]
    classes = _bisimulation_classes(results)
    named = dict(zip(graph.states, classes, strict=True))
    return Branch(root, parts, named, _automaton(classes, results))


def _always_ends(graph: Graph, runs: Sequence[bool]) -> bool:
    """Return whether all fair runs of a branch end, and an idle branch waits for nothing.

    The waits of a branch end with the branch, so runs of the tree in which the branch ends repeatedly are fair.
    """
    waits_while_idle = any(
        waits for state in range(len(runs)) if not runs[state] for _, waits in graph.ticks(state)
    )
    rounds = components(graph, bytearray(not each for each in runs))
    return not waits_while_idle and not any(is_fair(graph, component) for component in rounds)


def _bisimulation_classes(results: Sequence[Sequence[BranchResult]]) -> list[int]:
    """Return the class of each state, as a number, in the coarsest bisimulation.

    Only a running branch can be halted, so states in which the branch runs and does not run have different classes.
    """
    classes, count = [0] * len(results), 0
    while count < len(set(classes)):
        count = len(set(classes))
        signs = [(classes[state], _next_results(classes, each)) for state, each in enumerate(results)]
        numbers = {sign: number for number, sign in enumerate(sorted(set(signs)))}
        classes = [numbers[sign] for sign in signs]
    return classes


def _next_results(classes: Sequence[int], results: Iterable[BranchResult]) -> tuple[BranchResult, ...]:
    return tuple(sorted({(outcome, classes[target]) for outcome, target in results}))


def _automaton(classes: Sequence[int], results: Sequence[Sequence[BranchResult]]) -> Automaton:
    found = dict(zip(classes, (_next_results(classes, each) for each in results), strict=True))
    ticks, halts = (
        tuple(
            tuple(each for each in found[number] if (each[0] == INVALID) is halted)
            for number in sorted(found)
        )
        for halted in (False, True)
    )
    return Automaton(ticks, halts, classes[0])
