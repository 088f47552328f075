"""Reports that are kept until they arrive, and finds that may be the same: nothing is lost, and the operator decides."""

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


class Day:
    """Has leaves, by name, answer the same whenever they can, and what is usual otherwise."""

    def __init__(self, **answers: str) -> None:
        self.outcomes = answers

    def choose(self, leaf: StubLeaf, options: Sequence[Outcome]) -> Outcome:
        said = self.outcomes.get(leaf.name)
        return next((answer for answer in options if answer.name == said), nominal(options))


@pytest.fixture
def mission() -> SimulatedTree:
    """The resilient mission, without a robot, one tick under way."""
    tree = compile_simulated(bind_main(load_forest(RESILIENT, read_tree_file), default_registry()), {})
    tree.policy = Day(NotifyBase="refused", DeliverOnTheWay="refused")
    return tree


def tick(mission: SimulatedTree, count: int = 1) -> list[str]:
    """Tick, and return what the leaves have answered meanwhile."""
    mission.events.clear()
    for _ in range(count):
        mission.clock.advance(1.0)
        mission.root.tick_once()
    return [f"{event.leaf} {event.outcome}" for event in mission.events if event.outcome]


def test_a_find_is_kept_before_anybody_is_told(mission: SimulatedTree) -> None:
    said = tick(mission)
    order = ["BroadcastSurvivorTF named", "KeepReport kept", "AdvanceZone advanced", "NotifyBase refused"]
    assert [line for line in said if line in order] == order


def test_a_base_that_is_silent_does_not_hold_up_the_next_zone(mission: SimulatedTree) -> None:
    mission.policy = Day(NotifyBase="refused", NavigateToZone="arrived", DeliverOnTheWay="reporting")
    said = tick(mission, 3)
    assert said.count("AdvanceZone advanced") == 3


def test_what_is_kept_is_sent_during_the_drive(mission: SimulatedTree) -> None:
    tick(mission)
    mission.policy = Day(NavigateToZone="driving")
    said = tick(mission, 2)
    assert said[said.index("NavigateToZone driving") + 1] == "DeliverOnTheWay delivered"
    assert mission.fact_values()["reports_kept"] == 0


@pytest.mark.parametrize(
    "moment", ["NavigateToZone driving", "NotifyBase reporting", "DetectSurvivor searching"]
)
def test_a_mission_that_is_halted_names_and_keeps_each_find_once(mission: SimulatedTree, moment: str) -> None:
    name, answer = moment.split()
    mission.policy = Day(**{name: answer})
    first = tick(mission)
    assert moment in first
    mission.root.stop(Status.INVALID)
    mission.policy = Day()
    said = first + tick(mission, 20)
    assert said.count("BroadcastSurvivorTF named") == said.count("AdvanceZone advanced") == 3
    assert said.count("KeepReport kept") == 3


def test_pauses_grow_to_a_limit_and_end_with_a_success() -> None:
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


def test_a_clock_that_jumps_back_ends_a_pause() -> None:
    clock = ManualClock(1000.0)
    backoff = Backoff(clock, 5.0, 60.0)
    backoff.start_pause()
    clock.advance(-900.0)
    assert backoff.remaining_sec <= 0.0


def test_no_pause_is_no_pause() -> None:
    backoff = Backoff(ManualClock(), 0.0, 60.0)
    backoff.start_pause()
    assert backoff.remaining_sec <= 0.0


class TestFindsThatMayBeTheSame:
    @pytest.fixture
    def record(self) -> MissionRecord:
        record = MissionRecord(duplicate_radius_m=3.0)
        for number, (zone, x) in enumerate({"zone_a": 0.0, "zone_b": 2.9, "zone_c": 9.0}.items(), start=1):
            record.zone_searched(zone, (x, 0.0))
            record.survivor_named(f"survivor_{number}", x, 0.0)
        return record

    def test_both_are_kept_and_the_later_one_is_marked(self, record: MissionRecord) -> None:
        assert [survivor.possibly for survivor in record.survivors] == [None, "survivor_1", None]
        assert str(record.survivors[1]) == "survivor_2 in zone_b at (2.90, 0.00), possibly survivor_1"

    def test_both_must_be_acknowledged(self, record: MissionRecord) -> None:
        zones = ZoneManager([], {"x": 0, "y": 0, "yaw": 0})
        record.base_reached()
        record.record_acknowledgement("survivor_1")
        record.record_acknowledgement("survivor_3")
        assert record.shortfalls(zones) == [
            "The base station did not acknowledge survivor_2 in zone_b at (2.90, 0.00), possibly survivor_1."
        ]

    @pytest.mark.parametrize("standing", [DetectionVerdict.REJECTED, DetectionVerdict.MERGED])
    def test_whom_the_operator_rejects_or_merges_need_not_be_acknowledged(
        self, record: MissionRecord, standing: DetectionVerdict
    ) -> None:
        zones = ZoneManager([], {"x": 0, "y": 0, "yaw": 0})
        record.base_reached()
        record.record_acknowledgement("survivor_1")
        record.record_acknowledgement("survivor_3")
        record.survivor_judged("survivor_2", standing)
        assert record.shortfalls(zones) == []

    def test_who_is_confirmed_must_be_acknowledged_all_the_same(self, record: MissionRecord) -> None:
        record.survivor_judged("survivor_3", DetectionVerdict.CONFIRMED)
        assert str(record.survivors[2]) == "survivor_3 in zone_c at (9.00, 0.00), confirmed"
        assert record.shortfalls(ZoneManager([], {"x": 0, "y": 0, "yaw": 0})) != []

    def test_nobody_is_like_a_find_that_was_rejected(self, record: MissionRecord) -> None:
        record.survivor_judged("survivor_3", DetectionVerdict.REJECTED)
        record.survivor_named("survivor_4", 9.5, 0.0)
        assert record.survivors[-1].possibly is None


@pytest.mark.ros
class TestJudging:
    """The operator's word on a find, by its service."""

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

    def test_a_find_is_a_candidate_until_it_is_confirmed(
        self, ros: Any, record: MissionRecord, kept: StoredReports
    ) -> None:
        standings = [record.survivors[0].standing]
        assert self.judge(ros, "survivor_1", 1) == (True, "done")
        standings.append(record.survivors[0].standing)
        assert standings == [DetectionVerdict.CANDIDATE, DetectionVerdict.CONFIRMED]
        assert len(kept) == 2

    def test_a_find_that_is_rejected_is_reported_no_more(
        self, ros: Any, record: MissionRecord, kept: StoredReports
    ) -> None:
        assert self.judge(ros, "survivor_2", 2) == (True, "done")
        assert record.survivors[1].standing is DetectionVerdict.REJECTED
        assert [report.survivor_id for report in kept] == ["survivor_1"]

    def test_finds_are_merged_by_the_operator(self, ros: Any, record: MissionRecord) -> None:
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
    def test_a_word_that_makes_no_sense_is_refused(
        self, ros: Any, record: MissionRecord, survivor_id: str, verdict: int, same_as: str, said: str
    ) -> None:
        before = record.survivors
        assert self.judge(ros, survivor_id, verdict, same_as) == (False, said)
        assert record.survivors == before


@pytest.mark.ros
def test_reports_that_base_refuses_arrive_while_the_robot_drives_on() -> None:
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
