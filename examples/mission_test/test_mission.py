"""A test of a complete mission in the simulator: the robot visits each zone, reports the survivors and returns."""

from pathlib import Path

from sar_compiler.execution import RunOptions, run_mission


def test_two_survivors_are_reported_despite_a_rejected_goal_and_a_lost_report(tmp_path: Path) -> None:
    options = RunOptions(
        "search_and_rescue_resilient",
        sim="disaster_zone",
        fault=["navigate_to_pose:reject=1", "report_survivor:drop=1"],
        stepped=True,
        speed=1000.0,
        journal=tmp_path / "mission.journal",
    )
    outcome = run_mission(options)
    assert outcome.status == 0, outcome.reason
    assert outcome.figures["survivors reported"] == 2
