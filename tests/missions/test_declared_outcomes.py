"""Tests of the declared outcomes and effects of the mission's leaves: simulated leaves behave like the real ones."""

from pathlib import Path

import pytest
from py_trees.common import Status

from sar_compiler.analysis.simulated_tree import Assumptions, compile_simulated
from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.testing import simulate
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import load_forest
from search_and_rescue.record import MissionRecord
from search_and_rescue.zone_manager import ZoneManager
from tests.trees import forest

PLACE = {"x": 0.0, "y": 0.0, "yaw": 0.0}
TREE = "trees/search_and_rescue.xml"


def test_stub_leaves_count_zones_like_real_leaves():
    body = "<Sequence><ZonesRemaining/><AdvanceZone/></Sequence>"
    binding = bind_main(forest(body), default_registry())
    zones = ZoneManager([{"id": name, **PLACE} for name in ("a", "b")], PLACE)
    real = compile_tree(binding, {ZoneManager: zones, MissionRecord: MissionRecord()}, {}).root
    simulated = compile_simulated(binding, {}, Assumptions(facts={"zones_left": zones.total_zones()}))
    for _ in range(zones.total_zones() + 2):
        real.tick_once()
        simulated.root.tick_once()
        assert simulated.root.status == real.status
        assert simulated.fact_values()["zones_left"] == zones.total_zones() - zones.current_index()


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ("found", ["IsSurvivorDetected? yes", "BroadcastSurvivorTF named", "NotifyBase acknowledged"]),
        ("nothing", ["IsSurvivorDetected? no", "LogNoDetection logged"]),
    ],
)
def test_search_outcome_selects_next_branch(found, expected):
    run = simulate(TREE, DetectSurvivor=found).run_to_end()
    run.expect(order=expected)


def test_new_search_clears_previous_detection():
    run = simulate(TREE, DetectSurvivor=["found", {"outcome": "nothing", "after": "1s"}]).tick(2)
    assert run.facts["found_by_DetectSurvivor"] is False


def test_notify_base_without_detection_can_only_fail():
    binding = bind_main(forest("<Sequence><DetectSurvivor/><NotifyBase/></Sequence>"), default_registry())
    _, report = compile_simulated(binding, {}).leaves
    assert report.options() == (Outcome("FAILURE", "nothing to report", "!named_by_DetectSurvivor"),)


def test_location_fact_is_empty_until_arrival():
    run = simulate(TREE, NavigateToZone={"outcome": "arrived", "after": "1s"}).tick()
    assert run.facts["at"] == ""
    assert run.tick(2).facts["at"] == "zone"


def test_simulated_tree_has_same_composites_and_names_as_real_tree():
    binding = bind_main(load_forest(Path(TREE), read_tree_file), default_registry())
    real_tree, simulated_tree = preview_tree(binding).root, compile_simulated(binding, {}).root
    assert [type(node) for node in real_tree.iterate() if node.children] == [
        type(node) for node in simulated_tree.iterate() if node.children
    ]
    assert [node.name for node in real_tree.iterate()] == [node.name for node in simulated_tree.iterate()]
    assert simulated_tree.status == Status.INVALID
