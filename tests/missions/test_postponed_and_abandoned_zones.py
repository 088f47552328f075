"""Tests of PostponeZone and AbandonZone."""

from typing import TYPE_CHECKING

import pytest
from py_trees.common import Status

from search_and_rescue.actions.zones import AbandonZone, PostponeZone
from search_and_rescue.zone_manager import ZoneManager

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage


def postpone(stage: "Stage", attempts: int) -> PostponeZone:
    return stage.take(PostponeZone("PostponeZone", stage.zones, attempts=attempts))


def abandon(stage: "Stage") -> AbandonZone:
    return stage.take(AbandonZone("AbandonZone", stage.zones))


def order(zones: ZoneManager) -> list[str]:
    return [zone["id"] for zone in zones.remaining_zones()]


def test_less_than_one_attempt_is_rejected() -> None:
    with pytest.raises(ValueError, match="attempts is 0: write 1 or more"):
        PostponeZone("PostponeZone", ZoneManager([], {"x": 0, "y": 0, "yaw": 0}), attempts=0)


@pytest.mark.ros
class TestPostponeZone:
    def test_postponed_zone_moves_to_end(self, stage: "Stage") -> None:
        assert stage.run(postpone(stage, 3)) is Status.SUCCESS
        assert order(stage.zones) == ["zone_b", "zone_a"]
        assert stage.warnings == ["zone_a is postponed after attempt 1 of 3."]

    def test_postponing_fails_after_last_attempt_and_keeps_order(self, stage: "Stage") -> None:
        leaf = postpone(stage, 2)
        assert [stage.run(leaf) for _ in range(3)] == [Status.SUCCESS, Status.SUCCESS, Status.FAILURE]
        assert order(stage.zones) == ["zone_a", "zone_b"]
        assert leaf.feedback_message == "attempt 2 on zone_a was the last one"

    def test_zone_with_one_attempt_is_never_postponed(self, stage: "Stage") -> None:
        assert stage.run(postpone(stage, 1)) is Status.FAILURE

    def test_postponing_without_zone_fails(self, stage: "Stage") -> None:
        stage.zones.select_next_zone()
        stage.zones.select_next_zone()
        assert stage.run(postpone(stage, 3)) is Status.FAILURE
        assert "no zone is left" in stage.warnings[0]

    def test_postponing_does_not_wake_tree(self, stage: "Stage") -> None:
        stage.run(postpone(stage, 3))
        assert stage.wakes == 0


@pytest.mark.ros
class TestAbandonZone:
    def test_abandoned_zone_is_removed_and_recorded_with_attempts(self, stage: "Stage") -> None:
        stage.zones.postpone()
        stage.zones.postpone()
        assert stage.run(abandon(stage)) is Status.SUCCESS
        assert order(stage.zones) == ["zone_b"]
        assert stage.record.shortfalls(stage.zones)[1] == "zone_a was abandoned after attempt 2."
        assert stage.warnings == ["zone_a is abandoned after attempt 2."]

    def test_abandoning_without_zone_succeeds_and_records_nothing(self, stage: "Stage") -> None:
        stage.zones.select_next_zone()
        stage.zones.select_next_zone()
        assert stage.run(abandon(stage)) is Status.SUCCESS
        assert stage.zones.abandoned_zones() == []
        assert stage.warnings == []
