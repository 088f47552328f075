"""Tests of the zones of a mission."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from sar_compiler.runtime.context import is_mission_context, preview_of
from search_and_rescue.zone_manager import ZoneManager

BASE = {"x": 0.5, "y": -0.5, "yaw": 3.14}


def zones(count: int) -> list[dict[str, Any]]:
    return [{"id": f"zone_{index}", "x": float(index), "y": -1.0, "yaw": 0.1} for index in range(count)]


def test_zones_come_in_given_order() -> None:
    manager = ZoneManager(zones(3), BASE)
    seen = []
    while manager.has_remaining():
        seen.append(manager.current_zone())
        manager.select_next_zone()
    assert seen == zones(3)


def test_no_current_zone_after_last_one() -> None:
    manager = ZoneManager(zones(1), BASE)
    manager.select_next_zone()
    with pytest.raises(IndexError, match="all 1 zones have already been visited"):
        manager.current_zone()


def test_an_empty_mission_has_no_zone() -> None:
    manager = ZoneManager([], BASE)
    assert not manager.has_remaining()
    assert manager.total_zones() == 0


def test_survivors_are_numbered_from_one() -> None:
    manager = ZoneManager([], BASE)
    assert [manager.next_survivor_id() for _ in range(3)] == ["survivor_1", "survivor_2", "survivor_3"]


def test_given_zones_and_base_are_copied() -> None:
    given_zones, given_base = zones(1), dict(BASE)
    manager = ZoneManager(given_zones, given_base)
    given_zones[0]["x"] = 99.0
    given_zones.clear()
    given_base["x"] = 99.0
    assert manager.current_zone()["x"] == 0.0
    assert manager.base_pose() == BASE


def test_returned_zones_and_base_are_copies() -> None:
    manager = ZoneManager(zones(2), BASE)
    manager.current_zone()["x"] = 99.0
    manager.base_pose()["x"] = 99.0
    manager.remaining_zones().clear()
    manager.remaining_zones()[0]["x"] = 99.0
    assert manager.remaining_zones() == zones(2)
    assert manager.base_pose() == BASE


def test_zone_manager_has_a_preview() -> None:
    assert is_mission_context(ZoneManager)
    preview = preview_of(ZoneManager)
    assert isinstance(preview, ZoneManager)
    assert preview.has_remaining()


@given(st.integers(0, 6), st.integers(0, 10))
def test_advancing_after_last_zone_changes_nothing(count: int, steps: int) -> None:
    manager = ZoneManager(zones(count), BASE)
    for _ in range(steps):
        manager.select_next_zone()
    assert manager.current_index() == min(count, steps)
    assert manager.remaining_zones() == zones(count)[steps:]


def test_postponed_zone_moves_to_end() -> None:
    manager = ZoneManager(zones(3), BASE)
    manager.select_next_zone()
    manager.postpone()
    assert [zone["id"] for zone in manager.remaining_zones()] == ["zone_2", "zone_1"]
    assert manager.current_index() == 1


def test_postponements_are_counted_per_zone() -> None:
    manager = ZoneManager(zones(2), BASE)
    manager.postpone()
    assert manager.times_postponed() == 0
    manager.postpone()
    assert manager.current_zone()["id"] == "zone_0"
    assert manager.times_postponed() == 1


def test_abandoned_zone_is_neither_remaining_nor_visited() -> None:
    manager = ZoneManager(zones(2), BASE)
    manager.abandon()
    assert manager.current_zone()["id"] == "zone_1"
    assert manager.current_index() == 0
    manager.select_next_zone()
    assert not manager.has_remaining()
    assert (manager.current_index(), manager.total_zones()) == (1, 2)
    assert manager.abandoned_zones() == zones(1)


def test_postponing_and_abandoning_after_last_zone_change_nothing() -> None:
    manager = ZoneManager([], BASE)
    manager.postpone()
    manager.abandon()
    assert manager.abandoned_zones() == []
    with pytest.raises(IndexError, match="no current zone"):
        manager.times_postponed()


class ZoneManagerInAnyOrder(RuleBasedStateMachine):
    """Calls in any order: remaining, abandoned and visited zones match a simple model."""

    def __init__(self) -> None:
        super().__init__()
        self.manager = ZoneManager(zones(4), BASE)
        self.left = zones(4)
        self.visited = 0
        self.abandoned: list[dict[str, Any]] = []
        self.names: list[str] = []

    @rule()
    def advance(self) -> None:
        self.manager.select_next_zone()
        self.visited += bool(self.left)
        self.left = self.left[1:]

    @rule()
    def postpone(self) -> None:
        self.manager.postpone()
        self.left = self.left[1:] + self.left[:1]

    @rule()
    def abandon(self) -> None:
        self.manager.abandon()
        self.abandoned += self.left[:1]
        self.left = self.left[1:]

    @rule()
    def name_a_survivor(self) -> None:
        self.names.append(self.manager.next_survivor_id())

    @rule(key=st.sampled_from(["x", "y", "yaw"]))
    def modify_returned_values(self, key: str) -> None:
        if self.manager.has_remaining():
            handed: dict[str, Any] = {**self.manager.current_zone()}
            handed[key] = 1e9
            self.manager.current_zone().update(handed)  # type: ignore[typeddict-item]
        self.manager.base_pose().clear()  # type: ignore[attr-defined]

    @invariant()
    def current_index_counts_advances(self) -> None:
        assert self.manager.current_index() == self.visited
        assert self.manager.has_remaining() == bool(self.left)
        assert self.manager.total_zones() == 4

    @invariant()
    def zones_match_calls(self) -> None:
        assert self.manager.remaining_zones() == self.left
        assert self.manager.abandoned_zones() == self.abandoned
        assert self.manager.base_pose() == BASE
        if self.manager.has_remaining():
            assert self.manager.current_zone() == self.left[0]

    @invariant()
    def survivor_names_are_unique(self) -> None:
        assert self.names == [f"survivor_{number + 1}" for number in range(len(self.names))]


TestZoneManagerInAnyOrder = ZoneManagerInAnyOrder.TestCase
