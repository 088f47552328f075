"""Scenarios by chance, played by seed, and the smallest one that fails."""

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
from tests.chance import rounds
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


def missed(play, seed=0):
    """Return the words of the expectations that a run does not meet."""
    (outcome,) = play([seed])
    return [each.split(":")[0] for each in outcome.failure.split("; ") if ": " in each]


def test_what_comes_of_a_seed_does_not_depend_on_the_seeds_before_it():
    copied = pickle.loads(pickle.dumps(runs()))  # noqa: S301 - it is ours
    assert runs()(range(6)) == [outcome for seed in reversed(range(6)) for outcome in copied([seed])][::-1]


def outcomes_alone(play, seeds):
    """Return what comes of each seed where its run is the only one of a worker."""
    outcomes = []
    for seed in seeds:
        _cached_runs.cache_clear()
        outcomes += play([seed])
    return outcomes


def test_a_tree_that_remembers_too_much_is_made_anew(monkeypatch):
    expected = outcomes_alone(runs(), range(5))
    monkeypatch.setattr(reused_tree, "_MAX_CHOICES", 1)
    _cached_runs.cache_clear()
    assert runs()(range(5)) == expected


@register("CountsItself", kind=Kind.DECORATOR)
class CountsItself(Decorator):
    """Fails from its third tick on, which it counts where nobody sees it."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
        self.ticks = [[0]]

    def resume(self, tick: Tick, outcome: Status) -> Behaviour | Status:
        self.ticks[0][0] += 1
        return super().resume(tick, outcome) if self.ticks[0][0] < 3 else Status.FAILURE


@register("CountsByItself", kind=Kind.DECORATOR)
class CountsByItself(StockDecorator):
    """Does the same, ticked by methods of its own."""

    ticks = 0

    def update(self) -> Status:
        self.ticks += 1
        return self.decorated.status if self.ticks < 3 else Status.FAILURE


@pytest.mark.parametrize("cls", [CountsItself, CountsByItself])
def test_what_a_node_of_the_users_keeps_to_itself_is_gone_with_its_run(tmp_path, cls):
    tree = tmp_path / "tree.xml"
    tree.write_text(document(f"<{cls.__name__}><NavigateToZone/></{cls.__name__}>"), encoding="utf-8")
    added = CommandLineSettings(nodes=(cls,))
    content = content_of(load(tree, nodes=[cls]))
    play = ScenarioRuns(tree, content, added, "expect: {root: SUCCESS}", "day.yaml", 0.1)
    assert not any(outcome.failure for outcome in play([3, 3, 3, 3]))


def test_a_run_that_cannot_be_finished_says_why_as_simulate_does():
    play = runs("facts: {zones_left: 0}\nleaves: {ZonesRemaining: SUCCESS}", 0.1)
    (outcome,) = play([0])
    assert outcome.failure == "run: " + failures(play.play(0).run)[0].message
    assert "'ZonesRemaining?' cannot return 'SUCCESS' here" in outcome.failure


def test_the_events_asked_for_are_counted():
    outcomes = runs("facts: {zones_left: 3}\nuntil: zones_left == 0", unusual=0.0)([0])
    assert outcomes[0].counts == {"NotifyBase acknowledged": 3}


def test_an_event_that_never_happens_is_a_finding():
    play = runs(counted=("NotifyBase acknowleged",))
    with pytest.raises(TreeError, match="did you mean 'acknowledged'"):
        play.events(play.understood().simulated)


@settings(max_examples=rounds(8))
@given(st.integers(0, 10_000))
def test_the_smallest_scenario_fails_as_its_run_has_and_leaves_nothing_to_chance(seed):
    if not missed(runs(), seed):
        return
    text = smallest_scenario(runs(), seed)
    assert text is not None
    small = runs(text, unusual=0.0)
    assert not small.has_randomness()
    assert missed(small) == missed(runs(), seed)


def test_the_smallest_scenario_has_only_what_makes_it_fail():
    said = "until: zones_left == 0\nexpect: {never: [NotifyBase refused]}"
    play = runs(said, unusual=0.3)
    seed = next(seed for seed in range(100) if missed(play, seed) == ["never"])
    text = smallest_scenario(play, seed)
    assert text is not None
    assert text.endswith("leaves:\n  NotifyBase:\n  - outcome: refused\n")


def test_two_leaves_of_one_path_have_no_scenario(tmp_path):
    tree = tmp_path / "tree.xml"
    tree.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="A"><Selector name="S">'
        '<NavigateToBase name="x"/><NavigateToBase name="x"/></Selector></BehaviorTree></root>',
        encoding="utf-8",
    )
    play = runs("expect: {never: [x aborted], root: FAILURE}", 0.5, (), tree)
    seed = next(seed for seed in range(100) if missed(play, seed) == ["root", "never"])
    assert smallest_scenario(play, seed) is None


def test_chances_and_durations_between_two_are_what_chance_decides():
    assert not runs("ticks: 9", 0.0).has_randomness()
    assert runs("ticks: 9", 0.1).has_randomness()
    assert runs("leaves: {NavigateToZone: {outcome: arrived, after: 1s to 2s}}", 0.0).has_randomness()
    assert runs("leaves: {NavigateToZone: {outcome: aborted, probability: 0.5}}", 0.0).has_randomness()


def test_what_is_varied_is_put_into_the_scenario_and_a_trace_is_left_out():
    said = {"facts": {"a": 1, "b": 2}, "expect": {"root": "FAILURE", "trace": "x.txt"}}
    assert change_scenario(said, {"facts": {"b": 3}}) == "facts:\n  a: 1\n  b: 3\nexpect:\n  root: FAILURE\n"


def test_without_expectations_and_an_end_of_its_own_the_root_must_succeed():
    assert change_scenario({}, {}) == "expect:\n  root: SUCCESS\n"
    assert change_scenario({}, {"until": "tick == 3"}) == "until: tick == 3\n"


def test_a_tree_that_has_changed_since_the_sweep_began_is_not_played(tmp_path):
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
