"""Runs trees with stub leaves, scripted by a test or random with one fault, and returns their journal entries."""

import functools
import random

from sar_compiler.analysis.simulate.scenario_files import Scenario
from sar_compiler.analysis.tree_analysis import stage_of
from sar_compiler.compiler.outline import outline
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Ending, JournalEntry
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.loaded_tree import load
from sar_compiler.nodes.registry import load_registry
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.live import LiveTree, show_visits
from sar_compiler.runtime.kernel.tree_nodes import Visit
from sar_compiler.runtime.outcomes import nominal
from sar_compiler.runtime.walking import pre_order
from tests.trees import document

TICKS = 60
REGISTRY = load_registry(["tests.analysis.verify.leaves"])
ACTION, CONDITION = "A", "P"


def simulated(tree, registry=REGISTRY):
    """Return a tree with stub leaves."""
    return stage_of(load(tree, registry=registry)).play().simulated


class ScriptedPolicy:
    """Lets leaves return scripted outcomes in turn, and their nominal outcomes otherwise.

    Args:
        outcomes: Labels or statuses, by the names of leaves.
    """

    def __init__(self, **answers):
        self._left = {name: list(each) for name, each in answers.items()}

    def choose(self, leaf, options):
        left = self._left.get(leaf.name)
        wanted = left.pop(0) if left else nominal(options).name
        return next(each for each in options if wanted in (each.label, each.status))


def a_mission(chance):
    """Return a realistic random tree: steps, some with a fallback, a condition before them, or retries."""
    numbers = iter(range(1000))

    def leaf(tag):
        return f'<{tag} name="{tag}{next(numbers)}"/>'

    def step(depth):
        kind = chance.random()
        if depth == 0 or kind < 0.3:
            return leaf(ACTION)
        if kind < 0.5:
            return f"<Fallback>{step(depth - 1)}{step(depth - 1)}</Fallback>"
        if kind < 0.65:
            return f"<Fallback>{leaf(CONDITION)}{step(depth - 1)}</Fallback>"
        if kind < 0.8:
            return f'<RetryUntilSuccessful num_attempts="3">{step(depth - 1)}</RetryUntilSuccessful>'
        tag = chance.choice(["Sequence", "SequenceWithMemory", "ReactiveSequence"])
        steps = "".join(step(depth - 1) for _ in range(chance.randint(2, 3)))
        return f"<{tag}>{leaf(CONDITION) if tag == 'ReactiveSequence' else ''}{steps}</{tag}>"

    return f'<Sequence name="Main">{"".join(step(3) for _ in range(4))}</Sequence>'


class FaultyPolicy:
    """Lets actions run for a while and succeed, and one leaf fail from some visit on.

    A condition returns the same status in the whole run, FAILURE in 40 % of the cases.
    """

    def __init__(self, seed, faulty=None, first=0):
        self._seed, self._faulty, self._first = seed, faulty, first
        self.asked = {}

    def choose(self, leaf, options):
        count = self.asked[leaf.name] = self.asked.get(leaf.name, -1) + 1
        status = self._status(leaf.name, count)
        return next(each for each in options if each.status == status)

    def _status(self, name, count):
        if name == self._faulty and count >= self._first:
            return "FAILURE"
        whole, now = (random.Random(f"{self._seed} {name} {each}") for each in ("", count))  # noqa: S311
        if name.startswith(CONDITION):
            return "FAILURE" if whole.random() < 0.4 else "SUCCESS"
        return "RUNNING" if now.random() < 0.3 else "SUCCESS"


def run_and_record(simulated, policy, journal=None, **about):
    """Return the journal entries of a run and the root's last status.

    Args:
        policy: Chooses the outcomes. Its attribute `tick` is set before each tick.
        about: More data for the journal's description of the run.
    """
    tree = LiveTree(simulated.root, is_strict=True)
    simulated.policy = policy
    journal = journal or Journal()
    stream: list[JournalEntry] = []
    journal.add_listener(stream.append)
    journal.clock = simulated.clock
    looks = [
        ["condition" if each.name.startswith(CONDITION) else "action", ""]
        for each in pre_order(simulated.root)
    ]
    journal.begin({"tree": outline(simulated.compiled)}, {"looks": looks, **about})
    watch = StatusWatch(simulated.root, journal)
    for policy.tick in range(1, TICKS + 1):
        root = watched_tick(tree, watch)
        if root != "RUNNING":
            break
        simulated.clock.advance(Scenario().period_sec)
    journal.end_run(Ending.OVER, int(root != "SUCCESS"))
    return stream, root


def watched_tick(tree, watch):
    """Tick a tree once, recorded as in a run; return the root's status."""
    visits: list[Visit] = []
    watch.initialise()
    try:
        return WORDS[tree.tick_and_visit(visits)]
    finally:
        for behaviour in show_visits(visits):
            watch.run(behaviour)
        watch.finalise()


def missions_with_fault(path):
    """Yield the faulty leaf, the journal entries and a factory of the policy of missions that failed because of one fault."""
    for seed in range(10_000):
        chance = random.Random(seed)  # noqa: S311 - the same in every run
        path.write_text(document(a_mission(chance)), encoding="utf-8")
        usual = FaultyPolicy(seed)
        if run_and_record(simulated(path), usual)[1] != "SUCCESS":
            continue
        faulty = chance.choice(sorted(usual.asked))
        policy = functools.partial(FaultyPolicy, seed, faulty, chance.randint(0, usual.asked[faulty]))
        stream, root = run_and_record(simulated(path), policy())
        if root == "FAILURE":
            yield faulty, stream, policy
