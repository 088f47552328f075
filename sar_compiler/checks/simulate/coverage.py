"""The coverage of a tree by a set of runs."""

from dataclasses import dataclass, field
from uuid import UUID

from py_trees.behaviour import Behaviour

from sar_compiler.checks.simulate.running import Run
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.runtime.answers import STATUSES
from sar_compiler.runtime.stub_leaf import StubLeaf


@dataclass
class Covered:
    """The outcomes seen of one node of the file, in all instances of its tree.

    Attributes:
        bound: The node.
        ticked: Whether it was ever ticked.
        outcomes: All that it can come to, if it is a leaf: the names of its answers.
        seen: What of it has been seen.
    """

    bound: BoundNode
    ticked: bool = False
    outcomes: list[str] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)

    @property
    def unseen(self) -> list[str]:
        """The outcomes that were not seen."""
        return [outcome for outcome in self.outcomes if outcome not in self.seen]


class Coverage:
    """Collects what runs have shown of the nodes of a file."""

    def __init__(self) -> None:
        self._nodes: dict[tuple[str, int, int], Covered] = {}

    @property
    def nodes(self) -> list[Covered]:
        """The nodes, file by file, in the order of each."""
        return [self._nodes[place] for place in sorted(self._nodes)]

    @property
    def never_ticked(self) -> list[Covered]:
        """The nodes that no run has ticked."""
        return [node for node in self.nodes if not node.ticked]

    @property
    def unseen(self) -> list[Covered]:
        """The leaves that were ticked, with outcomes that no run has shown."""
        return [node for node in self.nodes if node.ticked and node.unseen]

    def add(self, run: Run) -> None:
        """Add the outcomes that a run has shown."""
        origins = run.simulated.compiled.origins
        nodes: dict[UUID, Covered] = {}
        leaves = {leaf.number: leaf.id for leaf in run.simulated.leaves}
        for behaviour in run.simulated.root.iterate():
            bound = origins[behaviour.id].bound
            # What is wrapped around a node (conditions, a OneShot) has another name, and is not the node.
            if behaviour.name == bound.name:
                covered = nodes[behaviour.id] = self._nodes.setdefault(_place(bound), Covered(bound))
                covered.outcomes = list(dict.fromkeys([*covered.outcomes, *_outcomes(behaviour, bound)]))
        for event in run.events:
            if event.answer:
                nodes[leaves[event.number]].seen.add(event.answer)
        for tick in run.ticks:
            for node in tick.statuses.keys() & nodes.keys():
                nodes[node].ticked = True
                nodes[node].seen.add(tick.statuses[node])


def _outcomes(behaviour: Behaviour, bound: BoundNode) -> list[str]:
    if isinstance(behaviour, StubLeaf):
        return [answer.name for answer in behaviour.answers]
    leaf = bound.spec.kind.is_leaf and not behaviour.children
    return [status for status in STATUSES if leaf and status in bound.spec.outcomes]


def _place(bound: BoundNode) -> tuple[str, int, int]:
    element = bound.element
    return element.source.path, element.line, element.column
