"""What a run of a sweep costs: the shipped trees, played by chance in one process."""

from collections.abc import Callable, Iterator
from functools import partial

from benchmarks.figures import LOOP, Effort, Result, compared, in_turns, loop, timed
from sar_compiler.project import Additions, load
from sar_compiler.project.swept import ScenarioRuns, change_scenario, content_of

TREES = {"plain": "search_and_rescue", "resilient": "search_and_rescue_resilient"}
_RUNS, _UNUSUAL = 2_000, 0.1


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


def _runs(name: str) -> ScenarioRuns:
    tree = load(name)
    scenario = change_scenario({"ticks": 150}, {})
    runs = ScenarioRuns(tree.path, content_of(tree), Additions(), scenario, "benchmark", _UNUSUAL)
    runs([0])
    return runs


def _each(runs: ScenarioRuns, seeds: range) -> float:
    return timed(lambda: runs(seeds)) / len(seeds)
