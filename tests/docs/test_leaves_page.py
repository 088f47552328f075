"""Tests of the first three leaves in `docs/how-to/write-a-leaf.md`, as printed, against small servers over DDS."""

import ast
import importlib
import sys
from pathlib import Path

import pytest
from py_trees.common import Status

from sar_compiler.leaves import Input, Output
from tests.docs.markdown import blocks

SOURCE = next(block.text for block in blocks(Path("docs/how-to/write-a-leaf.md")) if block.file == "rover.py")
CLASSES = {node.name: node for node in ast.parse(SOURCE).body if isinstance(node, ast.ClassDef)}


@pytest.fixture(scope="module")
def rover(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    (folder / "rover.py").write_text(SOURCE, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield importlib.import_module("rover")
        sys.modules.pop("rover")


@pytest.fixture
def stage():
    rclpy = pytest.importorskip("rclpy")
    from tests.missions.mission_stage import Stage

    context = rclpy.context.Context()
    rclpy.init(context=context)
    stage = Stage(context)
    yield stage
    stage.close()
    context.try_shutdown()


def test_page_has_one_leaf_for_each_base_class():
    bases = [ast.unparse(node.bases[0]) for node in CLASSES.values()]
    assert bases == ["ActionLeaf", "ServiceLeaf", "TopicLeaf"]


@pytest.mark.parametrize("name", CLASSES)
def test_each_leaf_has_at_most_twenty_lines(name):
    first = CLASSES[name].decorator_list[0].lineno
    lines = SOURCE.splitlines()[first - 1 : CLASSES[name].end_lineno]
    assert len([line for line in lines if line.strip()]) <= 20


@pytest.mark.ros
def test_action_leaf_drives_to_position_from_its_ports(rover, stage):
    server = stage.nav_server()
    server.script = ["succeed"]
    assert stage.run(stage.take(rover.DriveTo("There", Input(1.5), Input(-0.5)))) is Status.SUCCESS
    assert server.goals[0].pose == ("map", 1.5, -0.5, 0.0, 1.0)


@pytest.mark.ros
def test_service_leaf_outputs_its_response(rover, stage):
    from lifecycle_msgs.srv import GetState

    from tests.missions.mission_stage import ScriptedService

    def answer(_, response):
        response.current_state.label = "inactive"

    ScriptedService(stage.host(), GetState, "camera/get_state", answer)
    state = Output[str]()
    assert stage.run(stage.take(rover.AskState("Ask", "camera", state))) is Status.SUCCESS
    assert state.value == "inactive"


@pytest.mark.ros
def test_topic_leaf_waits_for_pose_and_receives_latched_pose(rover, stage):
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from rclpy.qos import DurabilityPolicy, QoSProfile

    x, y = Output[float](), Output[float]()
    early = stage.take(rover.Locate("Early", x, y))
    early.tick_once()
    assert (early.status, x.value) == (Status.RUNNING, None)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    pose = PoseWithCovarianceStamped()
    pose.header.frame_id = "map"
    pose.pose.pose.position.x, pose.pose.pose.position.y = 1.5, -0.5
    stage.host().node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched).publish(pose)
    assert stage.run(early) is Status.SUCCESS
    late_x = Output[float]()
    assert stage.run(stage.take(rover.Locate("Late", late_x, y))) is Status.SUCCESS
    assert (x.value, late_x.value, y.value) == (1.5, 1.5, -0.5)
