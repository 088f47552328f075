"""Tests that a succeeded goal is checked against the robot's localisation."""

import pytest

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.mark.parametrize("tree", ["search_and_rescue", "search_and_rescue_resilient"])
def test_mission_whose_robot_does_not_move_is_not_complete(fly, serve, tree, tmp_path):
    navigation = serve("navigation", pose=[0.0, 0.0], odometry=True, arrives=False, goals=[{"drive": 0.0}])
    run = fly(tree, zones=("zone_a", "zone_b"), time_limit_sec=12.0)
    assert run.end() == 1, run.output
    assert navigation.of("goal")
    assert "the localisation places the robot 4.24 m away from the goal (0.75 m are allowed)" in run.output
    assert "Reached zone" not in run.output
    assert "zones visited:   0 of 2" in run.output, run.output
