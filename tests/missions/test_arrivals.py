"""A drive that has succeeded is held against the robot's own localisation, whatever leaf has sent its goal."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from sar_compiler.ros.leaves.arrivals import Arrival, goal_destination
from sar_compiler.ros.leaves.attribute_leaves import RosAction
from sar_compiler.ros.nav2_parameters import nav2_parameters
from sar_compiler.ros.robot_estimate import robot_estimate
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.ports import Input
from search_and_rescue.actions.navigation import NavigateToBase, NavigateToZone
from search_and_rescue.actions.return_checks import NavigateToCharge
from search_and_rescue.actions.sweep_leaves import NavigateThroughPieces, NavigateToPiece
from search_and_rescue.homing_estimates import HomingEstimator
from tests.missions.test_charging_places import home_of
from tests.missions.test_charging_places import searching as on_a_line
from tests.missions.test_sweeping import PIECES, planned, searching

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

pytestmark = pytest.mark.ros


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """The localisation follows at once here, and each leaf sends its goal several times."""
    monkeypatch.setattr("sar_compiler.ros.leaves.arrivals._FOLLOWS_SEC", 0.2)


FAR = (50.0, 50.0)
TO_POSE = "nav2_msgs/action/NavigateToPose"


def to_zone(stage: "Stage") -> Any:
    return NavigateToZone("Drive", stage.zones, record=stage.record)


def to_base(stage: "Stage") -> Any:
    return NavigateToBase("Drive", stage.zones, record=stage.record)


def to_charge(_: "Stage") -> Any:
    search = on_a_line(share=0.5, here=5.0, dock=4.0)
    return NavigateToCharge("Drive", search.zones, record=search.record, homing=home_of(search))


def to_piece(stage: "Stage") -> Any:
    search = planned(searching())
    return NavigateToPiece("Drive", search.zones, record=stage.record, sweeps=search.sweeps)


def through_pieces(stage: "Stage") -> Any:
    search = planned(searching())
    ports = {"homing": search.context[HomingEstimator], "clock": ManualClock(), "record": stage.record}
    return NavigateThroughPieces("Drive", search.zones, sweeps=search.sweeps, **ports)


def by_attributes(_: "Stage") -> Any:
    goal = "pose: {header: {frame_id: map}, pose: {position: {x: 2.0, y: 3.0}}}"
    return RosAction("Drive", Input("navigate_to_pose"), TO_POSE, goal=Input(goal))


# Each with where it drives to.
DRIVERS: list[tuple[Callable[["Stage"], Any], tuple[float, float]]] = [
    (to_zone, (-3.0, 3.0)),
    (to_base, (0.0, 0.0)),
    (to_charge, (4.0, 0.0)),
    (to_piece, PIECES[0]),
    (through_pieces, PIECES[-1]),
    (by_attributes, (2.0, 3.0)),
]


class Localisation:
    """A localisation that knows where the robot is."""

    def __init__(self, stage: "Stage", x: float, y: float) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._stage, self._type = stage, PoseWithCovarianceStamped
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._poses = stage.host().node.create_publisher(self._type, "amcl_pose", latched)
        self.estimate = robot_estimate(stage.node)
        self.tell(x, y)

    def tell(self, x: float, y: float) -> None:
        message = self._type()
        message.header.frame_id = "map"
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        self._poses.publish(message)
        self._stage.until(lambda: self.estimate.pose and self.estimate.pose[:2] == (x, y), "the pose")


def driving(stage: "Stage", make: Callable[["Stage"], Any]) -> Any:
    """Return a leaf whose server reports success at once."""
    leaf = make(stage)
    server = stage.through_server() if make is through_pieces else stage.nav_server()
    server.script = ["succeed"]
    leaf.hold_timeout_sec, leaf.pause_sec = 0.1, 0.01
    stage.take(leaf)
    stage.until(leaf._port.statuses.servers, "the server")
    return leaf


@pytest.mark.parametrize(("make", "there"), DRIVERS, ids=lambda each: getattr(each, "__name__", ""))
def test_a_drive_that_has_succeeded_far_from_its_goal_has_not_arrived(
    stage: "Stage", make: Callable[["Stage"], Any], there: tuple[float, float]
) -> None:
    leaf = driving(stage, make)
    Localisation(stage, *FAR)
    assert stage.run(leaf) is Status.FAILURE
    told = " ".join(stage.warnings)
    assert "the localisation places the robot " in told
    assert "m away from the goal (0.75 m are allowed)" in told
    if make is not by_attributes:
        record = leaf.record
        assert (leaf.outcome_label, record.home, record.charging_at) == ("unavailable", False, "")
        assert record.navigation_lost.startswith("Nav2 reports success of ")


@pytest.mark.parametrize(("make", "there"), DRIVERS, ids=lambda each: getattr(each, "__name__", ""))
def test_a_drive_has_arrived_within_the_tolerance(
    stage: "Stage", make: Callable[["Stage"], Any], there: tuple[float, float]
) -> None:
    leaf = driving(stage, make)
    Localisation(stage, there[0] + 0.7, there[1])
    assert stage.run(leaf) is Status.SUCCESS
    assert stage.warnings == []


def test_a_goal_that_has_not_arrived_is_sent_again_and_costs_no_attempt(stage: "Stage") -> None:
    leaf = driving(stage, to_zone)
    leaf.pause_sec = 0.5
    localisation = Localisation(stage, *FAR)
    stage.tick_until(leaf, lambda: leaf.has_not_arrived, "the end of the first goal")
    assert (leaf.status, leaf.outcome_label) == (Status.RUNNING, "not arrived")
    assert stage.record.navigation_lost
    localisation.tell(-3.0, 3.0)
    assert stage.run(leaf) is Status.SUCCESS
    assert stage.record.navigation_lost == ""
    assert stage.zones.times_postponed() == 0


def test_after_the_third_goal_in_a_row_it_holds_and_is_unavailable_in_the_end(stage: "Stage") -> None:
    leaf = driving(stage, to_zone)
    Localisation(stage, *FAR)
    assert stage.run(leaf) is Status.FAILURE
    assert "Nav2 reports success of the goal, but the localisation" in stage.warnings[0]
    assert (
        "'Drive' holds: Nav2 reports success of 3 goals in a row, but the localisation" in stage.warnings[2]
    )
    assert stage.warnings[-1].startswith("Navigation to zone_a is unavailable: Nav2 reports success of ")


def test_the_localisation_may_follow_the_robot_a_moment_later(stage: "Stage") -> None:
    leaf = driving(stage, to_zone)
    localisation = Localisation(stage, *FAR)
    stage.tick_until(
        leaf,
        lambda: leaf.feedback_message == "waiting for the localisation to confirm the arrival",
        "the wait",
    )
    assert leaf.status is Status.RUNNING
    localisation.tell(-3.0, 3.0)
    assert stage.run(leaf) is Status.SUCCESS


def test_the_mission_says_how_far_from_the_goal_a_robot_has_arrived(stage: "Stage") -> None:
    leaf = driving(stage, to_zone)
    Localisation(stage, -3.0, 8.0).estimate.arrival_tolerance_m = 5.1
    assert stage.run(leaf) is Status.SUCCESS


def test_without_a_tolerance_of_the_mission_that_of_nav2_counts_and_half_a_metre(stage: "Stage") -> None:
    arrival = Arrival(stage.node, (0.0, 0.0))
    assert arrival.tolerance_m == 0.75
    values = {"goal_checker_plugins": ["precise"], "precise.xy_goal_tolerance": 1.0}
    nav2_parameters(stage.node)._queries["controller_server"].values = values
    assert arrival.tolerance_m == 1.5


def test_a_localisation_that_has_stopped_says_nothing_of_an_arrival(
    stage: "Stage", monkeypatch: pytest.MonkeyPatch
) -> None:
    leaf = driving(stage, to_zone)
    estimate = Localisation(stage, *FAR).estimate
    monkeypatch.setattr(estimate, "lost_transforms", lambda: "No transform from 'map' has arrived")
    assert stage.run(leaf) is Status.SUCCESS


def test_pieces_are_passed_where_the_robot_was_by_its_localisation(stage: "Stage") -> None:
    server = stage.through_server()
    leaf = stage.take(through_pieces(stage))
    localisation = Localisation(stage, -2.1, 1.0)
    stage.until(leaf._port.statuses.servers, "the server")
    stage.tick_until(leaf, lambda: server.goals, "the goal")
    server.order("1 left")
    heard = stage.tick_until
    heard(
        leaf,
        lambda: "2.5 m" not in leaf.feedback_message and leaf._next_feedback.remaining_sec,
        "the feedback",
    )
    assert leaf.sweeps.state_of("a").done == 0
    localisation.tell(1.0, 1.5)
    server.order("1 left")
    heard(leaf, lambda: leaf.sweeps.state_of("a").done, "the pieces")
    assert leaf.sweeps.state_of("a").done == 3


def test_a_goal_ends_at_its_last_pose_and_in_another_frame_nothing_is_known_of_it() -> None:
    from geometry_msgs.msg import PoseStamped
    from nav2_msgs.action import ComputePathToPose, NavigateThroughPoses, NavigateToPose

    def pose(x: float, frame: str = "map") -> Any:
        made = PoseStamped()
        made.header.frame_id, made.pose.position.x = frame, x
        return made

    assert goal_destination(NavigateToPose, NavigateToPose.Goal(pose=pose(1.0))) == (1.0, 0.0)
    assert goal_destination(NavigateToPose, NavigateToPose.Goal(pose=pose(1.0, "odom"))) is None
    through = NavigateThroughPoses.Goal(poses=[pose(1.0), pose(2.0)])
    assert goal_destination(NavigateThroughPoses, through) == (2.0, 0.0)
    assert goal_destination(NavigateThroughPoses, NavigateThroughPoses.Goal()) is None
    assert goal_destination(ComputePathToPose, ComputePathToPose.Goal(goal=pose(1.0))) is None
