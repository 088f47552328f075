"""Tests of DetectSurvivor and NotifyBase with scripted services."""

import math
from typing import TYPE_CHECKING, Any

import pytest
from nav_msgs.msg import OccupancyGrid
from py_trees.common import Status
from rclpy.qos import DurabilityPolicy, QoSProfile

from search_and_rescue.actions.survivors import (
    DetectSurvivor,
    NotifyBase,
    map_extent_of,
)
from search_and_rescue.conditions import IsSurvivorDetected

if TYPE_CHECKING:
    from tests.missions.mission_stage import ScriptedService, Stage

pytestmark = pytest.mark.ros

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SURVIVORS = {"zone_a": (-2.5, 3.2)}


def search(stage: "Stage", **options: Any) -> DetectSurvivor:
    return stage.take(DetectSurvivor("DetectSurvivor", stage.zones, record=stage.record, **options))


def search_that_found(
    stage: "Stage", survivor_id: str | None = "survivor_1", **options: Any
) -> DetectSurvivor:
    """Return a search leaf that has found a survivor."""
    stage.detect_service(SURVIVORS)
    leaf = search(stage, **options)
    assert stage.run(leaf) is Status.SUCCESS
    if survivor_id is not None:
        leaf.set_survivor_id(survivor_id)
        stage.record.survivor_named(survivor_id, *SURVIVORS["zone_a"])
    return leaf


def report(stage: "Stage", detect: DetectSurvivor, **options: Any) -> NotifyBase:
    return stage.take(NotifyBase("NotifyBase", detect, record=stage.record, **options))


def tick_until_requested(
    stage: "Stage", leaf: DetectSurvivor | NotifyBase, service: "ScriptedService", times: int = 1
) -> None:
    stage.tick_until(leaf, lambda: len(service.requests) == times, f"request {times}")


class TestDetectSurvivor:
    def test_survivor_is_found_stored_and_recorded(self, stage: "Stage") -> None:
        service = stage.detect_service(SURVIVORS)
        leaf = search(stage)
        assert stage.run(leaf) is Status.SUCCESS
        assert [request.zone_id for request in service.requests] == ["zone_a"]
        assert leaf.was_found()
        assert leaf.survivor_pose() == (-2.5, 3.2)
        assert leaf.survivor_id() is None
        assert [str(survivor) for survivor in stage.record.survivors] == [
            "a survivor without a name in zone_a at (-2.50, 3.20)"
        ]

    def test_call_and_detection_are_logged_once(self, stage: "Stage") -> None:
        search_that_found(stage)
        said = [line for line in stage.lines if "Waiting" not in line]
        assert said == ["Calling detect_survivor for zone_a...", "Survivor detected at zone_a!"]

    def test_empty_zone_is_a_success(self, stage: "Stage") -> None:
        stage.detect_service({})
        leaf = search(stage)
        assert stage.run(leaf) is Status.SUCCESS
        assert not leaf.was_found()
        assert leaf.survivor_pose() is None
        assert stage.record.survivors == ()
        assert "Survivor detected at zone_a!" not in stage.lines

    @pytest.mark.parametrize(
        "place", [(math.nan, 0.0), (0.0, math.inf), (-math.inf, math.nan), (1e308, 0.0), (0.0, -100_001.0)]
    )
    def test_impossible_position_is_a_failure(self, stage: "Stage", place: tuple[float, float]) -> None:
        stage.detect_service({"zone_a": place})
        leaf = search(stage)
        assert stage.run(leaf) is Status.FAILURE
        assert not leaf.was_found()
        assert stage.record.survivors == ()
        assert stage.warnings[0].startswith(
            "'DetectSurvivor' failed: detect_survivor found a survivor, but ("
        )
        assert stage.wakes == 0
        reported = [line for line in stage.record.shortfalls(stage.zones) if "an unusable position" in line]
        assert len(reported) == 1
        assert reported[0].startswith("There is a survivor at an unusable position in zone_a: (")

    def test_unusable_position_is_a_shortfall_until_next_response(self, stage: "Stage") -> None:
        detect = stage.detect_service({"zone_a": (math.nan, 0.0)})
        leaf = search(stage)
        assert stage.run(leaf) is Status.FAILURE
        assert "an unusable position in zone_a" in str(stage.record.shortfalls(stage.zones))
        detect.answer = lambda _, response: setattr(response, "found", False)
        assert stage.run(leaf) is Status.SUCCESS
        assert "an unusable position" not in str(stage.record.shortfalls(stage.zones))

    @pytest.mark.parametrize(("place", "expected"), [((-0.9, 5.9), "SUCCESS"), ((1.1, 2.5), "FAILURE")])
    def test_survivor_position_must_be_inside_map(
        self, stage: "Stage", place: tuple[float, float], expected: str
    ) -> None:
        # A map of 4 m x 2 m, rotated by 90 degrees about its corner (1, 2): it extends from x = -1 to 1.
        grid = OccupancyGrid(data=[0] * 8)
        grid.info.resolution, grid.info.width, grid.info.height = 1.0, 4, 2
        grid.info.origin.position.x, grid.info.origin.position.y = 1.0, 2.0
        grid.info.origin.orientation.z = grid.info.origin.orientation.w = math.sqrt(0.5)
        stage.host().node.create_publisher(OccupancyGrid, "map", LATCHED).publish(grid)
        stage.detect_service({"zone_a": place})
        leaf = search(stage)
        stage.until(lambda: map_extent_of(stage.node)._place is not None, "the map")
        assert stage.run(leaf) is Status[expected]
        assert leaf.was_found() == (expected == "SUCCESS")

    def test_next_entry_clears_earlier_result(self, stage: "Stage") -> None:
        leaf = search_that_found(stage)
        stage.zones.select_next_zone()
        leaf.initialise()
        assert not leaf.was_found()
        assert leaf.survivor_pose() is None
        assert leaf.survivor_id() is None

    def test_next_entry_searches_next_zone(self, stage: "Stage") -> None:
        service = stage.detect_service(SURVIVORS)
        leaf = search(stage)
        stage.run(leaf)
        stage.zones.select_next_zone()
        assert stage.run(leaf) is Status.SUCCESS
        assert [request.zone_id for request in service.requests] == ["zone_a", "zone_b"]
        assert not leaf.was_found()

    def test_search_without_zone_fails(self, stage: "Stage") -> None:
        leaf = search(stage)
        stage.zones.select_next_zone()
        stage.zones.select_next_zone()
        assert stage.run(leaf) is Status.FAILURE
        assert "no zone to search" in stage.warnings[0]

    def test_service_name_is_configurable(self, stage: "Stage") -> None:
        leaf = search(stage, service="look/around", server_timeout_sec=0.0)
        assert stage.run(leaf) is Status.FAILURE
        assert "'look/around'" in stage.warnings[0]

    def test_condition_sees_result_of_search(self, stage: "Stage") -> None:
        condition = IsSurvivorDetected("IsSurvivorDetected?", search_that_found(stage))
        condition.tick_once()
        assert condition.status is Status.SUCCESS


class TestServiceCall:
    def test_slow_service_is_called_once(self, stage: "Stage") -> None:
        service = stage.detect_service(SURVIVORS)
        service.gate.clear()
        leaf = search(stage)
        tick_until_requested(stage, leaf, service)
        for _ in range(20):
            leaf.tick_once()
        assert leaf.status is Status.RUNNING
        service.gate.set()
        assert stage.run(leaf) is Status.SUCCESS
        assert len(service.requests) == 1

    def test_absent_service_fails_after_deadline(self, stage: "Stage") -> None:
        leaf = search(stage, server_timeout_sec=0.05)
        leaf.tick_once()
        assert leaf.status is Status.RUNNING
        assert stage.lines == ["Waiting for the service detect_survivor..."]
        assert stage.run(leaf) is Status.FAILURE
        assert "no server for the service" in stage.warnings[0]
        assert "within 0.05 s" in stage.warnings[0]

    def test_late_service_is_called_when_it_appears(self, stage: "Stage") -> None:
        leaf = search(stage)
        leaf.tick_once()
        stage.detect_service(SURVIVORS)
        assert stage.run(leaf) is Status.SUCCESS

    def test_missing_response_is_a_lasting_failure(self, stage: "Stage") -> None:
        service = stage.detect_service(SURVIVORS)
        service.gate.clear()
        leaf = search(stage, timeout_sec=0.05)
        assert stage.run(leaf) is Status.FAILURE
        assert "no answer within 0.05 s" in stage.warnings[0]
        assert leaf._client is not None
        assert leaf._client._pending_requests == {}
        assert leaf.update() is Status.FAILURE

    def test_new_client_is_used_after_missing_response(self, stage: "Stage") -> None:
        service = stage.detect_service(SURVIVORS)
        service.gate.clear()
        leaf = search(stage, timeout_sec=0.05)
        deaf = leaf._client
        assert stage.run(leaf) is Status.FAILURE
        assert leaf._client is not deaf
        assert deaf not in stage.node.clients
        service.gate.set()
        leaf.timeout_sec = 10.0
        assert stage.run(leaf) is Status.SUCCESS

    def test_late_response_of_old_call_is_ignored(self, stage: "Stage") -> None:
        service = stage.detect_service(SURVIVORS)
        service.gate.clear()
        leaf = search(stage, timeout_sec=0.05)
        assert stage.run(leaf) is Status.FAILURE
        stage.zones.select_next_zone()  # the next response is about a zone without a survivor
        service.gate.set()
        stage.until(lambda: service.answered == 1, "the late answer")
        assert stage.wakes == 0
        leaf.timeout_sec = 10.0
        assert stage.run(leaf) is Status.SUCCESS
        assert not leaf.was_found()

    def test_halt_drops_request(self, stage: "Stage") -> None:
        service = stage.detect_service(SURVIVORS)
        service.gate.clear()
        leaf = search(stage)
        tick_until_requested(stage, leaf, service)
        leaf.stop(Status.INVALID)
        assert leaf._client is not None
        assert leaf._client._pending_requests == {}
        assert leaf.update() is Status.FAILURE
        service.gate.set()
        stage.until(lambda: service.answered == 1, "the late answer")
        assert stage.wakes == 0
        assert not leaf.was_found()

    def test_response_that_crosses_halt_is_ignored(self, stage: "Stage") -> None:
        stage.detect_service(SURVIVORS)
        leaf = search(stage)
        leaf.tick_once()
        stage.tick_until(leaf, lambda: leaf._exchange is not None and leaf._exchange.sent, "sending")
        call = leaf._exchange
        assert call is not None
        future = call._future
        assert future is not None
        leaf.stop(Status.INVALID)
        future.set_result(object())
        assert call.answer is None

    def test_halt_before_service_appears_sends_nothing(self, stage: "Stage") -> None:
        leaf = search(stage)
        leaf.tick_once()
        leaf.stop(Status.INVALID)
        service = stage.detect_service(SURVIVORS)
        client = leaf._client
        assert client is not None
        stage.until(client.service_is_ready, "the service")
        assert service.requests == []

    def test_leaf_that_was_never_entered_stays_invalid(self, stage: "Stage") -> None:
        leaf = search(stage)
        leaf.stop(Status.INVALID)
        assert leaf.update() is Status.INVALID

    def test_abandoned_call_sends_nothing(self, stage: "Stage") -> None:
        leaf = search(stage)
        leaf.tick_once()
        call = leaf._exchange
        assert call is not None
        leaf.stop(Status.INVALID)
        call.poll()
        assert not call.sent
        assert call.trouble == ""

    def test_response_wakes_tree(self, stage: "Stage") -> None:
        search_that_found(stage)
        assert stage.wakes == 1

    def test_second_setup_leaves_no_extra_client(self, stage: "Stage") -> None:
        leaf = search(stage)
        clients = len(list(stage.node.clients))
        leaf.setup(node=stage.node)
        assert len(list(stage.node.clients)) == clients
        leaf.shutdown()
        leaf.shutdown()
        assert len(list(stage.node.clients)) == clients - 1


class TestNotifyBase:
    def test_survivor_is_reported_by_name_and_point_in_map(self, stage: "Stage") -> None:
        service = stage.report_service(acknowledged=True)
        assert stage.run(report(stage, search_that_found(stage))) is Status.SUCCESS
        request = service.requests[0]
        point = request.location.point
        assert request.survivor_id == "survivor_1"
        assert request.location.header.frame_id == "map"
        assert (point.x, point.y, point.z) == (-2.5, 3.2, 0.0)
        now = stage.node.get_clock().now().nanoseconds
        stamp = request.location.header.stamp
        assert 0 <= now - (stamp.sec * 10**9 + stamp.nanosec) < 10**10
        assert stage.record.survivors[0].acknowledged

    def test_report_and_acknowledgement_are_logged_once(self, stage: "Stage") -> None:
        stage.report_service(acknowledged=True)
        stage.run(report(stage, search_that_found(stage)))
        assert stage.lines.count("Reporting survivor_1 to base...") == 1
        assert stage.lines[-1] == "Base acknowledged survivor_1."

    def test_refused_report_fails_without_wake(self, stage: "Stage") -> None:
        stage.report_service(acknowledged=False)
        detect = search_that_found(stage)
        wakes = stage.wakes
        assert stage.run(report(stage, detect)) is Status.FAILURE
        assert stage.warnings == ["Base did not acknowledge survivor_1."]
        assert stage.wakes == wakes
        assert not stage.record.survivors[0].acknowledged

    def test_acknowledgement_wakes_tree(self, stage: "Stage") -> None:
        stage.report_service(acknowledged=True)
        detect = search_that_found(stage)
        wakes = stage.wakes
        stage.run(report(stage, detect))
        assert stage.wakes == wakes + 1

    def test_report_without_survivor_fails(self, stage: "Stage") -> None:
        assert stage.run(report(stage, search(stage))) is Status.FAILURE
        assert "no survivor was found" in stage.warnings[0]

    def test_report_of_unnamed_survivor_fails(self, stage: "Stage") -> None:
        assert stage.run(report(stage, search_that_found(stage, survivor_id=None))) is Status.FAILURE
        assert "no name yet" in stage.warnings[0]

    def test_absent_base_fails_after_deadline(self, stage: "Stage") -> None:
        assert stage.run(report(stage, search_that_found(stage), server_timeout_sec=0.0)) is Status.FAILURE
        assert "no server for the service" in stage.warnings[0]

    def test_unresponsive_base_fails_after_deadline(self, stage: "Stage") -> None:
        service = stage.report_service(acknowledged=True)
        service.gate.clear()
        assert stage.run(report(stage, search_that_found(stage), timeout_sec=0.05)) is Status.FAILURE
        assert "no answer within 0.05 s" in stage.warnings[0]

    def test_reentered_leaf_reports_again(self, stage: "Stage") -> None:
        service = stage.report_service(acknowledged=True)
        leaf = report(stage, search_that_found(stage))
        stage.run(leaf)
        stage.run(leaf)
        assert len(service.requests) == 2
