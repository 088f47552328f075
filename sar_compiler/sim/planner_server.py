"""A substitute for Nav2's planner. Like planner_server in Jazzy, it serves the action `compute_path_to_pose`."""

from collections.abc import Callable
from typing import Any

from nav2_msgs.action import ComputePathToPose
from rclpy.action import ActionServer, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from sar_compiler.sim.follower import Path2D
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.messages import from_pose, to_path
from sar_compiler.sim.planner import NavCode, Planner, PlanningError

PLAN = "compute_path_to_pose"
"""The action of Nav2's planner."""

_MAP = "map"
# Only every fourth point of a path is published.
_EVERY = 4
# The time for which results are stored for late clients, seconds.
_RESULT_TIMEOUT_SEC = 60


class PlannerServer:
    """Serves paths on the map without moving the robot.

    Args:
        node: The node that serves the action.
        planner: Plans the paths.
        localise: Returns the robot's pose in `map`, the default start of a path; None while the pose is unknown.
        is_active: Returns whether goals are accepted.
        tolerance: The maximum distance between an occupied goal and the end of a path, metres.
    """

    def __init__(
        self,
        node: Node,
        planner: Planner,
        localise: Callable[[], Pose2D | None],
        is_active: Callable[[], bool],
        *,
        tolerance: float = 0.0,
    ) -> None:
        self._node, self._planner, self._localise, self._tolerance = node, planner, localise, tolerance
        self._result = ComputePathToPose.Result
        self._server = ActionServer(
            node,
            ComputePathToPose,
            PLAN,
            execute_callback=self._execute,
            goal_callback=lambda _: GoalResponse.ACCEPT if is_active() else GoalResponse.REJECT,
            result_timeout=_RESULT_TIMEOUT_SEC,
        )

    def destroy(self) -> None:
        """Destroy the server."""
        self._server.destroy()

    def _execute(self, handle: ServerGoalHandle) -> Any:
        try:
            path = self._plan(handle.request)
        except PlanningError as error:
            handle.abort()
            return self._result(error_code=int(error.code), error_msg=str(error))
        handle.succeed()
        return self._result(path=to_path(path, self._node.get_clock().now().to_msg()))

    def _plan(self, request: Any) -> Path2D:
        start = self._pose(request.start, "start") if request.use_start else self._localise()
        if start is None:
            raise PlanningError(NavCode.TF_ERROR, "the robot's pose is unknown")
        path = self._planner.plan(start, self._pose(request.goal, "goal"), self._tolerance)
        # The points are thinned, because writing a point for each cell takes longer than planning. The goal remains the last point.
        return Path2D(path.points[::-1][::_EVERY][::-1])

    def _pose(self, message: Any, name: str) -> Pose2D:
        pose, frame = from_pose(message.pose), message.header.frame_id
        if pose is None or frame != _MAP:
            reason = f"is in the frame '{frame}', not '{_MAP}'" if frame != _MAP else "is not a valid pose"
            raise PlanningError(NavCode.TF_ERROR, f"the {name} {reason}")
        return pose
