"""Tests of the run-time monitor: it raises alarms exactly where the proof finds a property violated."""

import random
from contextlib import suppress

import pytest
from py_trees.common import Status

from sar_compiler import load
from sar_compiler.analysis.runtime_monitor import AlarmCause, RuntimeMonitor
from sar_compiler.analysis.tree_analysis import stage_of, watch_tree
from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.execution.leaf_listener import listen_to_leaf
from sar_compiler.runtime.events import RETURNED
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.random_branches import random_branches, random_properties
from tests.analysis.verify.random_trees import random_tree
from tests.analysis.verify.stage import BROKEN, TAGS, bound, simulated_tree
from tests.random_inputs import rounds

PROPERTIES = """
  p1: {never: X SUCCESS}
  p2: {before: Y SUCCESS, comes: X SUCCESS, since: X starts}
  p3: {after: X FAILURE, eventually: Y SUCCESS}
  p4: {at_most_once: Z SUCCESS, per: X starts}
  p5: {never: Z starts, while: n == 1}
  p6: {after: X starts, eventually: Y starts, before: X halted}
  p7: {at_end: root == 'SUCCESS'}
  p8: {never: Y halted}"""


class Scripted:
    """Returns the outcomes of a given run."""

    def __init__(self, run):
        answered = (each for tick in run.ticks for each in tick.events if each.what == RETURNED)
        self._answers = iter([(each.status, each.label) for each in answered])

    def choose(self, leaf, options):
        status, label = next(self._answers)
        return next(each for each in options if (each.status, each.label) == (status, label))


class LeafListener:
    """Reports the outcomes of stub leaves to a monitor, with their labels."""

    def __init__(self, watch, leaves):
        self._watch, self._leaves = watch, leaves
        self.on_before_event, self.on_start, self.on_halt = (
            watch.on_before_event,
            watch.on_start,
            watch.on_halt,
        )

    def on_status(self, number, status):
        self._watch.on_status(number, status, self._leaves[number].outcome_label)


def watch_robot(watch, robot):
    leaves = {leaf.number: leaf for leaf in robot.leaves}
    for number, leaf in leaves.items():
        listen_to_leaf(leaf, number, LeafListener(watch, leaves))


class Case:
    """A tree with properties."""

    def __init__(self, body, properties):
        self.binding = bound(body)
        self.text = properties

    @property
    def file(self):
        return parse_property_file(self.text, "props.yaml")

    def simulated(self):
        return simulated_tree(self.binding, self.file)

    def verified(self):
        return verify(self.simulated(), self.file, TAGS, 3000, plainly=10**9)

    def watch(self):
        return RuntimeMonitor(self.simulated(), self.file, TAGS)

    def replayed(self, run):
        """Return the monitor of a tree whose leaves returned the outcomes of a run."""
        robot = self.simulated()
        watch = RuntimeMonitor(self.simulated(), self.file, TAGS, robot.compiled)
        watch_robot(watch, robot)
        policy = Scripted(run)
        for leaf in robot.leaves:
            leaf.policy = policy
        tree = LiveTree(robot.root)
        for _ in run.ticks:
            watch.end_tick(WORDS[tree.tick()])
        return watch


def broken_runs(case):
    """Return the properties that do not hold, each with a finite run that violates it."""
    found = case.verified()
    names = case.watch().properties.names
    return {
        each.question: each.trace
        for each in found.verdicts
        if each.question in names and each.outcome is BROKEN and each.trace and not each.trace.loop
    }


KEY_PROPERTY = "p5"
"""A property whose condition reads a key, which events alone do not contain."""


def cases(count):
    """Yield random trees without timers, each with a name for messages."""
    for seed in range(rounds(count)):
        branches = random_branches(seed)
        bodies = {"": (random_tree(seed), f"properties:{PROPERTIES}")}
        if "Timeout" not in branches and "Delay" not in branches:
            bodies[" of branches"] = branches, random_properties(branches, seed)
        for kind, (body, properties) in bodies.items():
            with suppress(TreeError):  # a node could be skipped, which py_trees would treat as a halt
                yield f"seed {seed}{kind}", Case(body, properties)


@pytest.fixture(scope="module")
def violating_runs():
    """Return random trees without timers, and runs that violate their properties."""
    return [
        (f"{which}: {name}", case, name, run)
        for which, case in cases(30)
        for name, run in broken_runs(case).items()
    ]


@pytest.mark.unmeasured
def test_replayed_counterexample_raises_alarm_in_violating_tick(
    violating_runs,
):
    for which, case, name, run in violating_runs:
        alarms = {each.about: each.tick for each in case.replayed(run).alarms}
        assert alarms.get(name) == len(run.ticks), which
    assert len(violating_runs) > 60


@pytest.mark.unmeasured
def test_recorded_events_raise_same_alarms_as_ticked_tree(violating_runs):
    count = 0
    for which, case, _, run in violating_runs:
        watch, replayed = case.watch(), case.replayed(run)
        for event in run.events:
            watch.process_event(event)
        told = [
            [
                each
                for each in one.alarms
                if each.about != KEY_PROPERTY and each.cause is not AlarmCause.UNJUDGED
            ]
            for one in (watch, replayed)
        ]
        assert told[0] == told[1], which
        count += len(told[0])
    assert count > 60


class ByChance:
    """Returns any possible outcome; RUNNING is less likely."""

    def __init__(self, seed):
        self._chance = random.Random(seed)  # noqa: S311 - the same in every run

    def choose(self, _leaf, options):
        weights = [0.3 if each.status == "RUNNING" else 1.0 for each in options]
        return self._chance.choices(options, weights)[0]


@pytest.mark.costly
def test_random_runs_of_proved_tree_raise_no_alarm():
    tree, ended = load("search_and_rescue_resilient"), 0
    for seed in range(rounds(100)):
        robot = stage_of(tree).play().simulated
        watch = watch_tree(tree, robot.compiled)
        watch_robot(watch, robot)
        for leaf in robot.leaves:
            leaf.policy = ByChance(seed + leaf.number)
        ticked = LiveTree(robot.root)
        for _ in range(60):
            watch.end_tick(WORDS[ticked.tick()])
        watch.conclude(is_over=robot.fact_values()["zones_left"] == 0 and robot.root.status is Status.SUCCESS)
        assert watch.alarms == [], f"seed {seed}"
        ended += robot.fact_values()["zones_left"] == 0
    assert ended > 0


def alarms_after(watch, *events):
    """Report outcomes to a monitor, as (leaf number, status, label); return its alarms as sentences."""
    for number, status, *label in events:
        watch.on_before_event(number)
        watch.on_status(number, status, *label)
    return [each.sentence for each in watch.alarms]


def monitor_of(body, properties):
    return Case(body, properties).watch()


def test_outcome_excluded_by_facts_violates_assumption_once():
    properties = (
        "facts: {left: 1}\noutcomes: {A: [{status: SUCCESS, when: left > 0, then: left -= 1}, FAILURE]}"
    )
    watch = monitor_of("<Sequence><A/><B/></Sequence>", properties)
    assert alarms_after(watch, (1, "SUCCESS")) == []
    told = "Assumption failed: 'A' returns 'SUCCESS' only when left > 0 (left is 0)"
    assert alarms_after(watch, (1, "SUCCESS"), (1, "FAILURE"), (1, "SUCCESS")) == [told]


def test_undeclared_outcome_violates_assumption():
    watch = monitor_of("<A/>", "outcomes: {A: [{status: SUCCESS, label: yes}, {status: SUCCESS, label: no}]}")
    assert alarms_after(watch, (0, "SUCCESS", "yes")) == []
    assert alarms_after(watch, (0, "FAILURE"), (0, "SUCCESS", "perhaps"), (0, "SUCCESS")) == [
        "Assumption failed: 'A' returns only yes, no, but returned FAILURE",
        "Assumption failed: 'A' returns only yes, no, but returned perhaps",
        "Assumption failed: 'A' reports the label of each returned outcome (yes, no)",
    ]


def test_pending_property_is_violated_at_end_and_open_if_run_is_stopped():
    properties = "properties: {p: {after: A SUCCESS, eventually: B SUCCESS}}\nend: root == 'SUCCESS' && idle"
    for is_over, alarms in ((True, ["Property violated: p (pending at the end)"]), (False, [])):
        watch = monitor_of("<Sequence><A/><B/></Sequence>", properties)
        assert alarms_after(watch, (1, "SUCCESS")) == []
        watch.end_tick("SUCCESS")
        assert (watch.pending_properties, watch.alarms) == (["p"], [])
        watch.conclude(is_over=is_over)
        assert [each.sentence for each in watch.alarms] == alarms


def test_condition_with_unwritten_key_is_reported_once_and_is_false():
    watch = monitor_of(
        "<Sequence><A/><Script code='n := 1'/></Sequence>",
        "properties: {p: {never: A SUCCESS, while: n == 1}}",
    )
    (told,) = alarms_after(watch, (1, "SUCCESS"), (1, "SUCCESS"))
    assert told.startswith("Not monitored: p: 'n == 1' cannot be evaluated")
    assert watch.broken == set()


def test_alarm_omits_repeated_outcomes_of_earlier_ticks():
    watch = monitor_of("<Sequence><A/><B/></Sequence>", "properties: {p: {never: B SUCCESS}}")
    for _ in range(3):
        alarms_after(watch, (1, "RUNNING"))
        watch.end_tick("RUNNING")
    alarms_after(watch, (1, "SUCCESS"), (2, "SUCCESS"))
    (alarm,) = watch.alarms
    assert [(each.tick, each.number, each.action) for each in alarm.run] == [
        (1, 1, "RUNNING"),
        (4, 1, "SUCCESS"),
        (4, 2, "SUCCESS"),
    ]
    assert (alarm.event, alarm.tick, alarm.number) == ("B SUCCESS", 4, 2)


def test_first_outcome_can_violate_assumption():
    case = Case('<Y name="y"/>', "properties: {p: {never: y FAILURE}}")
    watch = case.watch()
    watch.on_start(0)
    watch.on_status(0, "SUCCESS", "counted")
    (alarm,) = watch.alarms
    assert (alarm.cause, alarm.event) == (AlarmCause.ASSUMPTION, "y counted")
    assert alarm.about == "'y' returns 'counted' only when f > 0 (f is 0)"
    assert [each.action for each in alarm.run] == ["counted"]


def test_condition_with_unchanged_outcome_consumes_limit_once():
    held = "outcomes: {P: [SUCCESS, {status: FAILURE, label: held, when: left > 0, then: left -= 1}]}\nfacts: {left: 1}"
    case = Case("<Sequence><P/><B/></Sequence>", held)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    for _ in range(5):
        assert alarms_after(watch, (1, "FAILURE", "held")) == []
        watch.end_tick("FAILURE")
    alarms_after(watch, (1, "SUCCESS"))
    watch.end_tick("RUNNING")
    assert alarms_after(watch, (1, "FAILURE", "held")) == [
        "Assumption failed: 'P' returns 'held' only when left > 0 (left is 0)"
    ]


def test_condition_repeated_within_tick_consumes_limit_once():
    held = "outcomes: {P: [SUCCESS, {status: FAILURE, label: held, when: left > 0, then: left -= 1}]}\nfacts: {left: 1}"
    case = Case("<Sequence><P/><B/></Sequence>", held)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    for answers in (1, 2):
        for _ in range(answers):
            assert alarms_after(watch, (1, "FAILURE", "held")) == []
        watch.end_tick("FAILURE")


def test_script_that_counts_once_consumes_limit_of_unchanged_condition():
    lost = "{status: FAILURE, label: lost, when: away || left > 0, then: 'left -= away ? 0 : 1; away = true'}"
    answers = (
        f"outcomes: {{P: [{{status: SUCCESS, then: away = false}}, {lost}]}}\nfacts: {{left: 1, away: false}}"
    )
    case = Case("<Sequence><P/><B/></Sequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    for _ in range(3):
        assert alarms_after(watch, (1, "FAILURE", "lost")) == []
        watch.end_tick("FAILURE")
    alarms_after(watch, (1, "SUCCESS"))
    watch.end_tick("RUNNING")
    (told,) = alarms_after(watch, (1, "FAILURE", "lost"))
    assert told.endswith("(away is 0, left is 0)")


def test_condition_consumes_limit_again_after_tick_without_it():
    answers = "outcomes: {P: [SUCCESS, {status: FAILURE, label: held, when: left > 0, then: left -= 1}]}\nfacts: {left: 1}"
    case = Case("<Sequence><P/><B/></Sequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    assert alarms_after(watch, (1, "FAILURE", "held")) == []
    watch.end_tick("FAILURE")
    watch.end_tick("FAILURE")
    assert alarms_after(watch, (1, "FAILURE", "held")) == [
        "Assumption failed: 'P' returns 'held' only when left > 0 (left is 0)"
    ]


def test_unchanged_outcome_is_judged_as_at_its_last_start():
    held = "{status: FAILURE, label: held, when: left == turn, then: left -= 1}"
    answers = f"outcomes: {{P: [{{status: SUCCESS, then: turn -= 1}}, {held}]}}\nfacts: {{left: 2, turn: 2}}"
    case = Case("<Sequence><P/><B/></Sequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    for answer in ((1, "FAILURE", "held"), (1, "SUCCESS"), (1, "FAILURE", "held"), (1, "FAILURE", "held")):
        assert alarms_after(watch, answer) == []
        watch.end_tick("FAILURE")


def test_action_consumes_limit_each_time():
    answers = "outcomes: {A: [SUCCESS, {status: FAILURE, label: lost, when: left > 0, then: left -= 1}]}\nfacts: {left: 1}"
    case = Case("<Sequence><A/><B/></Sequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    assert alarms_after(watch, (1, "FAILURE", "lost")) == []
    watch.end_tick("FAILURE")
    assert alarms_after(watch, (1, "FAILURE", "lost")) == [
        "Assumption failed: 'A' returns 'lost' only when left > 0 (left is 0)"
    ]


def test_condition_without_limit_is_judged_by_current_facts():
    seen = "[FAILURE, {status: SUCCESS, label: fine, when: left > 0, then: seen = true}]"
    answers = (
        f"outcomes: {{P: {seen}, B: [{{status: RUNNING, then: left -= 1}}]}}\nfacts: {{left: 1, seen: false}}"
    )
    case = Case("<ReactiveSequence><P/><B/></ReactiveSequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    assert alarms_after(watch, (1, "SUCCESS", "fine"), (2, "RUNNING")) == []
    watch.end_tick("RUNNING")
    assert alarms_after(watch, (1, "SUCCESS", "fine")) == [
        "Assumption failed: 'P' returns 'fine' only when left > 0 (left is 0)"
    ]


def test_unchanged_condition_does_not_restore_limits_of_others():
    answers = "[SUCCESS, {status: FAILURE, label: no, when: %s > 0, then: %s -= 1}]"
    case = Case(
        "<Fallback><P name='one'/><P name='other'/></Fallback>",
        f"outcomes: {{one: {answers % ('a', 'a')}, other: {answers % ('b', 'b')}}}\nfacts: {{a: 1, b: 1}}",
    )
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["a", "b"])
    assert alarms_after(watch, (1, "FAILURE", "no"), (2, "FAILURE", "no")) == []
    watch.end_tick("FAILURE")
    assert alarms_after(watch, (1, "FAILURE", "no"), (2, "SUCCESS")) == []
    watch.end_tick("SUCCESS")
    assert alarms_after(watch, (1, "FAILURE", "no"), (2, "FAILURE", "no")) == [
        "Assumption failed: 'other' returns 'no' only when b > 0 (b is 0)"
    ]


def test_unwritten_key_is_unknown_in_violated_assumption():
    answers = (
        "outcomes: {A: [{status: SUCCESS, when: 'left > 0 ? n == 1 : false'}, FAILURE]}\nfacts: {left: 0}"
    )
    watch = monitor_of("<Sequence><A/><Script code='n := 1'/></Sequence>", answers)
    assert alarms_after(watch, (1, "SUCCESS")) == [
        "Assumption failed: 'A' returns 'SUCCESS' only when left > 0 ? n == 1 : false (left is 0, n is unknown)"
    ]
