"""Tests of BroadcastSurvivorTF and the static transforms of a node, over DDS."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from search_and_rescue.actions.survivors import (
    BroadcastSurvivorTF,
    DetectSurvivor,
    static_transforms_of,
)

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

pytestmark = pytest.mark.ros


def search_that_found(stage: "Stage", x: float, y: float) -> DetectSurvivor:
    leaf = DetectSurvivor("DetectSurvivor", stage.zones)
    leaf._pose = (x, y)
    return leaf


def broadcast(stage: "Stage", detect: DetectSurvivor) -> BroadcastSurvivorTF:
    return stage.take(BroadcastSurvivorTF("BroadcastSurvivorTF", detect, stage.zones, record=stage.record))


def frame(name: str, x: float) -> Any:
    from geometry_msgs.msg import TransformStamped

    transform = TransformStamped()
    transform.header.frame_id = "map"
    transform.child_frame_id = name
    transform.transform.translation.x = x
    return transform


class TestBroadcastSurvivorTF:
    def test_survivor_gets_name_and_frame_under_map(self, stage: "Stage") -> None:
        detect = search_that_found(stage, -2.5, 3.2)
        assert stage.run(broadcast(stage, detect)) is Status.SUCCESS
        assert detect.survivor_id() == "survivor_1"
        listener = stage.static_frames()
        stage.until(lambda: listener.frames, "the frame")
        survivor = listener.frames["survivor_1"]
        rotation = survivor.transform.rotation
        assert survivor.header.frame_id == "map"
        assert listener.position("survivor_1") == (-2.5, 3.2, 0.0)
        assert (rotation.x, rotation.y, rotation.z, rotation.w) == (0.0, 0.0, 0.0, 1.0)
        now = stage.node.get_clock().now().nanoseconds
        assert 0 <= now - (survivor.header.stamp.sec * 10**9 + survivor.header.stamp.nanosec) < 10**10

    def test_broadcast_is_logged_once_and_name_recorded(self, stage: "Stage") -> None:
        stage.record.zone_searched("zone_a", (-2.5, 3.2))
        stage.run(broadcast(stage, search_that_found(stage, -2.5, 3.2)))
        assert stage.lines == ["Broadcasting TF frame: survivor_1 at (-2.50, 3.20) in map frame."]
        assert [survivor.survivor_id for survivor in stage.record.survivors] == ["survivor_1"]

    def test_activation_uses_one_name(self, stage: "Stage") -> None:
        leaf = broadcast(stage, search_that_found(stage, 1.0, 2.0))
        stage.run(leaf)
        assert leaf.update() is Status.SUCCESS
        assert stage.zones.next_survivor_id() == "survivor_2"

    def test_each_entry_uses_new_name_and_keeps_earlier_frames(self, stage: "Stage") -> None:
        detect = search_that_found(stage, 1.0, 2.0)
        leaf = broadcast(stage, detect)
        stage.run(leaf)
        detect._pose = (4.1, -2.5)
        stage.run(leaf)
        assert detect.survivor_id() == "survivor_2"
        late = stage.static_frames()
        stage.until(lambda: late.frames, "the frames")
        assert sorted(late.frames) == ["survivor_1", "survivor_2"]
        assert late.position("survivor_2") == (4.1, -2.5, 0.0)

    def test_broadcast_without_survivor_fails_and_uses_no_name(self, stage: "Stage") -> None:
        leaf = broadcast(stage, DetectSurvivor("DetectSurvivor", stage.zones))
        assert stage.run(leaf) is Status.FAILURE
        assert "no survivor was found" in stage.warnings[0]
        assert stage.zones.next_survivor_id() == "survivor_1"

    def test_two_leaves_on_one_node_publish_frames_of_both(self, stage: "Stage") -> None:
        first = broadcast(stage, search_that_found(stage, 1.0, 1.0))
        second = broadcast(stage, search_that_found(stage, 2.0, 2.0))
        stage.run(first)
        stage.run(second)
        late = stage.static_frames()
        stage.until(lambda: late.frames, "the frames")
        assert sorted(late.frames) == ["survivor_1", "survivor_2"]

    def test_frames_survive_shutdown_and_new_setup_of_leaf(self, stage: "Stage") -> None:
        leaf = broadcast(stage, search_that_found(stage, 1.0, 1.0))
        stage.run(leaf)
        leaf.shutdown()
        late = stage.static_frames()
        stage.until(lambda: "survivor_1" in late.frames, "the frame")
        leaf.setup(node=stage.node)
        stage.run(leaf)
        stage.until(lambda: sorted(late.frames) == ["survivor_1", "survivor_2"], "both frames")


class TestStaticTransforms:
    def test_resent_frame_replaces_earlier_one(self, stage: "Stage") -> None:
        transforms = static_transforms_of(stage.node)
        early = stage.static_frames()
        transforms.publish(frame("survivor_1", 1.0))
        transforms.publish(frame("survivor_2", 2.0))
        transforms.publish(frame("survivor_1", 3.0))
        late = stage.static_frames()
        for listener in (early, late):
            stage.until(lambda: len(listener.frames) == 2, "both frames")  # noqa: B023 - used at once
            assert listener.position("survivor_1") == (3.0, 0.0, 0.0)
            assert listener.position("survivor_2") == (2.0, 0.0, 0.0)

    def test_node_has_one_publisher(self, stage: "Stage") -> None:
        publisher = static_transforms_of(stage.node)
        assert static_transforms_of(stage.node) is publisher

    def test_two_nodes_share_no_frames(self, make_stage: Callable[[], "Stage"]) -> None:
        one, other = make_stage(), make_stage()
        static_transforms_of(one.node).publish(frame("survivor_1", 1.0))
        static_transforms_of(other.node).publish(frame("survivor_7", 7.0))
        seen_by_one, seen_by_other = one.static_frames(), other.static_frames()
        one.until(lambda: seen_by_one.frames, "the first node's frame")
        other.until(lambda: seen_by_other.frames, "the other node's frame")
        assert list(seen_by_one.frames) == ["survivor_1"]
        assert list(seen_by_other.frames) == ["survivor_7"]
