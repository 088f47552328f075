"""Tests of reports that are stored until they are acknowledged, and of possible duplicates among detections."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from sar_compiler.analysis.simulated_tree import SimulatedTree, compile_simulated
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.compiler import bind_main
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.outcomes import Outcome, nominal
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import load_forest
from search_and_rescue.actions.report_queue import Backoff
from search_and_rescue.operator_leaves import NotHeld
from search_and_rescue.record import (
    DetectionVerdict,
    MissionRecord,
    StoredReports,
    SurvivorReport,
)
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager
from tests.processes import Command, in_order

RESILIENT = Path("trees/search_and_rescue_resilient.xml")


class ScriptedPolicy:
    """Lets leaves return the outcome given for their name if they have it, and their nominal one otherwise."""

    def __init__(self, **answers: str) -> None:
        self.outcomes = answers

    def choose(self, leaf: StubLeaf, options: Sequence[Outcome]) -> Outcome:
        said = self.outcomes.get(leaf.name)
        return next((answer for answer in options if answer.name == said), nominal(options))


@pytest.fixture
def mission() -> SimulatedTree:
    """Return the simulated resilient mission; the base station refuses reports."""
    tree = compile_simulated(bind_main(load_forest(RESILIENT, read_tree_file), default_registry()), {})
    tree.policy = ScriptedPolicy(NotifyBase="refused", DeliverOnTheWay="refused")
    return tree


def tick(mission: SimulatedTree, count: int = 1) -> list[str]:
    """Tick `count` times; return the outcomes of the leaves."""
    mission.events.clear()
    for _ in range(count):
        mission.clock.advance(1.0)
        mission.root.tick_once()
    return [f"{event.leaf} {event.outcome}" for event in mission.events if event.outcome]


def test_detection_is_stored_before_it_is_reported(mission: SimulatedTree) -> None:
    said = tick(mission)
    order = ["BroadcastSurvivorTF named", "KeepReport kept", "AdvanceZone advanced", "NotifyBase refused"]
    assert [line for line in said if line in order] == order


def test_unresponsive_base_does_not_delay_next_zone(mission: SimulatedTree) -> None:
    mission.policy = ScriptedPolicy(
        NotifyBase="refused", NavigateToZone="arrived", DeliverOnTheWay="reporting"
    )
    said = tick(mission, 3)
    assert said.count("AdvanceZone advanced") == 3


def test_stored_report_is_delivered_during_drive(mission: SimulatedTree) -> None:
    tick(mission)
    mission.policy = ScriptedPolicy(NavigateToZone="driving")
    said = tick(mission, 2)
    assert said[said.index("NavigateToZone driving") + 1] == "DeliverOnTheWay delivered"
    assert mission.fact_values()["reports_kept"] == 0


@pytest.mark.parametrize(
    "moment", ["NavigateToZone driving", "NotifyBase reporting", "DetectSurvivor searching"]
)
def test_halted_mission_names_and_stores_each_detection_once(mission: SimulatedTree, moment: str) -> None:
    name, answer = moment.split()
    mission.policy = ScriptedPolicy(**{name: answer})
    first = tick(mission)
    assert moment in first
    mission.root.stop(Status.INVALID)
    mission.policy = ScriptedPolicy()
    said = first + tick(mission, 20)
    assert said.count("BroadcastSurvivorTF named") == said.count("AdvanceZone advanced") == 3
    assert said.count("KeepReport kept") == 3


def test_backoff_grows_to_limit_and_is_reset_by_success() -> None:
    clock = ManualClock()
    backoff = Backoff(clock, 5.0, 60.0)
    assert backoff.remaining_sec <= 0.0
    lengths = []
    for _ in range(6):
        backoff.start_pause()
        lengths.append(backoff.remaining_sec)
        clock.advance(backoff.remaining_sec)
        assert backoff.remaining_sec <= 0.0
    assert lengths == [5.0, 10.0, 20.0, 40.0, 60.0, 60.0]
    backoff.reset()
    backoff.start_pause()
    assert backoff.remaining_sec == 5.0


def test_backward_clock_jump_ends_backoff() -> None:
    clock = ManualClock(1000.0)
    backoff = Backoff(clock, 5.0, 60.0)
    backoff.start_pause()
    clock.advance(-900.0)
    assert backoff.remaining_sec <= 0.0


def test_zero_backoff_does_not_pause() -> None:
    backoff = Backoff(ManualClock(), 0.0, 60.0)
    backoff.start_pause()
    assert backoff.remaining_sec <= 0.0


class TestPossibleDuplicates:
    @pytest.fixture
    def record(self) -> MissionRecord:
        record = MissionRecord(duplicate_radius_m=3.0)
        for number, (zone, x) in enumerate({"zone_a": 0.0, "zone_b": 2.9, "zone_c": 9.0}.items(), start=1):
            record.zone_searched(zone, (x, 0.0))
            record.survivor_named(f"survivor_{number}", x, 0.0)
        return record

    def test_both_detections_are_kept_and_later_one_is_marked(self, record: MissionRecord) -> None:
        assert [survivor.possibly for survivor in record.survivors] == [None, "survivor_1", None]
        assert str(record.survivors[1]) == "survivor_2 in zone_b at (2.90, 0.00), possibly survivor_1"

    def test_both_detections_must_be_acknowledged(self, record: MissionRecord) -> None:
        zones = ZoneManager([], {"x": 0, "y": 0, "yaw": 0})
        record.base_reached()
        record.record_acknowledgement("survivor_1")
        record.record_acknowledgement("survivor_3")
        assert record.shortfalls(zones) == [
            "The base station did not acknowledge survivor_2 in zone_b at (2.90, 0.00), possibly survivor_1."
        ]

    @pytest.mark.parametrize("standing", [DetectionVerdict.REJECTED, DetectionVerdict.MERGED])
    def test_rejected_or_merged_detection_needs_no_acknowledgement(
        self, record: MissionRecord, standing: DetectionVerdict
    ) -> None:
        zones = ZoneManager([], {"x": 0, "y": 0, "yaw": 0})
        record.base_reached()
        record.record_acknowledgement("survivor_1")
        record.record_acknowledgement("survivor_3")
        record.survivor_judged("survivor_2", standing)
        assert record.shortfalls(zones) == []

    def test_confirmed_detection_must_be_acknowledged(self, record: MissionRecord) -> None:
        record.survivor_judged("survivor_3", DetectionVerdict.CONFIRMED)
        assert str(record.survivors[2]) == "survivor_3 in zone_c at (9.00, 0.00), confirmed"
        assert record.shortfalls(ZoneManager([], {"x": 0, "y": 0, "yaw": 0})) != []

    def test_rejected_detection_is_no_possible_duplicate(self, record: MissionRecord) -> None:
        record.survivor_judged("survivor_3", DetectionVerdict.REJECTED)
        record.survivor_named("survivor_4", 9.5, 0.0)
        assert record.survivors[-1].possibly is None


@pytest.mark.ros
class TestReview:
    """The operator's review of a detection by its service."""

    @pytest.fixture
    def search(self) -> Search:
        search = Search(ZoneManager([], {"x": 0, "y": 0, "yaw": 0}))
        for number in (1, 2):
            report = SurvivorReport(f"survivor_{number}", float(number), 0.0)
            search.record.survivor_named(report.survivor_id, report.x, report.y)
            search.record.report_kept(report)
        return search

    @pytest.fixture
    def kept(self, search: Search) -> StoredReports:
        return search.kept

    @pytest.fixture
    def record(self, ros: Any, search: Search) -> Any:
        leaf = NotHeld("NotHeld?", search.orders, search.zones, record=search.record)
        leaf.setup(node=ros.node("mission"))
        yield search.record
        leaf.shutdown()

    def judge(self, ros: Any, survivor_id: str, verdict: int, same_as: str = "") -> tuple[bool, str]:
        from sar_interfaces.srv import JudgeSurvivor

        client = ros.node("operator").create_client(JudgeSurvivor, "/mission/judge_survivor")
        ros.spin_until(client.service_is_ready, "the service")
        request = JudgeSurvivor.Request(survivor_id=survivor_id, verdict=verdict, same_as=same_as)
        answer = client.call_async(request)
        ros.spin_until(answer.done, "the answer")
        return answer.result().success, answer.result().message

    def test_detection_is_candidate_until_confirmed(
        self, ros: Any, record: MissionRecord, kept: StoredReports
    ) -> None:
        standings = [record.survivors[0].standing]
        assert self.judge(ros, "survivor_1", 1) == (True, "done")
        standings.append(record.survivors[0].standing)
        assert standings == [DetectionVerdict.CANDIDATE, DetectionVerdict.CONFIRMED]
        assert len(kept) == 2

    def test_rejected_detection_is_no_longer_reported(
        self, ros: Any, record: MissionRecord, kept: StoredReports
    ) -> None:
        assert self.judge(ros, "survivor_2", 2) == (True, "done")
        assert record.survivors[1].standing is DetectionVerdict.REJECTED
        assert [report.survivor_id for report in kept] == ["survivor_1"]

    def test_operator_can_merge_detections(self, ros: Any, record: MissionRecord) -> None:
        assert self.judge(ros, "survivor_2", 3, "survivor_1") == (True, "done")
        assert str(record.survivors[1]).endswith("merged with survivor_1")

    @pytest.mark.parametrize(
        ("survivor_id", "verdict", "same_as", "said"),
        [
            ("survivor_9", 1, "", "unknown survivor 'survivor_9'"),
            ("survivor_1", 7, "", "unknown verdict 7"),
            ("survivor_1", 3, "survivor_9", "'survivor_1' cannot be merged with 'survivor_9'"),
            ("survivor_1", 3, "survivor_1", "'survivor_1' cannot be merged with 'survivor_1'"),
        ],
    )
    def test_invalid_review_is_refused(
        self, ros: Any, record: MissionRecord, survivor_id: str, verdict: int, same_as: str, said: str
    ) -> None:
        before = record.survivors
        assert self.judge(ros, survivor_id, verdict, same_as) == (False, said)
        assert record.survivors == before


@pytest.mark.ros
def test_refused_reports_are_delivered_during_later_drive() -> None:
    run = Command(
        "sar-run",
        "search_and_rescue_resilient",
        "--sim",
        "--speed",
        20,
        "--fault",
        "report_survivor:refuse=2",
        "--ros-args",
        "-p",
        "zone_order:=[zone_a, zone_c]",
    )
    try:
        assert run.end() == 0, run.output
    finally:
        run.kill()
    told = [
        "The report of survivor_1 is stored until base acknowledges it.",
        "Base did not acknowledge survivor_1.",
        "Navigating to zone_c...",
        "Base acknowledged survivor_1.",
        "Reached zone_c.",
        "Mission complete.",
    ]
    assert in_order(told, run.log) is None, run.output
