"""Which lines of `/rosout` explain why Nav2 has ended a goal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from sar_compiler.ros.nav2_log import Nav2Log
    from tests.ros.conftest import Ros

pytestmark = pytest.mark.ros

RECORDED = Path(__file__).parent / "recorded" / "rosout_late_acknowledgements.txt"
LATE = "Timed out while waiting for action server to acknowledge goal request for follow_path"
CLIENT = "bt_navigator_navigate_to_pose_rclcpp_node"
SLOW = "Control loop missed its desired rate of 20.0000 Hz. Current loop rate is 9.3712 Hz."
OLD = "Transform data too old when converting from map to odom"
WARN, ERROR, INFO = 30, 40, 20


def heard(node: Any, *lines: tuple[int, str, str]) -> Nav2Log:
    """Return a log that has heard some lines: level, logger and text."""
    from rcl_interfaces.msg import Log

    from sar_compiler.ros.nav2_log import nav2_log

    log = nav2_log(node)
    for level, name, text in lines:
        log._on_line(Log(level=level, name=name, msg=text))
    return log


@pytest.mark.parametrize(
    ("lines", "quoted"),
    [
        (
            [
                (WARN, "controller_server", SLOW),
                (WARN, CLIENT, LATE),
                (
                    WARN,
                    "controller_server",
                    "No goal checker was specified in parameter 'current_goal_checker'.",
                ),
                (ERROR, "bt_navigator", "Goal failed"),
            ],
            f'{CLIENT}: "{LATE}"',
        ),
        ([(WARN, "controller_server", SLOW), (ERROR, "tf_help", OLD)], f'tf_help: "{OLD}"'),
        (
            [(ERROR, "bt_navigator_navigate_through_poses_rclcpp_node", LATE), (INFO, "tf_help", OLD)],
            f'bt_navigator_navigate_through_poses_rclcpp_node: "{LATE}"',
        ),
        (
            [(WARN, "local_costmap.local_costmap", "Sensor origin is out of map bounds.")],
            'local_costmap.local_costmap: "Sensor origin is out of map bounds."',
        ),
        ([(WARN, "controller_server", SLOW)], f'controller_server: "{SLOW}"'),
        ([(ERROR, "bt_navigator", "Goal failed")], ""),
        ([(ERROR, "lidar_driver", "no scans for 3 s")], 'lidar_driver: "no scans for 3 s"'),
        ([(WARN, "camera", "the exposure is long")], ""),
        (
            [(ERROR, "lidar_driver", "no scans"), (WARN, "planner_server", "Planner is odd")],
            'planner_server: "Planner is odd"',
        ),
        ([(ERROR, "tester", "Failed to make progress"), (ERROR, "tester.leaf", "No pose")], ""),
        ([(ERROR, "tf_help", "x" * 300)], f'tf_help: "{"x" * 119}…"'),
        ([(ERROR, "tf_help", f"{OLD}\nat 3.2 s")], f'tf_help: "{OLD}"'),
        (
            [(ERROR, "amcl", f"No pose {number}") for number in (1, 2, 3, 3)],
            'amcl: "No pose 2"; amcl: "No pose 3"',
        ),
    ],
)
def test_the_line_that_explains_an_abort_is_quoted_before_others(
    ros: Ros, lines: list[tuple[int, str, str]], quoted: str
) -> None:
    assert heard(ros.node(), *lines).quote() == quoted


def test_each_abort_of_a_real_run_is_explained_by_the_server_that_was_late(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr("sar_compiler.ros.nav2_log.time.monotonic", lambda: now[0])
    log = heard(ros.node("search_and_rescue"))
    recorded = [
        line for line in RECORDED.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    ]
    aborts = [float(line.split()[0]) for line in recorded if line.endswith(" aborted")]
    lines = [line.split(maxsplit=3) for line in recorded if not line.endswith(" aborted")]
    assert len(aborts) == 8
    for abort in aborts:
        for at, level, name, text in lines:
            if now[0] < float(at) <= abort + 0.3:
                now[0] = float(at)
                heard(ros.executor.get_nodes()[0], (int(level), name.removesuffix(":"), text))
        said = log.quote(since=abort - 1.0)
        assert said.startswith(
            f'{CLIENT}: "Timed out while waiting for action server to acknowledge goal request'
        ), said
        assert said.count(": ") == 1, said


def test_lines_of_before_the_end_of_the_goal_do_not_count(ros: Ros) -> None:
    import time

    log = heard(ros.node(), (WARN, CLIENT, LATE))
    assert log.quote(since=time.monotonic()) == ""


def test_in_a_namespace_the_lines_of_its_own_nav2_count(ros: Ros) -> None:
    node = ros.node("mission", namespace="/tb1")
    lines = ((ERROR, f"{name}.controller_server", f"No pose of {name}") for name in ("tb2", "tb1"))
    log = heard(node, *lines, (ERROR, "controller_server", "No pose of another"), (ERROR, "tf_help", OLD))
    assert log.quote() == f'controller_server: "No pose of tb1"; tf_help: "{OLD}"'


def test_another_robot_in_a_namespace_is_not_heard(ros: Ros) -> None:
    ros.node("bt_navigator", namespace="/tb1")
    node = ros.node()
    ros.spin_until(lambda: "bt_navigator" in node.get_node_names(), "the other robot")
    log = heard(
        node, (ERROR, "tb1.controller_server", "No pose of tb1"), (ERROR, "local_costmap.local_costmap", OLD)
    )
    assert log.quote() == f'local_costmap.local_costmap: "{OLD}"'


def test_the_node_whose_change_of_state_has_failed_last_is_known_from_the_lifecycle_manager(ros: Ros) -> None:
    manager = "lifecycle_manager_navigation"
    lines = (
        (ERROR, manager, "Failed to change state for node: planner_server. Exception: timed out."),
        (ERROR, manager, "Failed to bring up all requested nodes. Aborting bringup."),
        (ERROR, "lifecycle_manager_localization", "Failed to change state for node: amcl"),
    )
    assert heard(ros.node(), *lines).failed_change() == "planner_server"
    assert heard(ros.node("other")).failed_change() == ""
