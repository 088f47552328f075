"""A run that another program has recorded: the tree and all status changes of its nodes."""

from array import array
from dataclasses import dataclass, field

from sar_compiler.errors import SarError
from sar_compiler.nodes.nav2.log_lines import GoalEnd, LoggedLine

IDLE, RUNNING, SUCCESS, FAILURE, SKIPPED = range(5)
"""The numeric values of the statuses in BehaviorTree.CPP."""

WORDS = ("IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED")
"""The names of the statuses by number."""


class UnusableRecordingError(SarError):
    """Raised if a recorded run cannot be imported."""


@dataclass
class Recording:
    """A recorded run.

    Attributes:
        form: The name of the recording's format.
        began: The start time of the recording, in seconds since 1970.
        tree: The tree in XML, as BehaviorTree.CPP exports it; empty if the recording has no tree.
        times: The time of each change, in microseconds since the start.
        uids: The number of each changed node. BehaviorTree.CPP numbers the nodes from 1, in pre-order.
        statuses: The status of each changed node after the change.
        messages: The number of the message that contains each change; empty if the recording has no messages. A tick never continues in
            the next message.
        names: The names of nodes by node number, if the recording has no tree.
        lines: The warnings and errors that were logged during the run, ordered by time; their times are in seconds since the start.
        goal_ends: The ends of goals that Nav2 logged, ordered by time; their times are in seconds since the start.
        flaws: A sentence for each problem of the recording, with its location in the file.
    """

    form: str
    began: float
    tree: str = ""
    times: "array[int]" = field(default_factory=lambda: array("q"))
    uids: "array[int]" = field(default_factory=lambda: array("H"))
    statuses: bytearray = field(default_factory=bytearray)
    messages: "array[int]" = field(default_factory=lambda: array("q"))
    names: dict[int, str] = field(default_factory=dict)
    lines: list[LoggedLine] = field(default_factory=list)
    goal_ends: list[tuple[float, GoalEnd]] = field(default_factory=list)
    flaws: list[str] = field(default_factory=list)

    def add(self, time: int, uid: int, status: int) -> None:
        """Add a status change at the end of the recording."""
        self.times.append(time)
        self.uids.append(uid)
        self.statuses.append(status)
