"""Tests of AwaitSurvivor with a publishing detector: only a new survivor is a detection, and its position is stored."""

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
    """A detector that publishes on the detection topic of a stage."""

    def __init__(self, stage: "Stage") -> None:
        from geometry_msgs.msg import PointStamped

        self._type = PointStamped
        self._publisher = stage.host().node.create_publisher(PointStamped, "survivor_detections", 10)
        stage.until(self._publisher.get_subscription_count, "the subscription")

    def publish(self, x: float, y: float, frame: str = "map") -> None:
        message = self._type()
        message.header.frame_id = frame
        message.point.x, message.point.y = x, y
        self._publisher.publish(message)


def make_listening_leaf(stage: "Stage", **options: Any) -> tuple[AwaitSurvivor, DetectSurvivor, Detector]:
    search = DetectSurvivor("DetectSurvivor", stage.zones, record=stage.record)
    leaf = stage.take(AwaitSurvivor("AwaitSurvivor", search, stage.zones, record=stage.record, **options))
    return leaf, search, Detector(stage)


def assert_earlier_messages_skipped(stage: "Stage", leaf: AwaitSurvivor, detector: Detector) -> None:
    """Check that earlier messages were no detections: a later message is the first one."""
    detector.publish(9.0, 9.0)
    assert stage.run(leaf) is Status.SUCCESS
    assert leaf.detect_node.survivor_pose() == (9.0, 9.0)


def test_leaf_runs_while_no_detection_is_published(stage: "Stage") -> None:
    leaf, search, _ = make_listening_leaf(stage)
    leaf.tick_once()
    assert (leaf.status, leaf.outcome_label) == (Status.RUNNING, "listening")
    assert search.survivor_pose() is None


def test_published_detection_is_stored_in_search(stage: "Stage") -> None:
    leaf, search, detector = make_listening_leaf(stage)
    detector.publish(1.0, 2.0)
    assert stage.run(leaf) is Status.SUCCESS
    assert (search.survivor_pose(), search.survivor_id()) == ((1.0, 2.0), None)
    assert [str(each) for each in stage.record.survivors] == [
        "a survivor without a name in zone_a at (1.00, 2.00)"
    ]
    assert stage.lines[-1] == "Survivor seen on the way, in zone_a!"


def test_detection_published_while_leaf_is_halted_is_kept(stage: "Stage") -> None:
    leaf, search, detector = make_listening_leaf(stage)
    leaf.tick_once()
    leaf.stop(Status.INVALID)
    detector.publish(1.0, 2.0)
    stage.until(lambda: leaf.message is not None, "the message")
    assert stage.run(leaf) is Status.SUCCESS
    assert search.survivor_pose() == (1.0, 2.0)


def test_listening_again_clears_previous_detection(stage: "Stage") -> None:
    leaf, search, _ = make_listening_leaf(stage)
    search.store_detection((1.0, 2.0))
    leaf.tick_once()
    assert search.survivor_pose() is None


@pytest.mark.parametrize("standing", [DetectionVerdict.CONFIRMED, DetectionVerdict.REJECTED])
def test_detection_near_named_survivor_is_skipped(standing: DetectionVerdict, stage: "Stage") -> None:
    leaf, _, detector = make_listening_leaf(stage, same_within=1.0)
    stage.record.survivor_named("survivor_1", 1.0, 2.0)
    stage.record.survivor_judged("survivor_1", standing)
    detector.publish(1.0, 2.9)
    assert_earlier_messages_skipped(stage, leaf, detector)


def test_survivor_named_after_message_arrived_is_skipped(stage: "Stage") -> None:
    leaf, _, detector = make_listening_leaf(stage)
    detector.publish(1.0, 2.0)
    stage.until(lambda: leaf.message is not None, "the message")
    stage.record.survivor_named("survivor_1", 1.0, 2.0)
    leaf.tick_once()
    assert leaf.status is Status.RUNNING
    assert_earlier_messages_skipped(stage, leaf, detector)


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        ((1.0, 2.0, "camera"), "the point is in the frame 'camera', but must be in 'map'"),
        ((math.nan, 2.0), "(nan, 2.0) is not a position"),
    ],
    ids=["frame", "position"],
)
def test_invalid_detection_is_reported_once_and_skipped(
    seen: tuple[Any, ...], why: str, stage: "Stage"
) -> None:
    leaf, _, detector = make_listening_leaf(stage)
    detector.publish(*seen)
    detector.publish(*seen)
    assert_earlier_messages_skipped(stage, leaf, detector)
    assert stage.warnings == [f"Topic 'survivor_detections': {why}. The value is treated as unknown."]


def test_new_detection_among_known_ones_is_kept(stage: "Stage") -> None:
    leaf, search, detector = make_listening_leaf(stage)
    stage.record.survivor_named("survivor_1", 1.0, 2.0)
    for place in ((1.0, 2.0), (5.0, 5.0), (1.0, 2.0)):
        detector.publish(*place)
    assert stage.run(leaf) is Status.SUCCESS
    assert search.survivor_pose() == (5.0, 5.0)


def test_leaf_without_zone_fails(stage: "Stage") -> None:
    leaf, _, _ = make_listening_leaf(stage)
    for _ in range(stage.zones.total_zones()):
        stage.zones.select_next_zone()
    leaf.tick_once()
    assert (leaf.status, leaf.outcome_label) == (Status.FAILURE, "no zone")


def test_unhandled_detection_of_earlier_run_comes_first(stage: "Stage", tmp_path: Path) -> None:
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


def test_earlier_search_without_detection_is_left_to_detect_survivor(stage: "Stage") -> None:
    leaf, _, _ = make_listening_leaf(stage)
    stage.record.before._searches.append(("zone_a", None))
    leaf.tick_once()
    assert leaf.status is Status.RUNNING
    assert stage.record.before.has_searched("zone_a")
