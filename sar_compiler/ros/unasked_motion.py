"""A robot that moves although no goal of its mission is active: told, and where it still follows one of ours, stopped."""

import math
from collections.abc import Iterable

from action_msgs.srv import CancelGoal
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from sar_compiler.ros.awake import AWAKE
from sar_compiler.ros.leaves.deadline import deadline_clock
from sar_compiler.ros.leaves.goal_statuses import goal_statuses_of
from sar_compiler.ros.leaves.goals_under_way import GoalNews, goals_under_way
from sar_compiler.ros.robot_estimate import robot_estimate

_PERIOD_SEC = 0.1
# How long a robot may brake, and how long after the end of a goal a movement is taken for that goal's, seconds.
_BRAKES_SEC, _LATEST_SEC = 0.7, 2.0
# How often everything is cancelled while it moves on, steady seconds.
_CANCEL_SEC = 1.0
# What Nav2 drives with, beside the action that is asked: the goals of its navigator can outlive the navigator's own.
_SERVERS = ("navigate_to_pose", "follow_path", "spin", "backup")


class UnaskedMotion:
    """Looks at the odometry of a robot while no goal of this node is active.

    A goal that has ended is no proof that the robot stands: Nav2's navigator can give up a goal that its controller drives on
    for. What moves then is told, and every goal of Nav2 is cancelled, unless another client's goal is active. Any other movement
    is only told.

    Args:
        node: The node that sends the goals.
        actions: The actions that drive the robot, with resolved or relative names.
    """

    def __init__(self, node: Node, actions: Iterable[str]) -> None:
        actions = list(actions)
        self._node = node
        self._robot, self._goals, self._clock = (
            robot_estimate(node),
            goals_under_way(node),
            deadline_clock(node),
        )
        self._statuses = [goal_statuses_of(node, action) for action in actions]
        self._services = {node.resolve_service_name(_canceller(action)) for action in actions}
        beside = {action[: action.rfind("/") + 1] + server for action in actions for server in _SERVERS}
        self._cancellers = {
            name: node.create_client(CancelGoal, _canceller(name)) for name in sorted({*actions, *beside})
        }
        self._has_sent = False
        self._ended: tuple[float, float] | None = None
        self._since: tuple[float, float] | None = None
        self._told = self._blindness_told = False
        self._cancelled_at = -math.inf
        self._goals.listen(self._on_goal)
        # Steady: what has stopped may be the node's clock.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_PERIOD_SEC, self.look, clock=steady)

    def close(self) -> None:
        """Destroy what was created on the node."""
        self._timer.cancel()
        self._node.destroy_timer(self._timer)
        for client in self._cancellers.values():
            self._node.destroy_client(client)

    def look(self) -> None:
        """Look once, say what has changed, and cancel what is to be cancelled."""
        if self._goals.drives(self._services):
            self._ended = self._since = None
            return
        if self._has_sent and self._ended is None:
            self._ended = self._now()
        if self._robot.moves:
            self._since = self._since or self._now()
            if self._passed(self._since) >= _BRAKES_SEC:
                self._judge()
        elif self._robot.moves is None:
            self._tell_blindness()
        elif self._robot.stands:
            self._rest()

    def _judge(self) -> None:
        """Tell of a robot that moves, and stop one that moves since the end of a goal."""
        if self._is_ours():
            if AWAKE.now() - self._cancelled_at >= _CANCEL_SEC:
                self._cancel_everything()
        elif not self._told:
            self._tell(
                f"The robot moves ({self._robot.speed_in_words}), and no goal of this mission is active."
            )

    def _is_ours(self) -> bool:
        """Whether the robot moves since the end of a goal of ours, and nobody else has it driven."""
        return self._ended is not None and not any(each.has_foreign_goal for each in self._statuses)

    def _cancel_everything(self) -> None:
        self._cancelled_at = AWAKE.now()
        there = {name: client for name, client in self._cancellers.items() if client.service_is_ready()}
        if not self._told:
            self._tell(
                f"The robot moves ({self._robot.speed_in_words}) although its goal has ended and nobody else's is active: "
                f"everything is cancelled ({', '.join(there) or 'no server is there'})."
            )
        for client in there.values():
            # Neither id nor stamp: every goal.
            client.call_async(CancelGoal.Request())  # what comes of it, the odometry says

    def _rest(self) -> None:
        """Note that the robot stands; whatever moves it much later is no goal of ours."""
        self._since = None
        if self._told:
            self._told = False
            self._node.get_logger().info("The robot stands.")
        if self._ended is not None and self._passed(self._ended) >= _LATEST_SEC:
            self._has_sent, self._ended = False, None

    def _tell_blindness(self) -> None:
        if self._ended is not None and not self._blindness_told:
            self._blindness_told = True
            self._node.get_logger().info(
                "No odometry comes on odometry/filtered: a goal that has ended counts as a robot that stands."
            )

    def _tell(self, text: str) -> None:
        self._told = True
        self._node.get_logger().warning(text)

    def _on_goal(self, news: GoalNews) -> None:
        if news.canceller in self._services and not news.is_over:
            self._has_sent, self._ended, self._since, self._told = True, None, None, False

    def _now(self) -> tuple[float, float]:
        return AWAKE.now(), self._clock.now()

    def _passed(self, since: tuple[float, float]) -> float:
        """Return the seconds since then, of the clock that is slower: a robot brakes by its own."""
        return min(now - then for now, then in zip(self._now(), since, strict=True))


def _canceller(action: str) -> str:
    return f"{action}/_action/cancel_goal"
