"""KeepReport and DeliverReports against a scripted base station."""

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
    def test_the_report_of_the_survivor_that_was_found_is_kept_and_noted(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        stage.record.survivor_named("survivor_1", -2.5, 3.2)
        assert stage.run(keep(stage, kept, (-2.5, 3.2), "survivor_1")) is Status.SUCCESS
        assert list(kept) == [FIRST]
        assert [known.kept for known in stage.record.survivors] == [True]
        assert stage.lines == ["The report of survivor_1 is stored until base acknowledges it."]
        assert stage.warnings == []

    def test_a_report_that_an_earlier_run_has_delivered_is_not_kept_again(
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
    def test_without_a_survivor_with_a_name_there_is_nothing_to_keep(
        self, stage: "Stage", kept: StoredReports, pose: tuple[float, float] | None, missing: str
    ) -> None:
        assert stage.run(keep(stage, kept, pose, None)) is Status.FAILURE
        assert stage.warnings == [f"'KeepReport' has no report to store: {missing}."]
        assert not kept


class TestDeliverReports:
    def test_with_nothing_kept_it_succeeds_at_once_and_asks_nobody(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        leaf = deliver(stage, kept)
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS
        assert stage.lines == []

    def test_every_report_is_sent_once_the_oldest_first(self, stage: "Stage", kept: StoredReports) -> None:
        service = stage.report_service(acknowledged=True)
        assert stage.run(deliver(stage, kept, FIRST, SECOND)) is Status.SUCCESS
        assert ids(service) == ["survivor_1", "survivor_2"]
        assert not kept
        assert all(survivor.acknowledged for survivor in stage.record.survivors)

    def test_a_report_names_the_survivor_and_the_point_in_map(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        service = stage.report_service(acknowledged=True)
        stage.run(deliver(stage, kept, SECOND))
        location = service.requests[0].location
        assert location.header.frame_id == "map"
        assert (location.point.x, location.point.y, location.point.z) == (4.1, -2.5, 0.0)

    def test_a_report_that_is_refused_stays_kept_and_holds_up_no_other(
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

    def test_a_base_that_does_not_answer_is_asked_for_one_report_only(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        service = stage.report_service(acknowledged=True)
        service.gate.clear()
        assert stage.run(deliver(stage, kept, FIRST, SECOND, timeout_sec=0.05)) is Status.FAILURE
        assert len(service.requests) <= 1
        assert list(kept) == [FIRST, SECOND]

    def test_an_absent_base_costs_the_deadline_and_no_report(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        assert stage.run(deliver(stage, kept, FIRST, server_timeout_sec=0.0)) is Status.FAILURE
        assert "no server for the service" in stage.warnings[0]
        assert list(kept) == [FIRST]

    def test_what_was_refused_is_tried_again_when_the_leaf_is_entered_again(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        service = stage.report_service(acknowledged=False)
        leaf = deliver(stage, kept, FIRST)
        assert stage.run(leaf) is Status.FAILURE
        service.answer = lambda _, response: setattr(response, "acknowledged", True)
        assert stage.run(leaf) is Status.SUCCESS
        assert ids(service) == ["survivor_1", "survivor_1"]

    def test_with_a_back_off_it_waits_before_it_sends_again(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
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

    def test_a_new_report_does_not_wait_for_the_end_of_a_back_off(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        service = stage.report_service(acknowledged=False)
        leaf = deliver(stage, kept, FIRST, backoff_sec=5.0, clock=ManualClock())
        stage.run(leaf)
        stage.record.report_kept(SECOND)
        stage.run(leaf)
        assert ids(service) == ["survivor_1", "survivor_1", "survivor_2"]

    def test_an_absent_base_is_not_sought_again_in_a_back_off(
        self, stage: "Stage", kept: StoredReports
    ) -> None:
        leaf = deliver(stage, kept, FIRST, backoff_sec=5.0, clock=ManualClock(), server_timeout_sec=0.0)
        assert stage.run(leaf) is Status.FAILURE
        leaf.tick_once()
        assert leaf.status is Status.RUNNING

    def test_a_delivery_that_is_interrupted_begins_anew_with_what_is_kept(
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
