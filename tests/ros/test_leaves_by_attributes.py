"""Tests of leaves that need no Python: services, actions, topics and frames given in the tree, against real servers."""

import inspect
import math
import re
import subprocess
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from sar_compiler.loaded_tree import load
from sar_compiler.nodes.ros_fields import read_destinations, read_fields, read_path
from sar_compiler.nodes.ros_leaves import specs
from sar_compiler.nodes.spec import Direction, ParameterRole
from sar_compiler.nodes.values import strip_none
from sar_compiler.ros.leaves import attribute_leaves
from sar_compiler.ros.leaves.leaf import LeafDefinitionError
from sar_compiler.ros.poses import turn_by
from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.ports import Input, Output, PortError
from tests.processes import BIN
from tests.ros.conftest import Ros
from tests.trees import document
from tests.waiting import SILENCE_SEC

pytestmark = pytest.mark.ros
READ: dict[str, Callable[[str], object]] = {
    "request": read_fields,
    "goal": read_fields,
    "message": read_fields,
    "success": read_path,
    "field": read_path,
}
READ |= {"fields": read_destinations, "feedback": read_destinations}
POSE = "geometry_msgs/msg/PoseStamped"


def make_leaf(cls: Any, tag: str, *texts: str, **attributes: Any) -> Any:
    """Make a leaf from the attributes of a tree file: the name of a server or topic first, or two frames."""
    ports = ("request", "goal", "message")
    values = {name: READ[name](each) if name in READ else each for name, each in attributes.items()}
    values = {name: Input(each) if name in ports else each for name, each in values.items()}
    return cls(
        tag,
        Input(texts[0]),
        *(texts[1:] if cls is not attribute_leaves.RosTransform else [Input(texts[1])]),
        **values,
    )


def tick_leaf(leaf: Any) -> Status:
    """Tick a leaf, and return its status."""
    leaf.tick_once()
    status: Status = leaf.status
    return status


def run(ros: Ros, leaf: Any, until: Callable[[], object] | None = None) -> Status:
    """Set a leaf up and tick it until it has ended, or until another condition holds."""
    leaf.setup(node=ros.node("mission"))

    def is_over() -> bool:
        leaf.tick_once()
        return bool(leaf.status is not Status.RUNNING if until is None else until())

    ros.spin_until(is_over, f"the end of {leaf.name}")
    status: Status = leaf.status
    return status


def serve_switch(ros: Ros, *, success: bool = True) -> list[bool]:
    """Serve `switch`; return the list of requested values."""
    from std_srvs.srv import SetBool

    asked: list[bool] = []

    def answer(request: Any, response: Any) -> Any:
        asked.append(request.data)
        response.success, response.message = success, "as you like" if success else "it is locked"
        return response

    ros.node("server").create_service(SetBool, "switch", answer)
    return asked


class TestRosService:
    def leaf(self, **attributes: Any) -> attribute_leaves.RosService:
        leaf: attribute_leaves.RosService = make_leaf(
            attribute_leaves.RosService, "Switch", "switch", "std_srvs/srv/SetBool", **attributes
        )
        return leaf

    def test_request_is_sent_and_response_field_is_written(self, ros: Ros) -> None:
        asked, said = serve_switch(ros), Output[object]()
        assert run(ros, self.leaf(request="data: true", field="message", value=said)) is Status.SUCCESS
        assert (asked, said.value) == ([True], "as you like")

    def test_negative_response_fails_with_reason_if_success_is_given(self, ros: Ros) -> None:
        serve_switch(ros, success=False)
        leaf = self.leaf(success="success")
        assert run(ros, leaf) is Status.FAILURE
        assert leaf.feedback_message == "'Switch': 'switch' reports a failure: it is locked"

    def test_any_response_succeeds_without_success_attribute(self, ros: Ros) -> None:
        serve_switch(ros, success=False)
        assert run(ros, self.leaf()) is Status.SUCCESS

    @pytest.mark.parametrize(
        ("attributes", "said"),
        [
            ({"request": "dat: true"}, "'Switch': there is no field 'dat'; did you mean 'data'?"),
            ({"request": "data: 3"}, "'Switch': data is 3, but must be boolean, true or false"),
            (
                {"request": "{data: {x: 1}}"},
                "'Switch': data is fields (x), but must be boolean, true or false",
            ),
            ({"field": "mesage"}, "'Switch': there is no field 'mesage'; did you mean 'message'?"),
            ({"success": "ok"}, "'Switch': there is no field 'ok'"),
        ],
    )
    def test_invalid_fields_are_reported_without_node_and_in_setup(
        self, ros: Ros, attributes: dict[str, Any], said: str
    ) -> None:
        leaf = self.leaf(**attributes)
        for ask in (leaf.require_definition, lambda: leaf.setup(node=ros.node())):
            with pytest.raises(LeafDefinitionError) as raised:
                ask()
            assert str(raised.value).startswith(said)

    def test_fields_of_negative_response_are_written(self, ros: Ros) -> None:
        serve_switch(ros, success=False)
        text = Output[object]()
        leaf = self.leaf(success="success", field="message", value=text)
        assert run(ros, leaf) is Status.FAILURE
        assert (text.value, leaf.outcome_label) == ("it is locked", "refused")

    def test_missing_server_writes_nothing_and_sets_outcome(self, ros: Ros) -> None:
        text = Output[object]()
        leaf = self.leaf(field="message", value=text, server_timeout_sec=0.0)
        assert run(ros, leaf) is Status.FAILURE
        assert (text.value, leaf.outcome_label) == (None, "no answer")

    def parameters(
        self, ros: Ros, *results: tuple[bool, str], **attributes: Any
    ) -> attribute_leaves.RosService:
        """Return a leaf that sets parameters, and a server that answers with some results."""
        from rcl_interfaces.msg import SetParametersResult
        from rcl_interfaces.srv import SetParameters

        def answer(_: Any, response: Any) -> Any:
            response.results = [SetParametersResult(successful=good, reason=why) for good, why in results]
            return response

        ros.node("server").create_service(SetParameters, "set", answer)
        texts = ("Set", "set", "rcl_interfaces/srv/SetParameters")
        leaf: attribute_leaves.RosService = make_leaf(attribute_leaves.RosService, *texts, **attributes)
        return leaf

    def test_reason_is_read_beside_success_field(self, ros: Ros) -> None:
        leaf = self.parameters(ros, (True, ""), (False, "read only"), success="results[1].successful")
        assert run(ros, leaf) is Status.FAILURE
        assert leaf.feedback_message == "'Set': 'set' reports a failure: read only"

    def test_response_without_success_element_fails(self, ros: Ros) -> None:
        leaf = self.parameters(ros, success="results[0].successful")
        assert run(ros, leaf) is Status.FAILURE
        said = "'Set': 'set' reports a failure: 'results[0]' does not exist: 'results' has 0 values"
        assert (leaf.feedback_message, leaf.outcome_label) == (said, "refused")

    def test_missing_field_fails_and_other_fields_are_written(self, ros: Ros) -> None:
        scope = Scope(Board("test"))
        fields = "results[1].reason: {none}, results[0].reason: {why}"
        leaf = self.parameters(ros, (True, "fine"), fields=fields, scope=scope)
        assert run(ros, leaf) is Status.FAILURE
        said = "'Set' failed: 'results[1].reason' does not exist: 'results' has 1 value"
        assert (leaf.feedback_message, leaf.outcome_label) == (said, "no answer")
        assert (scope.resolve("why").read(), scope.resolve("none").exists) == ("fine", False)

    def test_service_name_and_request_values_come_from_keys(self, ros: Ros) -> None:
        asked, scope = serve_switch(ros), Scope(Board("test"))
        leaf = attribute_leaves.RosService(
            "Switch",
            Input(scope.resolve("service")),
            "std_srvs/srv/SetBool",
            request=Input(read_fields("data: {on}")),
            scope=scope,
        )
        leaf.setup(node=ros.node("mission"))
        scope.resolve("service").write("switch")
        for on in (True, 0):
            scope.resolve("on").write(on)
            leaf.tick_once()
            ros.spin_until(lambda: tick_leaf(leaf) is Status.SUCCESS, "an answer")
        assert asked == [True, False]
        scope.resolve("on").write("perhaps")
        with pytest.raises(PortError, match="request: data is 'perhaps', but must be boolean, true or false"):
            leaf.tick_once()
        scope.resolve("on").remove()
        with pytest.raises(PortError, match=r"request: \{on\}: the key 'on' has no value yet"):
            leaf.tick_once()

    def test_whole_request_comes_from_key_as_message_mapping_or_string(self, ros: Ros) -> None:
        from std_srvs.srv import SetBool, Trigger

        asked, entry = serve_switch(ros), Scope(Board("test")).resolve("request")
        leaf = attribute_leaves.RosService(
            "Switch", Input("switch"), "std_srvs/srv/SetBool", request=Input(entry)
        )
        leaf.setup(node=ros.node("mission"))
        for request in (SetBool.Request(data=True), {"data": False}, "data: true"):
            entry.write(request)
            leaf.tick_once()
            ros.spin_until(lambda: tick_leaf(leaf) is Status.SUCCESS, "an answer")
        assert asked == [True, False, True]
        for wrong in (Trigger.Request(), 5, "data: ["):
            entry.write(wrong)
            with pytest.raises(PortError, match=r"^request: \{request\}: "):
                leaf.tick_once()


@pytest.mark.parametrize(
    ("leaf", "said"),
    [
        ('<RosService service="x" type="std_srvs/srv/SetBol"/>', "did you mean 'std_srvs/srv/SetBool'?"),
        ('<RosAction action="x" type="nav2_msgs/action/NavigateToPose" goal="ps: {}"/>', "no field 'ps'"),
        ('<RosTopic topic="x" type="std_msgs/msg/String" field="date" value="{v}"/>', "did you mean 'data'?"),
    ],
)
def test_run_reports_invalid_leaf_before_waiting_for_server(leaf: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "call.xml").write_text(document(leaf), encoding="utf-8")
    words = (BIN / "sar-run", tmp_path / "call.xml", "--model", "ros:jazzy")
    done = subprocess.run(words, capture_output=True, text=True, timeout=SILENCE_SEC, check=False)
    assert (done.returncode, "Waiting for" in done.stderr) == (2, False)
    assert said in done.stderr


@pytest.mark.parametrize(
    "written",
    ["os/srv/Trigger", "sar_compiler/srv/Trigger", "no_such_msgs/srv/X", "../x/srv/X", "__main__/srv/X", ""],
)
def test_tree_file_can_import_only_interfaces(ros: Ros, written: str) -> None:
    leaf = make_leaf(attribute_leaves.RosService, "Call", "call", written)
    with pytest.raises(
        LeafDefinitionError, match=r"'Call': (there is no interface package '|'.*' is not a ROS type)"
    ):
        leaf.setup(node=ros.node())


@pytest.mark.parametrize(("written", "said"), [("no name", "topic name must not contain"), ("", "''")])
def test_invalid_server_name_is_reported_by_definition_check(written: str, said: str) -> None:
    leaf = make_leaf(attribute_leaves.RosService, "Call", written, "std_srvs/srv/Trigger")
    with pytest.raises(LeafDefinitionError, match=f"'Call': .*{said}") as raised:
        leaf.require_definition()
    assert f"'{written}' is not a valid server or topic name" in str(raised.value)


class TestRosAction:
    TYPE = "nav2_msgs/action/NavigateToPose"

    def server(self, ros: Ros, name: str = "go") -> list[Any]:
        """Serve an action that succeeds if x is above 0, and else aborts; return the list of goals."""
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionServer

        goals: list[Any] = []

        def execute(handle: Any) -> Any:
            goals.append(handle.request)
            handle.publish_feedback(NavigateToPose.Feedback(distance_remaining=1.25))
            (handle.succeed if handle.request.pose.pose.position.x > 0 else handle.abort)()
            return NavigateToPose.Result(error_code=7, error_msg="no path")

        node = ros.node(f"server_of_{name}")
        node.kept = ActionServer(node, NavigateToPose, name, execute)
        return goals

    def leaf(self, x: float, **attributes: Any) -> attribute_leaves.RosAction:
        goal = f"pose: {{header: {{frame_id: map}}, pose: {{position: {{x: {x}}}}}}}"
        leaf: attribute_leaves.RosAction = make_leaf(
            attribute_leaves.RosAction, "Go", "go", self.TYPE, goal=goal, **attributes
        )
        return leaf

    def test_goal_is_sent_and_its_result_ends_leaf(self, ros: Ros) -> None:
        goals, told = self.server(ros), Output[object]()
        leaf = self.leaf(2, field="error_code", value=told)
        assert run(ros, leaf) is Status.SUCCESS
        assert (goals[0].pose.header.frame_id, goals[0].pose.pose.position.x) == ("map", 2.0)
        assert (told.value, leaf.outcome_label) == (7, "succeeded")

    def test_result_of_aborted_goal_is_written_and_error_is_reported(self, ros: Ros) -> None:
        self.server(ros)
        scope = Scope(Board("test"))
        leaf = self.leaf(-2.5, fields="error_code: {code}, error_msg: {text}", scope=scope)
        assert run(ros, leaf) is Status.FAILURE
        assert (scope.resolve("code").read(), scope.resolve("text").read()) == (7, "no path")
        assert leaf.outcome_label == "aborted"
        assert leaf.feedback_message == "'Go' failed: 'go': aborted (status 6): error_code 7: no path"

    def test_missing_result_writes_nothing_and_sets_outcome(self, ros: Ros) -> None:
        code = Output[object]()
        leaf = self.leaf(1, field="error_code", value=code, server_timeout_sec=0.0)
        assert run(ros, leaf) is Status.FAILURE
        assert (code.value, leaf.outcome_label) == (None, "no result")

    def test_whole_result_is_written_as_message(self, ros: Ros) -> None:
        self.server(ros)
        whole: Any = Output()
        run(ros, self.leaf(-1, value=whole))
        assert (type(whole.value).__name__, whole.value.error_msg) == ("NavigateToPose_Result", "no path")

    def test_feedback_is_written_while_goal_is_active(self, ros: Ros) -> None:
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionServer
        from rclpy.task import Future

        async def execute(handle: Any) -> Any:
            feedback = NavigateToPose.Feedback(distance_remaining=1.25)
            timer = node.create_timer(0.02, lambda: handle.publish_feedback(feedback))
            await is_seen
            timer.cancel()
            handle.succeed()
            return NavigateToPose.Result()

        node, scope, is_seen = ros.node("server"), Scope(Board("test")), Future()
        node.kept = ActionServer(node, NavigateToPose, "go", execute)
        leaf = self.leaf(2, feedback="distance_remaining: {left}", scope=scope)
        left = scope.resolve("left")
        run(ros, leaf, lambda: left.exists)
        assert (left.read(), leaf.status) == (1.25, Status.RUNNING)
        is_seen.set_result(None)
        ros.spin_until(lambda: tick_leaf(leaf) is Status.SUCCESS, "the end of the goal")

    def test_goal_is_sent_to_server_named_by_key_on_entry(self, ros: Ros) -> None:
        first, second = self.server(ros, "first"), self.server(ros, "second")
        action = Scope(Board("test")).resolve("where")
        leaf = attribute_leaves.RosAction(
            "Go", Input(action), self.TYPE, goal=Input(read_fields("behavior_tree: x"))
        )
        mission = ros.node("mission")
        leaf.setup(node=mission)
        for name in ("first", "second", "first"):
            action.write(name)
            leaf.tick_once()
            ros.spin_until(lambda: tick_leaf(leaf) is not Status.RUNNING, f"an end on {name}")
        assert (len(first), len(second)) == (2, 1)
        action.write("no name")
        with pytest.raises(
            PortError, match=r"action: \{where\}: 'no name' is not a valid server or topic name"
        ):
            leaf.tick_once()
        assert list(mission.clients)
        leaf.shutdown()
        assert list(mission.clients) == []


class TestRosPublish:
    def leaf(self, **attributes: Any) -> attribute_leaves.RosPublish:
        texts = ("Say", "said", "std_msgs/msg/String")
        leaf: attribute_leaves.RosPublish = make_leaf(attribute_leaves.RosPublish, *texts, **attributes)
        return leaf

    def listen(self, ros: Ros, qos: Any = 10) -> list[str]:
        from std_msgs.msg import String

        heard: list[str] = []
        ros.node(f"listener_{len(ros.executor.get_nodes())}").create_subscription(
            String, "said", lambda message: heard.append(message.data), qos
        )
        return heard

    def test_leaf_waits_for_subscriber_and_publishes_once(self, ros: Ros) -> None:
        leaf = self.leaf(message="data: hello", timeout_sec=1000.0)
        leaf.setup(node=ros.node("mission"))
        leaf.tick_once()
        assert (leaf.status, leaf.feedback_message) == (Status.RUNNING, "waiting for a subscriber of '/said'")
        heard = self.listen(ros)
        ros.spin_until(lambda: tick_leaf(leaf) is Status.SUCCESS, "the publishing")
        ros.spin_until(lambda: heard, "the message")
        assert heard == ["hello"]

    def test_leaf_without_subscriber_fails_after_timeout_unless_waits_is_off(self, ros: Ros) -> None:
        leaf = self.leaf(timeout_sec=0.0)
        assert run(ros, leaf) is Status.FAILURE
        assert leaf.feedback_message == "'Say': no subscriber of '/said' within 0 s"
        assert run(ros, self.leaf(waits=False)) is Status.SUCCESS

    @pytest.mark.parametrize(
        ("kind", "durability", "why"),
        [
            ("String", "volatile", 'no message reaches /listener (best effort publisher and reliable subscription). Write qos="reliable"'),
            ("String", "transient_local", 'no message reaches /listener (best effort publisher and reliable subscription, volatile publisher and transient local subscription). Write qos="transient_local"'),
            ("Int8", "volatile", "subscribed as std_msgs/msg/Int8, but must be std_msgs/msg/String"),
        ],
    )  # fmt: skip
    def test_incompatible_subscriber_is_named_with_reason(
        self, ros: Ros, make_ros: Callable[[], Ros], kind: str, durability: str, why: str
    ) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from std_msgs import msg

        qos = QoSProfile(depth=1, durability=DurabilityPolicy.get_from_short_key(durability))
        make_ros().node("listener").create_subscription(getattr(msg, kind), "said", print, qos)
        leaf = self.leaf(qos="sensor_data", timeout_sec=0.0)
        leaf.setup(node=ros.node("mission"))
        said = f"'Say': no subscriber of '/said' within 0 s: {why}"
        ros.spin_until(lambda: tick_leaf(leaf) and leaf.feedback_message == said, said)

    def test_late_subscriber_receives_latched_message_of_last_leaf(self, ros: Ros) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile

        node = ros.node("mission")
        for text in ("first", "second"):
            leaf = self.leaf(message=f"data: {text}", qos="transient_local")
            leaf.setup(node=node)
            leaf.tick_once()
            assert leaf.status is Status.SUCCESS
        heard = self.listen(ros, QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        ros.spin_until(lambda: heard, "the latched message")
        assert heard == ["second"]

    def test_now_is_time_of_node_clock(self, ros: Ros) -> None:
        from std_msgs.msg import Header

        heard: list[Any] = []
        node = ros.node("mission")
        node.create_subscription(Header, "stamped", heard.append, 10)
        leaf = make_leaf(
            attribute_leaves.RosPublish, "Say", "stamped", "std_msgs/msg/Header", message="stamp: now"
        )
        before = node.get_clock().now().nanoseconds
        leaf.setup(node=node)
        ros.spin_until(lambda: tick_leaf(leaf) and heard, "the message")
        stamp = heard[0].stamp.sec * 10**9 + heard[0].stamp.nanosec
        assert before <= stamp <= node.get_clock().now().nanoseconds


class TestRosTopic:
    def test_field_of_latest_message_is_written(self, ros: Ros) -> None:
        from geometry_msgs.msg import PoseStamped

        publisher = ros.node("source").create_publisher(PoseStamped, "place", 1)
        at = Output[object]()
        leaf = make_leaf(
            attribute_leaves.RosTopic, "Place", "place", POSE, field="pose.position.x", value=at, waits=True
        )

        def is_written() -> bool:
            message = PoseStamped()
            message.pose.position.x = 3.5
            publisher.publish(message)
            return at.value is not None

        assert run(ros, leaf, is_written) is Status.SUCCESS
        assert at.value == 3.5

    @pytest.mark.parametrize(("waits", "status"), [(True, Status.RUNNING), (False, Status.FAILURE)])
    def test_leaf_without_message_runs_only_if_waits_is_set(
        self, ros: Ros, waits: bool, status: Status
    ) -> None:
        leaf = make_leaf(attribute_leaves.RosTopic, "Place", "place", POSE, waits=waits)
        assert run(ros, leaf, lambda: True) is status

    def test_invalid_field_is_reported_in_setup(self, ros: Ros) -> None:
        with pytest.raises(LeafDefinitionError) as raised:
            make_leaf(attribute_leaves.RosTopic, "Place", "place", POSE, field="pose.positon.x").setup(
                node=ros.node()
            )
        assert str(raised.value) == "'Place': there is no field 'pose.positon.x'; did you mean 'position'?"

    def test_field_missing_in_message_fails(self, ros: Ros) -> None:
        from sensor_msgs.msg import BatteryState

        publisher = ros.node("source").create_publisher(BatteryState, "battery", 1)
        texts = ("Cells", "battery", "sensor_msgs/msg/BatteryState")
        leaf = make_leaf(
            attribute_leaves.RosTopic, *texts, field="cell_voltage[2]", value=Output[object](), waits=True
        )

        def is_over() -> bool:
            publisher.publish(BatteryState(cell_voltage=[3.5]))
            return leaf.status not in (Status.RUNNING, Status.INVALID)

        assert run(ros, leaf, is_over) is Status.FAILURE
        said = "'Cells': 'cell_voltage[2]' does not exist: 'cell_voltage' has 1 value"
        assert leaf.feedback_message == said

    def test_topic_name_comes_from_key_on_each_entry(self, ros: Ros) -> None:
        from std_msgs.msg import String

        node, scope, said = ros.node("source"), Scope(Board("test")), Output[object]()
        topic = scope.resolve("topic")
        leaf = attribute_leaves.RosTopic(
            "Said", Input(topic), "std_msgs/msg/String", field=read_path("data"), value=said, waits=True
        )
        leaf.setup(node=ros.node("mission"))
        for name in ("first", "second"):
            topic.write(name)
            publisher = node.create_publisher(String, name, 1)

            def is_heard(publisher: Any = publisher, name: str = name) -> bool:
                publisher.publish(String(data=f"on {name}"))
                leaf.tick_once()
                return leaf.status is Status.SUCCESS

            ros.spin_until(is_heard, f"a message on {name}")
            assert said.value == f"on {name}"
        topic.write("no name")
        with pytest.raises(
            PortError,
            match=r"topic: \{topic\}: 'no name' is not a valid server or topic name: topic name must not",
        ):
            leaf.tick_once()


class TestRosTransform:
    def send(
        self,
        ros: Ros,
        *links: tuple[str, str, tuple[float, float, float]],
        ago_sec: float = 0.0,
        static: bool = False,
    ) -> None:
        """Publish transforms of a parent and a child, with x and y (m) and yaw (rad)."""
        from geometry_msgs.msg import TransformStamped
        from rclpy.duration import Duration
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from tf2_msgs.msg import TFMessage

        node = ros.node(f"broadcaster_{len(ros.executor.get_nodes())}")
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        topic = "/tf_static" if static else "/tf"
        publisher = node.create_publisher(TFMessage, topic, latched if static else 100)
        message = TFMessage()
        for parent, child, (x, y, yaw) in links:
            each = TransformStamped(child_frame_id=child)
            each.header.frame_id = parent
            each.transform.translation.x, each.transform.translation.y = x, y
            turn_by(each.transform.rotation, yaw)
            message.transforms.append(each)

        def publish() -> None:
            stamp = (node.get_clock().now() - Duration(seconds=ago_sec)).to_msg()
            for each in message.transforms:
                each.header.stamp = stamp
            publisher.publish(message)

        publish()
        if not static:
            node.create_timer(0.02, publish)

    def leaf(
        self, target: str = "map", source: str = "camera", **attributes: Any
    ) -> attribute_leaves.RosTransform:
        leaf: attribute_leaves.RosTransform = make_leaf(
            attribute_leaves.RosTransform, "Where", target, source, **attributes
        )
        return leaf

    def test_pose_across_intermediate_frames_is_written(self, ros: Ros) -> None:
        self.send(ros, ("base_link", "camera", (0.5, 0.0, 0.0)), static=True, ago_sec=1000.0)
        self.send(ros, ("map", "odom", (10.0, 0.0, math.pi / 2)))
        self.send(ros, ("odom", "base_link", (2.0, 1.0, 0.0)))
        ports: dict[str, Any] = {p: Output[float]() for p in ("x", "y", "z", "yaw", "qx", "qy", "qz", "qw")}
        assert run(ros, self.leaf(**ports)) is Status.SUCCESS
        half = math.sqrt(0.5)
        assert [each.value for each in ports.values()] == pytest.approx(
            [9.0, 2.5, 0.0, math.pi / 2, 0.0, 0.0, half, half]
        )

    def test_inverse_and_sibling_transforms_are_found(self, ros: Ros) -> None:
        self.send(ros, ("base", "left", (0.0, 1.0, math.pi)), ("base", "right", (0.0, -1.0, 0.0)))
        x, y = Output[float](), Output[float]()
        assert run(ros, self.leaf("left", "base", x=x, y=y)) is Status.SUCCESS
        assert (x.value, y.value) == pytest.approx((0.0, 1.0))
        assert run(ros, self.leaf("left", "/right", x=x, y=y)) is Status.SUCCESS
        assert (x.value, y.value) == pytest.approx((0.0, 2.0))

    def test_leaf_runs_until_transform_arrives_and_wakes_tree(self, ros: Ros) -> None:
        leaf, asked = self.leaf(timeout_sec=1000.0), list[bool]()
        leaf.setup(node=ros.node("mission"), wake=lambda: asked.append(True))
        leaf.tick_once()
        assert (leaf.status, leaf.feedback_message) == (
            Status.RUNNING,
            "no transform of 'map' and 'camera' has arrived, because no node publishes on /tf",
        )
        self.send(ros, ("map", "odom", (0.0, 0.0, 0.0)))
        self.send(ros, ("odom", "camera", (0.0, 0.0, 0.0)))
        ros.spin_until(lambda: asked, "a request for a tick")
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS

    @pytest.mark.parametrize(
        ("link", "ago_sec", "said"),
        [
            (("map", "camera", (1.0, 0.0, 0.0)), 100.0, r"the transforms are 10\d\.\d s old, but may be at most 5 s"),
            (("map", "odom", (1.0, 0.0, 0.0)), 0.0, "no transform of 'camera' has arrived, but there are 'map' and 'odom'"),
            (("odom", "camera", (1.0, 0.0, 0.0)), 0.0, "no transform of 'map' has arrived, but there are 'camera' and 'odom'"),
            (("map", "camera", (math.nan, 0.0, 0.0)), 0.0, "no transform of 'map' and 'camera' has arrived"),
        ],
    )  # fmt: skip
    def test_leaf_fails_with_reason_after_timeout(
        self, ros: Ros, link: Any, ago_sec: float, said: str
    ) -> None:
        self.send(ros, link, ago_sec=ago_sec)
        leaf = self.leaf(timeout_sec=1000.0)
        run(ros, leaf, lambda: re.fullmatch(said, leaf.feedback_message))
        leaf.stop(Status.INVALID)
        leaf.timeout_sec = 0.0
        leaf.tick_once()
        assert leaf.status is Status.FAILURE
        whole = f"'Where': the pose of 'camera' in 'map' is still unknown after 0 s: {said}"
        assert re.fullmatch(whole, leaf.feedback_message)

    def test_unconnected_frames_are_reported_with_their_roots(self, ros: Ros) -> None:
        self.send(ros, ("map", "odom", (0.0, 0.0, 0.0)), ("base", "camera", (0.0, 0.0, 0.0)))
        leaf = self.leaf("odom", "camera", timeout_sec=1000.0)
        said = "the frames have different roots, 'base' and 'map', and no transform connects the two roots"
        run(ros, leaf, lambda: leaf.feedback_message == said)


TREE = """<root BTCPP_format="4"><BehaviorTree ID="Door"><Sequence name="Main" memory="true">
<RosTopic topic="battery_state" type="sensor_msgs/msg/BatteryState" field="percentage" value="{battery}" waits="true"/>
<RosService service="door/open" type="std_srvs/srv/SetBool" request="data: true" success="success"/>
<RosAction action="dock" type="nav2_msgs/action/NavigateToPose"/>
<RosTransform target_frame="map" source_frame="base_link" x="{x}" yaw="{yaw}"/>
<RosPublish topic="door/opened" type="std_msgs/msg/String" message="data: at {x}"/>
</Sequence></BehaviorTree></root>"""


def test_palette_builds_tree_of_ros_leaves_with_declared_uses(tmp_path: Path) -> None:
    (tmp_path / "door.xml").write_text(TREE, encoding="utf-8")
    compiled = load(tmp_path / "door.xml", models=["ros:jazzy"]).compile()
    assert sorted((use.kind, use.name) for use in compiled.uses()) == [
        ("action", "dock"),
        ("service", "door/open"),
        ("topic", "battery_state"),
        ("transforms", ""),
    ]
    tags = [
        type(each).__name__
        for each in compiled.root.iterate()
        if type(each).__module__ == attribute_leaves.__name__
    ]
    assert sorted(tags) == sorted(spec.tag for spec in specs("jazzy"))


def parameters(spec: Any) -> dict[str, tuple[bool, object]]:
    """Return for each declared parameter of the constructor whether it is an input port, and its default."""
    return {
        each.keyword or each.name: (each.direction is Direction.INPUT, ... if each.required else each.default)
        for each in spec.parameters.values()
        if each.role is not ParameterRole.NAME
    }


@pytest.mark.parametrize("spec", specs("jazzy"), ids=lambda spec: spec.tag)
def test_constructor_parameters_match_declaration(spec: Any) -> None:
    takes = list(inspect.signature(spec.cls.__init__).parameters.values())[2:]
    hints = typing.get_type_hints(spec.cls.__init__)
    found = {}
    for each in takes:
        default = ... if each.default is each.empty else each.default
        is_input = typing.get_origin(strip_none(hints[each.name])) is Input
        found[each.name] = is_input, default.get() if isinstance(default, Input) else default
    assert found == parameters(spec)


def test_journal_why_quotes_error_of_aborted_goal(ros: Ros, tmp_path: Path) -> None:
    from nav2_msgs.action import ComputePathToPose
    from rclpy.action import ActionServer

    def execute(handle: Any) -> Any:
        handle.abort()
        return ComputePathToPose.Result(error_code=208, error_msg="walled in")

    node = ros.node("planner")
    node.kept = ActionServer(node, ComputePathToPose, "plan", execute)
    leaf = '<RosAction action="plan" type="nav2_msgs/action/ComputePathToPose"/>'
    (tmp_path / "plan.xml").write_text(document(leaf), encoding="utf-8")
    words = (
        BIN / "sar-run",
        tmp_path / "plan.xml",
        "--model",
        "ros:jazzy",
        "--journal",
        tmp_path / "journal.db",
    )
    done = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    ros.spin_until(lambda: done.poll() is not None, "the end of the run")
    why = subprocess.run(
        (BIN / "sar-journal", "why", tmp_path / "journal.db"), capture_output=True, text=True, check=False
    )
    said = "RosAction FAILURE (aborted), 'RosAction' failed: 'plan': aborted (status 6): error_code 208 (NO_VALID_PATH): walled in"
    assert said in why.stdout
