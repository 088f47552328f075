"""The stand-in for Nav2's planner: ways on the map, for which nothing moves."""

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
        """Ask for a way, from where the robot is if no start is given; return its handle."""
        from sar_compiler.sim.messages import to_pose

        message = self._type.Goal(use_start=start is not None)
        for stamped, pose in ((message.start, start or Pose2D(50.0, 50.0)), (message.goal, goal)):
            stamped.header.frame_id, stamped.pose = frame, to_pose(pose)
        return self._client.result(self._action.send_goal_async(message), "the goal's answer")

    def way(self, goal: Pose2D, start: Pose2D | None = None, frame: str = "map") -> tuple[int, Any]:
        """Return how the planning has ended, and the result."""
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


def test_a_way_leads_around_the_walls_of_the_map(planning: Planning) -> None:
    status, result = planning.way(THERE, HERE)
    assert (status, result.error_code, result.path.header.frame_id) == (SUCCEEDED, 0, "map")
    way = points(result)
    assert math.dist(way[0], (HERE.x, HERE.y)) < 0.3
    assert way[-1] == (THERE.x, THERE.y)
    assert sum(math.dist(*step) for step in itertools.pairwise(way)) > 3.0 * HERE.distance_to(THERE)


def test_without_a_start_a_way_begins_where_the_robot_is(planning: Planning) -> None:
    status, result = planning.way(THERE)
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
def test_where_there_is_no_way_it_is_aborted_with_the_code_of_nav2(
    planning: Planning, goal: Pose2D, frame: str, code: int, said: str
) -> None:
    status, result = planning.way(goal, HERE, frame)
    assert (status, result.error_code, result.error_msg, points(result)) == (ABORTED, code, said, [])


def test_like_nav2_a_way_may_end_beside_an_occupied_goal_or_there_is_none(
    simulate: Callable[..., Any], client: "Client"
) -> None:
    from sar_compiler.sim.placement import Placement

    simulate(robots=(Placement("", like="nav2"),))
    client.make_ready()
    planning = Planning(client)
    status, result = planning.way(Pose2D(3.0, -2.5), HERE)
    assert (status, result.error_code) == (SUCCEEDED, 0)
    assert 0.0 < math.dist(points(result)[-1], (3.0, -2.5)) < 0.25
    status, result = planning.way(Pose2D(3.0, -3.0), HERE)
    assert (status, result.error_code) == (ABORTED, result.NO_VALID_PATH)
    planning.close()


def test_before_it_is_active_it_takes_no_goal(simulate: Callable[..., Any], client: "Client") -> None:
    simulate()
    planning = Planning(client)
    assert not planning.send(THERE, HERE).accepted
    planning.close()


def test_the_code_of_a_way_that_is_not_there_is_nav2s() -> None:
    from nav2_msgs.action import ComputePathToPose

    from sar_compiler.sim.planner import NavCode

    theirs = {
        name: getattr(ComputePathToPose.Result, name)
        for name in NavCode.__members__
        if name != "FAILED_TO_MAKE_PROGRESS"
    }
    assert theirs == {code.name: code.value for code in NavCode if code.name in theirs}
