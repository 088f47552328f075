"""Leaves that need no Python: a service, an action, a topic and frames that stand in the tree, against real servers."""

import math
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from sar_compiler.nodes.ros_leaves import specs
from sar_compiler.project import load
from sar_compiler.ros.leaves import by_attributes
from sar_compiler.ros.leaves.leaf import LeafDefinitionError
from sar_compiler.ros.poses import turn_by
from sar_compiler.runtime.ports import Output
from tests.processes import BIN
from tests.ros.conftest import Ros
from tests.trees import document
from tests.waiting import SILENCE_SEC

pytestmark = pytest.mark.ros
POSE = "geometry_msgs/msg/PoseStamped"


def run(ros: Ros, leaf: Any, until: Callable[[], object] | None = None) -> Status:
    """Set a leaf up and tick it until it has ended, or something else is so."""
    leaf.setup(node=ros.node("mission"))

    def is_over() -> bool:
        leaf.tick_once()
        return bool(leaf.status is not Status.RUNNING if until is None else until())

    ros.spin_until(is_over, f"the end of {leaf.name}")
    status: Status = leaf.status
    return status


def switch(ros: Ros, *, success: bool = True) -> list[bool]:
    """Serve `switch`; return what was asked for."""
    from std_srvs.srv import SetBool

    asked: list[bool] = []

    def answer(request: Any, response: Any) -> Any:
        asked.append(request.data)
        response.success, response.message = success, "as you like" if success else "it is locked"
        return response

    ros.node("server").create_service(SetBool, "switch", answer)
    return asked


class TestRosService:
    def leaf(self, **attributes: Any) -> by_attributes.RosService:
        return by_attributes.RosService("Switch", "switch", "std_srvs/srv/SetBool", **attributes)

    def test_the_request_is_what_the_tree_says_and_a_field_of_the_answer_is_written(self, ros: Ros) -> None:
        asked, said = switch(ros), Output[object]()
        assert run(ros, self.leaf(request="data: true", field="message", value=said)) is Status.SUCCESS
        assert (asked, said.value) == ([True], "as you like")

    def test_an_answer_that_says_no_is_a_failure_with_its_reason_where_the_tree_asks_for_that(
        self, ros: Ros
    ) -> None:
        switch(ros, success=False)
        leaf = self.leaf(success="success")
        assert run(ros, leaf) is Status.FAILURE
        assert leaf.feedback_message == "'Switch': 'switch' says no: it is locked"

    def test_else_any_answer_is_a_success(self, ros: Ros) -> None:
        switch(ros, success=False)
        assert run(ros, self.leaf()) is Status.SUCCESS

    @pytest.mark.parametrize(
        ("attributes", "said"),
        [
            ({"request": "dat: true"}, "'Switch': there is no field 'dat'; did you mean 'data'?"),
            ({"request": "data: 3"}, "'Switch': data is 3, and must be boolean"),
            ({"request": "{data: {x: 1}}"}, "'Switch': data is {'x': 1}, and must be boolean"),
            ({"request": "data: ["}, "'Switch': 'data: [' is no YAML"),
            ({"field": "mesage"}, "'Switch': there is no field 'mesage'; did you mean 'message'?"),
            ({"success": "ok"}, "'Switch': there is no field 'ok'"),
        ],
    )
    def test_a_mistake_in_the_fields_is_told_without_a_node_and_when_it_is_set_up(
        self, ros: Ros, attributes: dict[str, Any], said: str
    ) -> None:
        leaf = self.leaf(**attributes)
        for ask in (leaf.require_definition, lambda: leaf.setup(node=ros.node())):
            with pytest.raises(LeafDefinitionError) as raised:
                ask()
            assert str(raised.value).startswith(said)


@pytest.mark.parametrize(
    ("leaf", "said"),
    [
        ('<RosService service="x" type="std_srvs/srv/SetBol"/>', "did you mean 'std_srvs/srv/SetBool'?"),
        ('<RosAction action="x" type="nav2_msgs/action/NavigateToPose" goal="ps: {}"/>', "no field 'ps'"),
        ('<RosTopic topic="x" type="std_msgs/msg/String" field="date" value="{v}"/>', "did you mean 'data'?"),
    ],
)
def test_a_run_tells_a_mistake_before_it_waits_for_a_server_that_nobody_has(
    leaf: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / "call.xml").write_text(document(leaf), encoding="utf-8")
    words = (BIN / "sar-run", tmp_path / "call.xml", "--model", "ros:jazzy")
    done = subprocess.run(words, capture_output=True, text=True, timeout=SILENCE_SEC, check=False)
    assert (done.returncode, "Waiting for" in done.stderr) == (2, False)
    assert said in done.stderr


@pytest.mark.parametrize(
    "written",
    ["os/srv/Trigger", "sar_compiler/srv/Trigger", "no_such_msgs/srv/X", "../x/srv/X", "__main__/srv/X", ""],
)
def test_a_file_has_nothing_imported_but_interfaces(ros: Ros, written: str) -> None:
    leaf = by_attributes.RosService("Call", "call", written)
    with pytest.raises(LeafDefinitionError, match="'Call': no package of interfaces is called '"):
        leaf.setup(node=ros.node())


class TestRosAction:
    def test_the_goal_is_what_the_tree_says_and_its_end_is_the_leafs(self, ros: Ros) -> None:
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionServer

        goals: list[Any] = []

        def execute(handle: Any) -> Any:
            goals.append(handle.request)
            (handle.succeed if handle.request.pose.pose.position.x > 0 else handle.abort)()
            return NavigateToPose.Result(error_code=7)

        server = ActionServer(ros.node("server"), NavigateToPose, "go", execute)
        told = Output[object]()

        def leaf(x: float) -> by_attributes.RosAction:
            goal = f"pose: {{header: {{frame_id: map}}, pose: {{position: {{x: {x}}}}}}}"
            kind = "nav2_msgs/action/NavigateToPose"
            return by_attributes.RosAction("Go", "go", kind, goal=goal, field="error_code", value=told)

        assert run(ros, leaf(2)) is Status.SUCCESS
        assert (goals[0].pose.header.frame_id, goals[0].pose.pose.position.x) == ("map", 2.0)
        assert told.value == 7
        assert run(ros, leaf(-2.5)) is Status.FAILURE
        server.destroy()


class TestRosTopic:
    def test_a_field_of_the_latest_message_is_written(self, ros: Ros) -> None:
        from geometry_msgs.msg import PoseStamped

        publisher = ros.node("source").create_publisher(PoseStamped, "place", 1)
        at = Output[object]()
        leaf = by_attributes.RosTopic("Place", "place", POSE, field="pose.position.x", value=at, waits=True)

        def is_written() -> bool:
            message = PoseStamped()
            message.pose.position.x = 3.5
            publisher.publish(message)
            return at.value is not None

        assert run(ros, leaf, is_written) is Status.SUCCESS
        assert at.value == 3.5

    @pytest.mark.parametrize(("waits", "status"), [(True, Status.RUNNING), (False, Status.FAILURE)])
    def test_without_a_message_it_waits_only_if_it_is_to(self, ros: Ros, waits: bool, status: Status) -> None:
        leaf = by_attributes.RosTopic("Place", "place", POSE, waits=waits)
        assert run(ros, leaf, lambda: True) is status

    @pytest.mark.parametrize(
        ("field", "said"),
        [
            ("pose.position", "'Place': 'pose.position' has fields of its own: write one of them, such as pose.position.x"),
            ("pose.positon.x", "'Place': there is no field 'pose.positon.x'; did you mean 'position'?"),
        ],
    )  # fmt: skip
    def test_a_field_that_is_none_is_told_before_the_first_tick(
        self, ros: Ros, field: str, said: str
    ) -> None:
        with pytest.raises(LeafDefinitionError) as raised:
            by_attributes.RosTopic("Place", "place", POSE, field=field).setup(node=ros.node())
        assert str(raised.value) == said


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
    ) -> by_attributes.RosTransform:
        return by_attributes.RosTransform("Where", target, source, **attributes)

    def test_where_a_frame_is_goes_through_all_between_and_is_written(self, ros: Ros) -> None:
        self.send(ros, ("base_link", "camera", (0.5, 0.0, 0.0)), static=True, ago_sec=1000.0)
        self.send(ros, ("map", "odom", (10.0, 0.0, math.pi / 2)))
        self.send(ros, ("odom", "base_link", (2.0, 1.0, 0.0)))
        ports: dict[str, Any] = {p: Output[float]() for p in ("x", "y", "z", "yaw", "qx", "qy", "qz", "qw")}
        assert run(ros, self.leaf(**ports)) is Status.SUCCESS
        half = math.sqrt(0.5)
        assert [each.value for each in ports.values()] == pytest.approx(
            [9.0, 2.5, 0.0, math.pi / 2, 0.0, 0.0, half, half]
        )

    def test_it_is_told_backwards_and_between_branches_as_well(self, ros: Ros) -> None:
        self.send(ros, ("base", "left", (0.0, 1.0, math.pi)), ("base", "right", (0.0, -1.0, 0.0)))
        x, y = Output[float](), Output[float]()
        assert run(ros, self.leaf("left", "base", x=x, y=y)) is Status.SUCCESS
        assert (x.value, y.value) == pytest.approx((0.0, 1.0))
        assert run(ros, self.leaf("left", "/right", x=x, y=y)) is Status.SUCCESS
        assert (x.value, y.value) == pytest.approx((0.0, 2.0))

    def test_it_runs_until_there_is_one_which_asks_for_a_tick(self, ros: Ros) -> None:
        leaf, asked = self.leaf(timeout_sec=1000.0), list[bool]()
        leaf.setup(node=ros.node("mission"), wake=lambda: asked.append(True))
        leaf.tick_once()
        assert (leaf.status, leaf.feedback_message) == (
            Status.RUNNING,
            "no transform of 'map' and 'camera' has come; no node publishes on /tf",
        )
        self.send(ros, ("map", "odom", (0.0, 0.0, 0.0)))
        self.send(ros, ("odom", "camera", (0.0, 0.0, 0.0)))
        ros.spin_until(lambda: asked, "a request for a tick")
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS

    @pytest.mark.parametrize(
        ("link", "ago_sec", "said"),
        [
            (("map", "camera", (1.0, 0.0, 0.0)), 100.0, r"the transforms are 10\d\.\d s old, and may be 5 s"),
            (("map", "odom", (1.0, 0.0, 0.0)), 0.0, "no transform of 'camera' has come; there are 'map' and 'odom'"),
            (("odom", "camera", (1.0, 0.0, 0.0)), 0.0, "no transform of 'map' has come; there are 'camera' and 'odom'"),
            (("map", "camera", (math.nan, 0.0, 0.0)), 0.0, "no transform of 'map' and 'camera' has come"),
        ],
    )  # fmt: skip
    def test_after_the_time_out_it_fails_with_the_reason(
        self, ros: Ros, link: Any, ago_sec: float, said: str
    ) -> None:
        self.send(ros, link, ago_sec=ago_sec)
        leaf = self.leaf(timeout_sec=1000.0)
        run(ros, leaf, lambda: re.fullmatch(said, leaf.feedback_message))
        leaf.stop(Status.INVALID)
        leaf.timeout_sec = 0.0
        leaf.tick_once()
        assert leaf.status is Status.FAILURE
        whole = f"'Where': where 'camera' is in 'map' is not known within 0 s: {said}"
        assert re.fullmatch(whole, leaf.feedback_message)

    def test_frames_that_do_not_hang_together_are_named_by_what_is_above_them(self, ros: Ros) -> None:
        self.send(ros, ("map", "odom", (0.0, 0.0, 0.0)), ("base", "camera", (0.0, 0.0, 0.0)))
        leaf = self.leaf("odom", "camera", timeout_sec=1000.0)
        said = "'base' and 'map', above them, are not connected"
        run(ros, leaf, lambda: leaf.feedback_message == said)


def test_numbers_and_lists_are_plain_values() -> None:
    from sensor_msgs.msg import BatteryState

    message = by_attributes.filled("X", BatteryState(), "percentage: 1, cell_voltage: [3.5, 3.0]")
    assert by_attributes.field_of("X", message, "percentage") == 1.0
    assert list(by_attributes.field_of("X", message, "cell_voltage")) == [3.5, 3.0]  # type: ignore[call-overload]


TREE = """<root BTCPP_format="4"><BehaviorTree ID="Door"><Sequence name="Main" memory="true">
<RosTopic topic="battery_state" type="sensor_msgs/msg/BatteryState" field="percentage" value="{battery}" waits="true"/>
<RosService service="door/open" type="std_srvs/srv/SetBool" request="data: true" success="success"/>
<RosAction action="dock" type="nav2_msgs/action/NavigateToPose"/>
<RosTransform target_frame="map" source_frame="base_link" x="{x}" yaw="{yaw}"/>
</Sequence></BehaviorTree></root>"""


def test_a_tree_of_such_leaves_is_made_by_the_palette_and_says_what_it_uses(tmp_path: Path) -> None:
    (tmp_path / "door.xml").write_text(TREE, encoding="utf-8")
    compiled = load(tmp_path / "door.xml", models=["ros:jazzy"]).compile()
    assert sorted((use.kind, use.name) for use in compiled.uses()) == [
        ("action", "dock"),
        ("service", "door/open"),
        ("topic", "battery_state"),
    ]
    tags = [
        type(each).__name__
        for each in compiled.root.iterate()
        if type(each).__module__ == by_attributes.__name__
    ]
    assert sorted(tags) == sorted(spec.tag for spec in specs("jazzy"))
