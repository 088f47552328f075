"""A run that is watched raises its alarms where the proof says that a property breaks, and nowhere else."""

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
from tests.chance import rounds

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
    """Answers what leaves have answered in a run."""

    def __init__(self, run):
        answered = (each for tick in run.ticks for each in tick.events if each.what == RETURNED)
        self._answers = iter([(each.status, each.label) for each in answered])

    def choose(self, leaf, options):
        status, label = next(self._answers)
        return next(each for each in options if (each.status, each.label) == (status, label))


class Told:
    """Has a watch told of stub leaves, which say themselves which answers they give."""

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
        listen_to_leaf(leaf, number, Told(watch, leaves))


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

    def flown(self, run):
        """Return the watch of a tree that was ticked, in which leaves answered as in a run."""
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
    """Return the properties that do not hold, each with a run to its end."""
    found = case.verified()
    names = case.watch().properties.names
    return {
        each.question: each.trace
        for each in found.verdicts
        if each.question in names and each.outcome is BROKEN and each.trace and not each.trace.loop
    }


OF_KEYS = "p5"
"""Its condition reads a key, of which events alone say nothing."""


def cases(count):
    """Yield trees at random without timers, each with a name for messages."""
    for seed in range(rounds(count)):
        branches = random_branches(seed)
        bodies = {"": (random_tree(seed), f"properties:{PROPERTIES}")}
        if "Timeout" not in branches and "Delay" not in branches:
            bodies[" of branches"] = branches, random_properties(branches, seed)
        for kind, (body, properties) in bodies.items():
            with suppress(TreeError):  # what py_trees treats as an interruption may be skipped
                yield f"seed {seed}{kind}", Case(body, properties)


@pytest.fixture(scope="module")
def broken():
    """Trees at random without timers, and runs that break their properties."""
    return [
        (f"{which}: {name}", case, name, run)
        for which, case in cases(30)
        for name, run in broken_runs(case).items()
    ]


@pytest.mark.unmeasured
def test_a_tree_that_is_ticked_as_in_a_run_of_the_proof_raises_the_alarm_in_the_tick_that_breaks_the_property(
    broken,
):
    for which, case, name, run in broken:
        alarms = {each.about: each.tick for each in case.flown(run).alarms}
        assert alarms.get(name) == len(run.ticks), which
    assert len(broken) > 60


@pytest.mark.unmeasured
def test_the_events_of_a_run_raise_the_same_alarms_at_the_same_events_as_the_tree_that_is_ticked(broken):
    count = 0
    for which, case, _, run in broken:
        watch, flown = case.watch(), case.flown(run)
        for event in run.events:
            watch.process_event(event)
        told = [
            [each for each in one.alarms if each.about != OF_KEYS and each.cause is not AlarmCause.UNJUDGED]
            for one in (watch, flown)
        ]
        assert told[0] == told[1], which
        count += len(told[0])
    assert count > 60


class ByChance:
    """Answers anything that is possible; what goes on running is rarer."""

    def __init__(self, seed):
        self._chance = random.Random(seed)  # noqa: S311 - the same in every run

    def choose(self, _leaf, options):
        weights = [0.3 if each.status == "RUNNING" else 1.0 for each in options]
        return self._chance.choices(options, weights)[0]


@pytest.mark.costly
def test_runs_by_chance_of_a_tree_whose_properties_are_proved_raise_no_alarm():
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


def taken(watch, *events):
    """Have a watch take answers, each as the leaf's number with a status and perhaps a label; return its alarms in words."""
    for number, status, *label in events:
        watch.on_before_event(number)
        watch.on_status(number, status, *label)
    return [each.sentence for each in watch.alarms]


def watch_of(body, properties):
    return Case(body, properties).watch()


def test_an_answer_that_the_facts_exclude_is_an_assumption_that_failed_told_once():
    properties = (
        "facts: {left: 1}\noutcomes: {A: [{status: SUCCESS, when: left > 0, then: left -= 1}, FAILURE]}"
    )
    watch = watch_of("<Sequence><A/><B/></Sequence>", properties)
    assert taken(watch, (1, "SUCCESS")) == []
    told = "Assumption failed: 'A' returns 'SUCCESS' only when left > 0 (left is 0)"
    assert taken(watch, (1, "SUCCESS"), (1, "FAILURE"), (1, "SUCCESS")) == [told]


def test_an_answer_that_a_leaf_has_not_declared_is_an_assumption_that_failed():
    watch = watch_of("<A/>", "outcomes: {A: [{status: SUCCESS, label: yes}, {status: SUCCESS, label: no}]}")
    assert taken(watch, (0, "SUCCESS", "yes")) == []
    assert taken(watch, (0, "FAILURE"), (0, "SUCCESS", "perhaps"), (0, "SUCCESS")) == [
        "Assumption failed: 'A' returns only yes, no, but returned FAILURE",
        "Assumption failed: 'A' returns only yes, no, but returned perhaps",
        "Assumption failed: 'A' reports the label of each returned outcome (yes, no)",
    ]


def test_what_is_owed_is_broken_by_an_end_and_open_where_the_run_is_stopped():
    properties = "properties: {p: {after: A SUCCESS, eventually: B SUCCESS}}\nend: root == 'SUCCESS' && idle"
    for is_over, alarms in ((True, ["Property violated: p (pending at the end)"]), (False, [])):
        watch = watch_of("<Sequence><A/><B/></Sequence>", properties)
        assert taken(watch, (1, "SUCCESS")) == []
        watch.end_tick("SUCCESS")
        assert (watch.pending_properties, watch.alarms) == (["p"], [])
        watch.conclude(is_over=is_over)
        assert [each.sentence for each in watch.alarms] == alarms


def test_what_a_condition_reads_and_nobody_has_written_is_told_once_and_counts_as_false():
    watch = watch_of(
        "<Sequence><A/><Script code='n := 1'/></Sequence>",
        "properties: {p: {never: A SUCCESS, while: n == 1}}",
    )
    (told,) = taken(watch, (1, "SUCCESS"), (1, "SUCCESS"))
    assert told.startswith("Not monitored: p: 'n == 1' cannot be evaluated")
    assert watch.broken == set()


def test_the_run_that_led_to_an_alarm_leaves_out_what_came_in_the_tick_before_as_well():
    watch = watch_of("<Sequence><A/><B/></Sequence>", "properties: {p: {never: B SUCCESS}}")
    for _ in range(3):
        taken(watch, (1, "RUNNING"))
        watch.end_tick("RUNNING")
    taken(watch, (1, "SUCCESS"), (2, "SUCCESS"))
    (alarm,) = watch.alarms
    assert [(each.tick, each.number, each.action) for each in alarm.run] == [
        (1, 1, "RUNNING"),
        (4, 1, "SUCCESS"),
        (4, 2, "SUCCESS"),
    ]
    assert (alarm.event, alarm.tick, alarm.number) == ("B SUCCESS", 4, 2)


def test_the_first_answer_of_a_leaf_can_be_one_that_assumptions_exclude():
    case = Case('<Y name="y"/>', "properties: {p: {never: y FAILURE}}")
    watch = case.watch()
    watch.on_start(0)
    watch.on_status(0, "SUCCESS", "counted")
    (alarm,) = watch.alarms
    assert (alarm.cause, alarm.event) == (AlarmCause.ASSUMPTION, "y counted")
    assert alarm.about == "'y' returns 'counted' only when f > 0 (f is 0)"
    assert [each.action for each in alarm.run] == ["counted"]


def test_a_condition_that_goes_on_finding_the_same_takes_from_a_limit_once():
    held = "outcomes: {P: [SUCCESS, {status: FAILURE, label: held, when: left > 0, then: left -= 1}]}\nfacts: {left: 1}"
    case = Case("<Sequence><P/><B/></Sequence>", held)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    for _ in range(5):
        assert taken(watch, (1, "FAILURE", "held")) == []
        watch.end_tick("FAILURE")
    taken(watch, (1, "SUCCESS"))
    watch.end_tick("RUNNING")
    assert taken(watch, (1, "FAILURE", "held")) == [
        "Assumption failed: 'P' returns 'held' only when left > 0 (left is 0)"
    ]


def test_a_condition_that_finds_twice_in_a_tick_what_it_found_in_the_last_one_takes_nothing_again():
    held = "outcomes: {P: [SUCCESS, {status: FAILURE, label: held, when: left > 0, then: left -= 1}]}\nfacts: {left: 1}"
    case = Case("<Sequence><P/><B/></Sequence>", held)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    for answers in (1, 2):
        for _ in range(answers):
            assert taken(watch, (1, "FAILURE", "held")) == []
        watch.end_tick("FAILURE")


def test_a_limit_that_a_condition_goes_on_exceeding_is_spent_all_the_same_by_a_script_that_counts_once():
    lost = "{status: FAILURE, label: lost, when: away || left > 0, then: 'left -= away ? 0 : 1; away = true'}"
    answers = (
        f"outcomes: {{P: [{{status: SUCCESS, then: away = false}}, {lost}]}}\nfacts: {{left: 1, away: false}}"
    )
    case = Case("<Sequence><P/><B/></Sequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    for _ in range(3):
        assert taken(watch, (1, "FAILURE", "lost")) == []
        watch.end_tick("FAILURE")
    taken(watch, (1, "SUCCESS"))
    watch.end_tick("RUNNING")
    (told,) = taken(watch, (1, "FAILURE", "lost"))
    assert told.endswith("(away is 0, left is 0)")


def test_what_a_condition_finds_again_after_a_tick_without_it_takes_again():
    answers = "outcomes: {P: [SUCCESS, {status: FAILURE, label: held, when: left > 0, then: left -= 1}]}\nfacts: {left: 1}"
    case = Case("<Sequence><P/><B/></Sequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    assert taken(watch, (1, "FAILURE", "held")) == []
    watch.end_tick("FAILURE")
    watch.end_tick("FAILURE")
    assert taken(watch, (1, "FAILURE", "held")) == [
        "Assumption failed: 'P' returns 'held' only when left > 0 (left is 0)"
    ]


def test_what_goes_on_is_judged_as_it_was_when_it_began_last():
    held = "{status: FAILURE, label: held, when: left == turn, then: left -= 1}"
    answers = f"outcomes: {{P: [{{status: SUCCESS, then: turn -= 1}}, {held}]}}\nfacts: {{left: 2, turn: 2}}"
    case = Case("<Sequence><P/><B/></Sequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    for answer in ((1, "FAILURE", "held"), (1, "SUCCESS"), (1, "FAILURE", "held"), (1, "FAILURE", "held")):
        assert taken(watch, answer) == []
        watch.end_tick("FAILURE")


def test_an_action_takes_from_a_limit_each_time():
    answers = "outcomes: {A: [SUCCESS, {status: FAILURE, label: lost, when: left > 0, then: left -= 1}]}\nfacts: {left: 1}"
    case = Case("<Sequence><A/><B/></Sequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    assert taken(watch, (1, "FAILURE", "lost")) == []
    watch.end_tick("FAILURE")
    assert taken(watch, (1, "FAILURE", "lost")) == [
        "Assumption failed: 'A' returns 'lost' only when left > 0 (left is 0)"
    ]


def test_a_condition_that_takes_from_no_limit_is_judged_by_what_is_left_now():
    seen = "[FAILURE, {status: SUCCESS, label: fine, when: left > 0, then: seen = true}]"
    answers = (
        f"outcomes: {{P: {seen}, B: [{{status: RUNNING, then: left -= 1}}]}}\nfacts: {{left: 1, seen: false}}"
    )
    case = Case("<ReactiveSequence><P/><B/></ReactiveSequence>", answers)
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["left"])
    assert taken(watch, (1, "SUCCESS", "fine"), (2, "RUNNING")) == []
    watch.end_tick("RUNNING")
    assert taken(watch, (1, "SUCCESS", "fine")) == [
        "Assumption failed: 'P' returns 'fine' only when left > 0 (left is 0)"
    ]


def test_one_condition_that_goes_on_gives_others_nothing_back():
    answers = "[SUCCESS, {status: FAILURE, label: no, when: %s > 0, then: %s -= 1}]"
    case = Case(
        "<Fallback><P name='one'/><P name='other'/></Fallback>",
        f"outcomes: {{one: {answers % ('a', 'a')}, other: {answers % ('b', 'b')}}}\nfacts: {{a: 1, b: 1}}",
    )
    watch = RuntimeMonitor(case.simulated(), case.file, TAGS, limits=["a", "b"])
    assert taken(watch, (1, "FAILURE", "no"), (2, "FAILURE", "no")) == []
    watch.end_tick("FAILURE")
    assert taken(watch, (1, "FAILURE", "no"), (2, "SUCCESS")) == []
    watch.end_tick("SUCCESS")
    assert taken(watch, (1, "FAILURE", "no"), (2, "FAILURE", "no")) == [
        "Assumption failed: 'other' returns 'no' only when b > 0 (b is 0)"
    ]


def test_what_nobody_has_written_is_said_to_be_unknown_where_an_answer_is_excluded():
    answers = (
        "outcomes: {A: [{status: SUCCESS, when: 'left > 0 ? n == 1 : false'}, FAILURE]}\nfacts: {left: 0}"
    )
    watch = watch_of("<Sequence><A/><Script code='n := 1'/></Sequence>", answers)
    assert taken(watch, (1, "SUCCESS")) == [
        "Assumption failed: 'A' returns 'SUCCESS' only when left > 0 ? n == 1 : false (left is 0, n is unknown)"
    ]
