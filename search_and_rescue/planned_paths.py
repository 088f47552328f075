"""Request the lengths of paths from Nav2's planner."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from sar_compiler.leaves import (
    SUCCEEDED,
    ActionQueries,
    Deadline,
    UnusableValueError,
    path_points,
    turn_by,
)
from search_and_rescue.actions.navigation import describe_end
from search_and_rescue.zone_manager import (
    DETOUR,
    MAP_FRAME,
    MapPose,
    PosePair,
    ZoneManager,
)

if TYPE_CHECKING:
    from rclpy.node import Node

_ACTION = "compute_path_to_pose"


class PathRequests:
    """Requests one path after another from the planner, and stores the path lengths in the `ZoneManager`.

    Args:
        node: The mission's node.
        zones: Stores the path lengths.
        timeout_sec: Time limit for the whole sequence of requests, seconds of the machine's clock.
        planner_id: ID of the planner in the planner server; empty if the server has only one planner.
        wake: Called when the last response has arrived.
    """

    def __init__(
        self, node: "Node", zones: ZoneManager, timeout_sec: float, planner_id: str, wake: Callable[[], None]
    ) -> None:
        self._zones, self._timeout_sec, self._planner_id, self._wake = zones, timeout_sec, planner_id, wake
        self._planner = ActionQueries(node, "nav2_msgs/action/ComputePathToPose", _ACTION)
        # The deadline is in real time, because fast simulated time does not make the planner faster.
        self._due = Deadline(0.0)
        self._paths: Sequence[PosePair] = ()
        self._open: list[PosePair] = []
        self._is_waiting = False
        self._reasons: set[str] = set()
        self._reported_reason = ""

    def request_paths(self, paths: Sequence[PosePair]) -> None:
        """Start to request the paths with unknown lengths. If no server is available, request no path."""
        self.give_up()
        self._paths, self._reasons = paths, set()
        self._open = [path for path in paths if not self._zones.has_path_length(*path)]
        self._due = Deadline(self._timeout_sec)
        if self._open and not self._planner.has_server:
            self._stop(f"no server offers {_ACTION}")

    def are_awaited(self) -> bool:
        """Return whether a response is still awaited. Send the first request when the server is available."""
        if self._open and self._due.has_passed:
            self._stop(f"no response within {self._timeout_sec:g} s")
        elif self._open and not self._is_waiting:
            self._request_next()
        return bool(self._open)

    def shortfall(self) -> str:
        """Describe how many path lengths are only estimated, and why; empty if all lengths are known."""
        unknown = sum(not self._zones.has_path_length(*path) for path in self._paths)
        if not unknown:
            return ""
        return f"{unknown} of {len(self._paths)} paths are estimated as {DETOUR:g} times the straight line: {self._reason}"

    def new_shortfall(self) -> str:
        """Return the result of `shortfall` if the reason is new since the last call; otherwise an empty string."""
        previous, self._reported_reason = self._reported_reason, self._reason
        return self.shortfall() if self._reason != previous else ""

    @property
    def _reason(self) -> str:
        return ", ".join(sorted(self._reasons))

    def give_up(self) -> None:
        """Stop requesting paths, and ignore later responses."""
        self._open, self._is_waiting = [], False
        self._planner.give_up()

    def release(self) -> None:
        """Stop requesting paths, and release the action client."""
        self.give_up()
        self._planner.release()

    def _stop(self, reason: str) -> None:
        self.give_up()
        self._reasons.add(reason)

    def _request_next(self) -> None:
        if self._planner.is_ready:
            self._is_waiting = True
            self._planner.send_goal(self._goal(*self._open[0]), self._on_result)

    def _goal(self, start: MapPose, target: MapPose) -> Any:
        goal = self._planner.interface.Goal(planner_id=self._planner_id, use_start=True)
        for message, pose in ((goal.start, start), (goal.goal, target)):
            message.header.frame_id = MAP_FRAME
            message.pose.position.x, message.pose.position.y = float(pose["x"]), float(pose["y"])
            turn_by(message.pose.orientation, pose["yaw"])
        return goal

    def _on_result(self, status: int, result: Any) -> None:
        """Store the path length from a response, and request the next path."""
        start, target = self._open.pop(0)
        self._is_waiting = False
        try:
            points = path_points(result.path) if status == SUCCEEDED else []
        except UnusableValueError as error:
            points, why = [], f"the path contains an invalid point: {error}"
        else:
            why = describe_end(status, result) if status else "the request was rejected"
        if points:
            self._zones.store_path_length(start, target, _length(start, points, target))
        else:
            self._reasons.add(f"the planner returned no path: {why}")
        if self._open:
            self._request_next()
        else:
            self._wake()


def _length(start: MapPose, points: Sequence[tuple[float, float]], target: MapPose) -> float:
    """Return the length in metres of the path from the start through all points to the target."""
    whole = [(start["x"], start["y"]), *points, (target["x"], target["y"])]
    return math.fsum(math.dist(*step) for step in itertools.pairwise(whole))
