"""A run recorded by another program: the tree, and each change of a node's status."""

from array import array
from dataclasses import dataclass, field

from sar_compiler.errors import SarError
from sar_compiler.nodes.nav2.log_lines import LoggedLine

IDLE, RUNNING, SUCCESS, FAILURE, SKIPPED = range(5)
"""The statuses, by BehaviorTree.CPP's numbers."""

WORDS = ("IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED")


class UnusableRecordingError(SarError):
    """A recorded run cannot be imported."""


@dataclass
class Recording:
    """A recorded run.

    Attributes:
        form: The name of the format.
        began: The time from which the changes are measured, in seconds since 1970.
        tree: The tree as BehaviorTree.CPP exports it, in XML; empty if the recording has none.
        times: The time of each change, in microseconds.
        uids: The number of each changed node, as BehaviorTree.CPP numbers the nodes: from 1, in pre-order.
        statuses: The status of each changed node after the change.
        ticks: The number of the tick of each change; empty if the recording has no ticks.
        names: The names of nodes by their numbers, if the recording has no tree.
        lines: The warnings and errors that were logged during the run, by time; their times are those of the changes, in seconds.
        flaws: Problems of the recording, with their locations in the file.
    """

    form: str
    began: float
    tree: str = ""
    times: "array[int]" = field(default_factory=lambda: array("q"))
    uids: "array[int]" = field(default_factory=lambda: array("H"))
    statuses: bytearray = field(default_factory=bytearray)
    ticks: "array[int]" = field(default_factory=lambda: array("q"))
    names: dict[int, str] = field(default_factory=dict)
    lines: list[LoggedLine] = field(default_factory=list)
    flaws: list[str] = field(default_factory=list)

    def add(self, time: int, uid: int, status: int) -> None:
        """Add a change."""
        self.times.append(time)
        self.uids.append(uid)
        self.statuses.append(status)
