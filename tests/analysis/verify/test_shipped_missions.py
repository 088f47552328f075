"""Tests of the shipped missions: the first one violates shipped properties, the resilient one none."""

from pathlib import Path

import pytest

from sar_compiler.analysis.simulated_tree import Assumptions, compile_simulated
from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.properties import read_property_file
from sar_compiler.analysis.verify.verdicts import AN_END, EVERY_LEAF, NO_ERROR, NO_LIVELOCK
from sar_compiler.compiler import bind_main
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import load_forest
from tests.analysis.verify.stage import BROKEN, PROVED, outcome, told, verdict

pytestmark = pytest.mark.unmeasured

PROPERTIES = Path("config/mission_properties.yaml")
REPORTED = "a survivor found is reported or kept before the zone is left"
NO_SURVIVOR = "'no survivor' is logged only if the search found nobody"
REGISTRY = default_registry()


def verify_mission(name, zones):
    forest = load_forest(Path("trees", f"{name}.xml"), read_tree_file)
    simulated = compile_simulated(bind_main(forest, REGISTRY), {}, Assumptions({"zones_left": zones}))
    tags = {spec.tag for spec in REGISTRY if spec.kind.is_leaf}
    return verify(simulated, read_property_file(PROPERTIES), tags, 100_000)


@pytest.fixture(scope="module")
def first_mission():
    return verify_mission("search_and_rescue", 3)


@pytest.fixture(scope="module")
def resilient_mission():
    return verify_mission("search_and_rescue_resilient", 2)


def test_refused_report_abandons_zone_and_survivor(first_mission):
    found = verdict(first_mission, REPORTED)
    assert found.outcome is BROKEN
    (tick,) = told(found.trace)
    assert tick.endswith("NotifyBase:refused LogNoDetection:logged AdvanceZone:advanced")


def test_refused_report_is_logged_as_no_survivor(first_mission):
    found = verdict(first_mission, NO_SURVIVOR)
    assert found.outcome is BROKEN
    assert "NotifyBase:refused LogNoDetection:logged" in told(found.trace)[-1]


def test_unreachable_zone_makes_robot_alternate_between_zone_and_base_forever(first_mission):
    found = verdict(first_mission, NO_LIVELOCK)
    assert (found.outcome, found.trace.loop) == (BROKEN, 2)
    assert told(found.trace)[-2:] == [
        "NavigateToZone:aborted NavigateToBase:driving",
        "ZonesRemaining?:some left NavigateToZone:driving NavigateToBase:halted",
    ]


def test_robot_starts_home_while_zone_remains(first_mission):
    assert told(verdict(first_mission, "home only when no zone remains").trace) == [
        "ZonesRemaining?:some left NavigateToZone:aborted NavigateToBase:driving"
    ]


def test_robot_drives_home_only_too_early(first_mission):
    ticks = told(verdict(first_mission, "home at the end").trace)
    assert ticks[0].endswith("NavigateToZone:aborted NavigateToBase:arrived")
    assert ticks[-1].endswith("AdvanceZone:advanced")


def test_properties_kept_by_first_mission_are_proved(first_mission):
    kept = [NO_ERROR, EVERY_LEAF, AN_END, "no report without a detection", "one id per survivor"]
    assert [question for question in kept if outcome(first_mission, question) is not PROVED] == []


def test_resilient_mission_keeps_all_properties(resilient_mission):
    assert [each.question for each in resilient_mission.verdicts if each.outcome is not PROVED] == []
    assert resilient_mission.complete
    assert resilient_mission.left_out == ()


@pytest.mark.parametrize("zones", [0, 1])
def test_few_zones_change_nothing_for_resilient_mission(zones):
    verdicts = verify_mission("search_and_rescue_resilient", zones).verdicts
    never_run = [each.question for each in verdicts if each.outcome is not PROVED]
    # Without a zone, the search and report leaves cannot run.
    assert never_run == ([EVERY_LEAF] if zones == 0 else [])
