"""Tests of KeepReport and DeliverReports with a scripted base station."""

from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.runtime.clock import ManualClock
from search_and_rescue.actions.report_queue import DeliverReports, KeepReport
from search_and_rescue.actions.survivors import DetectSurvivor
from search_and_rescue.record import ResumedOutcomes, StoredReports, SurvivorReport

if TYPE_CHECKING:
    from tests.missions.mission_stage import ScriptedService, Stage

pytestmark = pytest.mark.ros

FIRST, SECOND = SurvivorReport("survivor_1", -2.5, 3.2), SurvivorReport("survivor_2", 4.1, -2.5)


@pytest.fixture
def kept(stage: "Stage") -> StoredReports:
    return stage.kept


def keep(
    stage: "Stage", kept: StoredReports, pose: tuple[float, float] | None, survivor_id: str | None
) -> KeepReport:
    detect = DetectSurvivor("DetectSurvivor", stage.zones)
    detect._pose, detect._survivor_id = pose, survivor_id
    return stage.take(KeepReport("KeepReport", detect, record=stage.record))


def deliver(stage: "Stage", kept: StoredReports, *reports: SurvivorReport, **options: Any) -> DeliverReports:
    for report in reports:
        stage.record.survivor_named(report.survivor_id, report.x, report.y)
        stage.record.report_kept(report)
    return stage.take(DeliverReports("DeliverReports", kept, record=stage.record, **options))


def ids(service: "ScriptedService") -> list[str]:
    return [request.survivor_id for request in service.requests]


class TestKeepReport:
    def test_report_of_found_survivor_is_stored_and_logged(self, stage: "Stage", kept: StoredReports) -> None:
        stage.record.survivor_named("survivor_1", -2.5, 3.2)
        assert stage.run(keep(stage, kept, (-2.5, 3.2), "survivor_1")) is Status.SUCCESS
        assert list(kept) == [FIRST]
        assert [known.kept for known in stage.record.survivors] == [True]
        assert stage.lines == ["The report of survivor_1 is stored until base acknowledges it."]
        assert stage.warnings == []

    def test_report_acknowledged_in_earlier_run_is_not_stored_again(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        stage.record.survivor_named("survivor_1", -2.5, 3.2)
        stage.record.record_acknowledgement("survivor_1")
        leaf = keep(stage, kept, (-2.5, 3.2), "survivor_1")
        named = {"survivor": "survivor_1", "x": -2.5, "y": 3.2}
        stage.record.before = ResumedOutcomes.from_events(
            [JournalEntry(1, 1, 0.0, 0.0, "survivor_named", named)]
        )
        assert stage.run(leaf) is Status.SUCCESS
        assert list(kept) == []
        assert [found.acknowledged for found in stage.record.survivors] == [True]

    @pytest.mark.parametrize(
        ("pose", "missing"), [(None, "no survivor was found"), ((1.0, 2.0), "the survivor has no name yet")]
    )
    def test_storing_without_named_survivor_fails(
        self, stage: "Stage", kept: StoredReports, pose: tuple[float, float] | None, missing: str
    ) -> None:
        assert stage.run(keep(stage, kept, pose, None)) is Status.FAILURE
        assert stage.warnings == [f"'KeepReport' has no report to store: {missing}."]
        assert not kept


class TestDeliverReports:
    def test_empty_queue_succeeds_at_once(self, stage: "Stage", kept: StoredReports) -> None:
        leaf = deliver(stage, kept)
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS
        assert stage.lines == []

    def test_reports_are_sent_once_oldest_first(self, stage: "Stage", kept: StoredReports) -> None:
        service = stage.report_service(acknowledged=True)
        assert stage.run(deliver(stage, kept, FIRST, SECOND)) is Status.SUCCESS
        assert ids(service) == ["survivor_1", "survivor_2"]
        assert not kept
        assert all(survivor.acknowledged for survivor in stage.record.survivors)

    def test_report_contains_name_and_point_in_map(self, stage: "Stage", kept: StoredReports) -> None:
        service = stage.report_service(acknowledged=True)
        stage.run(deliver(stage, kept, SECOND))
        location = service.requests[0].location
        assert location.header.frame_id == "map"
        assert (location.point.x, location.point.y, location.point.z) == (4.1, -2.5, 0.0)

    def test_refused_report_stays_and_does_not_block_others(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        service = stage.report_service(acknowledged=True)
        service.answer = lambda request, response: setattr(
            response, "acknowledged", request.survivor_id != "survivor_1"
        )
        assert stage.run(deliver(stage, kept, FIRST, SECOND)) is Status.FAILURE
        assert ids(service) == ["survivor_1", "survivor_2"]
        assert list(kept) == [FIRST]
        assert stage.warnings == ["Base did not acknowledge survivor_1."]

    def test_unresponsive_base_is_asked_for_one_report_only(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        service = stage.report_service(acknowledged=True)
        service.gate.clear()
        assert stage.run(deliver(stage, kept, FIRST, SECOND, timeout_sec=0.05)) is Status.FAILURE
        assert len(service.requests) <= 1
        assert list(kept) == [FIRST, SECOND]

    def test_absent_base_fails_and_keeps_report(self, stage: "Stage", kept: StoredReports) -> None:
        assert stage.run(deliver(stage, kept, FIRST, server_timeout_sec=0.0)) is Status.FAILURE
        assert "no server for the service" in stage.warnings[0]
        assert list(kept) == [FIRST]

    def test_refused_report_is_retried_on_next_entry(self, stage: "Stage", kept: StoredReports) -> None:
        service = stage.report_service(acknowledged=False)
        leaf = deliver(stage, kept, FIRST)
        assert stage.run(leaf) is Status.FAILURE
        service.answer = lambda _, response: setattr(response, "acknowledged", True)
        assert stage.run(leaf) is Status.SUCCESS
        assert ids(service) == ["survivor_1", "survivor_1"]

    def test_backoff_delays_next_attempt(self, stage: "Stage", kept: StoredReports) -> None:
        service, clock = stage.report_service(acknowledged=False), ManualClock()
        leaf = deliver(stage, kept, FIRST, backoff_sec=5.0, clock=clock)
        assert stage.run(leaf) is Status.FAILURE
        leaf.tick_once()
        assert (leaf.status, leaf.feedback_message) == (Status.RUNNING, "next attempt in 5 s")
        clock.advance(4.0)
        leaf.tick_once()
        assert leaf.status is Status.RUNNING
        assert ids(service) == ["survivor_1"]
        clock.advance(1.5)
        assert stage.run(leaf) is Status.FAILURE
        assert ids(service) == ["survivor_1", "survivor_1"]

    def test_new_report_ends_backoff(self, stage: "Stage", kept: StoredReports) -> None:
        service = stage.report_service(acknowledged=False)
        leaf = deliver(stage, kept, FIRST, backoff_sec=5.0, clock=ManualClock())
        stage.run(leaf)
        stage.record.report_kept(SECOND)
        stage.run(leaf)
        assert ids(service) == ["survivor_1", "survivor_1", "survivor_2"]

    def test_absent_base_is_not_looked_up_during_backoff(self, stage: "Stage", kept: StoredReports) -> None:
        leaf = deliver(stage, kept, FIRST, backoff_sec=5.0, clock=ManualClock(), server_timeout_sec=0.0)
        assert stage.run(leaf) is Status.FAILURE
        leaf.tick_once()
        assert leaf.status is Status.RUNNING

    def test_interrupted_delivery_starts_over_with_stored_reports(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        service = stage.report_service(acknowledged=True)
        service.gate.clear()
        leaf = deliver(stage, kept, FIRST)
        stage.tick_until(leaf, lambda: service.requests, "the request")
        leaf.stop(Status.INVALID)
        service.gate.set()
        assert stage.run(leaf) is Status.SUCCESS
        assert not kept
