"""Tests of the driving parameters of the stand-in for Nav2."""

from pathlib import Path

import pytest

from sar_compiler.sim.navigator import QUICK, like_nav2, manner


def test_nav2_mode_uses_shipped_parameters() -> None:
    nav2 = manner("nav2")
    assert (nav2.speed, nav2.turn, nav2.tolerance, nav2.server_timeout_sec) == (0.4, 1.0, 0.25, 1.0)
    assert (nav2.follower.look_ahead, nav2.follower.position_tolerance) == (0.6, 0.25)
    assert manner("quick") is QUICK


def test_parameter_file_overrides_defaults_of_nav2(tmp_path: Path) -> None:
    parameters = tmp_path / "nav2.yaml"
    parameters.write_text(
        """
controller_server:
  ros__parameters:
    controller_plugins: [Follow]
    goal_checker_plugins: [precise]
    Follow: {desired_linear_vel: 0.3}
    precise: {xy_goal_tolerance: 0.1, yaw_goal_tolerance: 0.2}
planner_server:
  ros__parameters: {GridBased: {tolerance: 0.4}}
""",
        encoding="utf-8",
    )
    nav2 = like_nav2(parameters)
    assert (nav2.speed, nav2.turn, nav2.tolerance) == (0.3, 1.8, 0.4)
    assert (nav2.follower.position_tolerance, nav2.follower.yaw_tolerance) == (0.1, 0.2)
    assert nav2.server_timeout_sec == pytest.approx(0.02)


def test_parameter_file_without_list_of_plugins_uses_default_names(tmp_path: Path) -> None:
    parameters = tmp_path / "nav2.yaml"
    parameters.write_text(
        "controller_server:\n  ros__parameters: {controller_plugins: 5, FollowPath: {desired_linear_vel: 0.3}}\n",
        encoding="utf-8",
    )
    assert like_nav2(parameters).speed == 0.3
