"""Tests of arrival checks: a succeeded drive is compared with the robot's localisation, for every leaf that sends goals."""

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
from tests.missions.test_charging_places import searching as search_on_line
from tests.missions.test_sweeping import PIECES, planned, searching

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

pytestmark = pytest.mark.ros


@pytest.fixture(autouse=True)
def shorten_confirmation_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorten the wait for the localisation: each leaf sends its goal several times."""
    monkeypatch.setattr("sar_compiler.ros.leaves.arrivals._FOLLOWS_SEC", 0.2)


FAR = (50.0, 50.0)
TO_POSE = "nav2_msgs/action/NavigateToPose"


def zone_drive(stage: "Stage") -> Any:
    return NavigateToZone("Drive", stage.zones, record=stage.record)


def base_drive(stage: "Stage") -> Any:
    return NavigateToBase("Drive", stage.zones, record=stage.record)


def charge_drive(_: "Stage") -> Any:
    search = search_on_line(share=0.5, here=5.0, dock=4.0)
    return NavigateToCharge("Drive", search.zones, record=search.record, homing=home_of(search))


def piece_drive(stage: "Stage") -> Any:
    search = planned(searching())
    return NavigateToPiece("Drive", search.zones, record=stage.record, sweeps=search.sweeps)


def pieces_drive(stage: "Stage") -> Any:
    search = planned(searching())
    ports = {"homing": search.context[HomingEstimator], "clock": ManualClock(), "record": stage.record}
    return NavigateThroughPieces("Drive", search.zones, sweeps=search.sweeps, **ports)


def ros_action_drive(_: "Stage") -> Any:
    goal = "pose: {header: {frame_id: map}, pose: {position: {x: 2.0, y: 3.0}}}"
    return RosAction("Drive", Input("navigate_to_pose"), TO_POSE, goal=Input(goal))


# Each drive with its destination.
DRIVERS: list[tuple[Callable[["Stage"], Any], tuple[float, float]]] = [
    (zone_drive, (-3.0, 3.0)),
    (base_drive, (0.0, 0.0)),
    (charge_drive, (4.0, 0.0)),
    (piece_drive, PIECES[0]),
    (pieces_drive, PIECES[-1]),
    (ros_action_drive, (2.0, 3.0)),
]


class Localisation:
    """A localisation that publishes the position of the robot."""

    def __init__(self, stage: "Stage", x: float, y: float) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._stage, self._type = stage, PoseWithCovarianceStamped
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._poses = stage.host().node.create_publisher(self._type, "amcl_pose", latched)
        self.estimate = robot_estimate(stage.node)
        self.publish(x, y)

    def publish(self, x: float, y: float) -> None:
        message = self._type()
        message.header.frame_id = "map"
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        self._poses.publish(message)
        self._stage.until(lambda: self.estimate.pose and self.estimate.pose[:2] == (x, y), "the pose")


def set_up_succeeding_drive(stage: "Stage", make: Callable[["Stage"], Any]) -> Any:
    """Set up a leaf whose server reports success at once."""
    leaf = make(stage)
    server = stage.through_server() if make is pieces_drive else stage.nav_server()
    server.script = ["succeed"]
    leaf.hold_timeout_sec, leaf.pause_sec = 0.1, 0.01
    stage.take(leaf)
    stage.until(leaf._port.statuses.servers, "the server")
    return leaf


@pytest.mark.parametrize(("make", "there"), DRIVERS, ids=lambda each: getattr(each, "__name__", ""))
def test_success_far_from_goal_is_no_arrival(
    stage: "Stage", make: Callable[["Stage"], Any], there: tuple[float, float]
) -> None:
    leaf = set_up_succeeding_drive(stage, make)
    Localisation(stage, *FAR)
    assert stage.run(leaf) is Status.FAILURE
    warning_text = " ".join(stage.warnings)
    assert "the localisation places the robot " in warning_text
    assert "m away from the goal (0.75 m are allowed)" in warning_text
    if make is not ros_action_drive:
        record = leaf.record
        assert (leaf.outcome_label, record.home, record.charging_at) == ("unavailable", False, "")
        assert record.navigation_lost.startswith("Nav2 reports success of ")


@pytest.mark.parametrize(("make", "there"), DRIVERS, ids=lambda each: getattr(each, "__name__", ""))
def test_success_within_tolerance_is_an_arrival(
    stage: "Stage", make: Callable[["Stage"], Any], there: tuple[float, float]
) -> None:
    leaf = set_up_succeeding_drive(stage, make)
    Localisation(stage, there[0] + 0.7, there[1])
    assert stage.run(leaf) is Status.SUCCESS
    assert stage.warnings == []


def test_unconfirmed_goal_is_resent_without_using_an_attempt(stage: "Stage") -> None:
    leaf = set_up_succeeding_drive(stage, zone_drive)
    leaf.pause_sec = 0.5
    localisation = Localisation(stage, *FAR)
    stage.tick_until(leaf, lambda: leaf.has_not_arrived, "the end of the first goal")
    assert (leaf.status, leaf.outcome_label) == (Status.RUNNING, "not arrived")
    assert stage.record.navigation_lost
    localisation.publish(-3.0, 3.0)
    assert stage.run(leaf) is Status.SUCCESS
    assert stage.record.navigation_lost == ""
    assert stage.zones.times_postponed() == 0


def test_three_unconfirmed_goals_hold_drive_until_it_is_unavailable(stage: "Stage") -> None:
    leaf = set_up_succeeding_drive(stage, zone_drive)
    Localisation(stage, *FAR)
    assert stage.run(leaf) is Status.FAILURE
    assert "Nav2 reports success of the goal, but the localisation" in stage.warnings[0]
    assert (
        "'Drive' holds: Nav2 reports success of 3 goals in a row, but the localisation" in stage.warnings[2]
    )
    assert stage.warnings[-1].startswith("Navigation to zone_a is unavailable: Nav2 reports success of ")


def test_late_localisation_can_confirm_arrival(stage: "Stage") -> None:
    leaf = set_up_succeeding_drive(stage, zone_drive)
    localisation = Localisation(stage, *FAR)
    stage.tick_until(
        leaf,
        lambda: leaf.feedback_message == "waiting for the localisation to confirm the arrival",
        "the wait",
    )
    assert leaf.status is Status.RUNNING
    localisation.publish(-3.0, 3.0)
    assert stage.run(leaf) is Status.SUCCESS


def test_mission_sets_arrival_tolerance(stage: "Stage") -> None:
    leaf = set_up_succeeding_drive(stage, zone_drive)
    Localisation(stage, -3.0, 8.0).estimate.arrival_tolerance_m = 5.1
    assert stage.run(leaf) is Status.SUCCESS


def test_default_tolerance_is_nav2_tolerance_plus_half_a_metre(stage: "Stage") -> None:
    arrival = Arrival(stage.node, (0.0, 0.0))
    assert arrival.tolerance_m == 0.75
    values = {"goal_checker_plugins": ["precise"], "precise.xy_goal_tolerance": 1.0}
    nav2_parameters(stage.node)._queries["controller_server"].values = values
    assert arrival.tolerance_m == 1.5


def test_stopped_localisation_does_not_prevent_arrival(
    stage: "Stage", monkeypatch: pytest.MonkeyPatch
) -> None:
    leaf = set_up_succeeding_drive(stage, zone_drive)
    estimate = Localisation(stage, *FAR).estimate
    monkeypatch.setattr(estimate, "lost_transforms", lambda: "No transform from 'map' has arrived")
    assert stage.run(leaf) is Status.SUCCESS


def test_pieces_are_passed_only_if_localisation_agrees(stage: "Stage") -> None:
    server = stage.through_server()
    leaf = stage.take(pieces_drive(stage))
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
    localisation.publish(1.0, 1.5)
    server.order("1 left")
    heard(leaf, lambda: leaf.sweeps.state_of("a").done, "the pieces")
    assert leaf.sweeps.state_of("a").done == 3


def test_goal_destination_is_last_pose_in_map_frame() -> None:
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
