"""Enumerates every possible run of a small tree with its probability, one run after another."""

import math
from itertools import pairwise
from typing import NamedTuple

from sar_compiler.analysis.simulate import scenario_run
from sar_compiler.analysis.simulate.reused_tree import ReusedTree
from sar_compiler.analysis.simulate.scenario_files import Scenario
from tests.analysis.predict.stage import CHANCES, PERIOD_SEC, file_of
from tests.analysis.verify.stage import bound, simulated_tree


class TooManyRunsError(Exception):
    """A tree has too many runs, or runs that are too long."""


class PlayedTick(NamedTuple):
    """A tick: its time, the outcomes of leaves, and the root's status."""

    now: float
    answers: tuple[tuple[int, str, str], ...]
    root: str


class PlayedRun(NamedTuple):
    """A run: its ticks, its probability, and whether it succeeded."""

    ticks: tuple[PlayedTick, ...]
    p: float
    succeeded: bool


class _EnumeratedChoices:
    """Replaces the random source: repeats the choices of a run, then takes each first option."""

    def __init__(self):
        self.path, self.counts, self.at, self.p = [], [], 0, 1.0

    def _pick(self, options):
        """Return one of some options, each given with its probability."""
        if self.at == len(self.path):
            self.path.append(0)
            self.counts.append(len(options))
        option, p = options[self.path[self.at]]
        self.at += 1
        self.p *= p
        return option

    def choices(self, population, weights):
        return [self._pick([each for each in zip(population, weights, strict=True) if each[1] > 0.0])]

    def uniform(self, low, high):
        """Return the middle of one of the intervals between ticks."""
        if low == high:
            return low
        grid = [n * PERIOD_SEC for n in range(math.floor(low / PERIOD_SEC) + 1, math.ceil(high / PERIOD_SEC))]
        ends = [low, *grid, high]
        return self._pick([((a + b) / 2, (b - a) / (high - low)) for a, b in pairwise(ends)])

    def advance(self):
        """Move to the next combination of choices; return whether there is one."""
        while self.path and self.path[-1] + 1 == self.counts[-1]:
            self.path.pop(), self.counts.pop()
        if self.path:
            self.path[-1] += 1
        self.at, self.p = 0, 1.0
        return bool(self.path)


def every_run(body, monkeypatch, *, most=1500, max_ticks=60):
    """Return all runs of a tree.

    Raises:
        TooManyRunsError: If there are more than `most` runs, or some have not ended after `max_ticks` ticks.
    """
    decided = _EnumeratedChoices()
    monkeypatch.setattr(scenario_run, "Random", lambda _seed: decided)
    tree = ReusedTree(simulated_tree(bound(body), file_of(body, CHANCES)))
    runs: list[PlayedRun] = []
    while True:
        run = tree.play(Scenario(period_sec=PERIOD_SEC, max_ticks=max_ticks)).run
        if not run.ended or run.trouble or len(runs) == most:
            raise TooManyRunsError(body)
        runs.append(PlayedRun(tuple(map(_played_tick, run.ticks)), decided.p, run.root == "SUCCESS"))
        if not decided.advance():
            return runs


def _played_tick(tick):
    end = tick.events[-1]
    answers = tuple((event.number, event.status, event.label) for event in tick.events if event.outcome)
    return PlayedTick(end.time_sec, answers, end.status)
