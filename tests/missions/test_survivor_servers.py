"""Tests of the two survivor servers over DDS: as nodes and as commands."""

from __future__ import annotations

import math
import re
import signal
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest

from search_and_rescue.hiding import HiddenSurvivor
from search_and_rescue.plugin import MISSION
from search_and_rescue.search_theory import SearchExpectation
from search_and_rescue.server_commands import detect, report
from search_and_rescue.zone_manager import MapPose
from tests.processes import Command
from tests.waiting import SILENCE_SEC

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tests.ros.conftest import Ros, Said

pytestmark = pytest.mark.ros

DETECT, REPORT = "sar-detect-survivor-server", "sar-report-survivor-server"


class Caller:
    """A client of the two services."""

    def __init__(self, ros: Ros, namespace: str = "") -> None:
        from sar_interfaces.srv import DetectSurvivor, ReportSurvivor

        self.ros = ros
        self.node = ros.node("caller", namespace=namespace)
        self.detector = self.node.create_client(DetectSurvivor, "detect_survivor")
        self.reporter = self.node.create_client(ReportSurvivor, "report_survivor")

    def send(self, client: Any, request: Any) -> Any:
        self.ros.spin_until(client.service_is_ready, f"the service {client.srv_name}", 10.0)
        return client.call_async(request)

    def answer(self, client: Any, request: Any) -> Any:
        future = self.send(client, request)
        self.ros.spin_until(future.done, f"the answer of {client.srv_name}")
        return future.result()

    def detect(self, zone_id: str) -> Any:
        from sar_interfaces.srv import DetectSurvivor

        return self.answer(self.detector, DetectSurvivor.Request(zone_id=zone_id))

    def report(self, survivor_id: str, x: float, y: float, frame: str = "map") -> bool:
        return bool(self.answer(self.reporter, self.report_request(survivor_id, x, y, frame)).acknowledged)

    def report_request(self, survivor_id: str, x: float, y: float, frame: str = "map") -> Any:
        from sar_interfaces.srv import ReportSurvivor

        request = ReportSurvivor.Request(survivor_id=survivor_id)
        request.location.header.frame_id = frame
        request.location.point.x, request.location.point.y = x, y
        return request


class TestDetectServer:
    def serve(self, ros: Ros, *parameters: str, faults: Any = None) -> Caller:
        from search_and_rescue.servers import DetectSurvivorServer

        arguments = ["--ros-args", *(part for each in parameters for part in ("-p", each))]
        ros.add(DetectSurvivorServer(faults, context=ros.context, cli_args=arguments if parameters else None))
        return Caller(ros)

    def test_survivor_in_range_is_published_while_robot_drives(self, ros: Ros) -> None:
        from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        places = (
            "survivors.near.x:=1.0",
            "survivors.near.y:=2.0",
            "survivors.far.x:=9.0",
            "survivors.far.y:=9.0",
        )
        ranges = ("zones.near.detection_range:=2.5", "zones.far.detection_range:=2.5")
        caller = self.serve(ros, *places, *ranges)
        seen: list[PointStamped] = []
        caller.node.create_subscription(PointStamped, "survivor_detections", seen.append, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        here = PoseWithCovarianceStamped()
        here.header.frame_id = "map"
        caller.node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched).publish(here)
        ros.spin_until(lambda: len(seen) == 2, "two detections")
        assert {(each.header.frame_id, each.point.x, each.point.y) for each in seen} == {("map", 1.0, 2.0)}

    def test_server_finds_survivors_of_contract(self, ros: Ros, said: Said) -> None:
        caller = self.serve(ros)
        answers = [caller.detect(f"zone_{letter}") for letter in "abcd"]
        assert [(a.found, a.survivor_x, a.survivor_y) for a in answers] == [
            (True, -2.5, 3.2),
            (False, 0.0, 0.0),
            (True, 4.1, -2.5),
            (False, 0.0, 0.0),
        ]
        # rclpy itself may warn of a client that is slow to listen.
        spoken = [line.partition("]: ")[2] for line in said.lines() if "]: " in line]
        assert spoken == [
            "DetectSurvivor service ready.",
            "Detection request for zone_a: FOUND at (-2.50, 3.20)",
            "Detection request for zone_b: NOT FOUND",
            "Detection request for zone_c: FOUND at (4.10, -2.50)",
            "Detection request for zone_d: NOT FOUND",
        ]

    def test_parameters_replace_survivors_of_contract(self, ros: Ros) -> None:
        caller = self.serve(ros, "survivors.zone_b.x:=1", "survivors.zone_b.y:=-2.5")
        answer = caller.detect("zone_b")
        assert (answer.found, answer.survivor_x, answer.survivor_y) == (True, 1.0, -2.5)
        assert not caller.detect("zone_a").found

    def test_server_finds_only_hidden_survivor(self, ros: Ros) -> None:
        from search_and_rescue.servers import DetectSurvivorServer

        poses = {name: MapPose(x=1.0, y=2.0, yaw=0.0) for name in ("cave", "zone_a")}
        hiding = HiddenSurvivor(
            poses, {"cave": SearchExpectation(1.0, 1.0), "zone_a": SearchExpectation(0.0, 1.0)}, 0
        )
        ros.add(DetectSurvivorServer(None, hiding, context=ros.context))
        caller = Caller(ros)
        answers = [caller.detect(name) for name in ("zone_a", "cave")]
        assert [(a.found, a.survivor_x, a.survivor_y) for a in answers] == [
            (False, 0.0, 0.0),
            (True, 2.0, 2.0),
        ]

    def test_incomplete_table_is_rejected(self, ros: Ros) -> None:
        from sar_compiler.missions.parameter_reader import ParameterError

        with pytest.raises(ParameterError, match=r"survivors\.zone_b\.y: is missing"):
            self.serve(ros, "survivors.zone_b.x:=1")

    def test_misspelled_parameter_is_reported_once(self, ros: Ros, said: Said) -> None:
        caller = self.serve(ros, "survivor.kitchen.x:=1.0", "survivor.kitchen.y:=2.0", "tick_rate:=1.0")
        assert not caller.detect("kitchen").found
        warnings = [line.partition("]: ")[2] for line in said.lines() if "is not used" in line]
        assert warnings == ["parameter 'survivor' is not used: did you mean 'survivors'?"]

    def test_service_follows_namespace(self, make_ros: Callable[..., Ros]) -> None:
        from search_and_rescue.servers import DetectSurvivorServer

        ros = make_ros(["--ros-args", "-r", "__ns:=/robot1"])
        ros.add(DetectSurvivorServer(context=ros.context))
        assert Caller(ros).detect("zone_a").found

    def test_dropped_call_gets_no_response_and_next_call_does(self, ros: Ros) -> None:
        from sar_compiler.missions.faults import FaultPlan, parse_fault

        plan = FaultPlan([parse_fault("detect_survivor:drop=1", MISSION.faults)])
        caller = self.serve(ros, faults=plan.for_service("detect_survivor"))
        from sar_interfaces.srv import DetectSurvivor

        first = caller.send(caller.detector, DetectSurvivor.Request(zone_id="zone_a"))
        assert caller.detect("zone_a").found
        assert not first.done()


class TestReportServer:
    def serve(self, ros: Ros, faults: Any = None) -> Caller:
        from search_and_rescue.servers import ReportSurvivorServer

        ros.add(ReportSurvivorServer(faults, context=ros.context))
        return Caller(ros)

    def test_report_is_acknowledged_and_logged_with_id_point_and_frame(self, ros: Ros, said: Said) -> None:
        assert self.serve(ros).report("survivor_1", -2.5, 3.2)
        # rclpy itself may warn of a client that is slow to listen.
        spoken = [line.partition("]: ")[2] for line in said.lines() if "]: " in line]
        assert spoken[:2] == [
            "ReportSurvivor service ready.",
            "Report received: survivor_1 at (-2.50, 3.20). Acknowledged.",
        ]
        assert said.has("survivor_1", "'map'")

    @pytest.mark.parametrize(("x", "y"), [(math.nan, 0.0), (0.0, math.inf), (-math.inf, math.nan)])
    def test_report_at_invalid_position_is_not_acknowledged(self, ros: Ros, x: float, y: float) -> None:
        assert not self.serve(ros).report("survivor_1", x, y)

    @pytest.mark.parametrize("frame", ["odom", "", "/map"])
    def test_report_in_another_frame_is_not_acknowledged(self, ros: Ros, said: Said, frame: str) -> None:
        assert not self.serve(ros).report("survivor_1", 0.0, 0.0, frame)
        assert said.has("WARN", "survivor_1", f"in the frame '{frame}'")
        assert not said.has("Acknowledged")

    def test_repeated_report_is_acknowledged_and_counted_once(self, ros: Ros, said: Said) -> None:
        caller = self.serve(ros)
        assert [caller.report("survivor_1", 1.0, 2.0) for _ in range(2)] == [True, True]
        assert said.has("Report received again: survivor_1 at (1.00, 2.00). Acknowledged.")
        assert sum("Report received: survivor_1" in line for line in said.lines()) == 1
        assert caller.report("survivor_1", 5.0, 2.0)
        assert said.has("Report received: survivor_1 at (5.00, 2.00).")

    def test_injected_fault_refuses_first_report_only(self, ros: Ros) -> None:
        from sar_compiler.missions.faults import FaultPlan, parse_fault

        plan = FaultPlan([parse_fault("report_survivor:refuse=1", MISSION.faults)])
        caller = self.serve(ros, plan.for_service("report_survivor"))
        assert [caller.report("survivor_1", 0.0, 0.0) for _ in range(2)] == [False, True]


@pytest.fixture
def start() -> Iterator[Callable[..., Command]]:
    running: list[Command] = []

    def begin(name: str, *arguments: str) -> Command:
        running.append(Command(name, *arguments))
        return running[-1]

    yield begin
    for each in running:
        each.kill()


class TestCommands:
    @pytest.mark.parametrize(
        ("name", "line", "number"),
        [
            (DETECT, "DetectSurvivor service ready.", signal.SIGINT),
            (REPORT, "ReportSurvivor service ready.", signal.SIGTERM),
        ],
    )
    def test_server_exits_cleanly_on_signal(
        self, start: Callable[..., Command], name: str, line: str, number: int
    ) -> None:
        server = start(name)
        server.wait_for(line)
        assert server.stop(number) == 0

    def test_server_exits_if_node_destruction_hangs(self) -> None:
        hangs = (
            "from rclpy.node import Node\n"
            "from sar_compiler.ros import serving\n"
            "class Stuck(Node):\n"
            "    def destroy_node(self):\n"
            "        while True: pass\n"
            "def make(context, arguments):\n"
            "    print('ready', flush=True)\n"
            "    return Stuck('stuck', context=context)\n"
            "serving._DESTRUCTION_SEC = 0.5\n"
            "serving.serve(make, 'stuck', 'Hangs.', [])\n"
        )
        server = subprocess.Popen(
            [sys.executable, "-c", hangs], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert server.stdout is not None
        assert server.stdout.readline() == "ready\n"
        server.terminate()
        _, said = server.communicate(timeout=SILENCE_SEC)
        assert server.returncode == 1
        assert "in destroy_node" in said

    def test_server_answers_another_process_in_namespace(
        self, ros: Ros, start: Callable[..., Command]
    ) -> None:
        server = start(
            DETECT,
            "--ros-args",
            "-r",
            "__ns:=/robot1",
            "-p",
            "survivors.cave.x:=1.0",
            "-p",
            "survivors.cave.y:=2",
        )
        answer = Caller(ros, "/robot1").detect("cave")
        assert (answer.found, answer.survivor_x, answer.survivor_y) == (True, 1.0, 2.0)
        server.wait_for("Detection request for cave: FOUND at (1.00, 2.00)")

    def test_server_acknowledges_report_of_another_process(
        self, ros: Ros, start: Callable[..., Command]
    ) -> None:
        server = start(REPORT)
        assert Caller(ros).report("survivor_2", 4.1, -2.5)
        server.wait_for("Report received: survivor_2 at (4.10, -2.50). Acknowledged.")

    @pytest.mark.parametrize(
        ("arguments", "part"),
        [
            (["--ros-args", "-p", "survivors.cave.x:=1.0"], r"survivors\.cave\.y: is missing"),
            (
                ["--ros-args", "-p", "survivors:=[]"],
                "parameter survivors: ROS cannot infer the type of an empty list",
            ),
            (["--ros-args", "-r", "nothing"], "'-r nothing' is invalid"),
            (["--ros-args", "--params-file", "none.yaml"], "cannot read none.yaml: No such file"),
        ],
    )
    def test_invalid_command_line_prints_one_message_with_status_2(
        self, capfd: pytest.CaptureFixture[str], arguments: list[str], part: str
    ) -> None:
        assert detect(arguments) == 2
        assert re.search(f"^sar-detect-survivor-server: .*{part}", capfd.readouterr().err, re.MULTILINE)

    def test_unknown_option_is_rejected(self, capfd: pytest.CaptureFixture[str]) -> None:
        with pytest.raises(SystemExit) as caught:
            detect(["--loud"])
        assert caught.value.code == 2
        assert "unrecognized arguments: --loud" in capfd.readouterr().err

    @pytest.mark.parametrize("command", [detect, report])
    def test_help_mentions_ros_arguments(
        self, capsys: pytest.CaptureFixture[str], command: Callable[[list[str]], int]
    ) -> None:
        with pytest.raises(SystemExit) as caught:
            command(["--help"])
        assert caught.value.code == 0
        assert "--ros-args" in capsys.readouterr().out
