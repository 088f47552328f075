"""Tests of the tree that chooses the next zone by the lengths of planned paths, in the simulator."""

import shutil
from pathlib import Path

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


def test_zone_behind_wall_is_searched_later_than_by_straight_distance(start, tmp_path):
    params, place = tmp_path / "params.yaml", tmp_path / "m.journal"
    params.write_text(PARAMETERS, encoding="utf-8")
    run = start("sar-run", "search_areas", "--sim", "--speed", "20", "--params", params, "--journal", place)
    assert run.end() == 0, run.output
    told = [line.split(":")[0].strip() for line in run.log if "searched after" in line]
    assert told == WITHOUT_WALLS
    chosen = [line for line in run.log if line.startswith("Next zone by")]
    assert chosen == [f"Next zone by expected_find: {zone}." for zone in WITH_WALLS]
    assert "times the straight line: " not in run.output
    show = start("sar-journal", "show", place)
    assert show.end() == 0
    facts = [line.split() for line in show.output.splitlines()]
    assert [words[-1] for words in facts if "zone_chosen" in words] == WITH_WALLS
    # Goals of the planner move nothing, need no cancellation, and are not recorded.
    goals = [words for words in facts if "goal_sent" in words]
    assert len(goals) == len(WITH_WALLS) + 1
    assert all("/navigate_to_pose," in words for words in goals)


@pytest.mark.costly
def test_robot_charges_at_nearer_dock_and_continues(start, tmp_path):
    params, world, place = (tmp_path / name for name in ("params.yaml", "world.yaml", "m.journal"))
    dock = (
        "    energy: {per_m: 0.02, per_sec: 0.0001}\n    charging:\n      dock: {x: 5.2, y: -1.5, yaw: 0.0}\n"
    )
    given = Path("config/search_areas_params.yaml").read_text(encoding="utf-8")
    params.write_text(f"{given}\n{dock}", encoding="utf-8")
    # The battery suffices for zone_c, near the dock, but not for the next zone.
    battery = (
        "battery: {per_m: 0.02, per_sec: 0.0001, share: 0.55, swap_sec: 5.0, places: [{x: 5.2, y: -1.5}]}"
    )
    shipped = Path("worlds/disaster_zone.yaml").read_text(encoding="utf-8")
    world.write_text(f"{shipped.replace('../maps/', '')}\n{battery}\n", encoding="utf-8")
    for suffix in ("yaml", "pgm"):
        shutil.copy(f"maps/disaster_zone.{suffix}", tmp_path)
    run = start(
        "sar-run", "search_areas", "--sim", world, "--speed", "20", "--params", params, "--journal", place
    )
    assert run.end() == 0, run.output
    assert "Mission complete." in run.output
    told = [line for line in run.log if "dock" in line or line.startswith("The battery is at")]
    assert ": the robot drives to dock first " in told[0], told
    assert told[-2:] == [
        "Reached charging place dock.",
        "The battery is at 100%: the robot continues to zone_a.",
    ]
    show = start("sar-journal", "show", place)
    assert show.end() == 0
    kinds = [word for line in show.output.splitlines() for word in line.split()]
    assert kinds.index("home_first") < kinds.index("charging_reached") < kinds.index("charged")
