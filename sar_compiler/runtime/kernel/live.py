"""Live trees. Between two ticks, the status of each behaviour equals the status in its cell.

The state of a tree is in its cells, and `verify` copies nothing else. A live tree also has py_trees behaviours, which other code reads and
stops. py_trees' visitors and displays read `status` and `feedback_message`. A runner stops the root, and a test or a sibling stops a single
leaf. A user's class may set its own status. So this module synchronises both copies of a status.

Why a node is synchronised when it is reached: parents read cells, because reading an attribute of a Python object would
cost a dictionary lookup. So a behaviour is compared with its cell when a tick first starts or stops its node
(`LiveTicker.reach`). After the tick, the behaviour gets the status in the cell, even if an exception aborted the tick.
So the cost of a tick depends on the nodes that it reaches: under a sequence with memory, often five of ten thousand.
Plain leaves are exempt: their nodes read and write the behaviour's status directly, because `update` may read it.

Why a changed status resets a node: code that stops a running behaviour calls `stop(INVALID)`, as py_trees does from its
generators. A node of this project is halted by this call, so its position and its counts are no longer valid. The only exception is a node
that had ended and is now INVALID: it was not halted, but reset by its parent before a restart. State that outlasts an end (the turn of a
RoundRobin) then remains. After any change, the cells of all nodes that this tick has not reached yet are read again, because `stop` reaches
descendants, too. Before the whole tree is stopped, all nodes are compared.

Why visits are stored and shown afterwards: py_trees' `tick()` is a generator, so a visitor sees each node directly
after its tick, with its status and message at that time. A node of this project may be ticked twice in a tick (Repeat),
or be halted after its tick. So a `Visit` stores the end of each node's tick. After the whole tick, each behaviour gets
its stored status for the visitor, and then its current status again.

Why a behaviour may be ticked by itself: `py_trees_ros` ticks the root by its generator, and a user's py_trees composite
ticks a control of this project below it in the same way. Such a behaviour is the root of a separate tree, down to
unknown nodes. A `ForeignNode` represents an unknown node, which is ticked by its own methods, with all its descendants.

Why a new tree may continue from an old one: adding or removing children at run time (py_trees' `insert_subtree`)
changes the number of cells, so the tree is rebuilt. The lists of children detect the change (`parents.Children`). Cells
contain indices of children. So a node restarts unless its old children are still its first children.
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
    """The ticker of a live tree. Other code may also read and stop the behaviours of such a tree.

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
        """Mark the beginning of a tick or a stop. It may be nested in another tick or stop."""
        if not self._depth:
            self._number += 1
            self._reached = []
        self._depth += 1

    def write_statuses(self) -> None:
        """End a tick or a stop, and copy the statuses of the reached nodes from the cells to the behaviours."""
        self._depth -= 1
        for node in self._reached:
            node.write_status(self.cells)

    def reach(self, node: TreeNode) -> None:
        """Copy a node's status from its behaviour, unless the tick has already reached the node."""
        if node.reached == self._number:
            return
        if not node.shows_itself:
            if node.behaviour.status is not STATUSES[self.cells[node.status_cell]]:
                self.copy_statuses()
            self._reached.append(node)
        node.reached = self._number
        if node.index != node.status_cell:
            # The node shares a cell with its child, and the result in it is newer than the statuses of both behaviours.
            self.reach(node.children[0])

    def copy_statuses(self) -> None:
        """Copy the statuses of all behaviours to the cells, except for nodes that the tick has reached.

        If a node's status has changed, the node is reset, unless it had ended and was reset by its parent.
        """
        cells, changed = self.cells, False
        nodes = [node for node in self._nodes if node.reached != self._number]
        for node in nodes:
            if not node.shows_itself and node.behaviour.status is not STATUSES[cells[node.status_cell]]:
                rests = cells[node.status_cell] & ENDED and node.behaviour.status is STATUSES[INVALID]
                cells[node.status_cell] = number_of(node.behaviour.status)
                if rests:
                    node.reset_outcome(self)
                else:
                    node.reset_cells(self)
                changed = True
        if changed:
            for node in nodes:
                cells[node.status_cell] = number_of(node.behaviour.status)


class LiveTree:
    """A tree of behaviours, and the nodes that tick these behaviours.

    If other code stops a behaviour or sets its status between two ticks, the tree's node is changed accordingly. A
    behaviour of an unknown class is ticked by its own methods.

    Args:
        root: The root behaviour.
        is_strict: Whether a `NoStatusError` is raised if a result is not a status. Otherwise the result is only logged.
        former: The earlier tree, if the children of some nodes have changed. A node keeps its state from this tree if its old children are
            still its first children.
    """

    def __init__(self, root: Any, *, is_strict: bool = False, former: "LiveTree | None" = None) -> None:
        self._flat = flat_tree(root, _node_of, _ticked_children)
        self.ticker = LiveTicker(self._flat)
        self.ticker.is_strict = is_strict
        self._parents = [
            node for node in self._flat.nodes if not node.shows_itself and not isinstance(node, ForeignNode)
        ]
        for node in self._parents:
            node.behaviour.children = Children.from_list(node.behaviour.children)
        self._children: list[list[Any]] = [list(node.behaviour.children) for node in self._parents]
        self._changes: int = Children.changes
        if former is not None:
            self._copy_state(former)
        self.ticker.copy_statuses()
        for node in self._flat.nodes:
            if is_strict and isinstance(node, ForeignNode):
                node.require_statuses()
            if isinstance(node.behaviour, EngineBehaviour) and not isinstance(node, ForeignNode):
                node.behaviour.place = self, node.index

    @property
    def root(self) -> Any:
        """The root behaviour."""
        return self._flat.nodes[0].behaviour

    @property
    def tree_nodes(self) -> list[TreeNode]:
        """The nodes of the tree, in pre-order."""
        return self._flat.nodes

    def is_whole(self) -> bool:
        """Return whether all nodes still have the children that they had when the tree was built."""
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
            visits: A list to which the visits of the ticked descendants are added, in the order in which their ticks end.
            index: The index of the node to tick; by default the root.

        Returns:
            The outcome RUNNING, SUCCESS, FAILURE or SKIPPED, as a number of `kernel.cells`.
        """
        node, ticker = self._flat.nodes[index], self.ticker
        ticker.enter()
        before = ticker.visits, ticker.by_step
        ticker.visits, ticker.by_step = visits, visits is not None
        try:
            outcome = ticker.run(node)
        finally:
            ticker.visits, ticker.by_step = before
            ticker.write_statuses()
        if node.is_skippable:
            node.behaviour.skipped = outcome == SKIPPED
        return outcome

    def tick_and_visit(self, visits: list[Visit]) -> int:
        """Tick the root, and record all ticked nodes.

        Args:
            visits: A list to which the visits of the ticked nodes are added, in the order in which their ticks end. The root is the last
                one.

        Returns:
            The outcome, as for `tick`.
        """
        outcome = self.tick(visits)
        root = self._flat.nodes[0]
        visits.append(Visit(root.behaviour, outcome, self.ticker.cells[root.status_cell]))
        return outcome

    def stop(self, index: int = 0) -> None:
        """Stop a node, by default the root, in the same way as `Behaviour.stop(Status.INVALID)`."""
        ticker = self.ticker
        ticker.enter()
        try:
            ticker.copy_statuses()
            self._flat.nodes[index].stop(ticker)
        finally:
            ticker.write_statuses()

    def _copy_state(self, former: "LiveTree") -> None:
        """Copy the state of unchanged nodes from an earlier tree that has the same behaviours."""
        there, here = former.ticker, self.ticker
        known = {id(node.behaviour): node for node in former._flat.nodes}
        for node in self._flat.nodes:
            old = known.get(id(node.behaviour))
            if old is None or type(old) is not type(node):
                continue
            children = [child.behaviour for child in old.children]
            if [child.behaviour for child in node.children[: len(children)]] != children:
                continue
            here.cells[node.status_cell] = there.cells[old.status_cell]
            for place in range(node.last_cell - node.first_cell):
                here.cells[node.first_cell + place] = there.cells[old.first_cell + place]
            here.values[node.first_value : node.last_value] = there.values[old.first_value : old.last_value]


def _node_of(part: NodeBuilder) -> TreeNode:
    """Create the node of a behaviour, or a `ForeignNode` if the kernel does not know the behaviour's class."""
    known = node_class_of(part.behaviour)
    if known is not None:
        return known(part)
    if type(part.behaviour).tick is EngineBehaviour.tick:
        # An unknown class that does not override `tick` cannot be ticked by its own methods.
        raise NotFlatError(part.behaviour)
    return ForeignNode(part)


def _ticked_children(behaviour: Any) -> list[Any]:
    """Return the children that the kernel ticks. If the behaviour has an unknown class, the kernel ticks none."""
    return [] if node_class_of(behaviour) is None else children_of(behaviour)


def show_visits(visits: list[Visit]) -> Iterator[Any]:
    """Yield each ticked behaviour after setting its status and message to those at the end of its tick."""
    for visit in visits:
        behaviour, status = visit.behaviour, STATUSES[visit.status]
        now = behaviour.status, behaviour.feedback_message
        label = getattr(behaviour, "outcome_label", "")
        behaviour.status, behaviour.feedback_message = status, visit.message
        if label != visit.label:
            behaviour.outcome_label = visit.label
        try:
            yield behaviour
        finally:
            # The consumer may have stopped the behaviour, whose status then remains.
            if behaviour.status is status:
                behaviour.status, behaviour.feedback_message = now
            if label != visit.label:
                behaviour.outcome_label = label
