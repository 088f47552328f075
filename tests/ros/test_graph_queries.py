"""Tests of ROS graph queries, over real DDS: wrong names, types, qualities of service and sources."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import pytest

from sar_compiler.nodes.spec import Use
from sar_compiler.ros.graph_queries import Endpoint, RosGraph, explain_endpoint, join_names, ros_graph
from sar_compiler.runtime.ports import Input
from tests.ros.conftest import Ros

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sar_compiler.ros.readiness import Readiness
    from tests.ros.conftest import Said

pytestmark = pytest.mark.ros

DETECT = "sar_interfaces/srv/DetectSurvivor"
NAVIGATE = "nav2_msgs/action/NavigateToPose"
ODOMETRY = "nav_msgs/msg/Odometry"
POSES = "geometry_msgs/msg/PoseWithCovarianceStamped"
BATTERY = "sensor_msgs/msg/BatteryState"


class Robots:
    """The nodes of one test, in the context that all tests of the module share."""

    def __init__(self, ros: Ros) -> None:
        self._ros = ros
        self._servers: list[Any] = []
        self.nodes: list[Any] = []

    def node(self, full_name: str, **options: Any) -> Any:
        space, _, name = full_name.rpartition("/")
        node = self._ros.node(name, namespace=space or "/", **options)
        self.nodes.append(node)
        return node

    def serve(self, node: Any, *names: str) -> None:
        """Serve lifecycle nodes such as `amcl`, detection services, and actions for names with `navigate`."""
        from lifecycle_msgs.srv import GetState
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionServer
        from sar_interfaces.srv import DetectSurvivor

        def active(_: Any, response: Any) -> Any:
            response.current_state.label = "active"
            return response

        for name in names:
            if "navigate" in name:
                self._servers.append(ActionServer(node, NavigateToPose, name, NavigateToPose.Result))
            elif "detect" in name.lower():
                node.create_service(DetectSurvivor, name, lambda _, response: response)
            else:
                node.create_service(GetState, f"{name}/get_state", active)

    def publish(self, node: Any, topic: str, type_name: str, **qos: Any) -> Any:
        from sar_compiler.ros.leaves.leaf import find_interface

        return node.create_publisher(find_interface("", "msg", topic, type_name), topic, qos_of(**qos))

    def send_transforms(
        self, node: Any, *links: tuple[str, str], topic: str = "/tf", x: float = 0.0, static: bool = False
    ) -> None:
        """Publish transforms of parents and children: 20 times a second, or static ones once."""
        from geometry_msgs.msg import TransformStamped
        from tf2_msgs.msg import TFMessage

        message = TFMessage()
        for parent, child in links:
            each = TransformStamped(child_frame_id=child)
            each.header.frame_id = parent
            each.transform.translation.x, each.transform.rotation.w = x, 1.0
            message.transforms.append(each)
        qos = qos_of(durability="transient_local") if static else qos_of()
        publisher = node.create_publisher(TFMessage, topic, qos)

        def publish() -> None:
            for each in message.transforms:
                each.header.stamp = node.get_clock().now().to_msg()
            publisher.publish(message)

        publish()
        if not static:
            node.create_timer(0.05, publish)

    def graph(self, full_name: str = "/mission", **options: Any) -> RosGraph:
        return ros_graph(self.node(full_name, **options))

    def until(self, condition: Any, what: str) -> None:
        self._ros.spin_until(condition, what)

    def expect_missing(self, ready: Readiness, *expected: str) -> None:
        """Spin until exactly these lines are reported as missing."""
        last: list[str] = []

        def same() -> bool:
            last[:] = ready.poll_all()
            return last == list(expected)

        try:
            self.until(same, "the lines")
        except AssertionError:
            pytest.fail(f"missing: {last}, not {list(expected)}")
        finally:
            ready.close()

    def close(self) -> None:
        for server in self._servers:
            server.destroy()
        for node in self.nodes:
            self._ros.remove(node)


def transform_bytes(parent: str, *children: str) -> bytes:
    """Return serialized transforms."""
    from geometry_msgs.msg import TransformStamped
    from rclpy.serialization import serialize_message
    from tf2_msgs.msg import TFMessage

    message = TFMessage()
    for child in children:
        message.transforms.append(TransformStamped(child_frame_id=child))
        message.transforms[-1].header.frame_id = parent
    return bytes(serialize_message(message))


def qos_of(
    reliability: str = "reliable", durability: str = "volatile", *, deadline_sec: float | None = None
) -> Any:
    from rclpy.duration import Duration
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    more = {"deadline": Duration(seconds=deadline_sec)} if deadline_sec is not None else {}
    return QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.get_from_short_key(reliability),
        durability=DurabilityPolicy.get_from_short_key(durability),
        **more,
    )


@pytest.fixture(scope="module")
def context() -> Iterator[Ros]:
    ros = Ros()
    yield ros
    ros.close()


@pytest.fixture
def robots(context: Ros) -> Iterator[Robots]:
    world = Robots(context)
    yield world
    left = {node.get_fully_qualified_name() for node in world.nodes}
    world.close()
    watcher = context.node("watcher")

    def are_gone() -> bool:
        return not left & {
            f"{space.rstrip('/')}/{name}" for name, space in watcher.get_node_names_and_namespaces()
        }

    context.spin_until(are_gone, "the end of the nodes")
    context.remove(watcher)


class Case(NamedTuple):
    """A wanted endpoint, the name that exists, and the expected message."""

    wanted: Endpoint
    there: str
    said: str
    mission: str = "/mission"


ACTION_REMAPPINGS = " ".join(
    f"-r navigate_to_pose/_action/{part}:=/tb1/navigate_to_pose/_action/{part}"
    for part in ("send_goal", "cancel_goal", "get_result", "feedback", "status")
)
DETECTOR = Endpoint("service", "detect_survivor", DETECT)
BATTERIES = Endpoint("topic", "battery_state", BATTERY)
NAMES = {
    "in another namespace": Case(
        DETECTOR, "/tb1/detect_survivor", ", but there is /tb1/detect_survivor: run with `--ros-args -r detect_survivor:=/tb1/detect_survivor`"),
    "in none, and the mission is in one": Case(
        DETECTOR, "/detect_survivor", ", but there is /detect_survivor: run with `--ros-args -r detect_survivor:=/detect_survivor`", "/tb1/mission"),
    "deeper": Case(
        DETECTOR, "/tb1/search/detect_survivor", ", but there is /tb1/search/detect_survivor: run with `--ros-args -r detect_survivor:=/tb1/search/detect_survivor`"),
    "by case": Case(DETECTOR, "/Detect_Survivor", ", but there is /Detect_Survivor: run with `--ros-args -r detect_survivor:=/Detect_Survivor`"),
    "by a typo": Case(DETECTOR, "/detect_surviver", ", but there is /detect_surviver: run with `--ros-args -r detect_survivor:=/detect_surviver`"),
    "by a typo in another namespace": Case(
        DETECTOR, "/tb1/detect_surviver", ", but there is /tb1/detect_surviver: run with `--ros-args -r detect_survivor:=/tb1/detect_surviver`"),
    "with a part more": Case(
        DETECTOR, "/detect_survivor/by_camera", ", but there is /detect_survivor/by_camera: run with `--ros-args -r detect_survivor:=/detect_survivor/by_camera`"),
    "by a name of its own, the only one of the type": Case(
        DETECTOR, "/find/detect_people", ", but there is /find/detect_people: run with `--ros-args -r detect_survivor:=/find/detect_people`"),
    "an action, in another namespace": Case(
        Endpoint("action", "navigate_to_pose", NAVIGATE, attribute="action"), "/tb1/navigate_to_pose",
        f', but there is /tb1/navigate_to_pose: write action="/tb1/navigate_to_pose" in the tree, or run with `--ros-args {ACTION_REMAPPINGS}`'),
    "an action that has no attribute for its name": Case(
        Endpoint("action", "navigate_to_pose", NAVIGATE), "/tb1/navigate_to_pose",
        f", but there is /tb1/navigate_to_pose: run with `--ros-args {ACTION_REMAPPINGS}`"),
    "a lifecycle node": Case(
        Endpoint("node", "amcl"), "/tb1/amcl", ", but there is /tb1/amcl: run with `--ros-args -r amcl/get_state:=/tb1/amcl/get_state`"),
    "a topic with a leading slash": Case(
        Endpoint("topic", "/battery_state", BATTERY), "/tb1/battery_state",
        ", but there is /tb1/battery_state: run with `--ros-args -r /battery_state:=/tb1/battery_state`", "/tb1/mission"),
    "a topic by another name": Case(BATTERIES, "/power/status", ", but there is /power/status: run with `--ros-args -r battery_state:=/power/status`"),
    "a topic with a part less": Case(
        Endpoint("topic", "battery_state/main", BATTERY), "/battery_state",
        ", but there is /battery_state: run with `--ros-args -r battery_state/main:=/battery_state`"),
}  # fmt: skip


@pytest.mark.parametrize("case", NAMES.values(), ids=NAMES)
def test_missing_name_is_explained_by_nearest_one(robots: Robots, case: Case) -> None:
    node = robots.node("/other")
    if case.wanted.kind == "topic":
        robots.publish(node, case.there, BATTERY)
    else:
        robots.serve(node, case.there)
    graph = robots.graph(case.mission)
    robots.until(lambda: graph.query(case.wanted).explanation == case.said, f"{case.said!r}")
    assert not graph.query(case.wanted).is_there


@pytest.mark.parametrize(
    ("wanted", "there"),
    [
        (Endpoint("service", "detect_survivor", "std_srvs/srv/Trigger"), "/tb1/detect_survivor"),
        (DETECTOR, "/report_survivor"),
        (Endpoint("node", "bt_navigator"), "/amcl"),
    ],
)
def test_name_of_other_type_or_without_similarity_is_not_suggested(
    robots: Robots, wanted: Endpoint, there: str
) -> None:
    robots.serve(robots.node("/other"), there, "/last")
    graph = robots.graph()
    robots.until(lambda: graph.query(Endpoint("node", "last")).is_there, "the services")
    assert graph.query(wanted).explanation == ""


def test_own_endpoints_are_not_suggested(robots: Robots) -> None:
    mission = robots.node("/mission")
    robots.serve(mission, "/tb1/detect_survivor")
    robots.publish(mission, "/tb1/battery_state", BATTERY)
    graph = ros_graph(mission)
    robots.until(lambda: mission.count_services("/tb1/detect_survivor"), "its own service")
    assert [graph.query(each).elsewhere for each in (DETECTOR, BATTERIES)] == [(), ()]


SHARED_TRANSFORMS = (
    "transforms from 'map' may belong to another robot, because /tf is also published by /tb2/amcl. Give each robot its own transforms "
    "(`-r __ns:=/robot1 -r /tf:=tf -r /tf_static:=tf_static`)"
)
NO_POSE = "topic amcl_pose: no initial pose is sent, because the localisation may belong to another robot"


class TestNamespaces:
    def ready(self, node: Any, *uses: Use, pose: bool = True, **types: str) -> Readiness:
        from sar_compiler.ros.readiness import Readiness

        endpoints = {use: Endpoint(use.kind, use.name, types[use.name]) for use in uses if use.name in types}
        return Readiness(node, uses, initial_pose=(0.0, 0.0, 0.0) if pose else None, endpoints=endpoints)

    def stack(self, robots: Robots, space: str, *, topic: str | None = None) -> Any:
        """Start a localised robot with Nav2 in a namespace."""
        from geometry_msgs.msg import PoseWithCovarianceStamped

        node = robots.node(f"{space}/amcl")
        robots.serve(node, f"{space}/amcl", f"{space}/bt_navigator", f"{space}/navigate_to_pose")
        poses = robots.publish(node, "amcl_pose", POSES, durability="transient_local")
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.pose.pose.orientation.w = "map", 1.0
        message.pose.pose.position.x = 4.0
        poses.publish(message)
        robots.send_transforms(node, ("map", "odom"), topic=topic or f"{space}/tf", x=4.0)
        return node

    USES = (Use.nav2(), Use.action("navigate_to_pose"))

    def test_namespace_of_all_endpoints_is_suggested_without_initial_pose(self, robots: Robots) -> None:
        """Transforms on `/tf` do not show to which robot they belong."""
        self.stack(robots, "/tb1", topic="/tf")
        mission = robots.node("/mission")
        robots.expect_missing(
            self.ready(mission, *self.USES),
            NO_POSE,
            "node amcl: missing (no service /amcl/get_state), but there is /tb1/amcl",
            "node bt_navigator: missing (no service /bt_navigator/get_state), but there is /tb1/bt_navigator",
            "action navigate_to_pose: no server, but there is /tb1/navigate_to_pose",
            "run with `--ros-args -r __ns:=/tb1`",
        )

    def test_transforms_in_namespace_are_remapped_with_it(self, robots: Robots) -> None:
        self.stack(robots, "/tb1")
        graph = robots.graph()
        wanted = [Endpoint("node", "amcl"), Endpoint("action", "navigate_to_pose", NAVIGATE)]
        said = "run with `--ros-args -r __ns:=/tb1 -r /tf:=tf -r /tf_static:=tf_static`"
        robots.until(lambda: graph.advice(wanted) == said, said)

    def test_existing_endpoint_is_remapped_out_of_suggested_namespace(self, robots: Robots) -> None:
        self.stack(robots, "/tb1", topic="/tf")
        robots.serve(robots.node("/detector"), "/detect_survivor")
        graph = robots.graph()
        wanted = [Endpoint("node", "amcl"), Endpoint("node", "bt_navigator"), DETECTOR]
        said = "run with `--ros-args -r __ns:=/tb1 -r detect_survivor:=/detect_survivor`"
        robots.until(lambda: graph.advice(wanted) == said, said)

    def test_single_name_elsewhere_is_remapped_alone(self, robots: Robots) -> None:
        node = robots.node("/other")
        robots.serve(node, "/tb1/detect_survivor")
        robots.publish(node, "/battery_state", BATTERY)
        uses = (Use.service("detect_survivor"), Use.topic("battery_state"))
        robots.expect_missing(
            self.ready(robots.node("/mission"), *uses),
            "service detect_survivor: no server, but there is /tb1/detect_survivor",
            "run with `--ros-args -r detect_survivor:=/tb1/detect_survivor`",
        )

    def test_only_wanted_name_is_remapped_without_namespace(self, robots: Robots) -> None:
        robots.serve(robots.node("/other"), "/tb1/detect_survivor")
        graph = robots.graph()
        said = "run with `--ros-args -r detect_survivor:=/tb1/detect_survivor`"
        robots.until(lambda: graph.advice([DETECTOR]) == said, said)

    def test_transforms_of_other_robot_are_not_suggested_beside_own_transforms(self, robots: Robots) -> None:
        robots.send_transforms(robots.node("/ekf"), ("odom", "base_link"))
        robots.send_transforms(robots.node("/tb2/ekf"), ("odom", "base_link"), topic="/tb2/tf")
        graph = robots.graph()
        robots.until(lambda: graph.publishers("/tf") and graph.publishers("/tb2/tf"), "both robots")
        assert (graph.transforms(), graph.explain_missing_transforms()) == ("", "")

    def test_namespaces_of_two_robots_are_named(self, robots: Robots) -> None:
        for space in ("/tb1", "/tb2"):
            self.stack(robots, space, topic="/tf")
        graph = robots.graph()
        wanted = [Endpoint("node", "amcl"), Endpoint("action", "navigate_to_pose", NAVIGATE)]
        said = "run with `--ros-args -r __ns:=/tb1`, or use /tb2 instead of /tb1"
        robots.until(lambda: graph.advice(wanted) == said, said)

    def test_global_namespace_is_suggested_to_mission_in_namespace(self, robots: Robots) -> None:
        self.stack(robots, "")
        graph = robots.graph("/tb1/mission")
        wanted = [Endpoint("node", "amcl"), Endpoint("action", "navigate_to_pose", NAVIGATE)]
        said = "run with `--ros-args -r __ns:=/`"
        robots.until(lambda: graph.advice(wanted) == said, said)

    @pytest.mark.parametrize("is_company", [False, True], ids=["alone", "beside another robot"])
    def test_mission_in_namespace_without_remapped_transforms_does_not_start(
        self, robots: Robots, *, is_company: bool
    ) -> None:
        self.stack(robots, "/tb1")
        if is_company:
            robots.send_transforms(robots.node("/tb2/amcl"), ("map", "tb2/odom"))
        ready = self.ready(robots.node("/tb1/mission"), *self.USES, pose=False)
        robots.expect_missing(
            ready,
            "transforms: published on /tb1/tf by /tb1/amcl, but this node subscribes to /tf. Run with "
            "`--ros-args -r /tf:=tf -r /tf_static:=tf_static`",
        )

    def test_remapping_of_global_transforms_is_reported(self, robots: Robots) -> None:
        self.stack(robots, "/tb1", topic="/tf")
        arguments = ["--ros-args", "-r", "/tf:=tf", "-r", "/tf_static:=tf_static"]
        graph = robots.graph("/tb1/mission", cli_args=arguments)
        said = (
            "transforms: published on /tf by /tb1/amcl, but this node subscribes to /tb1/tf. Run with "
            "`--ros-args -r /tf:=/tf -r /tf_static:=/tf_static`"
        )
        robots.until(lambda: graph.transforms() == said, said)

    def test_subscription_to_own_transforms_has_no_problem(self, robots: Robots) -> None:
        self.stack(robots, "/tb1")
        self.stack(robots, "/tb2")
        arguments = ["--ros-args", "-r", "/tf:=tf", "-r", "/tf_static:=tf_static"]
        graph = robots.graph("/tb1/mission", cli_args=arguments)
        robots.until(lambda: graph.publishers("/tf") and graph.publishers("/tb2/tf"), "both robots")
        assert (graph.transforms(), graph.foreign_localisation_problem()) == ("", "")

    def test_two_robots_on_same_transform_topic_are_named_and_no_pose_is_sent(self, robots: Robots) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped

        from sar_compiler.ros.frame_sources import frame_sources

        self.stack(robots, "", topic="/tf")
        other = robots.node("/tb2/amcl")
        robots.send_transforms(other, ("map", "odom"), x=-9.0)
        told: list[Any] = []
        other.create_subscription(PoseWithCovarianceStamped, "/initialpose", told.append, 1)
        mission = robots.node("/mission")
        conflict = (
            "frame 'odom' has two sources on /tf, /amcl and /tb2/amcl. Stop one of these nodes, or give each robot its own namespace and "
            "transforms (`-r __ns:=/robot1 -r /tf:=tf -r /tf_static:=tf_static`)"
        )
        ready = self.ready(mission, *self.USES)
        robots.until(lambda: len(mission.get_publishers_info_by_topic("/tf")) == 2, "both publishers")
        robots.until(frame_sources(mission).conflict, "the conflict")
        robots.expect_missing(
            ready,
            NO_POSE,
            conflict,
        )
        assert told == []

    @pytest.mark.parametrize(
        ("child", "advice"),
        [
            ("odom", SHARED_TRANSFORMS),
            ("tb2/odom", ""),
        ],
    )  # fmt: skip
    def test_initial_pose_is_not_sent_if_transforms_may_belong_to_other_robot(
        self, robots: Robots, child: str, advice: str
    ) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from nav_msgs.msg import Odometry

        from sar_compiler.ros.robot_estimate import robot_estimate

        amcl, other = robots.node("/amcl"), robots.node("/tb2/amcl")
        robots.serve(amcl, "/amcl", "/bt_navigator")
        robots.publish(amcl, "amcl_pose", POSES)
        robots.publish(other, "amcl_pose", POSES)
        robots.send_transforms(other, ("map", child), x=4.0)
        odometry = Odometry()
        odometry.header.frame_id, odometry.child_frame_id = "odom", "base_link"
        odometry.pose.pose.orientation.w = 1.0
        publisher = robots.publish(amcl, "odometry/filtered", ODOMETRY)

        def drive() -> None:
            odometry.header.stamp = amcl.get_clock().now().to_msg()
            publisher.publish(odometry)

        amcl.create_timer(0.05, drive)
        told: list[Any] = []
        amcl.create_subscription(PoseWithCovarianceStamped, "/initialpose", told.append, 1)
        mission = robots.node("/mission")
        robot, ready = robot_estimate(mission), self.ready(mission, Use.nav2())
        robots.until(lambda: robot.odometry and robot.transform_at, "odometry and transforms")
        if advice:
            robots.expect_missing(ready, NO_POSE, advice)
            assert told == []
        else:
            robots.until(lambda: ready.poll_all() and told, "the pose")
            ready.close()
        assert "2D Pose Estimate" not in str(ready.poll_all())

    def test_transforms_of_other_robot_do_not_update_transform_time(self, robots: Robots) -> None:
        from sar_compiler.ros.robot_estimate import robot_estimate

        robot = robot_estimate(robots.node("/mission"))
        robot._frames = ("odom", "base_link")
        own, other = (transform_bytes("map", child) for child in ("odom", "tb2/odom"))
        robot._on_transforms(other)
        before = robot.transform_at
        robot._on_transforms(own)
        after = robot.transform_at
        robot._on_transforms(other)
        assert before is not None
        assert after is not None
        assert before < after == robot.transform_at

    @pytest.mark.parametrize(
        ("topic", "type_name", "said"),
        [
            ("/amcl_pose", POSES, "topic amcl_pose has several publishers: /tb1/amcl and /tb2/amcl"),
            ("/odometry/filtered", ODOMETRY, "topic odometry/filtered: published by /tb1/amcl and /tb2/amcl. Stop all of these nodes but one"),
        ],
    )  # fmt: skip
    def test_two_localisation_sources_are_named(
        self, robots: Robots, topic: str, type_name: str, said: str
    ) -> None:
        for space in ("/tb1", "/tb2"):
            robots.publish(robots.node(f"{space}/amcl"), topic, type_name)
        graph = robots.graph()
        robots.until(lambda: graph.foreign_localisation_problem() == said, said)


TWO_MISMATCHES = (
    "best effort publisher and reliable subscription, volatile publisher and transient local subscription). "
    'Write qos="sensor_data"'
)


class TestQualityOfService:
    CASES: ClassVar[Any] = (
        (
            {"reliability": "best_effort"}, "reliable",
            'best effort publisher and reliable subscription). Write qos="sensor_data"',
        ),
        (
            {}, "transient_local",
            'volatile publisher and transient local subscription). Write qos="reliable"',
        ),
        (
            {"reliability": "best_effort"}, "transient_local",
            TWO_MISMATCHES,
        ),
    )  # fmt: skip

    @pytest.mark.parametrize(("offered", "wanted", "said"), CASES)
    def test_incompatible_publisher_is_named_with_remedy(
        self, robots: Robots, offered: dict[str, str], wanted: str, said: str
    ) -> None:
        from sar_compiler.ros.leaves.leaf import qos_profile

        robots.publish(robots.node("/tb1/driver"), "/battery_state", BATTERY, **offered)
        graph = robots.graph()
        endpoint = Endpoint("topic", "battery_state", BATTERY, (qos_profile("", wanted),))
        line = f"topic battery_state: no message of /tb1/driver arrives ({said}"
        robots.until(lambda: graph.query(endpoint).line == line, line)

    def test_deadline_shorter_than_publisher_deadline_is_named(self, robots: Robots) -> None:
        robots.publish(robots.node("/driver"), "/battery_state", BATTERY, deadline_sec=3.0)
        graph = robots.graph()
        strict, loose = (qos_of(deadline_sec=seconds) for seconds in (1.0, 5.0))
        endpoint = Endpoint("topic", "battery_state", BATTERY, (loose, strict))
        robots.until(lambda: graph.query(endpoint).problem, "the publisher")
        assert "subscription deadline is less than publisher deadline" in graph.query(endpoint).problem
        assert graph.query(Endpoint("topic", "battery_state", BATTERY, (loose,))).problem == ""

    def test_one_compatible_publisher_is_sufficient(self, robots: Robots) -> None:
        robots.publish(robots.node("/one"), "/battery_state", BATTERY, reliability="best_effort")
        robots.publish(robots.node("/two"), "/battery_state", BATTERY)
        graph = robots.graph()
        endpoint = Endpoint("topic", "battery_state", BATTERY, (qos_of(),))
        robots.until(lambda: len(graph.query(endpoint).nodes) == 2, "both publishers")
        assert graph.query(endpoint).line is None

    @pytest.mark.parametrize(
        ("qos", "said"),
        [
            (
                {"reliability": "best_effort"},
                "no response arrives from /detector (best effort publisher and reliable subscription)",
            ),
            (
                {"durability": "transient_local"},
                "no request reaches /detector (volatile publisher and transient local subscription)",
            ),
            ({}, ""),
        ],
    )
    def test_incompatible_service_is_named(self, robots: Robots, qos: dict[str, Any], said: str) -> None:
        from sar_interfaces.srv import DetectSurvivor

        server = robots.node("/detector")
        server.create_service(
            DetectSurvivor, "detect_survivor", lambda _, answer: answer, qos_profile=qos_of(**qos)
        )
        graph = robots.graph()
        line = (
            f"service detect_survivor: {said}: create its service with qos_profile_services_default"
            if said
            else None
        )
        robots.until(lambda: graph.query(DETECTOR).nodes == ("/detector",), "the service")
        robots.until(lambda: graph.query(DETECTOR).line == line, str(line))

    def test_visible_nodes_are_counted_by_name(self, robots: Robots) -> None:
        graph = robots.graph()
        for name in ("/tb1/amcl", "/tb1/amcl", "/tb2/amcl"):
            robots.node(name)
        robots.until(
            lambda: (graph.node_counts()["/tb1/amcl"], graph.node_counts()["/tb2/amcl"]) == (2, 1),
            "the nodes",
        )

    def test_readiness_check_reports_incompatible_publisher(self, robots: Robots) -> None:
        from sar_compiler.ros.graph_queries import declared_endpoints
        from sar_compiler.ros.leaves.attribute_leaves import RosTopic
        from sar_compiler.ros.readiness import Readiness

        leaf = RosTopic("Battery", Input("battery_state"), BATTERY, qos="reliable")
        robots.publish(robots.node("/driver"), "/battery_state", BATTERY, reliability="best_effort")
        ready = Readiness(
            robots.node("/mission"),
            [Use.topic("battery_state")],
            initial_pose=None,
            endpoints=declared_endpoints(leaf),
        )
        robots.expect_missing(
            ready,
            "topic battery_state: no message of /driver arrives (best effort publisher and reliable subscription). "
            'Write qos="sensor_data"',
        )


class TestSources:
    @pytest.mark.parametrize(
        ("topic", "type_name", "is_told"),
        [
            ("map", "nav_msgs/msg/OccupancyGrid", True),
            ("odometry/filtered", ODOMETRY, True),
            ("news", "std_msgs/msg/String", False),
        ],
    )
    def test_several_publishers_are_reported_for_single_source_topics(
        self, robots: Robots, topic: str, type_name: str, *, is_told: bool
    ) -> None:
        for name in ("/one", "/two"):
            robots.publish(robots.node(name), topic, type_name)
        graph = robots.graph()
        robots.until(lambda: len(graph.publishers(topic)) == 2, "both publishers")
        said = f"topic {topic}: published by /one and /two. Stop all of these nodes but one"
        assert graph.publisher_conflict(topic) == (said if is_told else "")

    def test_run_warns_of_several_publishers_and_renamed_odometry(self, robots: Robots, said: Said) -> None:
        from sar_compiler.ros.readiness import Readiness

        for name in ("/one", "/two"):
            robots.publish(robots.node(name), "map", "nav_msgs/msg/OccupancyGrid")
        robots.publish(robots.nodes[0], "odom", ODOMETRY)
        graph = robots.graph()
        robots.until(lambda: len(graph.publishers("map")) == 2 and graph.publishers("odom"), "the publishers")
        Readiness(robots.nodes[-1], [Use.nav2()], initial_pose=None).warn()
        lines = said.lines()
        assert any(
            "topic map: published by /one and /two. Stop all of these nodes but one." in line
            for line in lines
        )
        odometry = "topic odometry/filtered: no publisher, but there is /odom: run with `--ros-args -r odometry/filtered:=/odom`."
        assert any(odometry in line for line in lines)

    def test_source_that_joins_during_run_is_reported_once(self, robots: Robots, said: Said) -> None:
        from sar_compiler.ros.dependency_monitor import DependencyMonitor

        mission = robots.node("/mission")
        robots.publish(robots.node("/one"), "battery_state", BATTERY)
        watch = DependencyMonitor(mission, [Use.topic("battery_state")])
        robots.until(lambda: ros_graph(mission).publishers("battery_state") == ("/one",), "the first source")
        watch.poll()
        robots.publish(robots.node("/two"), "battery_state", BATTERY)
        line = "topic battery_state: published by /one and /two. Stop all of these nodes but one."
        robots.until(lambda: said.has(line), line)
        watch.poll()
        assert sum(line in each for each in said.lines()) == 1


class TestClock:
    @staticmethod
    def simulated() -> dict[str, Any]:
        from rclpy.parameter import Parameter

        return {"parameter_overrides": [Parameter("use_sim_time", value=True)]}

    def clock(self, robots: Robots, node: str, topic: str = "/clock", *, seconds: int | None = None) -> None:
        from rosgraph_msgs.msg import Clock

        other = robots.node(node)
        publisher = robots.publish(other, topic, "rosgraph_msgs/msg/Clock")
        if seconds is not None:
            message = Clock()
            message.clock.sec = seconds
            other.create_timer(0.05, lambda: publisher.publish(message))

    @pytest.mark.parametrize(
        ("nodes", "topic", "said"),
        [
            ((), "", "use_sim_time is set, but no message has arrived on /clock"),
            (("/gazebo",), "/clock", "use_sim_time is set, but no message has arrived on /clock from /gazebo: is the simulation paused?"),
            (
                ("/gazebo",), "/tb1/clock",
                "use_sim_time is set, but no message has arrived on /clock. Clock messages are published on /tb1/clock: run with `--ros-args -r /clock:=/tb1/clock`",
            ),
            (
                ("/bag", "/gazebo"), "/clock",
                "topic /clock has 2 publishers (nodes /bag and /gazebo), so the time jumps between their clocks. Stop all publishers but one",
            ),
        ],
    )  # fmt: skip
    def test_missing_or_duplicate_clock_is_explained(
        self, robots: Robots, nodes: tuple[str, ...], topic: str, said: str
    ) -> None:
        for node in nodes:
            self.clock(robots, node, topic)
        graph = robots.graph(**self.simulated())
        robots.until(lambda: graph.clock() == said, said)

    def test_two_clocks_prevent_start_although_time_has_arrived(self, robots: Robots) -> None:
        from sar_compiler.ros.readiness import Readiness

        for node in ("/bag", "/gazebo"):
            self.clock(robots, node, seconds=5)
        mission = robots.node("/mission", **self.simulated())
        robots.until(lambda: mission.get_clock().now().nanoseconds, "the time")
        ready = Readiness(mission, [], initial_pose=None)
        robots.until(lambda: ready.has_rival_servers, "both clocks")
        assert ready.poll_all() == [
            "topic /clock has 2 publishers (nodes /bag and /gazebo), so the time jumps between their clocks. Stop all publishers but one"
        ]

    def test_single_used_clock_is_not_reported(self, robots: Robots) -> None:
        self.clock(robots, "/gazebo", seconds=5)
        graph = robots.graph(**self.simulated())
        robots.until(lambda: graph.publishers("/clock") and graph.clock() == "", "the time")
        assert (graph.unused_clock_problem(), graph.is_clock_contested) == ("", False)

    def test_unused_clock_is_reported(self, robots: Robots, said: Said) -> None:
        from sar_compiler.ros.readiness import Readiness

        self.clock(robots, "/gazebo", seconds=5)
        mission = robots.node("/mission")
        robots.until(lambda: mission.count_publishers("/clock"), "the clock")
        assert Readiness(mission, [], initial_pose=None).poll()
        assert said.has(
            "/clock is published by /gazebo, but use_sim_time is not set, so the time stamps of the robot's messages appear old. "
            "Run with `--ros-args -p use_sim_time:=true`."
        )


class TestFrames:
    def make_lookup(self, robots: Robots, target: str, source: str, full_name: str = "/mission") -> Any:
        """Return a function that looks up a frame in another one, as a leaf does."""
        from sar_compiler.ros.frames import frame_tree

        frames = frame_tree(robots.node(full_name))
        return lambda: frames.look_up(target, source)

    @pytest.mark.parametrize(
        ("wanted", "link", "said"),
        [
            ("base_footprint", ("odom", "base_link"), "no transform of 'base_footprint' has arrived, but there are 'base_link' and 'odom'"),
            ("Base_Link", ("odom", "base_link"), "no transform of 'Base_Link' has arrived, but there are 'base_link' and 'odom'; did you mean 'base_link'?"),
            (
                "base_link", ("odom", "tb1/base_link"),
                "no transform of 'base_link' has arrived, but there are 'odom' and 'tb1/base_link'; did you mean 'tb1/base_link'?",
            ),
        ],
    )  # fmt: skip
    def test_missing_frame_is_reported_with_known_frames(
        self, robots: Robots, wanted: str, link: tuple[str, str], said: str
    ) -> None:
        robots.send_transforms(robots.node("/ekf"), link)
        look = self.make_lookup(robots, "odom", wanted)
        robots.until(lambda: look() == said, said)

    def test_eight_of_many_frames_are_named(self, robots: Robots) -> None:
        links = [("map", f"survivor_{number}") for number in range(1, 30)]
        robots.send_transforms(robots.node("/ekf"), *links)
        look = self.make_lookup(robots, "map", "zebra")
        robots.until(lambda: "survivor_15 and others" in str(look()).replace("'", ""), "some frames")

    def test_use_of_transforms_waits_for_one_source_of_each_frame(self, robots: Robots) -> None:
        from sar_compiler.ros.readiness import Readiness

        ready = Readiness(robots.node("/mission"), [Use.transforms()], initial_pose=None)
        assert ready.poll_all() == ["transforms: no node publishes on /tf or /tf_static"]
        one = robots.node("/one")
        robots.send_transforms(one, ("map", "dock"), topic="/tf_static", static=True)
        robots.until(lambda: ready.poll_all() == [], "the static transform")
        for node in (one, robots.node("/two")):
            robots.send_transforms(node, ("map", "odom"))
        robots.until(lambda: "frame 'odom' has two sources" in str(ready.poll_all()), "the conflict")

    def test_topic_of_missing_transforms_is_named(self, robots: Robots) -> None:
        robots.send_transforms(robots.node("/tb1/ekf"), ("map", "odom"), topic="/tb1/tf")
        look = self.make_lookup(robots, "map", "odom", "/tb1/mission")
        said = (
            "no transform of 'map' and 'odom' has arrived: transforms: published on /tb1/tf by /tb1/ekf, but this node subscribes "
            "to /tf. Run with `--ros-args -r /tf:=tf -r /tf_static:=tf_static`"
        )
        robots.until(lambda: look() == said, said)

    def test_frame_with_two_sources_is_rejected_and_both_are_named(self, robots: Robots) -> None:
        for name, x in (("/tb1/amcl", 1.0), ("/tb2/amcl", 9.0)):
            robots.send_transforms(robots.node(name), ("map", "odom"), x=x)
        look = self.make_lookup(robots, "map", "odom")
        said = "frame 'odom' has two sources on /tf, /tb1/amcl and /tb2/amcl. Stop one"
        robots.until(lambda: str(look()).startswith(said), said)

    def test_two_sources_among_three_publishers_are_reported(self, robots: Robots) -> None:
        for name, x in (("/tb1/amcl", 1.0), ("/tb2/amcl", 9.0)):
            robots.send_transforms(robots.node(name), ("map", "odom"), x=x)
        robots.send_transforms(robots.node("/arm"), ("base_link", "arm"))
        look = self.make_lookup(robots, "map", "odom")
        said = "frame 'odom' has two sources on /tf, among its 3 publishers /arm, /tb1/amcl and /tb2/amcl. Stop one"
        robots.until(lambda: str(look()).startswith(said), said)

    def test_publishers_of_different_frames_do_not_conflict(self, robots: Robots) -> None:
        from sar_compiler.ros.frames import frame_tree

        robots.send_transforms(robots.node("/amcl"), ("map", "odom"))
        robots.send_transforms(robots.node("/ekf"), ("odom", "base_link"))
        look = self.make_lookup(robots, "map", "base_link")
        robots.until(lambda: not isinstance(look(), str), "the transforms")
        heard = frame_tree(robots.nodes[-1])
        messages: list[bool] = []
        heard.add_listener(lambda: messages.append(isinstance(look(), str)))
        robots.until(lambda: len(messages) > 20, "more of them")
        assert not any(messages)

    @pytest.mark.parametrize(
        ("numbers", "now", "contested"),
        [
            ((1, 2, 3, 1, 2, 3), 3.0, []),  # restarted
            ((1, 1, 2, 2), 2.0, ["odom"]),
            ((7, 900, 8, 901, 9), 2.5, ["odom"]),
            ((7, 900, 8, 901, 9), 3.0, ["odom"]),
            ((7, 900, 8, 901, 9, 10, 11), 3.5, []),  # the other one has ended
        ],
    )
    def test_alternating_publishers_are_detected_by_sequence_numbers(
        self, numbers: tuple[int, ...], now: float, contested: list[str]
    ) -> None:
        from sar_compiler.ros.frame_sources import PublisherAlternation

        turns = PublisherAlternation()
        for at, number in enumerate(numbers):
            turns.add(["odom", f"wheel_{at}"], number, at / 2)
        assert turns.contested_frames(now) == contested

    def test_static_and_moving_frame_is_rejected_and_both_nodes_are_named(self, robots: Robots) -> None:
        robots.send_transforms(robots.node("/urdf"), ("odom", "base_link"), topic="/tf_static", static=True)
        robots.send_transforms(robots.node("/ekf"), ("odom", "base_link"), x=5.0)
        look = self.make_lookup(robots, "odom", "base_link")
        said = "frame 'base_link' is published as static (/tf_static, by /urdf) and as moving (/tf, by /ekf). Stop one of these nodes"
        robots.until(lambda: look() == said, said)

    def test_static_frame_is_found_after_moving_source_ends(self, robots: Robots, context: Ros) -> None:
        robots.send_transforms(robots.node("/urdf"), ("odom", "base_link"), topic="/tf_static", static=True)
        robots.send_transforms(robots.node("/amcl"), ("map", "odom"))
        robots.send_transforms(robots.node("/ekf"), ("odom", "base_link"), x=5.0)
        look = self.make_lookup(robots, "odom", "base_link")
        said = "frame 'base_link' is published as static"
        robots.until(lambda: str(look()).startswith(said), said)
        context.remove(robots.nodes.pop(2))
        robots.until(lambda: not isinstance(look(), str), "the frame")

    def test_restarted_static_source_with_new_value_is_one_source(self, robots: Robots, context: Ros) -> None:
        from sar_compiler.ros.frame_sources import frame_sources

        look = self.make_lookup(robots, "map", "dock")
        sources = frame_sources(robots.nodes[0])

        def is_heard(x: float) -> bool:
            return (
                sources.conflict() == ""
                and "dock" in sources._static
                and sources._static["dock"].transform.offset[0] == x
            )

        for name, x in (("/before", 1.0), ("/after", 2.0)):
            robots.send_transforms(robots.node(name), ("map", "dock"), topic="/tf_static", static=True, x=x)
            robots.until(lambda x=x: is_heard(x), name)
            robots.until(lambda x=x: not isinstance(look(), str) and look().transform.x == x, name)
            if name == "/before":
                context.remove(robots.nodes.pop())
                robots.until(lambda: not ros_graph(robots.nodes[0]).publishers("/tf_static"), "its end")

    def test_differing_static_sources_are_named_until_one_ends(self, robots: Robots, context: Ros) -> None:
        for name, x in (("/one", 1.0), ("/two", 2.0)):
            robots.send_transforms(robots.node(name), ("map", "dock"), topic="/tf_static", static=True, x=x)
        look = self.make_lookup(robots, "map", "dock")
        said = "frame 'dock' has two sources on /tf_static, /one and /two. Stop one"
        robots.until(lambda: str(look()).startswith(said), said)
        context.remove(robots.nodes.pop(0))
        robots.until(lambda: not isinstance(look(), str), "a frame of one source")

    def test_child_frames_are_read_from_serialized_message(self) -> None:
        from sar_compiler.ros.frame_sources import child_frames

        children = ["odom", "a", "base_link", "", "camera/é"]
        for parent in ("", "p", "pp", "ppp", "pppp"):
            came = transform_bytes(parent, *children)
            assert child_frames(came) == children
            assert child_frames(came[:-1]) == children[:-1]
        assert child_frames(b"\0\1\0\0\xff\xff\xff\xff") == child_frames(b"") == []


class TestWatch:
    def watch(self, node: Any) -> Any:
        from sar_compiler.ros.dependency_monitor import DependencyMonitor

        return DependencyMonitor(node, [Use.nav2()])

    def test_second_robot_on_transforms_is_reported_with_both_nodes(self, robots: Robots, said: Said) -> None:
        watch = self.watch(robots.node("/mission"))
        robots.send_transforms(robots.node("/amcl"), ("map", "odom"))
        robots.until(lambda: ros_graph(robots.nodes[0]).publishers("/tf"), "the transforms")
        watch.poll()
        assert not said.has("two sources")
        robots.send_transforms(robots.node("/tb2/amcl"), ("map", "odom"), x=9.0)
        robots.until(
            lambda: said.has("frame 'odom' has two sources on /tf, /amcl and /tb2/amcl"), "the report"
        )

    def test_second_clock_is_reported(self, robots: Robots, said: Said) -> None:
        watch = self.watch(robots.node("/mission", **TestClock.simulated()))
        for name in ("/bag", "/gazebo"):
            robots.publish(robots.node(name), "/clock", "rosgraph_msgs/msg/Clock")
        robots.until(lambda: said.has("topic /clock has 2 publishers (nodes /bag and /gazebo)"), "the report")
        watch.poll()

    def test_pose_is_not_sent_to_localisation_of_other_robot(
        self, robots: Robots, said: Said, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped

        from sar_compiler.ros.robot_estimate import robot_estimate

        monkeypatch.setattr("sar_compiler.ros.dependency_monitor._LOST_SEC", 0.1)
        amcl, mission = robots.node("/amcl"), robots.node("/mission")
        robots.serve(amcl, "/amcl", "/bt_navigator")
        poses = robots.publish(amcl, "amcl_pose", POSES, durability="transient_local")
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id, pose.pose.pose.orientation.w = "map", 1.0
        pose.header.stamp = amcl.get_clock().now().to_msg()
        poses.publish(pose)
        watch, robot = self.watch(mission), robot_estimate(mission)
        robots.until(lambda: robot.pose and robot.lifecycle("amcl").state == "active", "the localisation")
        watch.poll()
        other, told = robots.node("/tb2/amcl"), list[Any]()
        other.create_subscription(PoseWithCovarianceStamped, "/initialpose", told.append, 1)
        robots.publish(other, "/amcl_pose", POSES)
        line = (
            "A localisation node has appeared. No pose is sent to this node, because it may belong to another robot: topic amcl_pose has several publishers: "
            "/amcl and /tb2/amcl."
        )
        robots.until(lambda: said.has(line), line)
        assert told == []
        assert not said.has("2D Pose Estimate")


class TestLeaves:
    def test_latched_message_does_not_expire_by_default(self) -> None:
        from sar_compiler.ros.leaves.attribute_leaves import RosTopic

        ages = [
            RosTopic("Map", Input("map"), "nav_msgs/msg/OccupancyGrid", qos=qos, max_age_sec=age).max_age_sec
            for qos, age in (("transient_local", None), ("transient_local", 2.0), ("reliable", None), ("reliable", 7.0))
        ]  # fmt: skip
        assert ages == [None, 2.0, 5.0, 7.0]

    def test_leaf_without_message_reports_graph_findings(self, robots: Robots) -> None:
        from sar_compiler.ros.leaves.attribute_leaves import RosTopic

        mission = robots.node("/mission")
        leaf = RosTopic("Battery", Input("battery_state"), BATTERY, qos="reliable")
        leaf.setup(node=mission)

        def expect_message(text: str) -> None:
            def ticked() -> bool:
                leaf.tick_once()
                return leaf.feedback_message == f"no message on 'battery_state'{text}"

            try:
                robots.until(ticked, text)
            except AssertionError:
                pytest.fail(f"{leaf.feedback_message!r}, not {text!r}")

        expect_message(", because no node publishes it")
        driver = robots.node("/tb1/driver")
        robots.publish(driver, "battery_state", BATTERY)
        expect_message(', but there is /tb1/battery_state: write topic="/tb1/battery_state" in the tree, or run with '
             "`--ros-args -r battery_state:=/tb1/battery_state`")  # fmt: skip
        robots.publish(driver, "/battery_state", BATTERY, reliability="best_effort")
        expect_message(": no message of /tb1/driver arrives (best effort publisher and reliable subscription). "
             'Write qos="sensor_data"')  # fmt: skip
        robots.publish(driver, "/battery_state", BATTERY)
        expect_message("")
        leaf.shutdown()

    @pytest.mark.parametrize(
        ("topic", "qos", "said"),
        [
            ("/tb1/battery_state", {},
             (', but there is /tb1/battery_state: write topic="/tb1/battery_state" in the tree, or run with '
             "`--ros-args -r /battery_state:=/tb1/battery_state`")),
            ("/battery_state", {"durability": "transient_local"},
             (": no message reaches /display (volatile publisher and transient local subscription). "
             'Write qos="transient_local"')),
        ],
    )  # fmt: skip
    def test_missing_subscriber_is_explained(
        self, robots: Robots, topic: str, qos: dict[str, Any], said: str
    ) -> None:
        from sensor_msgs.msg import BatteryState

        display = robots.node("/display")
        display.create_subscription(BatteryState, topic, lambda _: None, qos_of(**qos))
        mission = robots.node("/mission")
        asked = Endpoint("listeners", "/battery_state", BATTERY, (qos_of(),), "topic")
        robots.until(lambda: explain_endpoint(mission, asked) == said, said)

    def test_leaf_without_server_names_similar_server(self, robots: Robots) -> None:
        from sar_compiler.ros.leaves.attribute_leaves import RosService

        mission = robots.node("/mission")
        robots.serve(robots.node("/other"), "/tb1/detect_survivor")
        graph = ros_graph(mission)
        robots.until(lambda: graph.query(DETECTOR).elsewhere, "the service")
        leaf = RosService("Detect", Input("detect_survivor"), DETECT, server_timeout_sec=0.0)
        leaf.setup(node=mission)
        leaf.tick_once()
        leaf.tick_once()
        assert leaf.feedback_message == (
            "'Detect' failed: no server for the service 'detect_survivor' within 0 s, but there is /tb1/detect_survivor: write "
            'service="/tb1/detect_survivor" in the tree, or run with '
            "`--ros-args -r detect_survivor:=/tb1/detect_survivor`"
        )
        leaf.shutdown()


def test_names_are_joined_with_commas_and_and() -> None:
    assert [join_names(names) for names in (["a"], ["a", "b"], ["a", "b", "c"])] == [
        "a",
        "a and b",
        "a, b and c",
    ]
