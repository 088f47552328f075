"""Tests of random scenarios, played by seed, and of the smallest failing scenario."""

import pickle
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator as StockDecorator

from sar_compiler.analysis.simulate import reused_tree
from sar_compiler.analysis.simulate.scenario_run import failures
from sar_compiler.analysis.sweep_runs import (
    ChangedTreeError,
    ScenarioRuns,
    _cached_runs,
    _stage,
    change_scenario,
    content_of,
    smallest_scenario,
)
from sar_compiler.leaves import Decorator, Kind, Tick, register
from sar_compiler.loaded_tree import load
from sar_compiler.project import CommandLineSettings
from sar_compiler.tree.diagnostic import TreeError
from tests.random_inputs import rounds
from tests.trees import document

TREE = Path("trees/search_and_rescue.xml").resolve()
ALWAYS = "times: always"
DAY = f"""
until: "zones_left == 0 && at == 'base'"
ticks: 150
leaves:
  NavigateToZone: [{{outcome: aborted, after: 2s to 5s, probability: 0.3, {ALWAYS}}}, {{outcome: arrived, after: 4s, {ALWAYS}}}]
  DetectSurvivor: [{{outcome: found, probability: 0.5, {ALWAYS}}}, {{outcome: nothing, {ALWAYS}}}]
  NavigateToBase: [{{outcome: aborted, probability: 0.2, {ALWAYS}}}]
expect:
  root: SUCCESS
  never: [NotifyBase refused]
"""


def runs(scenario=DAY, unusual=0.05, counted=("NotifyBase acknowledged",), tree=TREE):
    return ScenarioRuns(
        tree, content_of(load(tree)), CommandLineSettings(), scenario, "day.yaml", unusual, counted
    )


def failed_expectations(play, seed=0):
    """Return the keys of the expectations that a run does not meet."""
    (outcome,) = play([seed])
    return [each.split(":")[0] for each in outcome.failure.split("; ") if ": " in each]


def test_result_of_seed_does_not_depend_on_earlier_seeds():
    copied = pickle.loads(pickle.dumps(runs()))  # noqa: S301 - it is ours
    assert runs()(range(6)) == [outcome for seed in reversed(range(6)) for outcome in copied([seed])][::-1]


def outcomes_with_new_workers(play, seeds):
    """Return the outcome of each seed if its run is the only one of a worker."""
    outcomes = []
    for seed in seeds:
        _cached_runs.cache_clear()
        outcomes += play([seed])
    return outcomes


def test_tree_with_too_many_choices_is_rebuilt(monkeypatch):
    expected = outcomes_with_new_workers(runs(), range(5))
    monkeypatch.setattr(reused_tree, "_MAX_CHOICES", 1)
    _cached_runs.cache_clear()
    assert runs()(range(5)) == expected


@register("CountsItself", kind=Kind.DECORATOR)
class CountsItself(Decorator):
    """Fails from its third tick on, which it counts in a nested list."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
        self.ticks = [[0]]

    def resume(self, tick: Tick, outcome: Status) -> Behaviour | Status:
        self.ticks[0][0] += 1
        return super().resume(tick, outcome) if self.ticks[0][0] < 3 else Status.FAILURE


@register("CountsByItself", kind=Kind.DECORATOR)
class CountsByItself(StockDecorator):
    """Does the same with its own `update` method, as a stock py_trees decorator."""

    ticks = 0

    def update(self) -> Status:
        self.ticks += 1
        return self.decorated.status if self.ticks < 3 else Status.FAILURE


@pytest.mark.parametrize("cls", [CountsItself, CountsByItself])
def test_internal_state_of_own_node_does_not_outlast_run(tmp_path, cls):
    tree = tmp_path / "tree.xml"
    tree.write_text(document(f"<{cls.__name__}><NavigateToZone/></{cls.__name__}>"), encoding="utf-8")
    added = CommandLineSettings(nodes=(cls,))
    content = content_of(load(tree, nodes=[cls]))
    play = ScenarioRuns(tree, content, added, "expect: {root: SUCCESS}", "day.yaml", 0.1)
    assert not any(outcome.failure for outcome in play([3, 3, 3, 3]))


def test_run_with_error_has_same_message_as_simulate():
    play = runs("facts: {zones_left: 0}\nleaves: {ZonesRemaining: SUCCESS}", 0.1)
    (outcome,) = play([0])
    assert outcome.failure == "run: " + failures(play.play(0).run)[0].message
    assert "'ZonesRemaining?' cannot return 'SUCCESS' here" in outcome.failure


def test_requested_events_are_counted():
    outcomes = runs("facts: {zones_left: 3}\nuntil: zones_left == 0", unusual=0.0)([0])
    assert outcomes[0].counts == {"NotifyBase acknowledged": 3}


def test_unknown_event_is_reported():
    play = runs(counted=("NotifyBase acknowleged",))
    with pytest.raises(TreeError, match="did you mean 'acknowledged'"):
        play.events(play.understood().simulated)


@settings(max_examples=rounds(8))
@given(st.integers(0, 10_000))
def test_smallest_scenario_fails_like_its_run_without_randomness(seed):
    if not failed_expectations(runs(), seed):
        return
    text = smallest_scenario(runs(), seed)
    assert text is not None
    small = runs(text, unusual=0.0)
    assert not small.has_randomness()
    assert failed_expectations(small) == failed_expectations(runs(), seed)


def test_smallest_scenario_contains_only_cause_of_failure():
    said = "until: zones_left == 0\nexpect: {never: [NotifyBase refused]}"
    play = runs(said, unusual=0.3)
    seed = next(seed for seed in range(100) if failed_expectations(play, seed) == ["never"])
    text = smallest_scenario(play, seed)
    assert text is not None
    assert text.endswith("leaves:\n  NotifyBase:\n  - outcome: refused\n")


def test_two_leaves_of_same_path_have_no_scenario(tmp_path):
    tree = tmp_path / "tree.xml"
    tree.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="A"><Selector name="S">'
        '<NavigateToBase name="x"/><NavigateToBase name="x"/></Selector></BehaviorTree></root>',
        encoding="utf-8",
    )
    play = runs("expect: {never: [x aborted], root: FAILURE}", 0.5, (), tree)
    seed = next(seed for seed in range(100) if failed_expectations(play, seed) == ["root", "never"])
    assert smallest_scenario(play, seed) is None


def test_probabilities_and_duration_intervals_are_random():
    assert not runs("ticks: 9", 0.0).has_randomness()
    assert runs("ticks: 9", 0.1).has_randomness()
    assert runs("leaves: {NavigateToZone: {outcome: arrived, after: 1s to 2s}}", 0.0).has_randomness()
    assert runs("leaves: {NavigateToZone: {outcome: aborted, probability: 0.5}}", 0.0).has_randomness()


def test_varied_values_are_inserted_and_trace_is_omitted():
    said = {"facts": {"a": 1, "b": 2}, "expect": {"root": "FAILURE", "trace": "x.txt"}}
    assert change_scenario(said, {"facts": {"b": 3}}) == "facts:\n  a: 1\n  b: 3\nexpect:\n  root: FAILURE\n"


def test_root_must_succeed_without_expectations_and_until():
    assert change_scenario({}, {}) == "expect:\n  root: SUCCESS\n"
    assert change_scenario({}, {"until": "tick == 3"}) == "until: tick == 3\n"


def test_tree_changed_after_start_of_sweep_is_not_played(tmp_path):
    tree = tmp_path / "tree.xml"
    tree.write_text(document("<NavigateToZone/>"), encoding="utf-8")
    play = runs("ticks: 9", 0.1, (), tree)
    assert len(play([1])) == 1
    tree.write_text(document("<NavigateToBase/>"), encoding="utf-8")
    again = runs("ticks: 9", 0.1, (), tree)
    assert len(again([1])) == 1
    _cached_runs.cache_clear()
    _stage.cache_clear()
    with pytest.raises(ChangedTreeError, match="has changed since the Monte Carlo runs started"):
        play([2])
