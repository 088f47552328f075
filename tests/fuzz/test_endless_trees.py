"""Trees that need not end: every command that analyses comes to its end all the same, by its limits, with what it knows."""

import json
import random

import pytest

from sar_compiler.tree.diagnostic import TreeError
from tests.chance import rounds
from tests.checks.verify.random_trees import random_tree
from tests.checks.verify.stage import bound
from tests.cli.running import run
from tests.trees import document

NODES = ("--nodes", "tests.checks.verify.leaves")
ENDLESS = (
    "<KeepRunningUntilFailure><ForceSuccess>{}</ForceSuccess></KeepRunningUntilFailure>",
    '<RetryUntilSuccessful num_attempts="-1"><ForceFailure>{}</ForceFailure></RetryUntilSuccessful>',
    '<Repeat num_cycles="-1"><ForceSuccess>{}</ForceSuccess></Repeat>',
    "<Fallback><X/>{}<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure></Fallback>",
    "<ReactiveSequence><KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>{}</ReactiveSequence>",
)
SEARCHES = (*NODES, "--max-states", "2000", "--format", "json")
COMMANDS = {
    "verify": SEARCHES,
    "predict": SEARCHES,
    "simulate": (*NODES, "--ticks", "200", "--format", "json"),
    "sweep": (*NODES, "--unusual", "0.3", "--ticks", "50", "--runs", "5", "--jobs", "1", "--format", "json"),
    "validate": (*NODES, "--format", "json"),
    "diff": (),
}


def tree_of(seed: int) -> str:
    """Return the elements of a tree; every second one has a part that need not end."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    while True:
        body = random_tree(chance.randrange(1_000_000))
        if seed % 2:
            body = chance.choice(ENDLESS).format(body)
        try:
            bound(body)
        except TreeError:  # a node would be skipped that its parent takes for interrupted
            continue
        return body


@pytest.mark.random
@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(rounds(10)))
def test_every_analysis_of_a_tree_that_need_not_end_ends_by_itself(seed, capsys, tmp_path):
    tree, other = tmp_path / "tree.xml", tmp_path / "other.xml"
    tree.write_text(document(tree_of(seed)), encoding="utf-8")
    other.write_text(document(tree_of(seed + 1)), encoding="utf-8")
    for command, options in COMMANDS.items():
        files = (tree, other) if command == "diff" else (tree,)
        status, out, err = run(capsys, command, *files, *options)
        assert status in (0, 1), f"{command}: {err}"
        # The limit of time is for larger trees; it is processor time, so others on the machine do not count.
        assert "stopped after" not in err, command
        assert out or "nothing can be predicted: " in err, command
        if out and "json" in options:
            json.loads(out)
