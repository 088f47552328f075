"""Tests of the conditions of the mission."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from search_and_rescue.actions.survivors import DetectSurvivor
from search_and_rescue.conditions import (
    IsSurvivorDetected,
    MissionComplete,
    ZonesRemaining,
)
from search_and_rescue.record import MissionRecord
from search_and_rescue.zone_manager import ZoneManager

ZONES = ZoneManager([{"id": "zone_a", "x": 0, "y": 0, "yaw": 0}], {"x": 0, "y": 0, "yaw": 0})


def tick(leaf: Behaviour) -> Status:
    leaf.tick_once()
    return leaf.status


def test_zones_remain_until_the_last_one_is_visited() -> None:
    zones = ZoneManager([{"id": "zone_a", "x": 0, "y": 0, "yaw": 0}], {"x": 0, "y": 0, "yaw": 0})
    leaf = ZonesRemaining("ZonesRemaining?", zones)
    assert tick(leaf) is Status.SUCCESS
    zones.select_next_zone()
    assert tick(leaf) is Status.FAILURE
    assert leaf.feedback_message == "1 of 1 zones visited"


@pytest.mark.parametrize(("pose", "status"), [((1.0, 2.0), Status.SUCCESS), (None, Status.FAILURE)])
def test_a_survivor_is_detected_if_the_search_found_one(
    pose: tuple[float, float] | None, status: Status
) -> None:
    detect = DetectSurvivor("DetectSurvivor", ZONES)
    detect._pose = pose
    assert tick(IsSurvivorDetected("IsSurvivorDetected?", detect)) is status


def test_a_mission_is_complete_once_nothing_is_missing() -> None:
    zones = ZoneManager([], {"x": 0, "y": 0, "yaw": 0})
    record = MissionRecord()
    leaf = MissionComplete("MissionComplete?", record, zones)
    assert tick(leaf) is Status.FAILURE
    assert leaf.feedback_message == "The robot did not return to the base station."
    record.base_reached()
    assert tick(leaf) is Status.SUCCESS
    assert leaf.feedback_message == ""
