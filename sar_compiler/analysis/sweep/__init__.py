"""Estimates the success rate of a mission by Monte Carlo runs, for each combination of varied values."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass, field
from math import sqrt
from statistics import NormalDist
from typing import NamedTuple

from sar_compiler.analysis.sweep.workers import ReplaceableExecutor
from sar_compiler.errors import SarError


class Interval(NamedTuple):
    """An interval of probabilities.

    Attributes:
        low: The lower bound.
        high: The upper bound.
    """

    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half the distance between the lower and the upper bound."""
        return (self.high - self.low) / 2.0


def wilson(successes: int, runs: int, confidence: float) -> Interval:
    """Return the Wilson score interval of a success rate, which is also accurate near 0 and 1.

    Args:
        successes: The number of runs that have succeeded.
        runs: The number of runs; for 0, the interval contains all probabilities.
        confidence: The probability that the interval contains the true rate, between 0 and 1.
    """
    if not runs:
        return Interval(0.0, 1.0)
    z = NormalDist().inv_cdf((1.0 + confidence) / 2.0)
    rate, weight = successes / runs, 1.0 + z * z / runs
    centre = (rate + z * z / (2.0 * runs)) / weight
    spread = z * sqrt(rate * (1.0 - rate) / runs + z * z / (4.0 * runs * runs)) / weight
    low = 0.0 if successes == 0 else centre - spread
    return Interval(low, 1.0 if successes == runs else centre + spread)


# The number of times that workers may terminate during the same batch before the sweep ends.
_MAX_ATTEMPTS = 4


class SweepError(SarError):
    """Raised if the Monte Carlo runs cannot continue, because workers have terminated repeatedly."""


class RunResultSample(NamedTuple):
    """The result of one run.

    Attributes:
        seed: The seed of the run.
        failure: The unmet expectations; empty if the run has succeeded.
        time_sec: The duration of the run, in seconds of simulated time.
        counts: The number of times that each counted event happened, by event name.
        size: The distance of the run from a default run; the smaller it is, the easier the run is to understand.
    """

    seed: int
    failure: str
    time_sec: float
    counts: Mapping[str, float] = {}
    size: tuple[int, ...] = ()


PlayRuns = Callable[[Sequence[int]], list[RunResultSample]]
"""A function that plays a run for each seed. It can be pickled, and returns the same results in all processes."""


@dataclass(frozen=True)
class StoppingRule:
    """The condition under which a row needs no more runs.

    Attributes:
        runs: The maximum number of runs.
        half_width: The runs end when the half-width of the confidence interval is at most this value.
        confidence: The confidence of the interval, between 0 and 1.
        batch: The number of runs between two checks of the condition.
    """

    runs: int
    half_width: float
    confidence: float = 0.95
    batch: int = 25

    def interval(self, outcomes: Sequence[RunResultSample]) -> Interval:
        """Return the confidence interval of the success rate."""
        return wilson(sum(not each.failure for each in outcomes), len(outcomes), self.confidence)

    def is_enough(self, outcomes: Sequence[RunResultSample]) -> bool:
        """Return whether a row with these results needs no more runs."""
        return len(outcomes) >= self.runs or self.interval(outcomes).half_width <= self.half_width


@dataclass(eq=False)
class SweepRow:
    """A combination of the varied values, with the results of the runs for this combination.

    Attributes:
        labels: The values as text, by the name of the varied item.
        play: Plays runs of the combination.
        outcomes: The results of the runs, in the order of their seeds.
        is_done: Whether no more runs are needed.
        asked: The number of runs that were requested from workers.
    """

    labels: Mapping[str, str]
    play: PlayRuns
    outcomes: list[RunResultSample] = field(default_factory=list)
    is_done: bool = False
    asked: int = 0
    _early: dict[int, list[RunResultSample]] = field(default_factory=dict)

    def needs_no_more_runs(self, rule: StoppingRule) -> bool:
        """Return whether enough runs of the row were requested from workers."""
        return self.is_done or self.asked >= rule.runs

    def next_batch(self, rule: StoppingRule, seed: int) -> "_Batch":
        """Return the next runs to request from workers."""
        first, self.asked = self.asked, min(self.asked + rule.batch, rule.runs)
        return _Batch(self, first, range(seed + first, seed + self.asked))

    def add(self, first: int, outcomes: list[RunResultSample], rule: StoppingRule) -> None:
        """Store the results of a batch, and add them when the results of all earlier batches are known."""
        self._early[first] = outcomes
        while not self.is_done and len(self.outcomes) in self._early:
            self.outcomes += self._early.pop(len(self.outcomes))
            self.is_done = rule.is_enough(self.outcomes)


class _Batch(NamedTuple):
    row: SweepRow
    first: int
    seeds: range


ShowRows = Callable[[Sequence[SweepRow]], object]
"""A function that receives all rows after each batch."""


def sweep(
    rows: Sequence[SweepRow], rule: StoppingRule, seed: int, workers: ReplaceableExecutor, report: ShowRows
) -> None:
    """Play runs of all rows until every row meets the stopping rule.

    Args:
        rows: The rows, to which the results are added.
        rule: The stopping rule.
        seed: The seed of the first run of each row. Later runs of the row have consecutive seeds.
        workers: The executor of the runs.
        report: Called with the rows after each batch.

    Raises:
        SweepError: If workers terminate repeatedly during the same runs.
        Exception: Any exception that a run raises.
    """
    waiting: dict[Future[list[RunResultSample]], _Batch] = {}
    again: list[_Batch] = []
    attempts: Counter[_Batch] = Counter()
    while True:
        while len(waiting) < workers.ahead and (batch := _next_batch(rows, rule, seed, again)) is not None:
            waiting[workers.submit(batch.row.play, batch.seeds)] = batch
        if not waiting:
            return
        for future in wait(waiting, return_when=FIRST_COMPLETED).done:
            batch = waiting.pop(future)
            try:
                batch.row.add(batch.first, future.result(), rule)
            except BrokenExecutor as error:
                attempts[batch] += 1
                if attempts[batch] == _MAX_ATTEMPTS:
                    message = f"worker processes have terminated {_MAX_ATTEMPTS} times during the runs with {_batch_label(batch)}"
                    raise SweepError(message) from error
                again.append(batch)
        report(rows)


def _next_batch(
    rows: Sequence[SweepRow], rule: StoppingRule, seed: int, again: list[_Batch]
) -> _Batch | None:
    """Return the next batch to play, either from a terminated worker or for the row with the fewest runs."""
    if again:
        return again.pop(0)
    row = min(
        (row for row in rows if not row.needs_no_more_runs(rule)), key=lambda row: row.asked, default=None
    )
    return None if row is None else row.next_batch(rule, seed)


def _batch_label(batch: _Batch) -> str:
    labels = ", ".join(f"{name} {value}" for name, value in batch.row.labels.items())
    return f"seeds {batch.seeds[0]} to {batch.seeds[-1]}" + (f" of {labels}" if labels else "")


def smallest_failure(rows: Sequence[SweepRow]) -> tuple[SweepRow, RunResultSample] | None:
    """Return the failed run that differs least from a default run, with its row, or None if none failed."""
    failed = [(row, outcome) for row in rows for outcome in row.outcomes if outcome.failure]
    return min(failed, key=lambda each: each[1].size, default=None)
