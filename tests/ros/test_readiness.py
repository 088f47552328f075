"""Tests of the wait before the first tick."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest

from sar_compiler.nodes.spec import Use
from tests.waiting import SILENCE_SEC, Stopwatch

if TYPE_CHECKING:
    from collections.abc import Callable

    from sar_compiler.ros.readiness import Readiness
    from tests.ros.conftest import Ros, Said

pytestmark = pytest.mark.ros


class FakeNav2:
    """The two lifecycle nodes, and a localisation that confirms an initial pose."""

    def __init__(
        self, node: Any, *, states: tuple[str, str] = ("active", "active"), deaf: bool = False
    ) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from lifecycle_msgs.srv import GetState
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self.node = node
        self.states = dict(zip(("amcl", "bt_navigator"), states, strict=True))
        self.answers = True
        self.asked: set[str] = set()
        self.poses: list[Any] = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.publisher = node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched)
        if not deaf:
            node.create_subscription(
                PoseWithCovarianceStamped, "initialpose", self.on_pose, QoSProfile(depth=1)
            )
        for name in self.states:
            node.create_service(GetState, f"{name}/get_state", self.state_of(name))

    def on_pose(self, pose: Any) -> None:
        self.poses.append(pose)
        if self.answers:
            self.publisher.publish(pose)

    def state_of(self, name: str) -> Callable[[Any, Any], Any]:
        def answer(_: Any, response: Any) -> Any:
            self.asked.add(name)
            response.current_state.label = self.states[name]
            return response

        return answer


def log_as_node(ros: Ros, name: str, text: str, level: str = "ERROR") -> None:
    """Log a line as a node of Nav2."""
    from rcl_interfaces.msg import Log
    from rclpy.qos import DurabilityPolicy, QoSProfile

    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    rosout = ros.node("other_log").create_publisher(Log, "/rosout", latched)
    rosout.publish(Log(level=getattr(Log, level), name=name, msg=text))


def pose_message(x: float, y: float) -> Any:
    """Return a pose message of a localisation."""
    from geometry_msgs.msg import PoseWithCovarianceStamped

    message = PoseWithCovarianceStamped()
    message.header.frame_id = "map"
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.w = 1.0
    return message


def robot_of(node: Any) -> Any:
    from sar_compiler.ros.robot_estimate import robot_estimate

    return robot_estimate(node)


def readiness(
    node: Any, *uses: Use, initial_pose: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
) -> Readiness:
    from sar_compiler.ros.readiness import Readiness

    return Readiness(node, uses, initial_pose=initial_pose)


def wait(ros: Ros, ready: Readiness, timeout_sec: float = SILENCE_SEC) -> None:
    from sar_compiler.ros.readiness import wait_until_ready

    wait_until_ready(ros.executor, ready, timeout_sec, lambda: False)


def missing(ros: Ros, ready: Readiness, timeout_sec: float = 0.3) -> list[str]:
    from sar_compiler.ros.readiness import NotReadyError

    with pytest.raises(NotReadyError) as caught:
        wait(ros, ready, timeout_sec)
    assert all(line in str(caught.value) for line in caught.value.missing)
    return caught.value.missing


def expect_missing(ros: Ros, ready: Readiness, *lines: str) -> None:
    """Spin until exactly these lines are reported as missing."""
    last: list[str] = []

    def just_this() -> bool:
        ready.poll()
        last[:] = ready.poll_all()
        return last == list(lines)

    try:
        ros.spin_until(just_this, "what is missing")
    except AssertionError as error:
        pytest.fail(f"{error}: {lines}; there was {last}")
    ready.close()


def detector(node: Any, name: str = "detect_survivor") -> None:
    from sar_interfaces.srv import DetectSurvivor

    node.create_service(DetectSurvivor, name, lambda _, response: response)


def navigator(node: Any, name: str = "navigate_to_pose") -> Any:
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionServer

    return ActionServer(node, NavigateToPose, name, lambda _: NavigateToPose.Result())


class TestServers:
    def test_tree_without_uses_is_ready_at_once(self, ros: Ros) -> None:
        assert readiness(ros.node()).poll()

    def test_service_without_server_is_named(self, ros: Ros) -> None:
        assert missing(ros, readiness(ros.node(), Use.service("detect_survivor"))) == [
            "service detect_survivor: no server"
        ]

    def test_action_without_server_is_named(self, ros: Ros) -> None:
        assert missing(ros, readiness(ros.node(), Use.action("navigate_to_pose"))) == [
            "action navigate_to_pose: no server"
        ]

    def test_topic_without_publisher_is_named(self, ros: Ros) -> None:
        assert missing(ros, readiness(ros.node(), Use.topic("odometry/filtered"))) == [
            "topic odometry/filtered: no publisher"
        ]

    def test_missing_endpoints_are_named_once(self, ros: Ros) -> None:
        uses = [Use.service("a"), Use.service("b"), Use.service("a")]
        assert missing(ros, readiness(ros.node(), *uses)) == ["service a: no server", "service b: no server"]

    def test_tree_is_ready_with_servers_and_publishers(self, ros: Ros) -> None:
        from nav_msgs.msg import Odometry

        other = ros.node("other")
        detector(other)
        server = navigator(other)
        other.create_publisher(Odometry, "odometry/filtered", 1)
        uses = [
            Use.service("detect_survivor"),
            Use.action("navigate_to_pose"),
            Use.topic("odometry/filtered"),
        ]
        wait(ros, readiness(ros.node(), *uses))
        server.destroy()

    def test_tree_becomes_ready_when_server_appears(self, ros: Ros) -> None:
        node = ros.node()

        def appear() -> None:
            timer.cancel()
            detector(node)

        timer = node.create_timer(0.2, appear)
        wait(ros, readiness(node, Use.service("detect_survivor")))

    def test_name_is_resolved_in_namespace(self, ros: Ros) -> None:
        robot = ros.node("mission", namespace="/robot1")
        detector(ros.node("elsewhere"))
        assert missing(ros, readiness(robot, Use.service("detect_survivor"))) == [
            "service detect_survivor (/robot1/detect_survivor): no server, but there is /detect_survivor",
            "run with `--ros-args -r detect_survivor:=/detect_survivor`",
        ]
        detector(ros.node("there", namespace="/robot1"))
        wait(ros, readiness(robot, Use.service("detect_survivor")))

    def test_remapped_names_are_followed(self, make_ros: Callable[..., Ros]) -> None:
        ros = make_ros(["--ros-args", "-r", "navigate_to_pose/_action/send_goal:=drive/_action/send_goal"])
        server = navigator(ros.node("other"), "drive")
        wait(ros, readiness(ros.node(), Use.action("navigate_to_pose")))
        server.destroy()

    def test_two_servers_of_same_action_are_reported(self, ros: Ros, said: Said) -> None:
        servers = [navigator(ros.node(name)) for name in ("one", "two")]
        node = ros.node()
        ros.spin_until(
            lambda: node.count_services("/navigate_to_pose/_action/send_goal") == 2, "both servers"
        )
        [line] = missing(ros, readiness(node, Use.action("navigate_to_pose")))
        assert (
            line == "action navigate_to_pose: two servers provide /navigate_to_pose, /one and /two. Stop one"
        )
        assert said.has("Waiting for", "two servers")
        for server in servers:
            server.destroy()

    def test_wait_with_two_servers_ends_before_timeout(
        self, ros: Ros, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from sar_compiler.ros import readiness as module

        monkeypatch.setattr(module, "SHADOW_SEC", 0.1)
        node = ros.node()
        detector(ros.node("one"))
        detector(ros.node("two"))
        ros.spin_until(lambda: node.count_services("/detect_survivor") == 2, "both servers")
        watch = Stopwatch()
        missing(ros, readiness(node, Use.service("detect_survivor")), timeout_sec=30.0)
        assert watch.own_sec < 2.0

    def test_tree_is_ready_when_one_of_two_servers_ends(self, ros: Ros) -> None:
        node, second = ros.node(), ros.node("two")
        detector(ros.node("one"))
        detector(second)
        ros.spin_until(lambda: node.count_services("/detect_survivor") == 2, "both servers")
        ready = readiness(node, Use.service("detect_survivor"))
        assert ready.has_rival_servers
        ros.remove(second)
        wait(ros, ready)


class TestTypes:
    WANTED = "sar_interfaces/srv/DetectSurvivor"

    def ready(self, node: Any, use: Use, type_name: str) -> Readiness:
        from sar_compiler.ros.graph_queries import Endpoint
        from sar_compiler.ros.readiness import Readiness

        endpoints = {use: Endpoint(use.kind, use.name, type_name)}
        return Readiness(node, [use], initial_pose=None, endpoints=endpoints)

    def test_wrong_service_type_is_named(self, ros: Ros) -> None:
        from std_srvs.srv import SetBool

        ros.node("other").create_service(SetBool, "detect_survivor", lambda _, response: response)
        ready = self.ready(ros.node(), Use.service("detect_survivor"), self.WANTED)
        expect_missing(
            ros, ready, f"service detect_survivor: served as std_srvs/srv/SetBool, but must be {self.WANTED}"
        )

    def test_client_of_right_type_does_not_hide_server_of_wrong_type(
        self, ros: Ros, make_ros: Callable[..., Ros]
    ) -> None:
        from sar_interfaces.srv import DetectSurvivor
        from std_srvs.srv import SetBool

        ros.node("other").create_service(SetBool, "detect_survivor", lambda _, response: response)
        # In a separate context: within one, a name has one type.
        make_ros().node("asking").create_client(DetectSurvivor, "detect_survivor")
        node = ros.node()
        ros.spin_until(lambda: "asking" in node.get_node_names(), "the client")
        expect_missing(
            ros,
            self.ready(node, Use.service("detect_survivor"), self.WANTED),
            f"service detect_survivor: served as std_srvs/srv/SetBool, but must be {self.WANTED}",
        )

    def test_wrong_action_type_is_named(self, ros: Ros) -> None:
        server = navigator(ros.node("other"))
        wanted = "nav2_msgs/action/DockRobot"
        expect_missing(
            ros,
            self.ready(ros.node(), Use.action("navigate_to_pose"), wanted),
            f"action navigate_to_pose: served as nav2_msgs/action/NavigateToPose, but must be {wanted}",
        )
        server.destroy()

    def test_wrong_topic_type_is_named(self, ros: Ros) -> None:
        from std_msgs.msg import String

        ros.node("other").create_publisher(String, "battery_state", 1)
        wanted = "sensor_msgs/msg/BatteryState"
        expect_missing(
            ros,
            self.ready(ros.node(), Use.topic("battery_state"), wanted),
            f"topic battery_state: published as std_msgs/msg/String, but must be {wanted}",
        )

    def test_tree_is_ready_with_correct_types(self, ros: Ros) -> None:
        from std_msgs.msg import String

        other = ros.node("other")
        detector(other)
        server = navigator(other)
        other.create_publisher(String, "news", 1)
        for use, name in (
            (Use.service("detect_survivor"), self.WANTED),
            (Use.action("navigate_to_pose"), "nav2_msgs/action/NavigateToPose"),
            (Use.topic("news"), "std_msgs/msg/String"),
        ):
            wait(ros, self.ready(ros.node(), use, name))
        server.destroy()

    def test_mission_leaves_declare_their_types(self) -> None:
        from sar_compiler import load
        from sar_compiler.compiler import preview_tree
        from sar_compiler.ros.graph_queries import declared_endpoints

        tree = preview_tree(load("search_and_rescue").binding())
        types = {use: each.type_name for use, each in declared_endpoints(tree.root).items()}
        assert types == {
            Use.action("navigate_to_pose"): "nav2_msgs/action/NavigateToPose",
            Use.service("detect_survivor"): self.WANTED,
            Use.service("report_survivor"): "sar_interfaces/srv/ReportSurvivor",
        }


class TestNav2BringUp:
    """Tests with an inactive navigator, the nodes started before it, and the lifecycle manager."""

    @staticmethod
    def stack(ros: Ros, *, up: bool | None, **states: str) -> None:
        from lifecycle_msgs.srv import GetState
        from std_srvs.srv import Trigger

        node = ros.node("nav2")
        for name, state in {"amcl": "active", **states}.items():

            def answer(_: Any, response: Any, state: str = state) -> Any:
                response.current_state.label = state
                return response

            node.create_service(GetState, f"{name}/get_state", answer)
        if up is not None:

            def is_active(_: Any, response: Any) -> Any:
                response.success = up
                return response

            node.create_service(Trigger, "lifecycle_manager_navigation/is_active", is_active)

    def test_planner_activation_failure_recommends_initial_pose(self, ros: Ros) -> None:
        self.stack(
            ros, up=False, controller_server="active", planner_server="inactive", bt_navigator="inactive"
        )
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            "node bt_navigator: state 'inactive', must be 'active'. lifecycle_manager_navigation has given up starting Nav2, because planner_server failed to activate. Restart Nav2, and set the initial pose within its "
            "initial_transform_timeout",
        )

    @pytest.mark.parametrize(
        ("states", "failed"),
        [
            (("inactive", "unconfigured", "unconfigured"), "planner_server failed to configure"),
            (("inactive", "inactive", "unconfigured"), "bt_navigator failed to configure"),
            (("active", "active", "inactive"), "bt_navigator failed to activate"),
            (("inactive", "inactive", "inactive"), "controller_server failed to activate"),
        ],
    )
    def test_failed_bring_up_names_node_and_requests_no_pose(
        self, ros: Ros, states: tuple[str, str, str], failed: str
    ) -> None:
        controller, planner, navigator = states
        self.stack(
            ros, up=False, controller_server=controller, planner_server=planner, bt_navigator=navigator
        )
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            f"node bt_navigator: state '{navigator}', must be 'active'. lifecycle_manager_navigation has given up starting Nav2, because {failed}. Restart Nav2",
        )

    @pytest.mark.parametrize(
        ("states", "named", "failed"),
        [
            (
                ("active", "active", "inactive"),
                "planner_server",
                "planner_server was activated, but the response of this node was lost",
            ),
            (
                ("inactive", "inactive", "unconfigured"),
                "planner_server",
                "planner_server was configured, but the response of this node was lost",
            ),
            (("inactive", "inactive", "inactive"), "bt_navigator", "bt_navigator failed to activate"),
            (
                ("inactive", "unconfigured", "unconfigured"),
                "bt_navigator",
                "bt_navigator failed to configure",
            ),
        ],
    )
    def test_log_of_lifecycle_manager_identifies_failed_node(
        self, ros: Ros, states: tuple[str, str, str], named: str, failed: str
    ) -> None:
        controller, planner, navigator = states
        self.stack(
            ros, up=False, controller_server=controller, planner_server=planner, bt_navigator=navigator
        )
        log_as_node(ros, "lifecycle_manager_navigation", f"Failed to change state for node: {named}")
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            f"node bt_navigator: state '{navigator}', must be 'active'. lifecycle_manager_navigation has given up starting Nav2, because {failed}. Restart Nav2",
        )

    @pytest.mark.parametrize(
        ("level", "text"),
        [
            ("ERROR", "Failed to change state for node: bt_navigator. Exception: timed out."),
            ("INFO", "\x1b[34m\x1b[1mActivating bt_navigator\x1b[0m\x1b[0m"),
        ],
    )
    def test_navigator_crash_during_start_is_reported(self, ros: Ros, level: str, text: str) -> None:
        self.stack(ros, up=False, controller_server="inactive", planner_server="inactive")
        log_as_node(ros, "lifecycle_manager_navigation", text, level)
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            "node bt_navigator: missing (no service /bt_navigator/get_state). lifecycle_manager_navigation waits for "
            "bt_navigator, but the process of bt_navigator was not started or has crashed. Restart Nav2",
        )

    @pytest.mark.parametrize(
        "text", ["Configuring planner_server", "Waiting for service planner_server/get_state..."]
    )
    def test_other_crashed_or_unstarted_node_is_reported(self, ros: Ros, text: str) -> None:
        self.stack(ros, up=None, controller_server="unconfigured", bt_navigator="unconfigured")
        log_as_node(ros, "planner_server", "Failed to create global planner.")
        log_as_node(ros, "lifecycle_manager_navigation", text, "INFO")
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            "node bt_navigator: state 'unconfigured', must be 'active'. lifecycle_manager_navigation waits for planner_server, "
            'but the process of planner_server was not started or has crashed (planner_server: "Failed to create global planner."). Restart Nav2',
        )

    def test_log_of_failed_first_node_is_quoted(self, ros: Ros) -> None:
        self.stack(ros, up=False, controller_server="unconfigured", bt_navigator="unconfigured")
        log_as_node(ros, "controller_server", "Failed to create controller. No plugin.")
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            "node bt_navigator: state 'unconfigured', must be 'active'. lifecycle_manager_navigation has given up starting Nav2, because "
            'controller_server failed to configure (controller_server: "Failed to create controller. No plugin."). '
            "Restart Nav2",
        )

    def test_check_names_missing_pose(self, ros: Ros) -> None:
        nav2 = FakeNav2(ros.node("nav2"), states=("active", "inactive"))
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            "node bt_navigator: state 'inactive', must be 'active'. The localisation has no pose yet. Publish the pose on initialpose (in RViz: 2D Pose Estimate)",
        )
        assert nav2.poses == []

    def test_activating_node_is_named(self, ros: Ros) -> None:
        self.stack(ros, up=None, planner_server="activating", bt_navigator="inactive")
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            "node bt_navigator: state 'inactive', must be 'active', and planner_server is 'activating'",
        )

    def test_start_command_is_given_for_stack_without_autostart(self, ros: Ros) -> None:
        self.stack(ros, up=False, planner_server="unconfigured", bt_navigator="unconfigured")
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=None),
            "node bt_navigator: state 'unconfigured', must be 'active'. lifecycle_manager_navigation has not started Nav2, "
            "because autostart is off. Run: ros2 service call "
            '/lifecycle_manager_navigation/manage_nodes nav2_msgs/srv/ManageLifecycleNodes "{command: 0}"',
        )

    def test_wait_keeps_only_state_clients(self, ros: Ros) -> None:
        self.stack(ros, up=False, planner_server="inactive", bt_navigator="inactive")
        node = ros.node()
        missing(ros, readiness(node, Use.nav2(), initial_pose=None), 1.0)
        left = {each.srv_name for each in node.clients}
        assert left >= {"bt_navigator/get_state", "planner_server/get_state"}
        assert all(name.endswith("/get_state") for name in left)
        missing(ros, readiness(node, Use.nav2(), initial_pose=None), 1.0)
        assert len(list(node.clients)) == len(left)


class TestNav2:
    def test_tree_is_ready_when_nodes_are_active_and_pose_is_confirmed(self, ros: Ros) -> None:
        nav2 = FakeNav2(ros.node("nav2"))
        wait(ros, readiness(ros.node(), Use.nav2(), initial_pose=(1.0, 2.0, math.pi / 2)))
        pose = nav2.poses[0]
        assert pose.header.frame_id == "map"
        assert (pose.pose.pose.position.x, pose.pose.pose.position.y) == (1.0, 2.0)
        assert pose.pose.pose.orientation.z == pytest.approx(math.sqrt(0.5))
        assert [pose.pose.covariance[index] for index in (0, 7, 35)] == [0.25, 0.25, 0.068]

    def test_missing_nodes_are_named(self, ros: Ros) -> None:
        assert missing(ros, readiness(ros.node(), Use.nav2(), initial_pose=None)) == [
            "node amcl: missing (no service /amcl/get_state)",
            "node bt_navigator: missing (no service /bt_navigator/get_state)",
        ]

    def test_message_names_simulator_if_nav2_is_absent(self, ros: Ros) -> None:
        from sar_compiler.ros.readiness import NotReadyError

        with pytest.raises(NotReadyError, match="add --sim to run in the simulator"):
            wait(ros, readiness(ros.node(), Use.nav2(), initial_pose=None), 0.3)

    def test_message_does_not_name_simulator_if_nav2_is_in_other_namespace(self, ros: Ros) -> None:
        from sar_compiler.ros.readiness import NotReadyError

        FakeNav2(ros.node("nav2", namespace="/robot3"))
        ready = readiness(ros.node(), Use.nav2(), initial_pose=None)
        ros.spin_until(lambda: not ready.is_nav2_absent, "the nodes of the other namespace")
        with pytest.raises(NotReadyError) as caught:
            wait(ros, ready, 0.3)
        assert "--sim" not in str(caught.value)

    def test_full_names_are_shown_in_namespace(self, ros: Ros) -> None:
        node = ros.node("mission", namespace="/robot3")
        pose, *nodes = missing(ros, readiness(node, Use.nav2()))
        assert pose.startswith("topic amcl_pose (/robot3/amcl_pose): no response to the initial pose (")
        assert pose.endswith(", and no node subscribes to initialpose (/robot3/initialpose)")
        assert nodes == [
            "node amcl: missing (no service /robot3/amcl/get_state)",
            "node bt_navigator: missing (no service /robot3/bt_navigator/get_state)",
        ]

    def test_full_name_of_inactive_node_is_shown_in_namespace(self, ros: Ros) -> None:
        FakeNav2(ros.node("nav2", namespace="/robot3"), states=("active", "inactive"))
        expect_missing(
            ros,
            readiness(ros.node("mission", namespace="/robot3"), Use.nav2()),
            "node bt_navigator (/robot3/bt_navigator): state 'inactive', must be 'active'",
        )

    def test_state_of_inactive_node_is_named(self, ros: Ros) -> None:
        FakeNav2(ros.node("nav2"), states=("active", "inactive"))
        expect_missing(
            ros, readiness(ros.node(), Use.nav2()), "node bt_navigator: state 'inactive', must be 'active'"
        )

    def test_tree_becomes_ready_when_nodes_become_active(self, ros: Ros) -> None:
        nav2 = FakeNav2(ros.node("nav2"), states=("unconfigured", "inactive"))
        node = ros.node()
        node.create_timer(0.6, lambda: nav2.states.update(amcl="active", bt_navigator="active"))
        wait(ros, readiness(node, Use.nav2()))

    def test_lost_state_response_is_requested_again(self, ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
        from lifecycle_msgs.srv import GetState
        from rclpy.task import Future

        from sar_compiler.ros.lifecycle import PolledService
        from sar_compiler.ros.robot_estimate import robot_estimate

        monkeypatch.setattr(PolledService, "deadline_sec", 0.2)
        other, node = ros.node("other"), ros.node()
        calls: list[int] = []

        async def answer(_: Any, response: Any) -> Any:
            calls.append(1)
            if len(calls) == 1:
                await Future()
            response.current_state.label = "active"
            return response

        from rclpy.callback_groups import ReentrantCallbackGroup

        other.create_service(GetState, "amcl/get_state", answer, callback_group=ReentrantCallbackGroup())
        state = robot_estimate(node).lifecycle("amcl")
        ros.spin_until(lambda: state.poll() is None, "the second answer")
        assert len(calls) >= 2

    def test_unresponsive_node_is_reported(self, ros: Ros) -> None:
        from lifecycle_msgs.srv import GetState
        from rclpy.task import Future

        from sar_compiler.ros.robot_estimate import robot_estimate

        async def never(_: Any, __: Any) -> None:
            await Future()

        ros.node("other").create_service(GetState, "amcl/get_state", never)
        state = robot_estimate(ros.node()).lifecycle("amcl")
        ros.spin_until(lambda: "has not responded" in (state.poll() or ""), "the service")

    def test_unconfirmed_pose_is_named(self, ros: Ros) -> None:
        nav2 = FakeNav2(ros.node("nav2"))
        nav2.answers = False
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2(), initial_pose=(1.0, -2.0, 0.5)),
            "topic amcl_pose: no response to the initial pose (1.00, -2.00, yaw 0.50)",
        )

    def test_missing_subscriber_of_pose_is_reported(self, ros: Ros) -> None:
        FakeNav2(ros.node("nav2"), deaf=True)
        expect_missing(
            ros,
            readiness(ros.node(), Use.nav2()),
            "topic amcl_pose: no response to the initial pose (0.00, 0.00, yaw 0.00), and no node subscribes to initialpose",
        )

    def test_pose_is_published_again_until_confirmed(self, ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("sar_compiler.ros.readiness._INITIAL_POSE_PERIOD_SEC", 0.1)
        nav2 = FakeNav2(ros.node("nav2"))
        nav2.answers = False
        ready = readiness(ros.node(), Use.nav2())
        ros.spin_until(lambda: ready.poll() or len(nav2.poses) >= 3, "the pose for a third time")
        nav2.answers = True
        wait(ros, ready)

    def test_no_pose_is_sent_before_first_requirement_but_states_are_queried(self, ros: Ros) -> None:
        from sar_compiler.ros.clock import AWAKE
        from sar_compiler.ros.readiness import Readiness, Requirement

        class First(Requirement):
            line: str | None = "the first"

            def poll(self) -> str | None:
                return self.line

        nav2, first = FakeNav2(ros.node("nav2")), First()
        ready = Readiness(ros.node(), [Use.nav2()], initial_pose=(0.0, 0.0, 0.0), first=[first])
        localised = ready._localised
        assert localised is not None

        def is_known() -> bool:
            assert ready.poll_all() == ["the first"]
            return nav2.asked == nav2.states.keys() and localised._has_listened(AWAKE.now())

        ros.spin_until(is_known, "the answers of Nav2")
        assert nav2.poses == []
        first.line = None
        wait(ros, ready)
        assert nav2.poses

    def test_each_change_of_awaited_items_is_reported_for_operator(self, ros: Ros) -> None:
        from sar_compiler.ros.readiness import Readiness, Requirement

        class First(Requirement):
            title, line = "the first", "it is not there"

            def poll(self) -> str | None:
                return self.line or None

        told: list[list[tuple[str, str]]] = []
        first, report = First(), lambda items: told.append([*map(tuple, items)])
        use = Use.service("detect_survivor")
        ready = Readiness(ros.node(), [use], initial_pose=None, first=[first], report=report)
        for _ in range(2):
            assert not ready.poll()
        (items,) = told
        assert [name for name, problem in items if problem] == ["the first", "detect survivor"]
        assert dict(items)["the clock"] == ""
        first.line = ""
        assert not ready.poll()
        assert [name for name, problem in told[-1] if problem] == ["detect survivor"]

    def test_latched_old_pose_is_not_a_confirmation(self, ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("sar_compiler.ros.readiness._INITIAL_POSE_PERIOD_SEC", 0.1)
        nav2 = FakeNav2(ros.node("nav2"))
        nav2.publisher.publish(pose_message(0.3, -0.3))
        nav2.answers = False
        ready = readiness(ros.node(), Use.nav2())
        ros.spin_until(lambda: ready.poll() or len(nav2.poses) >= 3, "the pose for a third time")
        expect_missing(ros, ready, "topic amcl_pose: no response to the initial pose (0.00, 0.00, yaw 0.00)")

    def test_initial_pose_is_not_sent_to_robot_localised_elsewhere(self, ros: Ros) -> None:
        nav2 = FakeNav2(ros.node("nav2"))
        nav2.publisher.publish(pose_message(-0.44, 0.60))
        [line] = missing(ros, readiness(ros.node(), Use.nav2()), SILENCE_SEC)
        assert line.startswith(
            "the localisation locates the robot at (-0.44, 0.60), 0.74 m from initial_pose (0.00, 0.00). The initial "
            "pose is not sent. Drive back first, or give the robot's pose "
            "(-p initial_pose.x:=-0.44 -p initial_pose.y:=0.60, or -p set_initial_pose:=false"
        )
        assert nav2.poses == []

    def test_resume_is_suggested_if_previous_mission_can_be_resumed(self, ros: Ros) -> None:
        from sar_compiler.ros.readiness import Readiness

        FakeNav2(ros.node("nav2")).publisher.publish(pose_message(2.0, 0.0))
        ready = Readiness(ros.node(), [Use.nav2()], initial_pose=(0.0, 0.0, 0.0), can_resume=True)
        [line] = missing(ros, ready, SILENCE_SEC)
        assert "Resume the interrupted mission (--resume), drive back first" in line

    @pytest.mark.parametrize(
        ("odometry", "place", "told"),
        [
            ((3.6, 0.0), None, False),
            ((0.0, -0.26), None, False),
            ((0.2, 0.1), None, True),
            ((5.1, 5.0), None, True),
            ((3.6, 0.0), (5.1, 5.0), True),
        ],
    )
    def test_odometry_decides_whether_initial_pose_is_sent(
        self, ros: Ros, odometry: tuple[float, float], place: tuple[float, float] | None, told: bool
    ) -> None:
        """The pose is sent if the robot is at the start of its odometry, or if its odometry or localisation agrees with it."""
        from nav_msgs.msg import Odometry

        nav2, other, node = FakeNav2(ros.node("nav2")), ros.node("robot"), ros.node()
        message = Odometry(child_frame_id="base_link")
        message.header.frame_id, message.pose.pose.orientation.w = "odom", 1.0
        message.pose.pose.position.x, message.pose.pose.position.y = odometry
        publisher = other.create_publisher(Odometry, "odometry/filtered", 10)
        other.create_timer(0.05, lambda: publisher.publish(message))
        ros.spin_until(lambda: node.count_publishers("odometry/filtered"), "the odometry")
        if place is not None:
            nav2.publisher.publish(pose_message(*place))
        ready = readiness(node, Use.nav2(), initial_pose=(5.0, 5.0, 0.0))
        if told:
            wait(ros, ready)
            assert nav2.poses
            return
        moved = math.hypot(*odometry)
        assert missing(ros, ready, SILENCE_SEC) == [
            (
                f"the localisation has no pose, and according to the odometry the robot is {moved:.2f} m from its start. "
                "initial_pose (5.00, 5.00) is not sent. Set the pose (in RViz: 2D Pose Estimate), and start where the robot stands: "
                "-p set_initial_pose:=false"
            )
        ]
        assert nav2.poses == []

    def test_initial_pose_is_not_sent_to_robot_localised_by_transforms(self, ros: Ros) -> None:
        from geometry_msgs.msg import TransformStamped
        from nav_msgs.msg import Odometry
        from tf2_msgs.msg import TFMessage

        other = ros.node("nav2")
        nav2 = FakeNav2(other)
        offset, odometry = TransformStamped(), Odometry()
        offset.header.frame_id, offset.child_frame_id = "map", "odom"
        offset.transform.translation.x = 1.0
        offset.transform.rotation.z = offset.transform.rotation.w = math.sqrt(0.5)
        odometry.header.frame_id, odometry.child_frame_id = "odom", "base_link"
        odometry.pose.pose.position.x, odometry.pose.pose.orientation.w = 2.0, 1.0
        transforms = other.create_publisher(TFMessage, "/tf", 10)
        odometries = other.create_publisher(Odometry, "odometry/filtered", 10)

        def publish() -> None:
            odometries.publish(odometry)
            transforms.publish(TFMessage(transforms=[offset]))

        other.create_timer(0.05, publish)
        node = ros.node()
        robot = robot_of(node)
        ros.spin_until(lambda: robot.odometry is not None and robot.is_localised, "the place")
        assert robot.last_pose() == pytest.approx((1.0, 2.0, math.pi / 2))
        offset.transform.translation.x = math.nan
        ros.spin_until(lambda: robot.last_pose() is None, "a transform that is no number")
        offset.transform.translation.x = 1.0
        ros.spin_until(robot.last_pose, "the place")
        odometry.pose.pose.position.y, odometry.twist.twist.linear.x = math.nan, 0.5
        ros.spin_until(lambda: robot.moves, "odometry that is no number")
        assert robot.last_pose() == pytest.approx((1.0, 2.0, math.pi / 2))
        [line] = missing(ros, readiness(node, Use.nav2()), SILENCE_SEC)
        assert "locates the robot at (1.00, 2.00), 2.24 m from initial_pose (0.00, 0.00)" in line
        assert nav2.poses == []

    def test_odometry_is_awaited_after_transforms(self, ros: Ros) -> None:
        """On a busy computer odometry can arrive late; until then the transforms give no position."""
        from geometry_msgs.msg import TransformStamped
        from nav_msgs.msg import Odometry
        from tf2_msgs.msg import TFMessage

        other, node = ros.node("nav2"), ros.node()
        nav2 = FakeNav2(other)
        offset, odometry = TransformStamped(), Odometry()
        offset.header.frame_id, offset.child_frame_id, offset.transform.rotation.w = "map", "odom", 1.0
        odometry.header.frame_id, odometry.child_frame_id = "odom", "base_link"
        odometry.pose.pose.position.x, odometry.pose.pose.orientation.w = 0.4, 1.0
        transforms = other.create_publisher(TFMessage, "/tf", 10)
        odometries = other.create_publisher(Odometry, "odometry/filtered", 10)
        other.create_timer(0.05, lambda: transforms.publish(TFMessage(transforms=[offset])))
        ready = readiness(node, Use.nav2())
        ros.spin_until(lambda: robot_of(node).is_localised, "the transforms")
        assert not ready.poll()
        other.create_timer(0.05, lambda: odometries.publish(odometry))
        wait(ros, ready)
        assert nav2.poses

    def test_localisation_keeps_yaw_that_differs_from_initial_pose(self, ros: Ros, said: Said) -> None:
        nav2 = FakeNav2(ros.node("nav2"))
        nav2.publisher.publish(pose_message(0.1, 0.0))
        wait(ros, readiness(ros.node(), Use.nav2(), initial_pose=(0.0, 0.0, 3.0)))
        assert nav2.poses == []
        assert said.has("The initial pose is not sent. The localisation keeps its yaw of 0.00 rad")

    def test_localisation_of_new_simulation_receives_pose_at_once(self, ros: Ros) -> None:
        from sar_compiler.ros.readiness import LocalisationCheck

        nav2, node = FakeNav2(ros.node("nav2")), ros.node()
        localised = LocalisationCheck(node, (0.0, 0.0, 0.0), restarts=True)
        ros.spin_until(lambda: node.count_subscribers("initialpose"), "the localisation")
        localised.poll()
        ros.spin_until(lambda: nav2.poses, "the pose")
        localised.close()

    def test_no_pose_is_published_or_awaited_if_none_is_given(self, ros: Ros) -> None:
        nav2 = FakeNav2(ros.node("nav2"))
        nav2.answers = False
        wait(ros, readiness(ros.node(), Use.nav2(), initial_pose=None))
        assert nav2.poses == []

    def test_wait_leaves_no_entities_on_node(self, ros: Ros) -> None:
        from sar_compiler.ros.nav2_log import nav2_log

        FakeNav2(ros.node("nav2"))
        node = ros.node()

        def entities() -> list[int]:
            return [
                len(list(kind)) for kind in (node.publishers, node.subscriptions, node.clients, node.timers)
            ]

        robot = robot_of(node)  # is kept, like the log of Nav2
        for name in ("amcl", "bt_navigator"):
            robot.lifecycle(name)
        nav2_log(node)
        before = entities()
        ready = readiness(node, Use.nav2())
        assert entities() != before
        wait(ros, ready)
        assert entities() == before

    def test_use_of_nav2_is_detected(self, ros: Ros) -> None:
        node = ros.node()
        assert readiness(node, Use.nav2()).uses_nav2
        assert not readiness(node, Use.action("navigate_to_pose")).uses_nav2


class TestClock:
    def test_missing_clock_is_reported(self, ros: Ros) -> None:
        from rclpy.parameter import Parameter

        node = ros.node(parameter_overrides=[Parameter("use_sim_time", value=True)])
        assert missing(ros, readiness(node)) == ["use_sim_time is set, but no message has arrived on /clock"]

    def test_tree_is_ready_when_clock_has_arrived(self, ros: Ros) -> None:
        from rclpy.parameter import Parameter
        from rosgraph_msgs.msg import Clock

        node = ros.node(parameter_overrides=[Parameter("use_sim_time", value=True)])
        other = ros.node("other")
        publisher = other.create_publisher(Clock, "/clock", 1)
        message = Clock()
        message.clock.sec = 5
        other.create_timer(0.05, lambda: publisher.publish(message))
        wait(ros, readiness(node))


class TestWait:
    def test_wait_ends_early_on_cancellation(self, ros: Ros) -> None:
        from sar_compiler.ros.readiness import wait_until_ready

        watch = Stopwatch()
        ready = readiness(ros.node(), Use.service("detect_survivor"))
        wait_until_ready(ros.executor, ready, 30.0, lambda: watch.passed_sec > 0.1)
        assert watch.own_sec < 1.0

    def test_wait_ends_when_context_is_shut_down(self, ros: Ros) -> None:
        node = ros.node()
        node.create_timer(0.05, ros.context.try_shutdown)
        watch = Stopwatch()
        wait(ros, readiness(node, Use.service("detect_survivor")), 30.0)
        assert watch.own_sec < 2.0

    def test_wait_has_one_timeout_for_everything(self, ros: Ros) -> None:
        watch = Stopwatch()
        missing(
            ros, readiness(ros.node(), Use.nav2(), Use.service("a"), Use.action("b"), Use.topic("c")), 0.4
        )
        assert watch.passed_sec >= 0.4
        assert watch.own_sec < 1.5

    def test_wait_reports_missing_items_periodically(
        self, ros: Ros, said: Said, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from sar_compiler.ros import readiness as module

        monkeypatch.setattr(module, "_PROGRESS_PERIOD_SEC", 0.0)
        missing(ros, readiness(ros.node(), Use.service("a"), Use.topic("c")))
        assert said.has("Waiting for: service a: no server; topic c: no publisher")
