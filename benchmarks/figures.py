"""Figures: what was measured beside its references, in turns, as medians with their spread."""

import gc
import multiprocessing
import resource
import statistics
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple, ParamSpec, TypeVar

T = TypeVar("T")
P = ParamSpec("P")

LOOP = "a loop in Python"
"""The reference of what has no other: a fixed piece of work, so that a faster machine makes no difference."""

# Linux counts the memory of a process in these.
_KIBIBYTE = 1024
_AT_LEAST_SEC = 0.05
_LOOPS = 200_000
_FEW = 3


class Figure(NamedTuple):
    """One thing beside one reference.

    Attributes:
        subject: What was measured.
        against: What it is compared with; empty for a figure that is the same on any machine, such as bytes.
        ratio: The median of the ratios of all rounds; more is worse.
        low: Their lower quartile.
        high: Their upper quartile.
        ours: The median of the subject itself, in `unit`.
        unit: A key of `tables.UNITS`.
    """

    subject: str
    against: str
    ratio: float
    low: float
    high: float
    ours: float
    unit: str


class Missing(NamedTuple):
    """Something that could not be measured.

    Attributes:
        subject: What; empty for whatever stands beside this reference.
        against: Beside which reference; empty for any.
        reason: Why.
    """

    subject: str
    against: str
    reason: str


class Effort(NamedTuple):
    """How much is measured.

    Attributes:
        rounds: How often each thing is measured.
        share: How large trees are and how long searches go on, as a share of the whole; 1 but for a trial.
    """

    rounds: int
    share: float

    @property
    def few(self) -> int:
        """How often something that takes long is measured."""
        return min(self.rounds, _FEW)

    def size(self, whole: int) -> int:
        """Return a size for this effort."""
        return max(int(whole * self.share), 10)


Result = Figure | Missing


def timed(action: Callable[[], object], count: int = 1) -> float:
    """Return the CPU seconds of this process that an action takes, as the mean of so many times in a row."""
    gc.collect()
    start = time.process_time()
    for _ in range(count):
        made = action()
    seconds = time.process_time() - start
    del made
    return seconds / count


def often(seconds: Callable[[int], float]) -> Callable[[], float]:
    """Let something be done so often in a row that the time can be measured.

    Args:
        seconds: Does it so many times, and returns the mean time.
    """
    count = max(1, int(_AT_LEAST_SEC / max(seconds(1), 1e-7)))
    return lambda: seconds(count)


def loop() -> float:
    """Return the CPU seconds of a fixed piece of work: calls, attributes, dictionaries and lists."""

    def work() -> None:
        table: dict[int, list[int]] = {}
        for number in range(_LOOPS):
            table.setdefault(number % 1000, []).append(number)

    return timed(work)


def in_turns(actions: Mapping[str, Callable[[], T]], rounds: int) -> dict[str, list[T]]:
    """Return what each action says in each round; a round is one call of every action."""
    taken: dict[str, list[T]] = {name: [] for name in actions}
    for _ in range(rounds):
        for name, action in actions.items():
            taken[name].append(action())
    return taken


def compared(
    subject: str, ours: Sequence[float], references: Mapping[str, Sequence[float]], unit: str = "s"
) -> Iterator[Figure]:
    """Yield the figures of what was measured in the same rounds as its references."""
    for against, theirs in references.items():
        ratios = [one / other for one, other in zip(ours, theirs, strict=True)]
        yield Figure(subject, against, *quartiles(ratios), statistics.median(ours), unit)


def plain(subject: str, value: float, unit: str) -> Figure:
    """Return a figure without a reference.

    Raises:
        ValueError: If it is not above 0: then its gauge does not work.
    """
    if value <= 0:
        message = f"{subject}: {value} {unit} is no figure; what it is measured with does not work"
        raise ValueError(message)
    return Figure(subject, "", value, value, value, value, unit)


def quartiles(values: Sequence[float]) -> tuple[float, float, float]:
    """Return the median, the lower and the upper quartile."""
    if len(values) == 1:
        return values[0], values[0], values[0]
    low, median, high = statistics.quantiles(values, n=4, method="inclusive")
    return median, low, high


def alone(measured: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Measure in a process of its own: what one leaves behind in memory slows the next one down."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(measured, *args, **kwargs).result()


def traced_peak(action: Callable[[], object]) -> int:
    """Return the most memory that Python holds at a time for an action, in bytes."""
    gc.collect()
    tracemalloc.start()
    kept = action()
    size = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    del kept
    return size


def most_memory() -> int:
    """Return the most memory that this process had since its program was started, in bytes.

    `getrusage` would say what the process had before as well, as a copy of the one that has started it.
    """
    return _memory("VmHWM")


def memory_now(process: int | str = "self") -> int:
    """Return the memory that a process, by default this one, has now, in bytes."""
    return _memory("VmRSS", process)


def _memory(field: str, process: int | str = "self") -> int:
    status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
    return int(status.partition(f"{field}:")[2].split()[0]) * _KIBIBYTE


def cpu_of_children() -> float:
    """Return the CPU seconds of all child processes that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
