"""The example `decorators`: its four trees, run as its README says."""

import re

import pytest

from sar_compiler.nodes.registry import load_registry
from sar_compiler.testing import assert_matches_golden
from tests.examples.readme import EXAMPLES, steps
from tests.processes import Command

TREES = ["inverter", "timeout", "retry", "success_is_running"]
LEAVES = "examples.decorators.leaves"
FOLDER = EXAMPLES / "decorators"


def test_there_is_a_tree_for_each_decorator_and_no_other():
    assert sorted(path.stem for path in FOLDER.glob("*.xml")) == sorted(TREES)


@pytest.mark.parametrize("tree", TREES)
def test_the_tree_compiles_as_reviewed(tree):
    golden = f"tests/golden/examples/{tree}.json"
    assert_matches_golden(FOLDER / f"{tree}.xml", golden, registry=load_registry([LEAVES]))


@pytest.fixture(scope="module")
def runs():
    """Run all four at the same time, each as its step of the README says."""
    commands = [Command(*words) for step in steps("decorators") for words in step.commands]
    yield [(command.end(), command.output) for command in commands]
    for command in commands:
        command.kill()


def without_times(text):
    """Return the lines that tell of changes, without the time that each begins with."""
    return [found[1] for line in text.splitlines() if (found := re.match(r" +\d+:\d\d  (.*)", line))]


@pytest.mark.ros
@pytest.mark.parametrize("tree", TREES)
def test_the_tree_succeeds_and_is_printed_as_the_readme_shows(runs, tree):
    number = TREES.index(tree)
    step, (status, output) = steps("decorators")[number], runs[number]
    assert str(FOLDER / f"{tree}.xml") in step.commands[0]
    assert status == 0, output
    changes, (first, last) = without_times(output), map(without_times, step.shown)
    assert changes[: len(first)] == first
    assert changes[-len(last) :] == last
