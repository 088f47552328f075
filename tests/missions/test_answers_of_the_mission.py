"""What the mission's leaves say that they can answer is what they do."""

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


def test_zones_are_counted_as_the_real_leaves_count_them():
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
def test_what_the_search_finds_decides_what_follows(found, expected):
    run = simulate(TREE, DetectSurvivor=found).run_to_end()
    run.expect(order=expected)


def test_a_new_search_forgets_what_the_last_one_found():
    run = simulate(TREE, DetectSurvivor=["found", {"outcome": "nothing", "after": "1s"}]).tick(2)
    assert run.facts["found_by_DetectSurvivor"] is False


def test_nobody_reports_what_nobody_found():
    binding = bind_main(forest("<Sequence><DetectSurvivor/><NotifyBase/></Sequence>"), default_registry())
    _, report = compile_simulated(binding, {}).leaves
    assert report.options() == (Outcome("FAILURE", "nothing to report", "!named_by_DetectSurvivor"),)


def test_a_robot_that_drives_is_nowhere_until_it_arrives():
    run = simulate(TREE, NavigateToZone={"outcome": "arrived", "after": "1s"}).tick()
    assert run.facts["at"] == ""
    assert run.tick(2).facts["at"] == "zone"


def test_a_simulated_tree_is_made_of_the_same_classes_as_a_run():
    binding = bind_main(load_forest(Path(TREE), read_tree_file), default_registry())
    flown, simulated_tree = preview_tree(binding).root, compile_simulated(binding, {}).root
    assert [type(node) for node in flown.iterate() if node.children] == [
        type(node) for node in simulated_tree.iterate() if node.children
    ]
    assert [node.name for node in flown.iterate()] == [node.name for node in simulated_tree.iterate()]
    assert simulated_tree.status == Status.INVALID
