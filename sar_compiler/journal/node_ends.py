"""Explains, tick by tick, why the nodes of a tree ended. The statuses in a journal are the source.

The end of a node is explained by the children that have the node's status. An only child also explains the end if it has the
opposite status, because a decorator may invert the status. If no child explains the end, the node itself has
decided: the node is a leaf, or it was ended by a time limit, by a scripted condition or by an empty loop.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from sar_compiler.journal.mission_state import FAILURE, RUNNING, SUCCESS, NodeState

OTHER_END = {FAILURE: SUCCESS, SUCCESS: FAILURE}
"""Maps each of the two final statuses of a node to the opposite status."""

_INACTIVE = ("IDLE", "HALTED")


class NodeEnds:
    """Stores the last end of each node, and explains why the node ended.

    An explanation is determined in the tick in which the node ended, because the node's descendants may be reset afterwards.

    Args:
        nodes: The nodes of the tree, in pre-order.

    Attributes:
        tick: The number of the tick whose entries are being received.
        status: The last result of each node, by its number.
        causes: The numbers of the children that explain the end of a node, by the node's number; empty if the node itself decided.
        halted: The numbers of the nodes that were running and were stopped in the last finished tick.
    """

    def __init__(self, nodes: Sequence[NodeState]) -> None:
        self._nodes = nodes
        self.tick = 0
        self.status: dict[int, str] = {}
        self.causes: dict[int, list[int]] = {}
        self.halted: list[int] = []
        self._began: dict[int, int] = {}
        self._began_sec: dict[int, float] = {}
        self._gone: dict[int, int] = {}
        # In the current tick: the ticked nodes, their parents, and the nodes stopped or reset at the end of the tick.
        self._visited: dict[int, None] = {}
        self._above: dict[int, None] = {}
        self._going: dict[int, int] = {}
        self._halting: list[int] = []

    def receive(self, data: Mapping[str, Any], time_sec: float) -> None:
        """Process a recorded status of a node.

        Args:
            data: The data of the `status` entry.
            time_sec: The time of the entry, seconds.
        """
        number, status = data["node"], data["status"]
        self.tick = data["tick"]
        if status in _INACTIVE:
            self._going[number] = int(data.get("last", self.tick))
            if status == "HALTED":
                self._halting.append(number)
            return
        if number in self._gone:
            del self._gone[number]
            self._began[number], self._began_sec[number] = self.tick, time_sec
        elif self.status.get(number) != RUNNING:
            self._began[number], self._began_sec[number] = self.tick, time_sec
        self.status[number] = status
        self._visited[number] = None
        parent = self._nodes[number].parent
        self._above[number if parent is None else parent] = None

    def end_tick(self) -> list[int]:
        """End the current tick. Return the numbers of the nodes that ended in it, in the order of the entries."""
        self._gone.update(self._going)
        self.halted, self._halting = self._halting, []
        ended = []
        for number in self._visited | self._above:
            if self.status.get(number) in OTHER_END:
                if number not in self._visited:
                    # The node has returned the same status as before, in a new activation.
                    self._began[number] = self.tick
                children = self._nodes[number].children
                self.causes[number] = self._explaining_children(number, children) if children else []
                ended.append(number)
        self._visited, self._above, self._going = {}, {}, {}
        return ended

    @property
    def has_failed(self) -> bool:
        """Whether the root has failed in the last finished tick or before, and was not reset since."""
        return self.status.get(0) == FAILURE and 0 not in self._gone

    def is_running(self, number: int) -> bool:
        """Return whether a node is running."""
        return self.status.get(number) == RUNNING and number not in self._gone

    def start_sec(self, number: int) -> float:
        """Return the time at which the last activation of a node started, in seconds."""
        return self._began_sec.get(number, 0.0)

    def is_in_activation(self, number: int) -> bool:
        """Return whether the last end of a node belongs to the current activation of its parent."""
        parent = self._nodes[number].parent
        began = self._began.get(parent, 0) if parent is not None else 0
        return self._gone.get(number, began) >= began

    def failed_before(self, number: int) -> Iterator[int]:
        """Yield the earlier siblings whose failure in this activation led to the tick of a node."""
        parent = self._nodes[number].parent
        if parent is None:
            return
        for sibling in self._nodes[parent].children:
            if sibling == number:
                return
            if self.status.get(sibling) == FAILURE and self.is_in_activation(sibling):
                yield sibling

    def _explaining_children(self, number: int, children: Sequence[int]) -> list[int]:
        """Return the children that explain the end of a node."""
        status, began = self.status[number], self._began[number]
        # A child that was reset, and was last ticked before the node started, did not contribute to the end.
        part = [each for each in children if self._gone.get(each, began) >= began]
        same = [each for each in part if self.status.get(each) == status]
        if same or len(children) > 1:
            return same
        # A decorator may invert its child's status. A control returns the status of one of its children.
        return [each for each in part if self.status.get(each) == OTHER_END[status]]
