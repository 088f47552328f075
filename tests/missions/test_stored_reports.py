"""Tests of stored reports."""

import pytest

from sar_compiler.runtime.context import is_mission_context, preview_of
from search_and_rescue.record import (
    DetectionVerdict,
    MissionRecord,
    StoredReports,
    SurvivorReport,
)
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager

FIRST, SECOND = SurvivorReport("survivor_1", 1.0, 2.0), SurvivorReport("survivor_2", 3.0, 4.0)


@pytest.fixture
def search() -> Search:
    return Search(ZoneManager([], {"x": 0, "y": 0, "yaw": 0}))


@pytest.fixture
def record(search: Search) -> MissionRecord:
    return search.record


@pytest.fixture
def kept(search: Search) -> StoredReports:
    return search.kept


def test_stored_reports_keep_their_order(record: MissionRecord, kept: StoredReports) -> None:
    record.report_kept(SECOND)
    record.report_kept(FIRST)
    assert list(kept) == [SECOND, FIRST]


def test_each_survivor_has_one_stored_report(record: MissionRecord, kept: StoredReports) -> None:
    record.report_kept(FIRST)
    record.report_kept(FIRST)
    assert len(kept) == 1


def test_acknowledged_report_is_removed(record: MissionRecord, kept: StoredReports) -> None:
    record.report_kept(FIRST)
    record.report_kept(SECOND)
    record.record_acknowledgement("survivor_1")
    record.record_acknowledgement("survivor_9")
    assert list(kept) == [SECOND]


@pytest.mark.parametrize(
    ("standing", "left"),
    [(DetectionVerdict.CONFIRMED, [FIRST]), (DetectionVerdict.REJECTED, []), (DetectionVerdict.MERGED, [])],
)
def test_report_of_rejected_or_merged_survivor_is_removed(
    record: MissionRecord, kept: StoredReports, standing: DetectionVerdict, left: list[SurvivorReport]
) -> None:
    record.report_kept(FIRST)
    record.survivor_judged("survivor_1", standing)
    assert list(kept) == left


def test_reports_can_be_acknowledged_during_iteration(record: MissionRecord, kept: StoredReports) -> None:
    record.report_kept(FIRST)
    record.report_kept(SECOND)
    for report in kept:
        record.record_acknowledgement(report.survivor_id)
    assert not kept


def test_stored_reports_have_a_preview() -> None:
    assert is_mission_context(StoredReports)
    assert isinstance(preview_of(StoredReports), StoredReports)
