"""Small trees of the leaves of `tests.analysis.verify.leaves`, predicted and played."""

import random
import re

from sar_compiler.analysis.assumptions import read_assumptions
from sar_compiler.analysis.predict import predict
from sar_compiler.analysis.simulate.reused_tree import ReusedTree
from sar_compiler.analysis.simulate.scenario_files import Scenario
from sar_compiler.analysis.simulated_tree import compile_simulated
from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.random_trees import random_tree
from tests.analysis.verify.stage import TAGS, bound, simulated_tree

PERIOD_SEC = 0.5
_OTHERS = 10_000
CHANCES = """
A: [{outcome: SUCCESS, p: 0.8, sec: [0.5, 4]}, {outcome: FAILURE, p: 0.2, sec: 3}]
P: [{outcome: SUCCESS, p: 0.6}, {outcome: FAILURE, p: 0.4}]
X: [{outcome: SUCCESS, p: 0.7, sec: [0, 2]}, {outcome: FAILURE, p: 0.3}]
Y: [{outcome: counted, p: 0.5}, {outcome: FAILURE, p: 0.5, sec: 1}]
Z: [{outcome: SUCCESS, p: 0.9, sec: 1.2}, {outcome: FAILURE, p: 0.1}]
"""


def file_of(body, chances, rest=""):
    """Return a properties file that gives the leaves of a tree their probabilities, followed by `rest`."""
    tags = set(re.findall(r"<(\w+)", body))
    lines = [line for line in chances.split("\n") if line.partition(":")[0] in tags]
    text = "\n".join(["outcomes:" if lines else "outcomes: {}", *(f"  {line}" for line in lines), rest])
    return parse_property_file(text, "props.yaml")


def compile_with_probabilities(body, chances, rest):
    """Return a simulated tree whose leaves have probabilities, and the file that defines them."""
    file, binding = file_of(body, chances, rest), bound(body)
    with file.document.prefer_findings():
        plain = compile_simulated(binding, {}, all_runs=True)
        assumptions = read_assumptions(file.document, file.facts, file.outcomes, plain)
        return compile_simulated(binding, {}, assumptions, all_runs=True), file


def predicted(body, chances=CHANCES, rest="", *, max_states=100_000):
    """Predict a tree."""
    simulated, file = compile_with_probabilities(body, chances, rest)
    return predict(simulated, file, TAGS, PERIOD_SEC, max_states)


def played(body, runs, *, max_ticks=300):
    """Play a tree `runs` times; return the number of successes, of ended runs, and the times of these."""
    simulated = simulated_tree(bound(body), file_of(body, CHANCES))
    tree = ReusedTree(simulated)
    ends = [
        tree.play(Scenario(period_sec=PERIOD_SEC, max_ticks=max_ticks, seed=seed)).run for seed in range(runs)
    ]
    over = [run for run in ends if run.ended]
    return sum(run.root == "SUCCESS" for run in over), len(over), [run.time_sec for run in over]


def random_timed_tree(seed):
    """Return the elements of a tree whose leaves take time, some with a time limit or in parallel."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    around = chance.choice(
        [
            '<Timeout msec="1200">{}</Timeout>',
            '<Parallel failure_count="1"><A/>{}</Parallel>',
            '<Delay delay_msec="700">{}</Delay>',
            "<ReactiveFallback><P/>{}</ReactiveFallback>",
            '<Parallel success_count="1" failure_count="2"><Sleep msec="1500"/>{}</Parallel>',
        ]
    )
    body = around.format(random_tree(seed))
    try:
        bound(body)
    except TreeError:  # a node could be skipped, which its parent would treat as an interruption
        return random_timed_tree(seed + _OTHERS)
    return body
