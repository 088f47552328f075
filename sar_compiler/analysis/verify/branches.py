"""Branches below parallel nodes that share nothing with the rest of their tree, and what can come of their ticks.

Neighbours that all have to succeed are together one branch (`joined`): a parallel node of three such children is one of two, of which the first one is a
parallel node of two. What can come of the ticks of two is brought to its fewest states before a third one is added; so twenty like branches are some ten
states.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Running

from sar_compiler.analysis.simulated_tree import SimulatedTree, is_answered
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
from sar_compiler.analysis.verify.state import Prepared
from sar_compiler.analysis.verify.state_space import IsWanted
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.checks.rules.entry_accesses import PlaceFinder, entry_table_of
from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.runtime.blackboard import Entry
from sar_compiler.runtime.kernel.branching import TryCatchNode
from sar_compiler.runtime.kernel.cells import INVALID, RUNNING, SKIPPED
from sar_compiler.runtime.kernel.counting import CountingNode
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.user_nodes import UserNode

_MOST_STATES = 20_000
"""A branch with more states on its own is no small part of a proof."""
_READS = (AccessKind.READ, AccessKind.PEEK, AccessKind.FIXED)
_OUTSIDE = -1
"""In place of the number of a node: something else than a node."""


def has_parallels(flat: FlatTree) -> bool:
    """Return whether a tree has parallel nodes, and none that may tick a child twice in a tick, or look at whatever it likes."""
    own = any(isinstance(node, UserNode) for node in flat.nodes)
    return not own and any(isinstance(node, CountingNode) for node in flat.nodes)


class Sharing:
    """Which nodes of a tree use which entries.

    Args:
        simulated: The tree.
        read: The names of the entries that properties read.

    Attributes:
        is_open: Whether a node may depend on others in ways that are not seen here.
    """

    def __init__(self, simulated: SimulatedTree, read: Iterable[str]) -> None:
        self._origins = simulated.compiled.origins
        # The numbers of the nodes that use each entry.
        self._users: dict[str, set[int]] = {name: {_OUTSIDE} for name in read}
        self._changed: set[str] = set()
        top = simulated.compiled.instance
        self._places = PlaceFinder(top)
        table = entry_table_of(top)
        self.is_open = table.is_open or any(
            # What is only removed is no access.
            any(role.kind is AccessKind.NONE for role in bound.spec.semantics.keys.values())
            or (bound.references and not is_answered(bound.spec))
            for tree in table.accesses
            for bound in tree.nodes
        )
        for use in (use for entry in table.entries for use in entry.uses):
            entry = use.instance.scope.resolve(use.access.key)
            self._take([entry], use.place.number, changes=use.access.kind not in _READS)
        for leaf in simulated.leaves:
            made = self._origins.construction(leaf.id)
            number = self._places.of(made.instance, made.bound).number
            for answer in leaf.answers:
                self._take(leaf.entries(filter(None, [answer.when])), number, changes=False)
                self._take(leaf.entries(filter(None, [answer.then])), number, changes=True)

    def _take(self, entries: Iterable[Entry], number: int, *, changes: bool) -> None:
        for entry in entries:
            self._users.setdefault(entry.name, set()).add(number)
            if changes:
                self._changed.add(entry.name)

    def is_apart(self, branch: Behaviour) -> bool:
        """Return whether nobody else uses what a branch changes, or changes what it uses."""
        if branch.id not in self._origins:
            return False
        made = self._origins.construction(branch.id)
        place = self._places.of(made.instance, made.bound)
        inside = range(place.number, place.last + 1)
        users = (self._users[name] for name in self._changed)
        return all(len({number in inside for number in each}) == 1 for each in users)


@dataclass(frozen=True, eq=False)
class Assembly:
    """A tree, or a branch that is ticked on its own, of which some branches stand for themselves.

    Attributes:
        stepper: Ticks it.
        told: What these branches have done in the tick that was told last.
        branches: They, by their indexes in it.
    """

    stepper: TreeStepper
    told: list[BranchDeed]
    branches: "Mapping[int, Branch]"

    @classmethod
    def of(
        cls,
        prepared: Prepared,
        root: Behaviour,
        branches: "Iterable[Branch]",
        rules: PropertyAutomata,
        *,
        around: Behaviour | None = None,
        joined: Mapping[Behaviour, list[Behaviour]] | None = None,
    ) -> "Assembly":
        """Put them together.

        Args:
            prepared: The tree.
            root: Its root, or the branch's.
            branches: The branches that stand for themselves.
            rules: What is watched.
            around: A behaviour for what ticks a branch on its own.
            joined: The children of parallel nodes that need all of them, where there are fewer than in the tree.
        """
        known, told = {branch.root: branch for branch in branches}, list[BranchDeed]()
        automata = {root: branch.automaton for root, branch in known.items()}
        composed = FlatComposition(root, automata, joined or {}, around, told)
        stepper = TreeStepper(prepared, rules, composed.flat)
        nodes = enumerate(stepper.flat.nodes)
        found = {index: known[node.behaviour] for index, node in nodes if node.behaviour in known}
        return cls(stepper, told, found)

    def start(self) -> "Position":
        """Return where it is before the first tick."""
        return Position(
            self.stepper.steps.start(), tuple(branch.parts.start() for branch in self.branches.values())
        )

    def go_on(self, position: "Position", wanted: IsWanted) -> "tuple[Position, tuple[int, ...]]":
        """Play the first tick that is wanted; return where it leads, and its choices in the tree as it is."""
        path = next(step for step in self.stepper.ticks(position.state) if wanted(step)).path()
        self.told.clear()
        state = next(self.stepper.ticks(position.state, path)).state or b""
        choices: list[int] = []
        behind, within = 0, dict(zip(self.branches, position.within, strict=True))
        for index, first, then, result in self.told:
            within[index], own = self.branches[index].go_on(within[index], result)
            choices += [*path[behind:first], *own]
            behind = then
        return Position(state, tuple(within.values())), (*choices, *path[behind:])


@dataclass(frozen=True)
class Position:
    """Where a run is that was put together of those of branches.

    Attributes:
        state: The state of the whole; empty after an error.
        within: Where the branches are that stand for themselves.
    """

    state: bytes
    within: "tuple[Position, ...]"


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch that was searched on its own.

    Attributes:
        root: Its root.
        parts: What it consists of.
        classes: The state of the automaton that each of its states is.
        automaton: What its parent sees of it.
    """

    root: Behaviour
    parts: Assembly
    classes: Mapping[bytes, int]
    automaton: Automaton

    @property
    def is_never_skipped(self) -> bool:
        """Whether it is never skipped."""
        return all(outcome != SKIPPED for some in self.automaton.ticks for outcome, _ in some)

    def go_on(self, position: Position, result: BranchResult) -> tuple[Position, tuple[int, ...]]:
        """Return where a tick with a result leads, and the choices of that tick in the tree as it is."""
        classes, runs = self.classes, self.automaton.halts[self.classes[position.state]]
        after, choices = self.parts.go_on(
            position, lambda step: (step.outcome, classes[step.state or b""]) == result
        )
        # The first one is whether a branch that runs is halted.
        return after, choices[1 if runs else 0 :]


def branches_of(prepared: Prepared, flat: FlatTree, read: Iterable[str]) -> Iterator[Branch]:
    """Yield the branches of a tree that can stand for themselves, none within another one.

    Args:
        prepared: The tree.
        flat: Its flat form.
        read: The names of the entries that properties read.
    """
    sharing = Sharing(prepared.simulated, read)
    waiting = [] if sharing.is_open else [flat.nodes[0]]
    while waiting:
        around = waiting.pop()
        for node in around.children:
            is_candidate = isinstance(around, CountingNode) and sharing.is_apart(node.behaviour)
            branch = searched(prepared, node.behaviour) if is_candidate else None
            if branch is None:
                waiting.append(node)
            else:
                yield branch


def searched(prepared: Prepared, root: Behaviour, pair: Sequence[Branch] = ()) -> Branch | None:
    """Search a branch on its own; return None if it cannot stand for itself.

    Args:
        prepared: The tree.
        root: The root of the branch.
        pair: The two branches that it joins, if it is none of the tree.
    """
    rules, around = without_properties().rules, Running("around")
    try:
        joined = {root: [branch.root for branch in pair]} if pair else {}
        parts = Assembly.of(prepared, root, pair, rules, around=around, joined=joined)
        graph = explore(parts.stepper.steps, _MOST_STATES)
    except UndecidableError:
        return None
    # One that is ticked when it is halted may choose then, in the order in which its parent halts.
    catches = any(isinstance(node, TryCatchNode) for node in parts.stepper.flat.nodes)
    if catches or not graph.complete or graph.error is not None:
        return None
    steps, child = parts.stepper.steps, parts.stepper.flat.nodes[0].children[0]
    runs: list[bool] = []
    outcomes: list[int] = []
    for state in graph.states:
        outcomes.append(steps.restore(state)[0])
        runs.append(parts.stepper.ticker.cells[child.at] == RUNNING)
    if not _comes_to_its_end(graph, runs):
        return None
    results = [[(outcomes[target], target) for target, _ in graph.ticks(state)] for state in range(len(runs))]
    classes = _classes(results)
    named = dict(zip(graph.states, classes, strict=True))
    return Branch(root, parts, named, _automaton(classes, results))


def _comes_to_its_end(graph: Graph, runs: Sequence[bool]) -> bool:
    """Return whether a branch comes to its end in every fair run, and nothing goes on being waited for while it does not run.

    What was waited for until it has ended is not waited for when it begins again, so that runs in which it ends again and again are fair.
    """
    waits_at_rest = any(
        waits for state in range(len(runs)) if not runs[state] for _, waits in graph.ticks(state)
    )
    rounds = components(graph, bytearray(not each for each in runs))
    return not waits_at_rest and not any(is_fair(graph, component) for component in rounds)


def _classes(results: Sequence[Sequence[BranchResult]]) -> list[int]:
    """Return a number for each state, the same for those of which the same can come: the coarsest bisimulation.

    Only a branch that runs can be halted, so one that does not is another one.
    """
    classes, count = [0] * len(results), 0
    while count < len(set(classes)):
        count = len(set(classes))
        signs = [(classes[state], _following(classes, each)) for state, each in enumerate(results)]
        numbers = {sign: number for number, sign in enumerate(sorted(set(signs)))}
        classes = [numbers[sign] for sign in signs]
    return classes


def _following(classes: Sequence[int], results: Iterable[BranchResult]) -> tuple[BranchResult, ...]:
    return tuple(sorted({(outcome, classes[target]) for outcome, target in results}))


def _automaton(classes: Sequence[int], results: Sequence[Sequence[BranchResult]]) -> Automaton:
    found = dict(zip(classes, (_following(classes, each) for each in results), strict=True))
    ticks, halts = (
        tuple(
            tuple(each for each in found[number] if (each[0] == INVALID) is halted)
            for number in sorted(found)
        )
        for halted in (False, True)
    )
    return Automaton(ticks, halts, classes[0])
