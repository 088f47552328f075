"""Trees that are ticked for real: what their behaviours and their cells say of a status is the same between ticks.

A state of a tree is its cells, and `verify` copies nothing else. A tree that is ticked for real has behaviours as well, and these belong to
others too: py_trees' visitors and displays read `status` and `feedback_message`, a runner stops the root, a test or a neighbour stops a
single leaf, and a user's class may set its own status. So a status is said twice, and this module keeps both in step.

Why it is done when a node is reached. Parents read cells, which costs a load, where an attribute of a Python object costs a dictionary. So a
behaviour is compared with its cell when a tick first begins or stops its node (`LiveTicker.reach`), and gets what the cell says when the tick is over,
whether it was finished or broken off by an exception. A tick costs what it reaches: of ten thousand nodes under a sequence with memory that is often five.
A plain leaf is left out of both: its node looks at its behaviour's status itself, since `update` may look at it, and writes it where it changes.

Why a changed status makes a node forget. Somebody who stops a running behaviour calls `stop(INVALID)`, as py_trees does from its generators. For a
node of ours that is a halt: where it was, and what it counted, is no longer so. Only a node that had ended and is INVALID now was not halted: it was
brought to rest, as its parent does before it starts it again, and what outlasts an end (whose turn it is in a RoundRobin) stays.
When anything has changed all cells are read again, because a `stop` reaches the behaviours below, too; but for those that this tick has reached
before, whose cells are newer. Whoever stops the whole tree has all of it compared first, so that nothing is left running.

Why visits are kept and shown afterwards. py_trees' `tick()` is a generator: a visitor sees each node just after its tick, with the status and the
message of that moment. A node of ours may be ticked twice in a tick (Repeat), or be halted after it has been ticked. So the end of each node's tick is
noted as a `Visit`, and when the tick is over each behaviour is shown once more as it was then, and put back.

Why a behaviour may be ticked by itself. `py_trees_ros` ticks the root by its generator, and a py_trees composite of somebody's own ticks a control
of ours below it in the same way. Such a behaviour is the root of a tree of its own (`EngineBehaviour._place`), as deep as the nodes are known; a `ForeignNode`
stands for what is ticked by methods of its own, with all that is below it. Each place where one way of ticking ends and the other begins is such a node.

Why a new tree may take over from a former one. Whoever adds or takes away children at run time (py_trees' `insert_subtree`) changes the number
of the cells. The tree is made anew then; that children have changed at all, the lists say that it gives them (`parents.Children`). A node goes on from where it was if the children that it had are still its first ones, since its cells hold
indexes of children; any other begins from the start.
"""

from collections.abc import Iterator
from typing import Any

from sar_compiler.runtime.kernel.cells import ENDED, INVALID, SKIPPED, STATUSES, number_of
from sar_compiler.runtime.kernel.leaf_nodes import ForeignNode
from sar_compiler.runtime.kernel.table import NotFlatError, node_class_of
from sar_compiler.runtime.kernel.times import ClockTimes
from sar_compiler.runtime.kernel.tree import FlatTree, children_of, flat_tree
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, Ticker, TreeNode, Visit
from sar_compiler.runtime.parents import Children, EngineBehaviour


class LiveTicker(Ticker):
    """Ticks a tree whose behaviours are seen, and stopped, by others.

    Args:
        flat: The tree.
    """

    def __init__(self, flat: FlatTree) -> None:
        nodes = flat.nodes
        first = flat.ticker(ClockTimes(lambda index: nodes[index].behaviour.clock))
        super().__init__(first.cells, first.values, first.times)
        self.is_live = True
        self._nodes = nodes
        self._number = self._depth = 0
        self._reached: list[TreeNode] = []

    def enter(self) -> None:
        """Begin a tick or a stop, perhaps within another one."""
        if not self._depth:
            self._number += 1
            self._reached = []
        self._depth += 1

    def leave(self) -> None:
        """Give the behaviours that were reached the statuses that the cells say."""
        self._depth -= 1
        for node in self._reached:
            node.show(self.cells)

    def reach(self, node: TreeNode) -> None:
        """Take a node's status over from its behaviour, where the tick has not reached it before."""
        if node.reached == self._number:
            return
        if not node.shows_itself:
            if node.behaviour.status is not STATUSES[self.cells[node.at]]:
                self.take_over()
            self._reached.append(node)
        node.reached = self._number
        if node.index != node.at:
            # They have one cell, and what either makes of it is newer than both behaviours.
            self.reach(node.children[0])

    def take_over(self) -> None:
        """Take the statuses of all behaviours over, but for those that were reached.

        A node whose status has changed forgets where it was, but for one that had ended and was brought to rest.
        """
        cells, changed = self.cells, False
        nodes = [node for node in self._nodes if node.reached != self._number]
        for node in nodes:
            if not node.shows_itself and node.behaviour.status is not STATUSES[cells[node.at]]:
                rests = cells[node.at] & ENDED and node.behaviour.status is STATUSES[INVALID]
                cells[node.at] = number_of(node.behaviour.status)
                if rests:
                    node.rest(self)
                else:
                    node.forget(self)
                changed = True
        if changed:
            for node in nodes:
                cells[node.at] = number_of(node.behaviour.status)


class LiveTree:
    """A tree of behaviours and the nodes that tick them.

    Whoever stops one of the behaviours, or sets its status, between two ticks has done so for the tree as well. A
    behaviour of a class of its own is ticked by its own methods.

    Args:
        root: The root.
        is_strict: Whether an answer that is no status raises a `NoStatusError`, and is not only logged.
        former: The tree before its nodes got other children. A node goes on from where it was there, unless children that
            it had are gone.
    """

    def __init__(self, root: Any, *, is_strict: bool = False, former: "LiveTree | None" = None) -> None:
        self._flat = flat_tree(root, _node_of, _below)
        self.ticker = LiveTicker(self._flat)
        self.ticker.is_strict = is_strict
        self._parents = [
            node for node in self._flat.nodes if not node.shows_itself and not isinstance(node, ForeignNode)
        ]
        for node in self._parents:
            node.behaviour.children = Children.of(node.behaviour.children)
        self._children: list[list[Any]] = [list(node.behaviour.children) for node in self._parents]
        self._changes: int = Children.changes
        if former is not None:
            self._go_on_from(former)
        self.ticker.take_over()
        for node in self._flat.nodes:
            if is_strict and isinstance(node, ForeignNode):
                node.insist()
            if isinstance(node.behaviour, EngineBehaviour) and not isinstance(node, ForeignNode):
                node.behaviour.place = self, node.index

    @property
    def root(self) -> Any:
        """The behaviour at the root."""
        return self._flat.nodes[0].behaviour

    @property
    def nodes(self) -> list[TreeNode]:
        """The nodes, in pre-order."""
        return self._flat.nodes

    def is_whole(self) -> bool:
        """Return whether all nodes still have the children that they had."""
        changes: int = Children.changes
        if changes == self._changes:
            return True
        for node, children in zip(self._parents, self._children, strict=True):
            if node.behaviour.children != children:
                return False
        self._changes = changes
        return True

    def tick(self, visits: list[Visit] | None = None, index: int = 0) -> int:
        """Tick once.

        Args:
            visits: Where the nodes below it go that are ticked, in the order of their ends.
            index: The node that is ticked; by default the root.

        Returns:
            RUNNING, SUCCESS, FAILURE or SKIPPED, as numbers of `kernel.cells`.
        """
        node, ticker = self._flat.nodes[index], self.ticker
        ticker.enter()
        before = ticker.visits, ticker.by_step
        ticker.visits, ticker.by_step = visits, visits is not None
        try:
            outcome = ticker.run(node)
        finally:
            ticker.visits, ticker.by_step = before
            ticker.leave()
        if node.is_skippable:
            node.behaviour.skipped = outcome == SKIPPED
        return outcome

    def tick_and_visit(self, visits: list[Visit]) -> int:
        """Tick the root, and note all nodes that were ticked.

        Args:
            visits: Where they go, in the order of their ends, the root last.

        Returns:
            The outcome, as `tick`.
        """
        outcome = self.tick(visits)
        root = self._flat.nodes[0]
        visits.append(Visit(root.behaviour, outcome, self.ticker.cells[root.at]))
        return outcome

    def stop(self, index: int = 0) -> None:
        """Stop a node as `Behaviour.stop(Status.INVALID)` does; by default the root."""
        ticker = self.ticker
        ticker.enter()
        try:
            ticker.take_over()
            self._flat.nodes[index].stop(ticker)
        finally:
            ticker.leave()

    def _go_on_from(self, former: "LiveTree") -> None:
        """Take over what nodes remember that were part of another tree."""
        there, here = former.ticker, self.ticker
        known = {id(node.behaviour): node for node in former._flat.nodes}
        for node in self._flat.nodes:
            old = known.get(id(node.behaviour))
            if old is None or type(old) is not type(node):
                continue
            children = [child.behaviour for child in old.children]
            if [child.behaviour for child in node.children[: len(children)]] != children:
                continue
            here.cells[node.at] = there.cells[old.at]
            for place in range(node.last_cell - node.first_cell):
                here.cells[node.first_cell + place] = there.cells[old.first_cell + place]
            here.values[node.first_value : node.last_value] = there.values[old.first_value : old.last_value]


def _node_of(part: NodeBuilder) -> TreeNode:
    """Build the node of a behaviour; one of a class that is not known is ticked by its own methods."""
    known = node_class_of(part.behaviour)
    if known is not None:
        return known(part)
    if type(part.behaviour).tick is EngineBehaviour.tick:
        # It has nothing but what its node says.
        raise NotFlatError(part.behaviour)
    return ForeignNode(part)


def _below(behaviour: Any) -> list[Any]:
    """Return the children that are ticked by nodes, too."""
    return [] if node_class_of(behaviour) is None else children_of(behaviour)


def show_visits(visits: list[Visit]) -> Iterator[Any]:
    """Yield the behaviours that were ticked, each with the status and the message that it had at the end of its tick."""
    for visit in visits:
        behaviour, status = visit.behaviour, STATUSES[visit.status]
        now = behaviour.status, behaviour.feedback_message
        label = getattr(behaviour, "answer_label", "")
        behaviour.status, behaviour.feedback_message = status, visit.message
        if label != visit.label:
            behaviour.answer_label = visit.label
        try:
            yield behaviour
        finally:
            # Whoever was shown it may have stopped it.
            if behaviour.status is status:
                behaviour.status, behaviour.feedback_message = now
            if label != visit.label:
                behaviour.answer_label = label
