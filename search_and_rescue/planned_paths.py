"""Path lengths from Nav2's planner."""

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
    """Requests paths from the planner, one after the other, and passes their lengths to the zones.

    Args:
        node: The mission's node.
        zones: Receives each length.
        timeout_sec: Time limit for all paths together, seconds of the machine's clock.
        planner_id: ID of the planner in the server; empty for its only one.
        wake: Called when the last response has arrived.
    """

    def __init__(
        self, node: "Node", zones: ZoneManager, timeout_sec: float, planner_id: str, wake: Callable[[], None]
    ) -> None:
        self._zones, self._timeout_sec, self._planner_id, self._wake = zones, timeout_sec, planner_id, wake
        self._planner = ActionQueries(node, "nav2_msgs/action/ComputePathToPose", _ACTION)
        # A planner computes by the machine's clock, even if simulated time runs faster.
        self._due = Deadline(0.0)
        self._ways: Sequence[PosePair] = ()
        self._left: list[PosePair] = []
        self._is_waiting = False
        self._reasons: set[str] = set()
        self._told = ""

    def request_paths(self, ways: Sequence[PosePair]) -> None:
        """Request the unknown paths; without a server, request none."""
        self.give_up()
        self._ways, self._reasons = ways, set()
        self._left = [way for way in ways if not self._zones.has_path_length(*way)]
        self._due = Deadline(self._timeout_sec)
        if self._left and not self._planner.has_server:
            self._stop(f"no server offers {_ACTION}")

    def are_awaited(self) -> bool:
        """Return whether a response is pending; sends the first request as soon as the server is available."""
        if self._left and self._due.has_passed:
            self._stop(f"no response within {self._timeout_sec:g} s")
        elif self._left and not self._is_waiting:
            self._request_next()
        return bool(self._left)

    def shortfall(self) -> str:
        """Return the number of paths estimated by straight lines, with the reason; empty if all are known."""
        unknown = sum(not self._zones.has_path_length(*way) for way in self._ways)
        if not unknown:
            return ""
        return f"{unknown} of {len(self._ways)} paths estimated as {DETOUR:g} times the straight line: {self._reason}"

    def new_shortfall(self) -> str:
        """Return the shortfall once for each reason."""
        told, self._told = self._told, self._reason
        return self.shortfall() if self._reason != told else ""

    @property
    def _reason(self) -> str:
        return ", ".join(sorted(self._reasons))

    def give_up(self) -> None:
        """Stop the requests; later responses are ignored."""
        self._left, self._is_waiting = [], False
        self._planner.give_up()

    def release(self) -> None:
        """Release the client."""
        self.give_up()
        self._planner.release()

    def _stop(self, reason: str) -> None:
        self.give_up()
        self._reasons.add(reason)

    def _request_next(self) -> None:
        if self._planner.is_ready:
            self._is_waiting = True
            self._planner.send_goal(self._goal(*self._left[0]), self._on_result)

    def _goal(self, start: MapPose, target: MapPose) -> Any:
        goal = self._planner.interface.Goal(planner_id=self._planner_id, use_start=True)
        for message, pose in ((goal.start, start), (goal.goal, target)):
            message.header.frame_id = MAP_FRAME
            message.pose.position.x, message.pose.position.y = float(pose["x"]), float(pose["y"])
            turn_by(message.pose.orientation, pose["yaw"])
        return goal

    def _on_result(self, status: int, result: Any) -> None:
        """Store the response, and request the next path."""
        start, target = self._left.pop(0)
        self._is_waiting = False
        try:
            points = path_points(result.path) if status == SUCCEEDED else []
        except UnusableValueError as error:
            points, why = [], f"its path contains an invalid point: {error}"
        else:
            why = describe_end(status, result) if status else "it rejected the request"
        if points:
            self._zones.store_path_length(start, target, _length(start, points, target))
        else:
            self._reasons.add(f"the planner returned no path: {why}")
        if self._left:
            self._request_next()
        else:
            self._wake()


def _length(start: MapPose, points: Sequence[tuple[float, float]], target: MapPose) -> float:
    """Return the length of a path from the start over its points to the target, metres."""
    whole = [(start["x"], start["y"]), *points, (target["x"], target["y"])]
    return math.fsum(math.dist(*step) for step in itertools.pairwise(whole))
