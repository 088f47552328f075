"""The tree that chooses where to look first, flown in the simulator: by the planner's ways, which walls make long."""

import pytest

pytestmark = pytest.mark.ros

PARAMETERS = """
/**:
  ros__parameters:
    zone_order: ["likely", "behind_wall", "on_this_side"]
    zones:
      likely: {x: 4.5, y: -1.2, yaw: 0.0, poa: 0.6, pod: 0.9, look_sec: 5.0}
      behind_wall: {x: 4.5, y: 1.2, yaw: 0.0, poa: 0.15, pod: 0.9, look_sec: 5.0}
      on_this_side: {x: 1.2, y: -3.5, yaw: 0.0, poa: 0.15, pod: 0.9, look_sec: 5.0}
    base_station: {x: 0.0, y: 0.0, yaw: 0.0}
    tick_rate_hz: 2.0
"""
WITHOUT_WALLS = ["likely", "behind_wall", "on_this_side"]
WITH_WALLS = ["likely", "on_this_side", "behind_wall"]


def test_the_zone_behind_a_wall_comes_later_than_a_straight_line_says(start, tmp_path):
    params, place = tmp_path / "params.yaml", tmp_path / "m.journal"
    params.write_text(PARAMETERS, encoding="utf-8")
    run = start("sar-run", "search_areas", "--sim", "--speed", "20", "--params", params, "--journal", place)
    assert run.end() == 0, run.output
    told = [line.split(":")[0].strip() for line in run.log if "searched after" in line]
    assert told == WITHOUT_WALLS
    chosen = [line for line in run.log if line.startswith("Next zone by")]
    assert chosen == [f"Next zone by expected_find: {zone}." for zone in WITH_WALLS]
    assert "straight lines times 1.5: " not in run.output
    show = start("sar-journal", "show", place)
    assert show.end() == 0
    facts = [line.split() for line in show.output.splitlines()]
    assert [words[-1] for words in facts if "zone_chosen" in words] == WITH_WALLS
    # The planner moves nothing: nobody has to cancel what it was asked.
    goals = [words for words in facts if "goal_sent" in words]
    assert len(goals) == len(WITH_WALLS) + 1
    assert all("/navigate_to_pose," in words for words in goals)
