"""Tests of the zone facts of leaves: simulated leaves count zones as the real ones do."""

from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour

from sar_compiler.analysis.simulated_tree import Assumptions, SimulatedTree, compile_simulated
from sar_compiler.compiler import bind_main
from sar_compiler.nodes.registry import default_registry
from search_and_rescue.actions.zones import AbandonZone, AdvanceZone, PostponeZone
from search_and_rescue.record import MissionRecord
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager
from tests.random_inputs import rounds
from tests.trees import forest

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

BASE = {"x": 0.0, "y": 0.0, "yaw": 0.0}
STEPS = ("AdvanceZone", "PostponeZone", "AbandonZone")


def simulate_steps(zones: int, attempts: int) -> SimulatedTree:
    written = {"PostponeZone": f' attempts="{attempts}"'}
    steps = "".join(f"<{step}{written.get(step, '')}/>" for step in STEPS)
    binding = bind_main(forest(f"<Sequence>{steps}</Sequence>"), default_registry())
    return compile_simulated(binding, {}, Assumptions(facts={"zones_left": zones}))


def real_leaves(
    stage: "Stage", zones: ZoneManager, record: MissionRecord, attempts: int
) -> dict[str, Behaviour]:
    leaves = [
        AdvanceZone("AdvanceZone", zones),
        PostponeZone("PostponeZone", zones, attempts=attempts),
        AbandonZone("AbandonZone", zones),
    ]
    return {leaf.name: stage.take(leaf) for leaf in leaves}


@pytest.mark.ros
@settings(max_examples=rounds(20), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    count=st.integers(1, 4), attempts=st.integers(1, 4), steps=st.lists(st.sampled_from(STEPS), max_size=25)
)
def test_simulated_leaves_count_zones_like_real_leaves(
    stage: "Stage", count: int, attempts: int, steps: list[str]
) -> None:
    plan = [{"id": f"zone_{index}", "x": 0.0, "y": 0.0, "yaw": 0.0} for index in range(count)]
    search = Search(ZoneManager(plan, BASE))
    zones, record = search.zones, search.record
    real, simulated_tree = real_leaves(stage, zones, record, attempts), simulate_steps(count, attempts)
    stand_ins = {leaf.name: leaf for leaf in simulated_tree.leaves}
    for step in steps:
        real[step].tick_once()
        stand_ins[step].tick_once()
        assert real[step].status is stand_ins[step].status, step
        facts = simulated_tree.fact_values()
        assert facts["zones_left"] == len(zones.remaining_zones())
        assert facts["zones_abandoned"] == len(zones.abandoned_zones())
