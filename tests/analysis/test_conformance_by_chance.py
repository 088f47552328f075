"""Flights of random trees: those that were simulated conform and break what the simulation broke; what was altered is found."""

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
from tests.analysis.test_property_watch import ByChance, Scripted, broken_runs, cases, watch_robot
from tests.analysis.verify.stage import TAGS
from tests.chance import rounds
from tests.views.flown import watched_tick

TICKS = 12
WRONG = (PropertyResult.BROKEN, PropertyResult.IN_DOUBT)


def flown_tick(watch, tree, recorder):
    """Tick a tree; return whether no script of it has raised."""
    try:
        watch.end_tick(watched_tick(tree, recorder))
    except NodeScriptError:
        return False
    return True


class Flown:
    """A flight of a case with stub leaves: what its journal says of it, and what broke.

    Args:
        case: The tree and its properties.
        policy: What leaves answer.
        ticks: How many.
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
            if not flown_tick(watch, tree, recorder):
                break
        journal.end_run(Ending.STOPPED, 0)
        self.events = [*recorded_events(stream)]
        self.broken = {each.about: (each.event, each.tick) for each in watch.alarms if each.cause.is_broken}
        self.owed = set(watch.pending_properties)

    def compared(self, case, events=None):
        record = self.events if events is None else events
        return conform(case.simulated(), case.file, TAGS, record, self.names, is_over=False)


@pytest.mark.unmeasured
def test_a_counterexample_of_a_proof_that_was_flown_breaks_its_property_at_the_same_event():
    count = 0
    for seed, case in cases(20):
        for name, run in broken_runs(case).items():
            flown = Flown(case, Scripted(run), len(run.ticks))
            found = flown.compared(case)
            assert found.misfit is None, f"{seed}: {name}: {found.misfit}"
            fate = next(each for each in found.properties if each.name == name)
            assert fate.fate in WRONG, f"{seed}: {name}: {fate}"
            if fate.fate is PropertyResult.BROKEN:
                assert (fate.event, fate.tick) == flown.broken[name], f"{seed}: {name}"
                count += 1
    assert count > 40


@pytest.mark.unmeasured
def test_a_flight_conforms_and_breaks_what_its_own_watch_has_told():
    sure = doubtful = 0
    for seed, case in cases(20):
        flown = Flown(case, ByChance(seed), TICKS)
        found = flown.compared(case)
        assert found.misfit is None, f"{seed}: {found.misfit}"
        for each in found.properties:
            if each.fate is PropertyResult.IN_DOUBT:
                doubtful += 1
            else:
                sure += 1
                broken = flown.broken.get(each.name)
                assert (each.fate is PropertyResult.BROKEN) == (broken is not None), f"{seed}: {each}"
                if broken is not None:
                    assert (each.event, each.tick) == broken, f"{seed}: {each}"
                elif each.name in flown.owed:
                    assert each.fate is PropertyResult.OPEN, f"{seed}: {each}"
    assert sure > 100
    assert doubtful < sure / 10


def test_an_answer_that_was_altered_is_found_where_it_stands():
    count = 0
    for seed, case in cases(20):
        flown = Flown(case, ByChance(seed), TICKS)
        chance = random.Random(seed)  # noqa: S311 - the same in every run
        answers = [
            place for place, each in enumerate(flown.events) if each.what == RETURNED and each.leaf in "XYZP"
        ]
        for place in chance.sample(answers, min(3, len(answers))):
            altered = list(flown.events)
            altered[place] = altered[place]._replace(label="of nobody")
            misfit = flown.compared(case, altered).misfit
            assert misfit is not None, f"{seed}: {place}"
            assert (misfit.tick, misfit.event) == (altered[place].tick, f"{altered[place].leaf} of nobody"), (
                seed
            )
            assert "returned of nobody" in misfit.why, f"{seed}: {misfit}"
            count += 1
    assert count > rounds(30)
