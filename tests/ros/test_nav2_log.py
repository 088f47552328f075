"""Tests of finding the lines of `/rosout` that explain why Nav2 has ended a goal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from sar_compiler.ros.nav2_log import Nav2Log
    from tests.ros.conftest import Ros

pytestmark = pytest.mark.ros

RECORDED = Path(__file__).parent / "recorded"
LATE = "Timed out while waiting for action server to acknowledge goal request for follow_path"
CLIENT = "bt_navigator_navigate_to_pose_rclcpp_node"
SLOW = "Control loop missed its desired rate of 20.0000 Hz. Current loop rate is 9.3712 Hz."
LATE_PLAN = LATE.replace("follow_path", "compute_path_to_pose")
LOST = "Unable to transform robot pose into global plan's frame"
OLD = "Transform data too old when converting from map to odom"
WARN, ERROR, INFO = 30, 40, 20


def log_with_lines(node: Any, *lines: tuple[int, str, str]) -> Nav2Log:
    """Return a log that has received some lines: level, logger and text."""
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
def test_line_that_explains_abort_is_quoted_before_others(
    ros: Ros, lines: list[tuple[int, str, str]], quoted: str
) -> None:
    assert log_with_lines(ros.node(), *lines).quote() == quoted


class Recording:
    """The log of a real Nav2, received by a node at the times of the run."""

    def __init__(self, ros: Ros, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
        self._now = 0.0
        monkeypatch.setattr("sar_compiler.ros.nav2_log.time.monotonic", lambda: self._now)
        self._node = ros.node("search_and_rescue")
        self.log = log_with_lines(self._node)
        text = (RECORDED / f"rosout_{name}.txt").read_text(encoding="utf-8")
        recorded = [line for line in text.splitlines() if not line.startswith("#")]
        self.aborts = [float(line.split()[0]) for line in recorded if line.endswith(" aborted")]
        self._lines = [line.split(maxsplit=3) for line in recorded if not line.endswith(" aborted")]

    def hear_until(self, end: float) -> None:
        """Receive the lines that were logged until a time."""
        while self._lines and float(self._lines[0][0]) <= end:
            at, level, name, text = self._lines.pop(0)
            self._now = float(at)
            log_with_lines(self._node, (int(level), name.removesuffix(":"), text))

    def hear_all(self) -> None:
        """Receive all lines, and advance the clock by a minute."""
        self.hear_until(float("inf"))
        self._now += 60.0


@pytest.mark.parametrize(
    ("name", "quoted"),
    [
        (
            "late_acknowledgements",
            [*[[LATE]] * 2, *[[LATE_PLAN]] * 2, [LATE], *[[LATE_PLAN]] * 2, [LATE]],
        ),
        ("starved_controller", [[LATE], [LATE, LOST], [LATE]]),
    ],
)
def test_aborts_of_recorded_run_are_explained_by_late_server(
    ros: Ros, monkeypatch: pytest.MonkeyPatch, name: str, quoted: list[list[str]]
) -> None:
    recording = Recording(ros, monkeypatch, name)
    said = []
    for abort in recording.aborts:
        recording.hear_until(abort + 0.3)
        said.append(recording.log.quote(since=abort - 1.0))
    speakers = {LATE: CLIENT, LATE_PLAN: CLIENT, LOST: "controller_server"}
    assert said == ["; ".join(f'{speakers[each]}: "{each}"' for each in lines) for lines in quoted]


@pytest.mark.parametrize(
    ("name", "awaited", "failed", "quoted"),
    [
        ("start_navigator_died", "bt_navigator", "", ""),
        ("start_planner_died", "planner_server", "", "Failed to create global planner. Exception:"),
        ("start_planner_not_started", "planner_server", "", ""),
        (
            "start_no_tree_file",
            "bt_navigator",
            "bt_navigator",
            "Couldn't open input XML file: /opt/trees/none.xml",
        ),
        ("starved_controller", "", "", ""),
    ],
)
def test_node_awaited_by_lifecycle_manager_is_read_from_log(
    ros: Ros, monkeypatch: pytest.MonkeyPatch, name: str, awaited: str, failed: str, quoted: str
) -> None:
    recording = Recording(ros, monkeypatch, name)
    recording.hear_all()
    assert (recording.log.awaited_node(), recording.log.failed_change()) == (awaited, failed)
    if awaited:
        said = recording.log.quote(awaited)
        assert said.startswith(f'{awaited}: "{quoted}') if quoted else said == ""


def test_node_named_just_now_is_not_yet_reported_as_awaited(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = Recording(ros, monkeypatch, "start_planner_died")
    recording.hear_until(6.977)
    assert recording.log.awaited_node() == ""


def test_lines_before_goal_end_are_ignored(ros: Ros) -> None:
    import time

    log = log_with_lines(ros.node(), (WARN, CLIENT, LATE))
    assert log.quote(since=time.monotonic()) == ""


def test_lines_of_nav2_in_own_namespace_are_quoted(ros: Ros) -> None:
    node = ros.node("mission", namespace="/tb1")
    lines = ((ERROR, f"{name}.controller_server", f"No pose of {name}") for name in ("tb2", "tb1"))
    log = log_with_lines(
        node, *lines, (ERROR, "controller_server", "No pose of another"), (ERROR, "tf_help", OLD)
    )
    assert log.quote() == f'controller_server: "No pose of tb1"; tf_help: "{OLD}"'


def test_lines_of_robot_in_other_namespace_are_ignored(ros: Ros) -> None:
    ros.node("bt_navigator", namespace="/tb1")
    node = ros.node()
    ros.spin_until(lambda: "bt_navigator" in node.get_node_names(), "the other robot")
    log = log_with_lines(
        node, (ERROR, "tb1.controller_server", "No pose of tb1"), (ERROR, "local_costmap.local_costmap", OLD)
    )
    assert log.quote() == f'local_costmap.local_costmap: "{OLD}"'


def test_failed_state_change_is_read_from_navigation_manager_log(ros: Ros) -> None:
    manager = "lifecycle_manager_navigation"
    lines = (
        (ERROR, manager, "Failed to change state for node: planner_server. Exception: timed out."),
        (ERROR, manager, "Failed to bring up all requested nodes. Aborting bringup."),
        (ERROR, "lifecycle_manager_localization", "Failed to change state for node: amcl"),
    )
    assert log_with_lines(ros.node(), *lines).failed_change() == "planner_server"
    assert log_with_lines(ros.node("other")).failed_change() == ""
