"""AwaitSurvivor against a detector that publishes: only somebody new is a find, and the search is told where."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from sar_compiler.journal.journal_opening import open_journal
from search_and_rescue.actions.survivors import AwaitSurvivor, DetectSurvivor
from search_and_rescue.record import DetectionVerdict
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

pytestmark = pytest.mark.ros

ZONES = [{"id": "zone_a", "x": -3.0, "y": 3.0, "yaw": 0.0}]
BASE = {"x": 0.0, "y": 0.0, "yaw": 0.0}


class Detector:
    """Publishes on the topic of a stage, which it has found."""

    def __init__(self, stage: "Stage") -> None:
        from geometry_msgs.msg import PointStamped

        self._type = PointStamped
        self._publisher = stage.host().node.create_publisher(PointStamped, "survivor_detections", 10)
        stage.until(self._publisher.get_subscription_count, "the subscription")

    def see(self, x: float, y: float, frame: str = "map") -> None:
        message = self._type()
        message.header.frame_id = frame
        message.point.x, message.point.y = x, y
        self._publisher.publish(message)


def listening(stage: "Stage", **options: Any) -> tuple[AwaitSurvivor, DetectSurvivor, Detector]:
    search = DetectSurvivor("DetectSurvivor", stage.zones, record=stage.record)
    leaf = stage.take(AwaitSurvivor("AwaitSurvivor", search, stage.zones, record=stage.record, **options))
    return leaf, search, Detector(stage)


def passed_over(stage: "Stage", leaf: AwaitSurvivor, detector: Detector) -> None:
    """Check that what was published was no find: what comes behind it is the first one."""
    detector.see(9.0, 9.0)
    assert stage.run(leaf) is Status.SUCCESS
    assert leaf.detect_node.survivor_pose() == (9.0, 9.0)


def test_it_is_running_while_nobody_was_published(stage: "Stage") -> None:
    leaf, search, _ = listening(stage)
    leaf.tick_once()
    assert (leaf.status, leaf.outcome_label) == (Status.RUNNING, "listening")
    assert search.survivor_pose() is None


def test_the_search_is_told_where_somebody_was_seen(stage: "Stage") -> None:
    leaf, search, detector = listening(stage)
    detector.see(1.0, 2.0)
    assert stage.run(leaf) is Status.SUCCESS
    assert (search.survivor_pose(), search.survivor_id()) == ((1.0, 2.0), None)
    assert [str(each) for each in stage.record.survivors] == [
        "a survivor without a name in zone_a at (1.00, 2.00)"
    ]
    assert stage.lines[-1] == "Survivor seen on the way, in zone_a!"


def test_a_find_that_was_published_while_nobody_listened_is_not_lost(stage: "Stage") -> None:
    leaf, search, detector = listening(stage)
    leaf.tick_once()
    leaf.stop(Status.INVALID)
    detector.see(1.0, 2.0)
    stage.until(lambda: leaf.message is not None, "the message")
    assert stage.run(leaf) is Status.SUCCESS
    assert search.survivor_pose() == (1.0, 2.0)


def test_the_search_forgets_its_last_find_when_it_listens_anew(stage: "Stage") -> None:
    leaf, search, _ = listening(stage)
    search.store_detection((1.0, 2.0))
    leaf.tick_once()
    assert search.survivor_pose() is None


@pytest.mark.parametrize("standing", [DetectionVerdict.CONFIRMED, DetectionVerdict.REJECTED])
def test_who_is_near_somebody_with_a_name_is_no_news(standing: DetectionVerdict, stage: "Stage") -> None:
    leaf, _, detector = listening(stage, same_within=1.0)
    stage.record.survivor_named("survivor_1", 1.0, 2.0)
    stage.record.survivor_judged("survivor_1", standing)
    detector.see(1.0, 2.9)
    passed_over(stage, leaf, detector)


def test_who_was_named_since_the_message_came_is_no_news(stage: "Stage") -> None:
    leaf, _, detector = listening(stage)
    detector.see(1.0, 2.0)
    stage.until(lambda: leaf.message is not None, "the message")
    stage.record.survivor_named("survivor_1", 1.0, 2.0)
    leaf.tick_once()
    assert leaf.status is Status.RUNNING
    passed_over(stage, leaf, detector)


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        ((1.0, 2.0, "camera"), "the point is in the frame 'camera', but must be in 'map'"),
        ((math.nan, 2.0), "(nan, 2.0) is not a position"),
    ],
    ids=["frame", "position"],
)
def test_what_cannot_be_is_told_once_and_passed_over(seen: tuple[Any, ...], why: str, stage: "Stage") -> None:
    leaf, _, detector = listening(stage)
    detector.see(*seen)
    detector.see(*seen)
    passed_over(stage, leaf, detector)
    assert stage.warnings == [f"Topic 'survivor_detections': {why}. The value is treated as unknown."]


def test_somebody_new_among_others_who_are_seen_at_once_is_not_missed(stage: "Stage") -> None:
    leaf, search, detector = listening(stage)
    stage.record.survivor_named("survivor_1", 1.0, 2.0)
    for place in ((1.0, 2.0), (5.0, 5.0), (1.0, 2.0)):
        detector.see(*place)
    assert stage.run(leaf) is Status.SUCCESS
    assert search.survivor_pose() == (5.0, 5.0)


def test_without_a_zone_nobody_is_found(stage: "Stage") -> None:
    leaf, _, _ = listening(stage)
    for _ in range(stage.zones.total_zones()):
        stage.zones.select_next_zone()
    leaf.tick_once()
    assert (leaf.status, leaf.outcome_label) == (Status.FAILURE, "no zone")


def test_a_find_that_an_earlier_run_has_not_dealt_with_comes_first(stage: "Stage", tmp_path: Path) -> None:
    first, second = (Search(ZoneManager(ZONES, BASE)) for _ in range(2))
    for search, resume in ((first, False), (second, True)):
        kept = open_journal(tmp_path / "m.journal", resume=resume)
        search.use_journal(kept)
        kept.begin({}, {})
        if not resume:
            search.record.zone_searched("zone_a", (1.0, 2.0))
        kept.close()
    leaf = stage.take(
        AwaitSurvivor(
            "AwaitSurvivor",
            DetectSurvivor("DetectSurvivor", second.zones, record=second.record),
            second.zones,
            record=second.record,
        )
    )
    leaf.tick_once()
    assert leaf.status is Status.SUCCESS
    assert leaf.detect_node.survivor_pose() == (1.0, 2.0)
    assert len(second.record.survivors) == 1


def test_an_earlier_search_that_found_nobody_is_left_to_the_search(stage: "Stage") -> None:
    leaf, _, _ = listening(stage)
    stage.record.before._searches.append(("zone_a", None))
    leaf.tick_once()
    assert leaf.status is Status.RUNNING
    assert stage.record.before.has_searched("zone_a")
