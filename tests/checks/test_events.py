"""The event is the same, whoever tells of it: a simulated run, a tree that is ticked live, the proof."""

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
from tests.chance import rounds

TICKS = 6


class ByChance:
    """Answers by chance."""

    def __init__(self, seed):
        self._random = random.Random(seed)  # noqa: S311 - the same in every run

    def choose(self, leaf, options):
        return self._random.choice(options)


class Again:
    """Answers what events say, in their order."""

    def __init__(self, events):
        self._answers = [event for event in events if event.what == RETURNED]

    def choose(self, leaf, options):
        event = self._answers.pop(0)
        assert event.number == leaf.number
        return next(each for each in options if (each.status, each.label) == (event.status, event.label))


def simulate(binding, policy):
    """Return a simulated run of some ticks, fewer if one raises, with the statuses of its ticks."""
    player = ScenarioPlayer(simulated_tree(binding), Scenario())
    player.run.simulated.policy = policy
    numbers = {each.id: number for number, each in enumerate(pre_order(player.run.simulated.root))}
    with contextlib.suppress(Exception):  # scripts of random trees go wrong
        for _ in range(TICKS):
            player.tick()
    return player.run, [
        {numbers[node]: status for node, status in tick.statuses.items()} for tick in player.run.ticks
    ]


def fly(binding, policy, times):
    """Yield the events of a tree that is ticked live at some times, tick by tick."""
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
    """Yield what the proof knows of the ticks that a flight may be in; it is sent the events of the flight's tick."""
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


def timeless(events):
    """Return events as a proof has them, which knows neither when a tick is nor which one."""
    return tuple(event._replace(tick=0, time_sec=None) for event in events)


@pytest.mark.parametrize("binding", trees(range(300, 300 + rounds(25))))
def test_the_events_of_a_run_lead_to_its_statuses_again(binding):
    run, statuses = simulate(binding, ByChance(1))
    again, statuses_again = simulate(binding, Again(run.events))
    assert list(again.events) == list(run.events)
    assert statuses_again == statuses


@pytest.mark.parametrize("binding", trees(range(400, 400 + rounds(25))))
def test_a_simulated_run_a_live_one_and_the_proof_tell_of_the_same_answers_by_the_same_events(binding):
    run, _ = simulate(binding, ByChance(2))
    flight = fly(binding, ByChance(2), [tick.time_sec for tick in run.ticks])
    assert list(flight) == [tick.events for tick in run.ticks]
    proof = prove(binding)
    next(proof)
    assert all(proof.send(timeless(tick.events)) for tick in run.ticks)


def test_an_event_says_which_answer_it_was_where_when_and_what_it_has_changed():
    (tick,) = played("until: zones_left == 2", "<Sequence><NavigateToZone/><AdvanceZone/></Sequence>").ticks
    assert tick.events[3] == Event(
        ("Sequence", "AdvanceZone"), 2, RETURNED, "SUCCESS", "advanced", (("zones_left", 2),), 1, 0.0
    )
    assert tick.events[-1] == Event(("Sequence",), 0, TICKED, "SUCCESS", tick=1, time_sec=0.0)


def test_what_a_script_between_two_answers_writes_is_seen_by_the_second():
    """Else what an answer changes would be concluded from the state in which the tick began."""
    found = verified(
        '<Sequence><Script code="n := 0"/><X/><Script code="n := 2"/><X/><Y/></Sequence>',
        "outcomes: {X: [{status: SUCCESS, then: f = n + 1}]}\nproperties: {none: {never: Y counted}}",
    )
    answers = [event for event in verdict(found, "none").trace.events if event.outcome]
    assert [event.facts for event in answers] == [(("f", 1),), (("f", 3),), (("f", 2),)]
    assert [event.tick for event in answers] == [1, 1, 1]


def test_a_leaf_that_goes_on_does_not_start_again():
    run = played("ticks: 2\nleaves: {NavigateToZone: RUNNING}")
    assert [event.action for event in run.events if event.leaf == "NavigateToZone"] == [
        STARTED,
        "driving",
        "driving",
    ]
