"""Tests of the battery of a simulated robot: how it discharges, and where it is swapped."""

from pathlib import Path

import pytest

from sar_compiler.sim.battery import Battery, BatteryKind
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.world import load_world
from sar_compiler.tree.diagnostic import TreeError

START = Pose2D(2.0, 1.0, 0.0)


def drive(battery: Battery, metres: float, start: float = START.x) -> None:
    """Drive along the x axis at 1 m/s, to a distance from the start."""
    for step in range(20 + 1):
        battery.step(Pose2D(start + metres * step / 20, START.y), 1.0, 0.0)


def stand(battery: Battery, seconds: float, away: float = 0.0, speed: float = 0.0) -> None:
    for _ in range(round(seconds)):
        battery.step(Pose2D(START.x + away, START.y), speed, 1.0)


def test_distance_and_time_discharge_battery() -> None:
    battery = Battery(BatteryKind(per_m=0.01, per_sec=0.002, share=0.9), START)
    drive(battery, 10.0)
    assert battery.share == pytest.approx(0.8)
    stand(battery, 50, away=10.0)
    assert battery.share == pytest.approx(0.7)


def test_empty_battery_stays_empty() -> None:
    battery = Battery(BatteryKind(per_m=0.2), START)
    drive(battery, 10.0)
    assert battery.share == 0.0


def test_default_battery_lasts_four_hours_and_is_not_swapped() -> None:
    battery = Battery(BatteryKind(), START)
    drive(battery, 50.0)
    stand(battery, 3600, away=50.0)
    drive(battery, -50.0, START.x + 50.0)
    stand(battery, 3600)
    assert battery.share == pytest.approx(0.5)


def test_battery_is_swapped_at_charging_location() -> None:
    kind = BatteryKind(per_m=0.01, per_sec=0.0, swap_sec=10.0, places=((12.0, START.y),))
    battery = Battery(kind, START)
    drive(battery, 5.0)
    stand(battery, 20, away=5.0)
    assert battery.share == pytest.approx(0.95)
    drive(battery, 5.0, START.x + 5.0)
    stand(battery, 10, away=10.0)
    assert battery.share == 1.0


def test_battery_is_swapped_after_robot_stands_at_start() -> None:
    battery = Battery(BatteryKind(per_m=0.01, per_sec=0.0, swap_sec=10.0), START)
    drive(battery, 10.0)
    stand(battery, 20, away=10.0)
    drive(battery, -9.5, START.x + 10.0)
    stand(battery, 9, away=0.5)
    assert battery.share == pytest.approx(0.805)
    stand(battery, 1, away=0.5, speed=0.1)
    stand(battery, 9, away=0.5)
    assert battery.share == pytest.approx(0.805)
    stand(battery, 1, away=0.5)
    assert battery.share == 1.0


def test_battery_is_not_swapped_before_robot_leaves_start() -> None:
    battery = Battery(BatteryKind(per_sec=0.0, share=0.5, swap_sec=10.0), START)
    stand(battery, 100)
    assert battery.share == 0.5
    drive(battery, 2.0)
    drive(battery, -2.0, START.x + 2.0)
    stand(battery, 10)
    assert battery.share == 1.0


def world(tmp_path: Path, battery: str) -> BatteryKind:
    file = tmp_path / "world.yaml"
    file.write_text(f"robot: {{x: 0, y: 0, radius: 0.2}}\nwalls: []\n{battery}\n", encoding="utf-8")
    return load_world(file).battery


def test_world_file_configures_battery(tmp_path: Path) -> None:
    assert world(tmp_path, "") == BatteryKind()
    said = "battery: {per_m: 0.01, per_sec: 0.001, share: 0.5, swap_sec: 20}"
    assert world(tmp_path, said) == BatteryKind(0.01, 0.001, 0.5, 20)


@pytest.mark.parametrize("battery", ["{share: 50}", "{per_m: -1}", "{swap_sec: 0}", "{volts: 12}"])
def test_invalid_battery_in_world_file_is_rejected(tmp_path: Path, battery: str) -> None:
    with pytest.raises(TreeError):
        world(tmp_path, f"battery: {battery}")
