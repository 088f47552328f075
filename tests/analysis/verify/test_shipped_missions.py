"""The shipped missions, held against the shipped properties: what the first one breaks, and the resilient one keeps."""

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


def mission(name, zones):
    forest = load_forest(Path("trees", f"{name}.xml"), read_tree_file)
    simulated = compile_simulated(bind_main(forest, REGISTRY), {}, Assumptions({"zones_left": zones}))
    tags = {spec.tag for spec in REGISTRY if spec.kind.is_leaf}
    return verify(simulated, read_property_file(PROPERTIES), tags, 100_000)


@pytest.fixture(scope="module")
def first():
    return mission("search_and_rescue", 3)


@pytest.fixture(scope="module")
def resilient():
    return mission("search_and_rescue_resilient", 2)


def test_a_report_that_is_refused_leaves_the_zone_and_the_survivor_behind(first):
    found = verdict(first, REPORTED)
    assert found.outcome is BROKEN
    (tick,) = told(found.trace)
    assert tick.endswith("NotifyBase:refused LogNoDetection:logged AdvanceZone:advanced")


def test_a_report_that_is_refused_ends_as_no_survivor(first):
    found = verdict(first, NO_SURVIVOR)
    assert found.outcome is BROKEN
    assert "NotifyBase:refused LogNoDetection:logged" in told(found.trace)[-1]


def test_a_zone_out_of_reach_makes_the_robot_swing_between_zone_and_base_for_ever(first):
    found = verdict(first, NO_LIVELOCK)
    assert (found.outcome, found.trace.loop) == (BROKEN, 2)
    assert told(found.trace)[-2:] == [
        "NavigateToZone:aborted NavigateToBase:driving",
        "ZonesRemaining?:some left NavigateToZone:driving NavigateToBase:halted",
    ]


def test_the_way_home_begins_while_a_zone_remains(first):
    assert told(verdict(first, "home only when no zone remains").trace) == [
        "ZonesRemaining?:some left NavigateToZone:aborted NavigateToBase:driving"
    ]


def test_a_drive_home_too_early_is_the_only_one(first):
    ticks = told(verdict(first, "home at the end").trace)
    assert ticks[0].endswith("NavigateToZone:aborted NavigateToBase:arrived")
    assert ticks[-1].endswith("AdvanceZone:advanced")


def test_what_the_first_mission_keeps_is_proved(first):
    kept = [NO_ERROR, EVERY_LEAF, AN_END, "no report without a detection", "one id per survivor"]
    assert [question for question in kept if outcome(first, question) is not PROVED] == []


def test_the_resilient_mission_keeps_all_of_it_in_every_run(resilient):
    assert [each.question for each in resilient.verdicts if each.outcome is not PROVED] == []
    assert resilient.complete
    assert resilient.left_out == ()


@pytest.mark.parametrize("zones", [0, 1])
def test_few_zones_change_nothing_for_the_resilient_mission(zones):
    verdicts = mission("search_and_rescue_resilient", zones).verdicts
    never_run = [each.question for each in verdicts if each.outcome is not PROVED]
    # Without any zone there is nothing to search, and nothing to report.
    assert never_run == ([EVERY_LEAF] if zones == 0 else [])
