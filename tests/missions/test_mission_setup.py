"""Tests of setup and shutdown of the leaves, and of AdvanceZone and LogNoDetection."""

import subprocess
import sys
from typing import TYPE_CHECKING

import py_trees
import pytest
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.ros.leaves.leaf import MissingNodeError
from sar_compiler.runtime.leaf_protocol import SettlingLeaf
from search_and_rescue.actions.navigation import NavigateToBase, NavigateToZone
from search_and_rescue.actions.report_queue import DeliverReports, KeepReport
from search_and_rescue.actions.survivors import (
    BroadcastSurvivorTF,
    DetectSurvivor,
    LogNoDetection,
    NotifyBase,
)
from search_and_rescue.actions.zones import AbandonZone, AdvanceZone, PostponeZone
from search_and_rescue.record import MissionRecord, SurvivorReport
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

BASE = {"x": 0.0, "y": 0.0, "yaw": 0.0}


def one_zone() -> ZoneManager:
    return ZoneManager([{"id": "zone_a", "x": 1.0, "y": 2.0, "yaw": 0.0}], BASE)


def leaves_with_a_node() -> list[py_trees.behaviour.Behaviour]:
    zones = one_zone()
    detect = DetectSurvivor("DetectSurvivor", zones)
    search = Search(zones)
    search.record.report_kept(SurvivorReport("survivor_1", 1.0, 2.0))
    kept = search.kept
    return [
        NavigateToZone("NavigateToZone", zones),
        NavigateToBase("NavigateToBase", zones),
        detect,
        BroadcastSurvivorTF("BroadcastSurvivorTF", detect, zones),
        NotifyBase("NotifyBase", detect),
        LogNoDetection("LogNoDetection"),
        KeepReport("KeepReport", detect),
        DeliverReports("DeliverReports", kept),
        PostponeZone("PostponeZone", zones),
        AbandonZone("AbandonZone", zones),
    ]


def test_leaves_can_be_imported_and_built_without_ros() -> None:
    program = (
        "import sys; sys.modules['rclpy'] = None\n"
        "from search_and_rescue.actions.navigation import NavigateToZone\n"
        "from search_and_rescue.zone_manager import ZoneManager\n"
        "NavigateToZone('NavigateToZone', ZoneManager([], {'x': 0, 'y': 0, 'yaw': 0}))\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize("leaf", leaves_with_a_node(), ids=lambda leaf: leaf.name)
class TestWithoutNode:
    def test_setup_without_node_raises_missing_node_error(self, leaf: py_trees.behaviour.Behaviour) -> None:
        with pytest.raises(
            MissingNodeError, match=f"'{leaf.name}' .* no ROS node. Pass an rclpy node"
        ) as error:
            leaf.setup()
        assert isinstance(error.value, KeyError)
        assert isinstance(error.value, SarError)
        assert error.value.leaf_name == leaf.name

    def test_tick_before_setup_raises_missing_node_error(self, leaf: py_trees.behaviour.Behaviour) -> None:
        with pytest.raises(MissingNodeError, match=leaf.name):
            leaf.tick_once()

    def test_shutdown_before_setup_is_harmless(self, leaf: py_trees.behaviour.Behaviour) -> None:
        leaf.shutdown()


def test_drives_are_settling_leaves() -> None:
    assert isinstance(NavigateToZone("NavigateToZone", one_zone()), SettlingLeaf)
    assert NavigateToBase("NavigateToBase", one_zone()).is_settled()


class TestAdvanceZone:
    def test_advance_records_visit_and_wakes_tree(self) -> None:
        search, wakes = Search(one_zone()), []
        zones, record = search.zones, search.record
        leaf = AdvanceZone("AdvanceZone", zones)
        leaf.setup(node=object(), wake=lambda: wakes.append("wake"))
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS
        assert not zones.has_remaining()
        assert record.zones_visited == ("zone_a",)
        assert wakes == ["wake"]

    def test_advance_after_last_zone_succeeds_without_wake(self) -> None:
        wakes: list[str] = []
        leaf = AdvanceZone("AdvanceZone", ZoneManager([], BASE))
        leaf.setup(node=object(), wake=lambda: wakes.append("wake"))
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS
        assert wakes == []

    def test_advance_works_without_wake_callback(self) -> None:
        zones = one_zone()
        leaf = AdvanceZone("AdvanceZone", zones)
        leaf.setup(node=object())
        leaf.tick_once()
        assert zones.current_index() == 1


@pytest.mark.ros
class TestLogNoDetection:
    def test_message_names_zone(self, stage: "Stage") -> None:
        assert stage.run(stage.take(LogNoDetection("LogNoDetection", stage.zones))) is Status.SUCCESS
        assert stage.lines == ["No survivor found at zone_a."]

    def test_earlier_unacknowledged_survivor_is_noted_for_operator(self, stage: "Stage") -> None:
        record = MissionRecord()
        for zone, name in (("zone_a", "survivor_1"), ("zone_b", "survivor_2")):
            record.zone_searched(zone, (1.0, 2.0))
            record.survivor_named(name, 1.0, 2.0)
        leaf = stage.take(LogNoDetection("LogNoDetection", stage.zones, record=record))
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.lines == ["No survivor found at zone_a."]
        said = "survivor_1 in zone_a at (1.00, 2.00) was found, and base has not acknowledged it"
        assert stage.warnings == [f"Note for the operator: {said}."]

    def test_message_without_zone_manager_names_no_zone(self, stage: "Stage") -> None:
        assert stage.run(stage.take(LogNoDetection("LogNoDetection"))) is Status.SUCCESS
        assert stage.lines == ["No survivor found."]

    def test_message_after_last_zone_names_no_zone(self, stage: "Stage") -> None:
        assert (
            stage.run(stage.take(LogNoDetection("LogNoDetection", ZoneManager([], BASE)))) is Status.SUCCESS
        )
        assert stage.lines == ["No survivor found."]


@pytest.mark.ros
class TestShutdown:
    def test_leaves_survive_shutdown_of_context(self, mortal_stage: "Stage") -> None:
        stage = mortal_stage
        server = stage.nav_server()
        drive = stage.take(NavigateToZone("NavigateToZone", stage.zones, feedback_timeout_sec=0.0))
        search = stage.take(DetectSurvivor("DetectSurvivor", stage.zones))
        search.tick_once()
        stage.tick_until(drive, lambda: server.goals and stage.wakes, "the goal")
        stage.context.shutdown()
        drive.tick_once()
        search.tick_once()
        assert search.status is Status.RUNNING
        for leaf in (drive, search):
            leaf.stop(Status.INVALID)
            leaf.shutdown()
        assert not drive.is_settled(), "nobody has seen the goal's end"

    def test_unaccepted_drive_survives_shutdown_of_context(self, mortal_stage: "Stage") -> None:
        stage = mortal_stage
        server = stage.nav_server()
        server.accept_after = 0.1
        drive = stage.take(NavigateToZone("NavigateToZone", stage.zones))
        stage.tick_until(drive, lambda: server.requests, "the goal")
        stage.context.shutdown()
        drive.stop(Status.INVALID)
        assert not drive.is_settled()
        drive.shutdown()

    def test_leaves_survive_destroyed_node(self, stage: "Stage") -> None:
        leaves = [stage.take(leaf) for leaf in leaves_with_a_node()]
        stage.node.destroy_node()
        for leaf in leaves:
            leaf.stop(Status.INVALID)
            leaf.shutdown()
