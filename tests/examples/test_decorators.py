"""Tests of the example `decorators`: its four trees, run with the commands of its README."""

import re

import pytest

from sar_compiler.nodes.registry import load_registry
from sar_compiler.testing import assert_matches_golden
from tests.examples.readme import EXAMPLES, steps
from tests.processes import Command

TREES = ["inverter", "timeout", "retry", "success_is_running"]
LEAVES = "examples.decorators.leaves"
FOLDER = EXAMPLES / "decorators"


def test_there_is_exactly_one_tree_for_each_decorator():
    assert sorted(path.stem for path in FOLDER.glob("*.xml")) == sorted(TREES)


@pytest.mark.parametrize("tree", TREES)
def test_tree_compiles_as_reviewed(tree):
    golden = f"tests/golden/examples/{tree}.json"
    assert_matches_golden(FOLDER / f"{tree}.xml", golden, registry=load_registry([LEAVES]))


@pytest.fixture(scope="module")
def runs():
    """Run all four trees at the same time, each with the command of its step."""
    commands = [Command(*words) for step in steps("decorators") for words in step.commands]
    yield [(command.end(), command.output) for command in commands]
    for command in commands:
        command.kill()


def without_times(text):
    """Return the lines about changes without their times."""
    return [found[1] for line in text.splitlines() if (found := re.match(r" +\d+:\d\d  (.*)", line))]


@pytest.mark.ros
@pytest.mark.parametrize("tree", TREES)
def test_tree_succeeds_and_prints_output_of_readme(runs, tree):
    number = TREES.index(tree)
    step, (status, output) = steps("decorators")[number], runs[number]
    assert str(FOLDER / f"{tree}.xml") in step.commands[0]
    assert status == 0, output
    changes, (first, last) = without_times(output), map(without_times, step.shown)
    assert changes[: len(first)] == first
    assert changes[-len(last) :] == last
