"""What a run of a sweep costs: the shipped trees, played by chance in one process, and flown in the simulator."""

import importlib.util
import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import partial

from benchmarks.figures import LOOP, Effort, Missing, Result, compared, in_turns, loop, plain, timed
from benchmarks.startup import SCRIPTS
from sar_compiler.analysis.swept import ScenarioRuns, change_scenario, content_of
from sar_compiler.loaded_tree import load
from sar_compiler.project import Additions

TREES = {"plain": "search_and_rescue", "resilient": "search_and_rescue_resilient"}
FLOWN = "a mission of `sar-sim sweep`, time that passes"
_RUNS, _UNUSUAL = 2_000, 0.1
_FLIGHTS, _DOMAIN = 40, "85"


def subject(kind: str) -> str:
    """Return what a run of a tree is called in the tables."""
    return f"a run of `sar-compile sweep` ({kind})"


def measure(effort: Effort) -> Iterator[Result]:
    """Yield what a run costs, without the tree's compilation."""
    seeds = range(effort.size(_RUNS))
    actions: dict[str, Callable[[], float]] = {LOOP: loop}
    for kind, name in TREES.items():
        actions[kind] = partial(_each, _runs(name), seeds)
    taken = in_turns(actions, effort.rounds)
    for kind in TREES:
        yield from compared(subject(kind), taken[kind], {LOOP: taken[LOOP]}, "s/run")
    if importlib.util.find_spec("rclpy") and importlib.util.find_spec("nav2_msgs"):
        yield plain(FLOWN, _flown(effort.size(_FLIGHTS)), "s/mission")
    else:
        yield Missing(FLOWN, "", "there is no ROS 2")


def _flown(count: int) -> float:
    """Return the seconds that pass for each of so many flights of the shipped mission, with the start of the command."""
    os.environ["ROS_DOMAIN_ID"] = _DOMAIN
    # So many flights say nothing about so high a rate, so that all are flown.
    wanted = ("--runs", str(count), "--at-least", "0.999", "--format", "json")
    start = time.perf_counter()
    command = [str(SCRIPTS / "sar-sim"), "sweep", TREES["plain"], *wanted]
    told = subprocess.run(command, check=False, stdout=subprocess.PIPE)
    taken = time.perf_counter() - start
    (row,) = json.loads(told.stdout)["rows"]
    return taken / int(row["runs"])


def _runs(name: str) -> ScenarioRuns:
    tree = load(name)
    scenario = change_scenario({"ticks": 150}, {})
    runs = ScenarioRuns(tree.path, content_of(tree), Additions(), scenario, "benchmark", _UNUSUAL)
    runs([0])
    return runs


def _each(runs: ScenarioRuns, seeds: range) -> float:
    return timed(lambda: runs(seeds)) / len(seeds)
