"""A run that is watched raises its alarms where the proof says that a property breaks, and nowhere else."""

from contextlib import suppress

from sar_compiler.checks.property_watch import AlarmCause, PropertyWatch
from sar_compiler.checks.verify import verify
from sar_compiler.checks.verify.properties import parse_property_file
from sar_compiler.runtime.events import ANSWERED
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.leaf_ear import hear
from sar_compiler.tree.diagnostic import TreeError
from tests.chance import rounds
from tests.checks.verify.random_branches import random_branches, random_properties
from tests.checks.verify.random_trees import random_tree
from tests.checks.verify.stage import BROKEN, TAGS, bound, simulated_tree

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
        answered = (each for tick in run.ticks for each in tick.events if each.what == ANSWERED)
        self._answers = iter([(each.status, each.label) for each in answered])

    def choose(self, leaf, options):
        status, label = next(self._answers)
        return next(each for each in options if (each.status, each.label) == (status, label))


class Ear(PropertyWatch):
    """Watches a tree of stub leaves, which say themselves which answers they give."""

    def __init__(self, simulated, file, robot):
        self._robot = {leaf.number: leaf for leaf in robot.leaves}
        super().__init__(simulated, file, TAGS, robot.compiled)
        for number, leaf in self._robot.items():
            hear(leaf, number, self)

    def answers(self, number, status, label=""):
        super().answers(number, status, self._robot[number].answer_label or label)


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
        return PropertyWatch(self.simulated(), self.file, TAGS)

    def flown(self, run):
        """Return the watch of a tree that was ticked, in which leaves answered as in a run."""
        robot = self.simulated()
        watch = Ear(self.simulated(), self.file, robot)
        policy = Scripted(run)
        for leaf in robot.leaves:
            leaf.policy = policy
        tree = LiveTree(robot.root)
        for _ in run.ticks:
            watch.end_tick(WORDS[tree.tick()])
        return watch


def heard(watch, run):
    """Have a watch take the events of a run; return the places of those by which each property broke, counted in the run."""
    places: dict[str, int] = {}
    for place, event in enumerate(run.events):
        watch.take(event)
        for name in watch.broken - places.keys():
            places[name] = place
    return places


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
    found = []
    for seed in range(rounds(count)):
        branches = random_branches(seed)
        bodies = {"": (random_tree(seed), f"properties:{PROPERTIES}")}
        if "Timeout" not in branches and "Delay" not in branches:
            bodies[" of branches"] = branches, random_properties(branches, seed)
        for kind, (body, properties) in bodies.items():
            with suppress(TreeError):  # what py_trees takes for an interruption may be skipped
                found.append((f"seed {seed}{kind}", Case(body, properties)))
    return found


def test_a_tree_that_is_ticked_as_in_a_run_of_the_proof_raises_the_alarm_in_the_tick_that_breaks_the_property():
    count = 0
    for seed, case in cases(40):
        for name, run in broken_runs(case).items():
            alarms = {each.about: each.tick for each in case.flown(run).alarms}
            assert alarms.get(name) == len(run.ticks), f"{seed}: {name}"
            count += 1
    assert count > 60


def test_the_events_of_a_run_raise_the_same_alarms_at_the_same_events_as_the_tree_that_is_ticked():
    count = 0
    for seed, case in cases(40):
        for name, run in broken_runs(case).items():
            watch, flown = case.watch(), case.flown(run)
            heard(watch, run)
            alarms = [
                [
                    each
                    for each in one.alarms
                    if each.about != OF_KEYS and each.cause is not AlarmCause.UNJUDGED
                ]
                for one in (watch, flown)
            ]
            assert alarms[0] == alarms[1], f"{seed}: {name}"
            count += len(alarms[0])
    assert count > 60
