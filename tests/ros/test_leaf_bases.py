"""Tests of leaves derived from the base classes, against scripted servers and publishers."""

import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import ClearingPolicy, Status

from sar_compiler.leaves import ActionLeaf, Input, Kind, Output, ServiceLeaf, TopicLeaf, Use, register
from sar_compiler.ros.clock import Deadline
from sar_compiler.ros.leaves.leaf import LeafDefinitionError
from sar_compiler.ros.robot_estimate import robot_estimate
from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.clock import ManualClock

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.missions.mission_stage import NavServer, ScriptedService, Stage
    from tests.ros.conftest import Ros

pytestmark = pytest.mark.ros

REJECTED = "the server rejected the goal. Is its lifecycle state 'active'? Nav2 becomes active once it has an initial pose"


@pytest.fixture
def stage(ros: "Ros") -> "Iterator[Stage]":
    from tests.missions.mission_stage import Stage

    stage = Stage(ros.context)
    yield stage
    stage.close()


@register("DriveTo", kind=Kind.ACTION, uses=[Use.action("navigate_to_pose")])
class DriveTo(ActionLeaf):
    """Drive straight to a point."""

    action_type = "nav2_msgs/action/NavigateToPose"
    action_name = "navigate_to_pose"

    def __init__(self, name: str, x: Input[float]) -> None:
        super().__init__(name)
        self.x = x
        self.ask: list[Status] = []
        self.fed: list[float] = []
        self.near = 0.0
        self.next: list[float] = []

    def goal(self) -> Any:
        if self.ask:
            return self.ask.pop(0)
        goal = self.interface.Goal()
        goal.pose.pose.position.x = self.next.pop(0) if self.next else self.x.get()
        return goal

    def on_feedback(self, feedback: Any) -> Status | None:
        self.fed.append(feedback.distance_remaining)
        return Status.SUCCESS if feedback.distance_remaining < self.near else None

    def on_result(self, status: int, result: Any) -> Status:
        return Status.RUNNING if self.next else super().on_result(status, result)


@register("DriveWithNav2", kind=Kind.ACTION, uses=[Use.action("navigate_to_pose"), Use.nav2()])
class DriveWithNav2(DriveTo):
    """Drive, once Nav2 is active."""


class DriveAlone(DriveTo):
    """Drive while no goal through several poses is active."""

    rivals = ("navigate_to_pose", "navigate_through_poses")


class DriveThrough(DriveTo):
    """Drive through several poses."""

    action_type = "nav2_msgs/action/NavigateThroughPoses"
    action_name = "navigate_through_poses"

    def goal(self) -> Any:
        return self.interface.Goal()


def driver(stage: "Stage", cls: type[DriveTo] = DriveTo, **attributes: Any) -> DriveTo:
    leaf = cls("Drive", Input(1.5))
    for name, value in attributes.items():
        setattr(leaf, name, value)
    return stage.take(leaf)


def wait_for_goals(stage: "Stage", leaf: DriveTo, server: "NavServer", goals: int = 1) -> None:
    wakes = stage.wakes
    stage.tick_until(leaf, lambda: stage.wakes > wakes and len(server.goals) == goals, f"goal {goals}")


def goal_positions(server: "NavServer") -> list[float]:
    return [goal.pose[1] for goal in server.goals]


class TestActionLeaf:
    def test_goal_uses_port_value_at_each_activation(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["succeed"]
        entry = Scope(Board("test")).resolve("x")
        leaf = stage.take(DriveTo("Drive", Input(entry)))
        for x in (1.5, -2.0):
            entry.write(x)
            assert stage.run(leaf) is Status.SUCCESS
        assert goal_positions(server) == [1.5, -2.0]

    def test_aborted_goal_fails_and_is_logged(self, stage: "Stage") -> None:
        stage.nav_server().script = ["abort"]
        assert stage.run(driver(stage)) is Status.FAILURE
        assert stage.warnings == ["'Drive' failed: aborted (status 6): error_code 105"]

    @pytest.mark.parametrize("status", [Status.SUCCESS, Status.FAILURE])
    def test_status_in_place_of_goal_ends_leaf_without_request(self, stage: "Stage", status: Status) -> None:
        server = stage.nav_server()
        leaf = driver(stage, ask=[status])
        leaf.tick_once()
        assert leaf.status is status
        assert leaf.update() is status
        assert leaf.is_settled()
        assert server.requests == 0

    def test_goal_method_is_called_again_while_it_returns_running(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["succeed"]
        leaf = driver(stage, ask=[Status.RUNNING] * 3)
        assert stage.run(leaf) is Status.SUCCESS
        assert leaf.ask == []
        assert server.requests == 1

    def test_each_feedback_is_processed_once(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["feedback"]
        leaf = driver(stage)
        stage.tick_until(leaf, lambda: leaf.fed, "feedback")
        for _ in range(5):
            leaf.tick_once()
        assert leaf.fed == [2.5]
        assert leaf.status is Status.RUNNING

    def test_feedback_is_read_at_most_once_per_period(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["feedback"]
        leaf = driver(stage, feedback_period_sec=60.0)
        stage.tick_until(leaf, lambda: leaf.fed, "feedback")
        server.order("feedback")
        stage.tick_until(leaf, lambda: leaf._exchange and leaf._exchange.has_feedback, "more of it")
        leaf.tick_once()
        assert leaf.fed == [2.5]
        leaf.feedback_period_sec, leaf._next_feedback = 0.0, Deadline(0.0)
        leaf.tick_once()
        server.order("feedback")
        stage.tick_until(leaf, lambda: len(leaf.fed) > 2, "what is read in each tick")

    def test_feedback_is_not_read_without_on_feedback(
        self, stage: "Stage", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        server = stage.nav_server()
        server.script = ["feedback"]
        monkeypatch.delattr(DriveTo, "on_feedback")
        leaf = driver(stage)
        stage.tick_until(leaf, lambda: leaf._exchange and leaf._exchange.has_feedback, "feedback")
        leaf.tick_once()
        assert leaf._exchange is not None
        assert leaf._exchange.has_feedback
        server.order("succeed")
        assert stage.run(leaf) is Status.SUCCESS

    def test_default_feedback_message_shows_duration_of_goal(self, stage: "Stage") -> None:
        stage.nav_server().script = ["feedback"]
        leaf = driver(stage)
        stage.tick_until(leaf, lambda: leaf.fed, "feedback")
        assert leaf.feedback_message == "active for 0:00"
        leaf.feedback_message = "docking"
        leaf.tick_once()
        assert leaf.feedback_message == "docking"

    def test_leaf_that_ends_on_feedback_cancels_its_goal(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["feedback"]
        leaf = driver(stage, near=3.0)
        assert stage.run(leaf) is Status.SUCCESS
        stage.until(leaf.is_settled, "the answer to the cancel")
        stage.until(lambda: server.goals[0].final == "canceled", "the end of the goal")
        assert leaf.update() is Status.SUCCESS

    def test_leaf_that_returns_running_on_result_sends_next_goal(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["succeed"]
        assert stage.run(driver(stage, next=[1.0, 2.0, 3.0])) is Status.SUCCESS
        assert goal_positions(server) == [1.0, 2.0, 3.0]

    def test_server_may_stay_silent_after_feedback(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["feedback"]
        leaf = driver(stage, server_timeout_sec=0.5)
        port = leaf._port
        assert port is not None
        stage.until(lambda: port.server_is_ready, "the server")
        stage.tick_until(leaf, lambda: leaf.fed, "feedback")
        doubts = port.prober._pending_requests
        stage.tick_until(leaf, lambda: len(doubts) > 2, "doubt about the server")
        server.order("succeed")
        assert stage.run(leaf) is Status.SUCCESS

    def test_missing_server_is_awaited_for_absence_timeout(self, stage: "Stage") -> None:
        host = stage.host()
        server = stage.nav_server_on(host)
        leaf = driver(stage, absence_timeout_sec=0.2)
        port = leaf._port
        assert port is not None
        stage.until(lambda: port.server_is_ready, "the server")
        wait_for_goals(stage, leaf, server)
        host.close()
        assert stage.run(leaf) is Status.FAILURE
        assert stage.warnings[-1] == (
            "'Drive' failed: the server has been missing for 0.2 s. The robot may still be moving"
        )

    def test_action_type_can_be_python_class(self, stage: "Stage") -> None:
        from nav2_msgs.action import NavigateToPose

        stage.nav_server().script = ["succeed"]
        assert stage.run(driver(stage, action_type=NavigateToPose)) is Status.SUCCESS


def test_invalid_return_of_goal_or_request_is_explained(stage: "Stage") -> None:
    driving, asking = driver(stage, ask=[None]), stage.take(Configure("Configure"))
    asking.ask = ["configure"]  # type: ignore[list-item]
    with pytest.raises(
        LeafDefinitionError, match=r"DriveTo\.goal\(\) returned None\. Return an interface\.Goal"
    ):
        driving.tick_once()
    with pytest.raises(LeafDefinitionError, match=r"Configure\.request\(\) returned 'configure'\. Return an"):
        asking.tick_once()


class TestRejection:
    def test_rejection_message_recommends_use_of_nav2(self, stage: "Stage") -> None:
        stage.nav_server().accept = False
        assert stage.run(driver(stage)) is Status.FAILURE
        (warning,) = stage.warnings
        assert warning == (
            f"'Drive' failed: {REJECTED}. Add `Use.nav2()` to `uses` of "
            '`@register("DriveTo", …)`, so that a run sends the pose at its start and waits for Nav2.'
        )

    def test_recommendation_is_omitted_if_nav2_is_declared(self, stage: "Stage") -> None:
        stage.nav_server().accept = False
        stage.run(driver(stage, DriveWithNav2))
        assert stage.warnings == [f"'Drive' failed: {REJECTED}."]

    def test_rejection_is_logged_once_until_goal_is_accepted(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.accept = False
        leaf = driver(stage, pause_sec=0.0)
        for _ in range(4):
            assert stage.run(leaf) is Status.FAILURE
            assert "rejected" in leaf.feedback_message
        assert len(stage.warnings) == 1
        server.accept = True
        server.script = ["abort"]
        stage.run(leaf)
        stage.run(leaf)
        assert stage.warnings[1:] == ["'Drive' failed: aborted (status 6): error_code 105"] * 2
        server.accept = False
        stage.run(leaf)
        assert len(stage.warnings) == 4
        assert server.requests == 7

    def test_delay_before_next_attempt_grows_after_second_failure(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.accept = False
        leaf = driver(stage)
        clock = leaf._clock = ManualClock()
        for _ in range(2):
            assert stage.run(leaf) is Status.FAILURE
        for number, pause in enumerate((1.0, 2.0, 4.0, 8.0, 8.0), start=3):
            leaf.tick_once()
            clock.advance(pause - 0.01)
            leaf.tick_once()
            assert leaf.status is Status.RUNNING
            assert leaf.feedback_message == f"next attempt in 0.0 s, after {number - 1} failures"
            assert server.requests == number - 1
            clock.advance(0.02)
            assert stage.run(leaf) is Status.FAILURE
            assert server.requests == number


class TestWaitBeforeSending:
    def test_inactive_lifecycle_node_is_awaited_and_goal_is_sent_again(self, stage: "Stage") -> None:
        server = stage.nav_server()
        state = lifecycle(stage, "bt_navigator")
        leaf = driver_with_known_node(stage, "bt_navigator")
        server.accept, state.label = False, "inactive"
        stage.tick_until(leaf, lambda: "waits to send its goal again" in leaf.feedback_message, "the wait")
        (warning,) = stage.warnings
        node = f"node bt_navigator ({stage.namespace}/bt_navigator)"
        assert warning == f"'Drive' waits to send its goal again: {node}: state 'inactive', must be 'active'."
        assert server.requests == 1
        server.accept, server.script, state.label = True, ["succeed"], "active"
        assert stage.run(leaf) is Status.SUCCESS
        assert server.requests == 2

    def test_goal_rejected_by_active_server_fails(self, stage: "Stage") -> None:
        stage.nav_server().accept = False
        lifecycle(stage, "bt_navigator")
        assert stage.run(driver_with_known_node(stage, "bt_navigator")) is Status.FAILURE
        assert "rejected" in stage.warnings[0]

    def test_wait_for_lifecycle_node_has_limit(self, stage: "Stage") -> None:
        server = stage.nav_server()
        state = lifecycle(stage, "amcl")
        leaf = driver_with_known_node(stage, "amcl")
        server.accept, state.label = False, "unconfigured"
        stage.tick_until(leaf, lambda: "waits" in leaf.feedback_message, "the wait")
        assert leaf._hold is not None
        leaf._hold = Deadline(0.0)
        assert stage.run(leaf) is Status.FAILURE
        assert stage.warnings[-1].endswith("state 'unconfigured', must be 'active', for 60 s")

    def test_goal_aborted_with_code_while_node_is_inactive_is_sent_again(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script, server.error_code = ["abort"], 208
        state = lifecycle(stage, "bt_navigator")
        leaf = driver_with_known_node(stage, "bt_navigator")
        state.label = "inactive"
        stage.tick_until(leaf, lambda: "waits" in leaf.feedback_message, "the wait")
        server.script, server.error_code, state.label = ["succeed"], 0, "active"
        assert stage.run(leaf) is Status.SUCCESS

    def test_goal_aborted_without_code_is_sent_again_after_localisation_is_active(
        self, stage: "Stage"
    ) -> None:
        server = stage.nav_server()
        server.script = ["abort"]
        state = lifecycle(stage, "amcl")
        leaf = driver_with_known_node(stage, "amcl")
        state.label = "finalized"
        stage.tick_until(leaf, lambda: "waits" in leaf.feedback_message, "the wait")
        server.script, state.label = ["succeed"], "active"
        assert stage.run(leaf) is Status.SUCCESS

    def test_goal_of_other_client_is_awaited(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = driver(stage)
        wait_for_goals(stage, leaf, server)
        from rclpy.action import ActionClient

        other = ActionClient(stage.node, leaf.interface, "navigate_to_pose")
        try:
            other.send_goal_async(leaf.interface.Goal())
            stage.until(lambda: len(server.goals) == 2, "the other goal")
            first, second = server.goals
            first.orders.put("abort")
            stage.tick_until(leaf, lambda: "another client's goal" in leaf.feedback_message, "the wait")
            assert server.requests == 2
            server.script = ["succeed"]
            second.orders.put("succeed")
            assert stage.run(leaf) is Status.SUCCESS
            assert server.requests == 3
        finally:
            other.destroy()

    @pytest.mark.parametrize("whose", ["this mission's", "another client's"])
    def test_goal_of_rival_action_is_awaited_before_sending(self, whose: str, stage: "Stage") -> None:
        from rclpy.action import ActionClient

        server, rival = stage.nav_server(), stage.through_server()
        leaf = driver(stage, DriveAlone)
        other = driver(stage, DriveThrough)
        client = ActionClient(stage.node, other.interface, "navigate_through_poses")
        try:
            if whose == "this mission's":
                wait_for_goals(stage, other, rival)
                rival.heed_cancel = False
                other.stop(Status.INVALID)
            else:
                stage.until(client.server_is_ready, "the rival's server")
                client.send_goal_async(other.interface.Goal())
                stage.until(lambda: leaf._rivals[0].has_foreign_goal and rival.goals, "the other goal")
            server.script = ["succeed"]
            leaf.tick_once()
            assert leaf.status is Status.RUNNING
            assert f"{whose} goal" in leaf.feedback_message
            assert server.requests == 0
            rival.order("succeed")
            assert stage.run(leaf) is Status.SUCCESS
        finally:
            client.destroy()

    def test_wait_for_own_goal_with_unknown_end_is_limited(self, stage: "Stage") -> None:
        server, rival = stage.nav_server(), stage.through_server()
        leaf = driver(stage, DriveAlone)
        clock = leaf._clock = ManualClock()
        other = driver(stage, DriveThrough)
        wait_for_goals(stage, other, rival)
        rival.heed_cancel = False
        other.stop(Status.INVALID)
        leaf.tick_once()
        clock.advance(4.9)
        leaf.tick_once()
        assert (leaf.status, server.requests) == (Status.RUNNING, 0)
        clock.advance(0.2)
        server.script = ["succeed"]
        assert stage.run(leaf) is Status.SUCCESS
        rival.order("succeed")
        rival.wait_for_end()


class TestStatusTopic:
    def test_status_topic_replaces_missing_result(
        self, stage: "Stage", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        server = stage.nav_server()
        leaf = driver(stage)
        clock = leaf._clock = ManualClock()
        wait_for_goals(stage, leaf, server)
        goal = leaf._exchange
        assert goal is not None
        monkeypatch.setattr(goal, "_on_result", lambda _: None)
        stage.until(lambda: not goal.has_ended, "the goal")
        goal._on_end(4)
        leaf.tick_once()
        clock.advance(1.9)
        leaf.tick_once()
        assert stage.warnings == []
        clock.advance(0.2)
        assert stage.run(leaf) is Status.SUCCESS
        assert (
            "has not arrived. According to the status topic, the goal has ended with status 4"
            in stage.warnings[0]
        )


class Lifecycle:
    """A lifecycle node's state."""

    label = "active"


def lifecycle(stage: "Stage", name: str) -> Lifecycle:
    from lifecycle_msgs.srv import GetState

    from tests.missions.mission_stage import ScriptedService

    state = Lifecycle()

    def answer(_: Any, response: Any) -> None:
        response.current_state.label = state.label

    ScriptedService(stage.host(), GetState, f"{name}/get_state", answer)
    return state


def driver_with_known_node(stage: "Stage", name: str) -> DriveTo:
    """Return a leaf that has discovered a lifecycle node of Nav2."""
    leaf = driver(stage, DriveWithNav2)
    node = robot_estimate(leaf.node).lifecycle(name)
    stage.until(lambda: node.is_there, name)
    return leaf


class Configure(ServiceLeaf):
    """Change the state of a lifecycle node."""

    service_type = "lifecycle_msgs/srv/ChangeState"
    service_name = "camera/change_state"

    def __init__(self, name: str, state: Output[str] | None = None) -> None:
        super().__init__(name)
        self.ask: list[Status] = []
        self.again = 0
        self._state = state

    def request(self) -> Any:
        return self.ask.pop(0) if self.ask else self.interface.Request()

    def on_response(self, response: Any) -> Status:
        if self._state is not None:
            self._state.set("configured")
        if self.again:
            self.again -= 1
            return Status.RUNNING
        return super().on_response(response)


def serve_configure(stage: "Stage", *, success: bool) -> "ScriptedService":
    from lifecycle_msgs.srv import ChangeState

    from tests.missions.mission_stage import ScriptedService

    def answer(_: Any, response: Any) -> None:
        response.success = success

    return ScriptedService(stage.host(), ChangeState, "camera/change_state", answer)


class TestServiceLeaf:
    def test_response_succeeds_and_wakes_tree(self, stage: "Stage") -> None:
        serve_configure(stage, success=True)
        state = Output[str]()
        assert stage.run(stage.take(Configure("Configure", state))) is Status.SUCCESS
        assert state.value == "configured"
        assert stage.wakes == 1

    def test_response_without_success_fails_and_does_not_wake_tree(self, stage: "Stage") -> None:
        serve_configure(stage, success=False)
        assert stage.run(stage.take(Configure("Configure"))) is Status.FAILURE
        assert stage.warnings == ["'Configure' failed: the server reports a failure"]
        assert stage.wakes == 0

    def test_status_in_place_of_request_ends_leaf(self, stage: "Stage") -> None:
        leaf = stage.take(Configure("Configure"))
        leaf.ask = [Status.SUCCESS]
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS
        assert stage.lines == []

    def test_leaf_that_returns_running_on_response_sends_request_again(self, stage: "Stage") -> None:
        service = serve_configure(stage, success=True)
        leaf = stage.take(Configure("Configure"))
        leaf.again = 2
        assert stage.run(leaf) is Status.SUCCESS
        assert len(service.requests) == 3

    def test_missing_service_is_logged_once(self, stage: "Stage") -> None:
        leaf = stage.take(Configure("Configure"))
        leaf.server_timeout_sec = 0.0
        assert [stage.run(leaf) for _ in range(3)] == [Status.FAILURE] * 3
        assert len(stage.warnings) == 1
        assert "no server for the service" in stage.warnings[0]
        serve_configure(stage, success=False)
        leaf.server_timeout_sec = 8.0
        stage.run(leaf)
        stage.run(leaf)
        assert len(stage.warnings) == 3, "two answers are two events"


class Battery(TopicLeaf):
    """Is there enough in the battery?"""

    topic_type = "std_msgs/msg/Float32"
    topic_name = "battery"

    def on_message(self, message: Any) -> Status:
        self.feedback_message = f"{message.data:.1f} V"
        return Status.SUCCESS if message.data > 11.0 else Status.FAILURE


class AnyMessage(TopicLeaf):
    """Wait for any message."""

    topic_type = "std_msgs/msg/Float32"
    topic_name = "battery"
    qos = "reliable"
    waits = True


def set_up_with_publisher(stage: "Stage", leaf: TopicLeaf, **attributes: Any) -> Any:
    """Set a leaf up; return a function that publishes a voltage and waits until the leaf has received it."""
    for name, value in attributes.items():
        setattr(leaf, name, value)
    stage.take(leaf)
    publisher = create_battery_publisher(stage, "reliable")

    def publish(volts: float) -> None:
        stage.until(lambda: publisher.get_subscription_count() == 1, "the subscription")
        before = leaf._message
        send(publisher, volts)
        stage.until(lambda: leaf._message is not before, "the message")

    return publish


def create_battery_publisher(stage: "Stage", reliability: str, durability: str = "volatile") -> Any:
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    from std_msgs.msg import Float32

    qos = QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.get_from_short_key(reliability),
        durability=DurabilityPolicy.get_from_short_key(durability),
    )
    return stage.host().node.create_publisher(Float32, "battery", qos)


def send(publisher: Any, volts: float) -> None:
    from std_msgs.msg import Float32

    publisher.publish(Float32(data=volts))


def tick_leaf(leaf: TopicLeaf) -> Status:
    leaf.tick_once()
    return leaf.status


def set_clock(stage: "Stage", seconds: float) -> None:
    from rclpy.clock import ROSClock
    from rclpy.time import Time

    clock = stage.node.get_clock()
    assert isinstance(clock, ROSClock)
    clock._set_ros_time_is_active(enabled=True)
    clock.set_ros_time_override(Time(nanoseconds=int(seconds * 1e9), clock_type=clock.clock_type))


class TestTopicLeaf:
    def test_condition_fails_without_message_and_then_uses_latest_message(self, stage: "Stage") -> None:
        leaf = Battery("Battery?")
        publish = set_up_with_publisher(stage, leaf)
        assert tick_leaf(leaf) is Status.FAILURE
        assert leaf.feedback_message == "no message on 'battery'"
        publish(12.0)
        assert tick_leaf(leaf) is Status.SUCCESS
        publish(10.5)
        assert tick_leaf(leaf) is Status.FAILURE
        assert leaf.feedback_message == "10.5 V"
        assert stage.wakes == 0

    def test_message_older_than_max_age_is_ignored(self, stage: "Stage") -> None:
        set_clock(stage, 100.0)
        leaf = Battery("Battery?")
        publish = set_up_with_publisher(stage, leaf, max_age_sec=0.5)
        publish(12.0)
        set_clock(stage, 100.5)
        assert tick_leaf(leaf) is Status.SUCCESS
        set_clock(stage, 100.6)
        assert tick_leaf(leaf) is Status.FAILURE
        assert leaf.feedback_message == "no message on 'battery' within 0.5 s"
        publish(12.5)
        assert tick_leaf(leaf) is Status.SUCCESS

    def test_clock_jump_back_expires_message(self, stage: "Stage") -> None:
        set_clock(stage, 100.0)
        leaf = Battery("Battery?")
        set_up_with_publisher(stage, leaf, max_age_sec=0.5)(12.0)
        set_clock(stage, 5.0)
        assert tick_leaf(leaf) is Status.FAILURE

    def test_waiting_leaf_is_woken_by_first_message_only(self, stage: "Stage") -> None:
        leaf = AnyMessage("Wait")
        publish = set_up_with_publisher(stage, leaf)
        assert tick_leaf(leaf) is Status.RUNNING
        publish(0.0)
        assert stage.wakes == 1
        publish(1.0)
        assert stage.wakes == 1
        assert tick_leaf(leaf) is Status.SUCCESS
        publish(2.0)
        assert stage.wakes == 1

    def test_earlier_message_is_used_unless_cleared_on_initialise(self, stage: "Stage") -> None:
        leaf = AnyMessage("Wait")
        publish = set_up_with_publisher(stage, leaf)
        publish(1.0)
        assert tick_leaf(leaf) is Status.SUCCESS
        assert tick_leaf(leaf) is Status.SUCCESS
        leaf.clearing_policy = ClearingPolicy.ON_INITIALISE
        assert tick_leaf(leaf) is Status.RUNNING
        publish(2.0)
        assert tick_leaf(leaf) is Status.SUCCESS

    def test_message_is_used_once_if_cleared_on_success(self, stage: "Stage") -> None:
        leaf = AnyMessage("Button")
        publish = set_up_with_publisher(stage, leaf, clearing_policy=ClearingPolicy.ON_SUCCESS)
        publish(1.0)
        assert tick_leaf(leaf) is Status.SUCCESS
        assert tick_leaf(leaf) is Status.RUNNING

    @pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
    def test_sensor_data_qos_matches_every_reliability(self, stage: "Stage", reliability: str) -> None:
        leaf = stage.take(Battery("Battery?"))
        publisher = create_battery_publisher(stage, reliability)

        def came() -> bool:
            send(publisher, 12.0)
            return tick_leaf(leaf) is Status.SUCCESS

        stage.until(came, f"a message of a {reliability} publisher")

    def test_transient_local_leaf_receives_message_published_before_setup(self, stage: "Stage") -> None:
        publisher = create_battery_publisher(stage, "reliable", "transient_local")
        send(publisher, 12.0)
        late, later = AnyMessage("Late"), AnyMessage("Later")
        late.qos = "transient_local"
        stage.take(later)
        stage.take(late)
        stage.tick_until(late, lambda: late.status is Status.SUCCESS, "the message from before")
        stage.until(lambda: publisher.get_subscription_count() == 2, "the other subscription")
        assert tick_leaf(later) is Status.RUNNING

    def test_qos_can_be_profile(self, stage: "Stage") -> None:
        from rclpy.qos import qos_profile_sensor_data

        leaf = Battery("Battery?")
        set_up_with_publisher(stage, leaf, qos=qos_profile_sensor_data)(12.0)
        assert tick_leaf(leaf) is Status.SUCCESS

    def test_repeated_setup_leaves_no_subscription_or_message(self, stage: "Stage") -> None:
        leaf = AnyMessage("Wait")
        set_up_with_publisher(stage, leaf)(1.0)
        subscriptions = len(list(stage.node.subscriptions))
        leaf.setup(node=stage.node)
        assert len(list(stage.node.subscriptions)) == subscriptions
        assert tick_leaf(leaf) is Status.RUNNING
        leaf.shutdown()
        leaf.shutdown()
        assert len(list(stage.node.subscriptions)) == subscriptions - 1

    def test_shutdown_works_after_node_is_destroyed(self, stage: "Stage") -> None:
        leaf = stage.take(Battery("Battery?"))
        stage.node.destroy_node()
        leaf.shutdown()


@pytest.mark.parametrize(
    ("leaf", "attributes", "message"),
    [
        (
            DriveTo("D", Input(0.0)),
            {"action_name": ""},
            "DriveTo has no action_name. Set the attribute in the class",
        ),
        (
            DriveTo("D", Input(0.0)),
            {"action_type": None},
            "DriveTo has no action_type. Set the attribute in the class",
        ),
        (
            Configure("C"),
            {"service_type": "ChangeState"},
            "Configure: service_type is 'ChangeState'. Write it as 'package/srv/Name'",
        ),
        (
            Configure("C"),
            {"service_type": "lifecycle_msgs/msg/State"},
            "Configure: service_type is 'lifecycle_msgs/msg/State'. Write it as 'package/srv/Name'",
        ),
        (
            Battery("B"),
            {"topic_type": "std_msgs/msg/Flaot32"},
            "Battery: there is no std_msgs/msg/Flaot32; did you mean 'std_msgs/msg/Float32'?",
        ),
        (Battery("B"), {"topic_type": "std_msgs/msg/Xyzzy"}, "Battery: there is no std_msgs/msg/Xyzzy$"),
        (
            Battery("B"),
            {"topic_type": "no_such_msgs/msg/Thing"},
            "Battery: no_such_msgs/msg/Thing cannot be imported .*. Build its package",
        ),
        (
            Battery("B"),
            {"qos": "sensor"},
            "Battery: qos is 'sensor'. Write one of sensor_data, reliable, transient_local, or an rclpy",
        ),
    ],
)
def test_setup_reports_invalid_class_attributes(
    stage: "Stage", leaf: Any, attributes: dict[str, Any], message: str
) -> None:
    for name, value in attributes.items():
        setattr(leaf, name, value)
    with pytest.raises(LeafDefinitionError, match=message):
        leaf.setup(node=stage.node)


def test_leaves_are_created_and_described_without_ros() -> None:
    program = (
        "import sys; sys.modules['rclpy'] = None\n"
        "from tests.ros.test_leaf_bases import *\n"
        "DriveTo('D', Input(1.0)), Configure('C'), Battery('B')\n"
        "from sar_compiler.cli.compile import main; main(['nodes', 'DriveTo', '--nodes', 'tests.ros.test_leaf_bases'])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "  x: input; a number. required\n" in done.stdout
