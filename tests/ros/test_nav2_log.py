"""Which lines of `/rosout` explain why Nav2 has ended a goal."""

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


class Recording:
    """What a real Nav2 has logged, heard by a node with the times of the run."""

    def __init__(self, ros: Ros, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
        self._now = 0.0
        monkeypatch.setattr("sar_compiler.ros.nav2_log.time.monotonic", lambda: self._now)
        self._node = ros.node("search_and_rescue")
        self.log = heard(self._node)
        text = (RECORDED / f"rosout_{name}.txt").read_text(encoding="utf-8")
        recorded = [line for line in text.splitlines() if not line.startswith("#")]
        self.aborts = [float(line.split()[0]) for line in recorded if line.endswith(" aborted")]
        self._lines = [line.split(maxsplit=3) for line in recorded if not line.endswith(" aborted")]

    def hear_until(self, end: float) -> None:
        """Hear what was logged until a time."""
        while self._lines and float(self._lines[0][0]) <= end:
            at, level, name, text = self._lines.pop(0)
            self._now = float(at)
            heard(self._node, (int(level), name.removesuffix(":"), text))

    def hear_all(self) -> None:
        """Hear everything, and let it be long ago."""
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
def test_each_abort_of_a_real_run_is_explained_by_the_server_that_was_late(
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
def test_the_node_for_which_the_lifecycle_manager_waits_is_known_from_its_lines(
    ros: Ros, monkeypatch: pytest.MonkeyPatch, name: str, awaited: str, failed: str, quoted: str
) -> None:
    recording = Recording(ros, monkeypatch, name)
    recording.hear_all()
    assert (recording.log.awaited_node(), recording.log.failed_change()) == (awaited, failed)
    if awaited:
        said = recording.log.quote(awaited)
        assert said.startswith(f'{awaited}: "{quoted}') if quoted else said == ""


def test_a_node_that_the_lifecycle_manager_has_named_just_now_may_still_be_discovered(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = Recording(ros, monkeypatch, "start_planner_died")
    recording.hear_until(6.977)
    assert recording.log.awaited_node() == ""


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
