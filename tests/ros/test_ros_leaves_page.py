"""Tests of the tree in `docs/how-to/leaves-by-attributes.md` against real servers, and of its tables against the registered leaves."""

from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from sar_compiler.loaded_tree import load
from sar_compiler.nodes.ros_leaves import specs
from sar_compiler.nodes.spec import ParameterRole
from tests.docs.markdown import blocks
from tests.ros.conftest import Ros

PAGE = Path("docs/how-to/leaves-by-attributes.md")
TREE = next(block.text for block in blocks(PAGE) if block.file == "inspection.xml")
SPECS = {spec.tag: spec for spec in specs("jazzy")}


class World:
    """The servers that the tree calls: a battery, a transform, parameters and an action that may abort."""

    def __init__(self, ros: Ros, *, aborts: bool) -> None:
        from geometry_msgs.msg import TransformStamped
        from nav2_msgs.action import NavigateThroughPoses
        from rcl_interfaces.msg import SetParametersResult
        from rcl_interfaces.srv import SetParameters
        from rclpy.action import ActionServer
        from sensor_msgs.msg import BatteryState
        from std_msgs.msg import String
        from tf2_msgs.msg import TFMessage

        self.parameters: list[Any] = []
        self.goals: list[Any] = []
        self.heard: list[str] = []
        node = ros.node("world")
        battery = node.create_publisher(BatteryState, "battery_state", 1)
        frames = node.create_publisher(TFMessage, "/tf", 1)
        where = TransformStamped(child_frame_id="base_link")
        where.header.frame_id = "map"
        where.transform.translation.x = 4.0
        where.transform.rotation.w = 1.0

        def publish() -> None:
            battery.publish(BatteryState(percentage=0.5))
            where.header.stamp = node.get_clock().now().to_msg()
            frames.publish(TFMessage(transforms=[where]))

        def set_parameters(request: Any, response: Any) -> Any:
            self.parameters += request.parameters
            response.results = [SetParametersResult(successful=True)]
            return response

        def execute(handle: Any) -> Any:
            self.goals.append(handle.request)
            (handle.abort if aborts else handle.succeed)()
            return (
                NavigateThroughPoses.Result(error_code=7, error_msg="no way")
                if aborts
                else NavigateThroughPoses.Result()
            )

        node.create_timer(0.02, publish)
        node.create_service(SetParameters, "controller_server/set_parameters", set_parameters)
        node.kept = ActionServer(node, NavigateThroughPoses, "navigate_through_poses", execute)
        node.create_subscription(
            String, "inspection/failed", lambda message: self.heard.append(message.data), 10
        )


@pytest.mark.ros
@pytest.mark.parametrize("aborts", [False, True])
def test_tree_of_page_calls_described_servers(tmp_path: Path, make_ros: Any, aborts: bool) -> None:
    ros: Ros = make_ros()
    world = World(ros, aborts=aborts)
    (tmp_path / "inspection.xml").write_text(TREE, encoding="utf-8")
    compiled = load(tmp_path / "inspection.xml", models=["ros:jazzy"]).compile()
    node = ros.node("inspection")
    for each in compiled.root.iterate():
        each.setup(node=node)

    def is_over() -> bool:
        compiled.root.tick_once()
        return compiled.root.status is not Status.RUNNING

    ros.spin_until(is_over, "the end of the tree")
    assert compiled.root.status is Status.SUCCESS
    (parameter,) = world.parameters
    assert (parameter.name, parameter.value.type, parameter.value.double_value) == ("max_speed", 3, 0.5)
    (goal,) = world.goals
    places = [(each.header.frame_id, each.pose.position.x, each.pose.position.y) for each in goal.poses]
    assert places == [("map", 1.0, 2.5), ("map", 4.0, 0.0)]
    assert all(each.header.stamp.sec for each in goal.poses)
    if aborts:
        ros.spin_until(lambda: world.heard, "the message")
    assert world.heard == ["no way"] * aborts


def rows(tag: str) -> dict[str, list[str]]:
    """Return the rows of a leaf's table by the attributes that they name."""
    section = PAGE.read_text(encoding="utf-8").partition(f"### {tag}\n")[2].partition("\n#")[0]
    found = {}
    for line in section.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `"):
            found.update(dict.fromkeys((name.strip(" `") for name in cells[0].split(",")), cells[1:]))
    return found


@pytest.mark.parametrize("tag", SPECS)
def test_leaf_table_lists_attributes_with_defaults(tag: str) -> None:
    attributes = [each for each in SPECS[tag].parameters.values() if each.role is ParameterRole.ATTRIBUTE]
    table = rows(tag)
    assert set(table) == {each.name for each in attributes}
    for each in attributes:
        shown = table[each.name][1].strip("`")
        if isinstance(each.default, (bool, int, float)):
            assert (
                shown
                == f"{str(each.default).lower() if isinstance(each.default, bool) else f'{each.default:g}'}"
            )
        elif isinstance(each.default, str):
            assert shown == each.default
        else:
            assert shown.partition(",")[0] in ("5", "\u2013", "")
