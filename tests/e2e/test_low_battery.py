"""Tests of a run whose battery does not suffice for all zones: the robot returns home, gets a new battery, and continues."""

import json
from pathlib import Path

import pytest

from tests.processes import Command, in_order

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def low_battery_run(tmp_path_factory):
    """Run with a battery that drains some 25 % faster than the parameters state, and is swapped at home; return run and report."""
    folder = tmp_path_factory.mktemp("flown")
    shipped = Path("worlds/disaster_zone.yaml").read_text(encoding="utf-8")
    text = shipped.replace("../maps/disaster_zone.yaml", "disaster_zone.yaml")
    battery = "battery: {per_m: 0.023, per_sec: 0.0006, swap_sec: 10}"
    (folder / "world.yaml").write_text(f"{text}\n{battery}\n", encoding="utf-8")
    for name in ("disaster_zone.yaml", "disaster_zone.pgm"):
        (folder / name).write_bytes(Path("maps", name).read_bytes())
    options = [
        "--sim",
        folder / "world.yaml",
        "--speed",
        20,
        "--properties",
        "--report",
        folder / "report.json",
    ]
    energy = ["-p", "energy.per_m:=0.0185", "-p", "energy.per_sec:=0.0005"]
    params = ["--params", "config/search_areas_params.yaml"]
    run = Command("sar-run", "search_areas", *params, *options, "--ros-args", *energy)
    try:
        assert run.end() == 0, run.output
    finally:
        run.kill()
    return run, json.loads((folder / "report.json").read_text(encoding="utf-8"))


@pytest.mark.costly
def test_robot_returns_home_for_new_battery_and_continues(
    low_battery_run,
):
    run, _ = low_battery_run
    expected = [
        "Next zone by expected_find: zone_d.",
        "Navigating to base station...",
        "Reached base station.",
        "The battery is at 100%: the robot continues to zone_d.",
        "Navigating to zone_d...",
        "Mission complete.",
    ]
    assert in_order(expected, run.log) is None, run.output
    (told,) = [line for line in run.log if line.endswith("home first.")]
    assert told.startswith("zone_d needs ")


@pytest.mark.costly
def test_no_property_is_violated_and_report_has_reason_and_figures(low_battery_run):
    run, report = low_battery_run
    assert "Monitored 10 properties: none violated." in run.output
    text = json.dumps(report)
    assert "the reserve is 15%: home first" in text
    assert "the battery suffices (" in text
    assert "metres to the point of no return" in text
