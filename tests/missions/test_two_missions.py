"""Tests of whole missions with py_trees' own tree class, and of two missions in one process."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import py_trees
import pytest
from py_trees.common import Status

from search_and_rescue.actions.navigation import NavigateToBase, NavigateToZone
from search_and_rescue.actions.survivors import (
    BroadcastSurvivorTF,
    DetectSurvivor,
    LogNoDetection,
    NotifyBase,
)
from search_and_rescue.actions.zones import AdvanceZone
from search_and_rescue.conditions import IsSurvivorDetected, ZonesRemaining

if TYPE_CHECKING:
    from tests.missions.mission_stage import ScriptedService, Stage

pytestmark = pytest.mark.ros

Sequence, Selector = py_trees.composites.Sequence, py_trees.composites.Selector


def search_and_rescue(stage: "Stage") -> py_trees.behaviour.Behaviour:
    zones, record = stage.zones, stage.record
    detect = DetectSurvivor("DetectSurvivor", zones, record=record)
    found = Sequence(
        "SurvivorFound",
        memory=True,
        children=[
            IsSurvivorDetected("IsSurvivorDetected?", detect),
            BroadcastSurvivorTF("BroadcastSurvivorTF", detect, zones, record=record),
            NotifyBase("NotifyBase", detect, record=record),
        ],
    )
    patrol = Sequence(
        "Patrol",
        memory=True,
        children=[
            ZonesRemaining("ZonesRemaining?", zones),
            NavigateToZone("NavigateToZone", zones, record=record),
            detect,
            Selector(
                "HandleDetection", memory=False, children=[found, LogNoDetection("LogNoDetection", zones)]
            ),
            AdvanceZone("AdvanceZone", zones),
        ],
    )
    home = py_trees.decorators.OneShot(
        "NavigateToBaseOneShot",
        NavigateToBase("NavigateToBase", zones, record=record),
        py_trees.common.OneShotPolicy.ON_COMPLETION,
    )
    return Selector("MissionOrReturnToBase", memory=False, children=[patrol, home])


class Mission:
    """A stage with all servers, and its tree."""

    def __init__(self, stage: "Stage", survivors: dict[str, tuple[float, float]]) -> None:
        self.stage = stage
        self.nav = stage.nav_server()
        self.nav.script = ["feedback", "succeed"]
        self.detect: ScriptedService = stage.detect_service(survivors)
        self.report: ScriptedService = stage.report_service(acknowledged=True)
        self.tree = py_trees.trees.BehaviourTree(search_and_rescue(stage))
        self.tree.setup(node=stage.node)

    def tick(self) -> None:
        self.tree.tick()

    @property
    def done(self) -> bool:
        return self.tree.root.status is Status.SUCCESS and self.stage.record.home

    @property
    def said(self) -> list[str]:
        return [line for line in self.stage.lines if not line.startswith("Waiting for ")]


NOMINAL = """\
--- Zone 1/2: zone_a (-3.00, 3.00) ---
Navigating to zone_a...
Reached zone_a.
Calling detect_survivor for zone_a...
Survivor detected at zone_a!
Broadcasting TF frame: survivor_1 at (-2.50, 3.20) in map frame.
Reporting survivor_1 to base...
Base acknowledged survivor_1.
--- Zone 2/2: zone_b (3.50, 3.00) ---
Navigating to zone_b...
Reached zone_b.
Calling detect_survivor for zone_b...
No survivor found at zone_b.
All zones visited. Returning to base.
Navigating to base station...
Reached base station.
Mission complete.
"""


def run(*missions: Mission) -> None:
    def done() -> bool:
        for mission in missions:
            mission.tick()
            for other in missions:
                other.stage.spin()
        return all(mission.done for mission in missions)

    missions[0].stage.until(done, "home")


def test_mission_runs_to_its_end_and_logs_each_step(stage: "Stage") -> None:
    mission = Mission(stage, {"zone_a": (-2.5, 3.2)})
    run(mission)
    assert mission.said == NOMINAL.splitlines()
    assert stage.warnings == []
    assert stage.record.shortfalls(stage.zones) == []
    assert stage.record.zones_visited == ("zone_a", "zone_b")
    for _ in range(5):
        mission.tick()
    assert mission.nav.requests == 3, "home is driven to once"


def test_two_missions_in_one_process_do_not_mix(make_stage: Callable[[], "Stage"]) -> None:
    one = Mission(make_stage(), {"zone_a": (-2.5, 3.2)})
    other = Mission(make_stage(), {"zone_b": (4.0, 1.0)})
    other.stage.zones.next_survivor_id()
    run(one, other)
    assert one.nav.requests == other.nav.requests == 3
    assert [request.survivor_id for request in one.report.requests] == ["survivor_1"]
    assert [request.survivor_id for request in other.report.requests] == ["survivor_2"]
    assert "Survivor detected at zone_a!" in one.said
    assert "Survivor detected at zone_a!" not in other.said
    for mission, frame in ((one, "survivor_1"), (other, "survivor_2")):
        listener = mission.stage.static_frames()
        mission.stage.until(lambda: listener.frames, "the frames")  # noqa: B023 - used at once
        assert list(listener.frames) == [frame]
        assert mission.stage.record.shortfalls(mission.stage.zones) == []


def test_refused_report_is_the_only_shortfall(stage: "Stage") -> None:
    mission = Mission(stage, {"zone_a": (-2.5, 3.2)})
    mission.report.answer = lambda _, response: setattr(response, "acknowledged", False)
    run(mission)
    assert stage.record.shortfalls(stage.zones) == [
        "The base station did not acknowledge survivor_1 in zone_a at (-2.50, 3.20)."
    ]


def test_unreachable_zone_is_retried_until_reachable(stage: "Stage") -> None:
    mission = Mission(stage, {})
    mission.nav.script = ["abort"]

    def tried_three_times() -> bool:
        mission.tick()
        return stage.lines.count("Navigating to zone_a...") >= 3

    stage.until(tried_three_times, "three tries")
    mission.nav.script = ["succeed"]
    run(mission)
    assert all("zone_a failed" in line or "base station failed" in line for line in stage.warnings)
