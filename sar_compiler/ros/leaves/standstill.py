"""A leaf's wait for a robot that is to stand."""

from sar_compiler.ros.clock import Deadline
from sar_compiler.ros.leaves.goals import goals_under_way
from sar_compiler.ros.leaves.leaf import RosLeaf
from sar_compiler.ros.robot_estimate import robot_estimate
from sar_compiler.runtime.leaf_protocol import Wake


class Standstill:
    """Waits while the odometry says that the robot moves, for `settle_timeout_sec` at most; without odometry not at all.

    Args:
        leaf: The leaf, which is set up; it says what it waits for, and that it has waited in vain.
        wake: Requests a tick.
        since: What the robot is to stand after, in words.
        with_goals: Whether the goals of the leaf's node must have ended as well; else those of the caller have.
    """

    def __init__(self, leaf: RosLeaf, wake: Wake, since: str, *, with_goals: bool = False) -> None:
        self._leaf, self._wake, self._since = leaf, wake, since
        self._goals = goals_under_way(leaf.node) if with_goals else None
        self._robot = robot_estimate(leaf.node)
        self._due: Deadline | None = None
        self._told = False

    def is_awaited(self) -> bool:
        """Return whether the wait goes on: the robot moves, or a goal may be active, and there is time."""
        moves = self._robot.stands is False
        if not moves and not (self._goals is not None and self._goals.may_be_active):
            if self._due is not None:
                self._leaf.feedback_message = ""
            self.give_up()
            return False
        if self._due is None:
            self._due = Deadline(self._robot.settle_timeout_sec, self._robot.clock)
            self._robot.call_when_it_stands(self._wake)
            self._leaf.feedback_message = "waiting for the robot to stand"
        if self._due.passed and not self._told:
            # Once: each line would have another speed.
            self._told = True
            what = (
                f"the robot still moves ({self._robot.speed_in_words})" if moves else "a goal may be active"
            )
            self._leaf.complain(
                f"'{self._leaf.name}': {what} {self._robot.settle_timeout_sec:g} s after {self._since}."
            )
            self.give_up()
        return not self._due.passed

    def give_up(self) -> None:
        """Wait no longer: no tick is requested any more when the robot stands."""
        self._robot.withdraw(self._wake)
