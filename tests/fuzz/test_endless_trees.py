"""Tests of trees that may never end: each analysing command ends within its limits and prints its result."""

import json
import random
from contextlib import closing

import pytest

from sar_compiler.cli.compile import main as sar_compile
from sar_compiler.cli.journal_command import main as sar_journal
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.random_trees import random_tree
from tests.analysis.verify.stage import bound
from tests.random_inputs import rounds
from tests.trees import document
from tests.views.recorded_runs import run_and_record, simulated

NODES = ("--nodes", "tests.analysis.verify.leaves")
ENDLESS = (
    "<KeepRunningUntilFailure><ForceSuccess>{}</ForceSuccess></KeepRunningUntilFailure>",
    '<RetryUntilSuccessful num_attempts="-1"><ForceFailure>{}</ForceFailure></RetryUntilSuccessful>',
    '<Repeat num_cycles="-1"><ForceSuccess>{}</ForceSuccess></Repeat>',
    "<Fallback><X/>{}<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure></Fallback>",
    "<ReactiveSequence><KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>{}</ReactiveSequence>",
)
TREE, OTHER, JOURNAL = "tree.xml", "other.xml", "run.journal"
JSON = ("--format", "json")
SEARCHES = (TREE, *NODES, "--max-states", "2000", *JSON)
COMMANDS = (
    ("verify", *SEARCHES),
    ("predict", *SEARCHES),
    ("simulate", TREE, *NODES, "--ticks", "200", *JSON),
    ("sweep", TREE, *NODES, "--unusual", "0.3", "--ticks", "50", "--runs", "5", "--jobs", "1", *JSON),
    ("validate", TREE, *NODES, *JSON),
    ("show", TREE, *NODES, *JSON),
    ("diff", TREE, OTHER),
    ("conform", TREE, JOURNAL, *NODES, *JSON),
    ("why", JOURNAL, *NODES, *JSON),
)


class RandomPolicy:
    """Lets each leaf return any of its outcomes.

    Args:
        seed: The seed of the random numbers.
    """

    def __init__(self, seed):
        self._chance = random.Random(seed)  # noqa: S311 - the same in every run

    def choose(self, _, options):
        return self._chance.choice(options)


def tree_of(seed: int) -> str:
    """Return the elements of a tree; every second one has a part that may never end."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    while True:
        body = random_tree(chance.randrange(1_000_000))
        if seed % 2:
            body = chance.choice(ENDLESS).format(body)
        try:
            bound(body)
        except TreeError:  # a parent does not support a child that is skipped
            continue
        return body


def record_run(folder, seed):
    """Record a random run of the tree in a journal; a run that does not end is stopped."""
    about = {"tree_file": str(folder / TREE), "tree_id": "Main"}
    with closing(open_journal(folder / JOURNAL)) as journal:
        run_and_record(simulated(folder / TREE), RandomPolicy(seed), journal, **about)


@pytest.mark.random
@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(rounds(20)))
def test_every_analysis_of_endless_tree_ends(seed, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / TREE).write_text(document(tree_of(seed)), encoding="utf-8")
    (tmp_path / OTHER).write_text(document(tree_of(seed + 1)), encoding="utf-8")
    record_run(tmp_path, seed)
    for command, *options in COMMANDS:
        status = (sar_journal if command == "why" else sar_compile)([command, *options])
        out, err = capsys.readouterr()
        assert status in (0, 1), f"{command}: {err}"
        # The time limit is for larger trees. It is processor time, so other processes do not matter.
        assert "stopped after" not in out + err, command
        assert out or "no prediction is possible: " in err, command
        found = json.loads(out) if out and "json" in options else {}
        if command == "conform":
            assert [each["misfit"] for each in found["runs"]] == [None]
