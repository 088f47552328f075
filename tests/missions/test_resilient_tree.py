"""Tests of the resilient tree, simulated without a robot."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from py_trees.common import Status

from sar_compiler.analysis.simulated_tree import SimulatedTree, compile_simulated
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.compiler import bind_main
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.outcomes import Outcome, nominal
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import load_forest

TREE = Path("trees/search_and_rescue_resilient.xml")


class Always:
    """Chooses a fixed outcome for leaves, by name or tag, whenever it is possible, and the nominal one otherwise."""

    def __init__(self, **answers: str) -> None:
        self._answers = answers

    def choose(self, leaf: StubLeaf, options: Sequence[Outcome]) -> Outcome:
        said = self._answers.get(leaf.name, self._answers.get(leaf.tag))
        wanted = [answer for answer in options if answer.name == said]
        return wanted[0] if wanted else nominal(options)


def tick(simulated: SimulatedTree) -> Status:
    simulated.clock.advance(30.0)
    simulated.root.tick_once()
    return simulated.root.status


def run_mission(**answers: str) -> SimulatedTree:
    simulated = compile_simulated(bind_main(load_forest(TREE, read_tree_file), default_registry()), {})
    simulated.policy = Always(**answers)
    for _ in range(200):
        if tick(simulated) is not Status.RUNNING:
            return simulated
    message = f"the mission did not end within 200 ticks; facts: {simulated.fact_values()}"
    raise AssertionError(message)


def event_lines(simulated: SimulatedTree) -> list[str]:
    return [f"{event.leaf} {event.outcome}" for event in simulated.events if event.outcome]


# The outcomes that leaves have whenever possible, and the final status of the mission.
CASES = {
    "nothing fails": ({}, Status.SUCCESS),
    "every zone is unreachable": ({"NavigateToZone": "aborted"}, Status.FAILURE),
    "no detection service responds": ({"DetectSurvivor": "no answer"}, Status.FAILURE),
    "every report is refused": ({"NotifyBase": "refused", "DeliverReports": "refused"}, Status.FAILURE),
    "reports are delivered later": ({"NotifyBase": "refused"}, Status.SUCCESS),
    "home is unreachable": ({"NavigateToBase": "aborted"}, Status.FAILURE),
    "Nav2 is unavailable": (
        {"NavigateToZone": "unavailable", "NavigateToBase": "unavailable"},
        Status.FAILURE,
    ),
    "every drive waits forever": (
        {"NavigateToZone": "waiting for Nav2", "NavigateToBase": "waiting for Nav2"},
        Status.FAILURE,
    ),
    "every drive takes forever": (
        {"NavigateToZone": "driving", "NavigateToBase": "driving"},
        Status.FAILURE,
    ),
}


@pytest.mark.parametrize(("answers", "end"), CASES.values(), ids=CASES)
def test_mission_ends_and_succeeds_only_if_nothing_is_missing(answers: dict[str, str], end: Status) -> None:
    assert run_mission(**answers).root.status is end


@pytest.mark.parametrize(("answers", "end"), CASES.values(), ids=CASES)
def test_finished_mission_stays_finished(answers: dict[str, str], end: Status) -> None:
    simulated = run_mission(**answers)
    simulated.events.clear()
    assert [tick(simulated) for _ in range(3)] == [end] * 3
    assert simulated.events == []


def test_unreachable_zone_is_tried_twice_in_each_of_three_rounds() -> None:
    said = event_lines(run_mission(NavigateToZone="aborted"))
    assert said.count("NavigateToZone aborted") == 3 * 3 * 2
    assert said.count("PostponeZone postponed") == 3 * 2
    assert said.count("AbandonZone abandoned") == 3
    assert said.count("NavigateToBase arrived") == 1


@pytest.mark.parametrize("answer", ["unavailable", "waiting for Nav2"])
def test_zone_is_neither_postponed_nor_abandoned_while_nav2_is_away(answer: str) -> None:
    said = event_lines(run_mission(NavigateToZone=answer))
    assert not {"PostponeZone postponed", "AbandonZone abandoned"} & set(said)
    assert said.count("AbandonZonesUnavailable abandoned") == 1
    assert said.count("NavigateToBase arrived") == 1


def test_survivor_is_named_once_even_if_report_is_refused() -> None:
    said = event_lines(run_mission(NotifyBase="refused", DeliverReports="refused"))
    assert said.count("BroadcastSurvivorTF named") == said.count("AdvanceZone advanced") == 3
    assert "LogNoDetection logged" not in said


def test_reports_are_delivered_even_if_return_fails() -> None:
    said = event_lines(run_mission(NotifyBase="refused", DeliverOnTheWay="refused", NavigateToBase="aborted"))
    assert said.index("NavigateToBase aborted") < said.index("DeliverReports delivered")
