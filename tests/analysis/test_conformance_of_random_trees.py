"""Tests of conformance with random trees: simulated runs conform, and altered runs do not."""

import random

import pytest

from sar_compiler.analysis.conformance import PropertyResult, conform
from sar_compiler.analysis.runtime_monitor import RuntimeMonitor
from sar_compiler.compiler.outline import outline
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Ending, JournalEntry
from sar_compiler.journal.recorded_events import recorded_events
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.runtime.events import RETURNED
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.scripting import NodeScriptError
from sar_compiler.runtime.walking import pre_order
from tests.analysis.test_runtime_monitor import ByChance, Scripted, broken_runs, cases, watch_robot
from tests.analysis.verify.stage import TAGS
from tests.random_inputs import rounds
from tests.views.recorded_runs import watched_tick

TICKS = 12
WRONG = (PropertyResult.BROKEN, PropertyResult.IN_DOUBT)


def record_tick(watch, tree, recorder):
    """Tick a tree; return whether no script raised an error."""
    try:
        watch.end_tick(watched_tick(tree, recorder))
    except NodeScriptError:
        return False
    return True


class RecordedRun:
    """A simulated run of a case: the events of its journal, and the violated properties.

    Args:
        case: The tree and its properties.
        policy: The policy that chooses the outcomes of leaves.
        ticks: The number of ticks.
    """

    def __init__(self, case, policy, ticks):
        robot = case.simulated()
        watch = RuntimeMonitor(case.simulated(), case.file, TAGS, robot.compiled)
        watch_robot(watch, robot)
        for leaf in robot.leaves:
            leaf.policy = policy
        self.names = [each.name for each in pre_order(robot.root)]
        tree, journal = LiveTree(robot.root), Journal()
        stream: list[JournalEntry] = []
        journal.add_listener(stream.append)
        journal.begin({"tree": outline(robot.compiled)}, {})
        answers = {leaf.id: leaf.outcomes for leaf in robot.leaves}
        recorder = StatusWatch(robot.root, journal, answers)
        for _ in range(ticks):
            if not record_tick(watch, tree, recorder):
                break
        journal.end_run(Ending.STOPPED, 0)
        self.events = [*recorded_events(stream)]
        self.broken = {each.about: (each.event, each.tick) for each in watch.alarms if each.cause.is_broken}
        self.owed = set(watch.pending_properties)

    def compared(self, case, events=None):
        record = self.events if events is None else events
        return conform(case.simulated(), case.file, TAGS, record, self.names, is_over=False)


@pytest.mark.unmeasured
def test_simulated_counterexample_violates_its_property_at_same_event():
    count = 0
    for seed, case in cases(20):
        for name, run in broken_runs(case).items():
            simulated_run = RecordedRun(case, Scripted(run), len(run.ticks))
            found = simulated_run.compared(case)
            assert found.misfit is None, f"{seed}: {name}: {found.misfit}"
            fate = next(each for each in found.properties if each.name == name)
            assert fate.fate in WRONG, f"{seed}: {name}: {fate}"
            if fate.fate is PropertyResult.BROKEN:
                assert (fate.event, fate.tick) == simulated_run.broken[name], f"{seed}: {name}"
                count += 1
    assert count > 40


@pytest.mark.unmeasured
def test_simulated_run_conforms_with_violations_of_its_monitor():
    sure = doubtful = 0
    for seed, case in cases(20):
        simulated_run = RecordedRun(case, ByChance(seed), TICKS)
        found = simulated_run.compared(case)
        assert found.misfit is None, f"{seed}: {found.misfit}"
        for each in found.properties:
            if each.fate is PropertyResult.IN_DOUBT:
                doubtful += 1
            else:
                sure += 1
                broken = simulated_run.broken.get(each.name)
                assert (each.fate is PropertyResult.BROKEN) == (broken is not None), f"{seed}: {each}"
                if broken is not None:
                    assert (each.event, each.tick) == broken, f"{seed}: {each}"
                elif each.name in simulated_run.owed:
                    assert each.fate is PropertyResult.OPEN, f"{seed}: {each}"
    assert sure > 100
    assert doubtful < sure / 10


def test_altered_outcome_is_found_at_its_location():
    count = 0
    for seed, case in cases(20):
        simulated_run = RecordedRun(case, ByChance(seed), TICKS)
        chance = random.Random(seed)  # noqa: S311 - the same in every run
        answers = [
            place
            for place, each in enumerate(simulated_run.events)
            if each.what == RETURNED and each.leaf in "XYZP"
        ]
        for place in chance.sample(answers, min(3, len(answers))):
            altered = list(simulated_run.events)
            altered[place] = altered[place]._replace(label="of nobody")
            misfit = simulated_run.compared(case, altered).misfit
            assert misfit is not None, f"{seed}: {place}"
            assert (misfit.tick, misfit.event) == (altered[place].tick, f"{altered[place].leaf} of nobody"), (
                seed
            )
            assert "returned of nobody" in misfit.why, f"{seed}: {misfit}"
            count += 1
    assert count > rounds(30)
