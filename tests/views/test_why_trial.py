"""Trees in which one leaf fails from some moment on: it is the first to be named."""

import random

from sar_compiler.checks.simulate.running import ScenarioPlayer
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Ending, JournalEntry
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.nodes.registry import load_registry
from sar_compiler.project import load
from sar_compiler.views.outline import outline
from sar_compiler.views.why import why
from tests.trees import document

FAULTS, NAMED_FIRST = 100, 95
TICKS = 60
REGISTRY = load_registry(["tests.checks.verify.leaves"])
ACTION, CONDITION = "A", "P"
CONDITIONS = [f"tests.checks.verify.leaves.{CONDITION}"]


def a_mission(chance):
    """Return a tree as people write them: steps, some with a second way, a look before, or some tries."""
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
    """Actions run for a while and succeed; conditions say the same for a whole run, many of them no; one leaf fails from some moment on."""

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


def flown(tree, policy):
    """Return the stream of a run, and what its root came to."""
    play = load(tree, registry=REGISTRY).stage().play()
    player, simulated = ScenarioPlayer(play.simulated, play.scenario), play.simulated
    simulated.policy = policy
    journal = Journal()
    stream: list[JournalEntry] = []
    journal.listen(stream.append)
    journal.clock = simulated.clock
    behaviours = list(simulated.root.iterate())
    described = with_real_classes(outline(simulated.compiled), simulated.compiled)
    journal.begin({"tree": described}, {})
    watch = StatusWatch(simulated.root, journal)
    numbers = watch._numbers
    by_id = {each.id: each for each in behaviours}
    for _ in range(TICKS):
        watch.initialise()
        for each, status in player.tick().statuses.items():
            watch._note(numbers[id(by_id[each])], status, by_id[each].feedback_message)
        watch.finalise()
        if player.run.root != "RUNNING":
            break
    journal.end(Ending.OVER, int(player.run.root != "SUCCESS"))
    return stream, player.run.root


def with_real_classes(node, tree):
    """Return an outline as a real run has it: with the classes of leaves for those that stand in for them."""
    classes = {
        tree.origins[each.id].bound.name: tree.origins[each.id].bound.spec.maker_path.replace(":", ".")
        for each in tree.root.iterate()
        if not each.children
    }

    def changed(node):
        children = [changed(child) for child in node["children"]]
        return {**node, "class": classes.get(node["name"], node["class"]), "children": children}

    return changed(node)


def injected(path):
    """Yield streams of missions that failed because of one fault, with the leaf that was faulty."""
    for seed in range(10_000):
        chance = random.Random(seed)  # noqa: S311 - the same in every run
        path.write_text(document(a_mission(chance)), encoding="utf-8")
        usual = FaultyPolicy(seed)
        if flown(path, usual)[1] != "SUCCESS":
            continue
        faulty = chance.choice(sorted(usual.asked))
        stream, root = flown(path, FaultyPolicy(seed, faulty, chance.randint(0, usual.asked[faulty])))
        if root == "FAILURE":
            yield faulty, stream


def test_of_a_hundred_faults_the_leaf_that_was_faulty_is_named_first_in_95(tmp_path):
    named = []
    for (faulty, stream), _ in zip(injected(tmp_path / "tree.xml"), range(FAULTS), strict=False):
        reasons = why(stream, CONDITIONS)
        named.append((reasons.first.name if reasons.first else "", faulty))
    assert len(named) == FAULTS
    wrong = [pair for pair in named if pair[0] != pair[1]]
    assert len(named) - len(wrong) >= NAMED_FIRST, wrong
