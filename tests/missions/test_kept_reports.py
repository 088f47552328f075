"""Reports that are kept."""

from sar_compiler.missions.search_and_rescue import KeptReports
from sar_compiler.missions.search_and_rescue.kept_reports import SurvivorReport
from sar_compiler.runtime.context import is_mission_context, preview_of

FIRST, SECOND = SurvivorReport("survivor_1", 1.0, 2.0), SurvivorReport("survivor_2", 3.0, 4.0)


def test_reports_come_in_the_order_in_which_they_were_kept() -> None:
    kept = KeptReports()
    kept.keep(SECOND)
    kept.keep(FIRST)
    assert list(kept) == [SECOND, FIRST]


def test_there_is_one_report_for_each_survivor() -> None:
    kept = KeptReports()
    kept.keep(FIRST)
    kept.keep(FIRST)
    assert len(kept) == 1


def test_a_report_that_is_delivered_is_kept_no_more() -> None:
    kept = KeptReports()
    kept.keep(FIRST)
    kept.keep(SECOND)
    kept.delivered("survivor_1")
    kept.delivered("survivor_9")
    assert list(kept) == [SECOND]


def test_reports_can_be_delivered_while_they_are_gone_through() -> None:
    kept = KeptReports()
    kept.keep(FIRST)
    kept.keep(SECOND)
    for report in kept:
        kept.delivered(report.survivor_id)
    assert not kept


def test_a_tree_can_be_looked_at_without_a_mission() -> None:
    assert is_mission_context(KeptReports)
    assert isinstance(preview_of(KeptReports), KeptReports)
