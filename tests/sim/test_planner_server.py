"""Tests of the stand-in for Nav2's planner, which plans paths on the map without moving the robot."""

import itertools
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from sar_compiler.sim.geometry import Pose2D

if TYPE_CHECKING:
    from tests.sim.conftest import Client

pytestmark = pytest.mark.ros

# On both sides of a wall of the shipped world.
HERE, THERE = Pose2D(4.5, -1.2), Pose2D(4.5, 1.2)
SUCCEEDED, ABORTED = 4, 6


class Planning:
    """An action client of `compute_path_to_pose`."""

    def __init__(self, client: "Client") -> None:
        from nav2_msgs.action import ComputePathToPose
        from rclpy.action import ActionClient

        self._client, self._type = client, ComputePathToPose
        self._action = ActionClient(client.node, ComputePathToPose, "compute_path_to_pose")
        client.wait(self._action.server_is_ready, "the server of compute_path_to_pose")

    def send(self, goal: Pose2D, start: Pose2D | None = None, frame: str = "map") -> Any:
        """Request a path, from the robot's position if no start is given; return its handle."""
        from sar_compiler.sim.messages import to_pose

        message = self._type.Goal(use_start=start is not None)
        for stamped, pose in ((message.start, start or Pose2D(50.0, 50.0)), (message.goal, goal)):
            stamped.header.frame_id, stamped.pose = frame, to_pose(pose)
        return self._client.result(self._action.send_goal_async(message), "the goal's answer")

    def plan(self, goal: Pose2D, start: Pose2D | None = None, frame: str = "map") -> tuple[int, Any]:
        """Return the final status of the planning, and the result."""
        handle = self.send(goal, start, frame)
        end = self._client.result(handle.get_result_async(), "the way")
        return end.status, end.result

    def close(self) -> None:
        self._action.destroy()


@pytest.fixture
def planning(simulate: Callable[..., Any], client: "Client") -> Iterator[Planning]:
    """A running simulation, localised and active, and a client of its planner."""
    simulate()
    client.make_ready()
    made = Planning(client)
    yield made
    made.close()


def points(result: Any) -> list[tuple[float, float]]:
    return [(each.pose.position.x, each.pose.position.y) for each in result.path.poses]


def test_path_leads_around_walls(planning: Planning) -> None:
    status, result = planning.plan(THERE, HERE)
    assert (status, result.error_code, result.path.header.frame_id) == (SUCCEEDED, 0, "map")
    way = points(result)
    assert math.dist(way[0], (HERE.x, HERE.y)) < 0.3
    assert way[-1] == (THERE.x, THERE.y)
    assert sum(math.dist(*step) for step in itertools.pairwise(way)) > 3.0 * HERE.distance_to(THERE)


def test_path_without_start_begins_at_robot(planning: Planning) -> None:
    status, result = planning.plan(THERE)
    assert status == SUCCEEDED
    assert math.dist(points(result)[0], (0.0, 0.0)) < 0.3


@pytest.mark.parametrize(
    ("goal", "frame", "code", "said"),
    [
        (Pose2D(50.0, 0.0), "map", 204, "the goal (50.00, 0.00) is outside the map"),
        (
            Pose2D(3.0, -3.0),
            "map",
            206,
            "there is not enough free ground for the robot at the goal (3.00, -3.00)",
        ),
        (THERE, "odom", 202, "the start is in the frame 'odom', not 'map'"),
    ],
)
def test_impossible_path_is_aborted_with_nav2_code(
    planning: Planning, goal: Pose2D, frame: str, code: int, said: str
) -> None:
    status, result = planning.plan(goal, HERE, frame)
    assert (status, result.error_code, result.error_msg, points(result)) == (ABORTED, code, said, [])


def test_path_in_nav2_mode_ends_beside_occupied_goal_or_fails(
    simulate: Callable[..., Any], client: "Client"
) -> None:
    from sar_compiler.sim.placement import Placement

    simulate(robots=(Placement("", like="nav2"),))
    client.make_ready()
    planning = Planning(client)
    status, result = planning.plan(Pose2D(3.0, -2.5), HERE)
    assert (status, result.error_code) == (SUCCEEDED, 0)
    assert 0.0 < math.dist(points(result)[-1], (3.0, -2.5)) < 0.25
    status, result = planning.plan(Pose2D(3.0, -3.0), HERE)
    assert (status, result.error_code) == (ABORTED, result.NO_VALID_PATH)
    planning.close()


def test_inactive_planner_rejects_goals(simulate: Callable[..., Any], client: "Client") -> None:
    simulate()
    planning = Planning(client)
    assert not planning.send(THERE, HERE).accepted
    planning.close()


def test_planner_codes_match_nav2() -> None:
    from nav2_msgs.action import ComputePathToPose

    from sar_compiler.sim.planner import NavCode

    theirs = {
        name: getattr(ComputePathToPose.Result, name)
        for name in NavCode.__members__
        if name != "FAILED_TO_MAKE_PROGRESS"
    }
    assert theirs == {code.name: code.value for code in NavCode if code.name in theirs}
