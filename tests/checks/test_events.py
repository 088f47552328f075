"""Tests that a simulated run, a live run and the proof report the same events."""

import contextlib
import random

import pytest

from sar_compiler.analysis.simulate.scenario_files import Scenario
from sar_compiler.analysis.simulate.scenario_run import ScenarioPlayer
from sar_compiler.analysis.verify.properties import without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.runtime.events import RETURNED, STARTED, TICKED, Event, append_end
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.walking import pre_order
from tests.analysis.simulate.stage import played
from tests.analysis.verify.stage import simulated_tree, verdict, verified
from tests.analysis.verify.test_same_as_py_trees import trees
from tests.random_inputs import rounds

TICKS = 6


class ByChance:
    """A policy that chooses random outcomes."""

    def __init__(self, seed):
        self._random = random.Random(seed)  # noqa: S311 - the same in every run

    def choose(self, leaf, options):
        return self._random.choice(options)


class ReplayPolicy:
    """A policy that chooses the outcomes of recorded events, in their order."""

    def __init__(self, events):
        self._answers = [event for event in events if event.what == RETURNED]

    def choose(self, leaf, options):
        event = self._answers.pop(0)
        assert event.number == leaf.number
        return next(each for each in options if (each.status, each.label) == (event.status, event.label))


def simulate(binding, policy):
    """Return a simulated run of `TICKS` ticks, or fewer if one raises, and the statuses of its ticks."""
    player = ScenarioPlayer(simulated_tree(binding), Scenario())
    player.run.simulated.policy = policy
    numbers = {each.id: number for number, each in enumerate(pre_order(player.run.simulated.root))}
    with contextlib.suppress(Exception):  # scripts of random trees may raise
        for _ in range(TICKS):
            player.tick()
    return player.run, [
        {numbers[node]: status for node, status in tick.statuses.items()} for tick in player.run.ticks
    ]


def run_live(binding, policy, times):
    """Tick a live tree at the given times, and yield the events of each tick."""
    simulated = simulated_tree(binding)
    simulated.policy = policy
    live = LiveTree(simulated.root, is_strict=True)
    for number, time_sec in enumerate(times, 1):
        simulated.clock.advance(time_sec - simulated.clock.now())
        simulated.events.clear()
        root = ""
        with contextlib.suppress(Exception):  # as in the simulated run
            root = WORDS[live.tick()]
        yield append_end(simulated.events, simulated.root.name, root, number, time_sec)


def prove(binding):
    """Receive the events of each tick of a run, and yield whether the proof has a possible tick with these events."""
    stepper = TreeStepper(
        PreparedTree.prepare(simulated_tree(binding)), without_properties().rules, meets=False
    )
    states = {stepper.steps.start()}
    seen = yield
    while True:
        ticks = [
            (stepper.tick_record().events, step.state) for state in states for step in stepper.ticks(state)
        ]
        states = {state for events, state in ticks if events == seen and state is not None}
        seen = yield bool(states)


def without_times(events):
    """Return events as in a proof, which knows neither the time nor the number of a tick."""
    return tuple(event._replace(tick=0, time_sec=None) for event in events)


@pytest.mark.parametrize("binding", trees(range(300, 300 + rounds(25))))
def test_replayed_events_of_run_give_same_statuses(binding):
    run, statuses = simulate(binding, ByChance(1))
    again, statuses_again = simulate(binding, ReplayPolicy(run.events))
    assert list(again.events) == list(run.events)
    assert statuses_again == statuses


@pytest.mark.parametrize("binding", trees(range(400, 400 + rounds(25))))
def test_simulation_live_run_and_proof_have_same_events(binding):
    run, _ = simulate(binding, ByChance(2))
    live = run_live(binding, ByChance(2), [tick.time_sec for tick in run.ticks])
    assert list(live) == [tick.events for tick in run.ticks]
    proof = prove(binding)
    next(proof)
    assert all(proof.send(without_times(tick.events)) for tick in run.ticks)


def test_event_has_outcome_node_time_and_changed_facts():
    (tick,) = played("until: zones_left == 2", "<Sequence><NavigateToZone/><AdvanceZone/></Sequence>").ticks
    assert tick.events[3] == Event(
        ("Sequence", "AdvanceZone"), 2, RETURNED, "SUCCESS", "advanced", (("zones_left", 2),), 1, 0.0
    )
    assert tick.events[-1] == Event(("Sequence",), 0, TICKED, "SUCCESS", tick=1, time_sec=0.0)


def test_outcome_sees_value_written_by_script_in_same_tick():
    """The changes of an outcome are not computed from the state at the start of the tick."""
    found = verified(
        '<Sequence><Script code="n := 0"/><X/><Script code="n := 2"/><X/><Y/></Sequence>',
        "outcomes: {X: [{status: SUCCESS, then: f = n + 1}]}\nproperties: {none: {never: Y counted}}",
    )
    answers = [event for event in verdict(found, "none").trace.events if event.outcome]
    assert [event.facts for event in answers] == [(("f", 1),), (("f", 3),), (("f", 2),)]
    assert [event.tick for event in answers] == [1, 1, 1]


def test_running_leaf_does_not_start_again():
    run = played("ticks: 2\nleaves: {NavigateToZone: RUNNING}")
    assert [event.action for event in run.events if event.leaf == "NavigateToZone"] == [
        STARTED,
        "driving",
        "driving",
    ]
