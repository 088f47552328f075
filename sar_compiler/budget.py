"""The limits of an analysis: time, memory, and Ctrl-C.

Even a small tree can have more states than fit into memory, because the number of states grows exponentially with the number of variables.
Every analysing command therefore has a budget, and prints its results so far when the budget is spent. Some code never checks whether to
stop, so an analysis ends in two steps:

1. The budget is *spent*. A search checks the budget every few hundred ticks, stops, and evaluates its results.
2. If the analysis continues for longer than a grace period, it is *abandoned*, and its last published result is used (`publish`). The
   analysis runs in a separate thread, so that the waiting thread can handle signals even while a library computes. To end an
   abandoned analysis, the waiting thread raises an exception in its thread, at the next Python instruction.
"""

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar, cast

from sar_compiler.commands import INTERRUPTED, status_of_interrupt
from sar_compiler.errors import SarError

T = TypeVar("T")

MAX_SEC, MAX_MEMORY_MB = 60.0, 2000
"""The default limits of an analysis."""

WORK = 1 << 24
"""The default limit of the work for searching the runs of a file.

It suffices for about 80,000 ticks of 10 nodes, or 4,000 ticks of 4,000 nodes.
"""
_FILES_WITH_FULL_WORK = 10
"""The number of files above which the work for each file is reduced, at most to a sixteenth."""

_MB = 1_000_000
_RSS_UNIT = 1 if sys.platform == "darwin" else 1024
_POLL_SEC = 0.05
# The fractions of the time limit and the memory limit by which an analysis may exceed them before it is abandoned.
_EXTRA_TIME, _EXTRA_MEMORY = 0.2, 0.5


def work_for(files: int) -> int:
    """Return the limit of the work for searching the runs of one file, given the number of checked files."""
    return min(WORK, max(WORK * _FILES_WITH_FULL_WORK // max(files, 1), WORK // 16))


class Progress(NamedTuple):
    """The progress of a search.

    Attributes:
        states: The number of states found.
        expanded: The number of states explored.
        steps: The number of steps between states.
        depth: The number of ticks from the start to the current state.
        broken: The names of the properties violated so far.
    """

    states: int
    expanded: int
    steps: int
    depth: int
    broken: tuple[str, ...] = ()


class BudgetSpentError(SarError):
    """An analysis was abandoned without a result.

    Args:
        budget: The spent budget of the analysis.
    """

    def __init__(self, budget: "Budget") -> None:
        super().__init__(f"there is no result yet, because the analysis was {budget.reason}")
        self.exit_status = budget.exit_status


class Budget:
    """The limits of an analysis.

    Args:
        max_sec: The maximum time since the creation of the budget, in seconds of *clock*.
        max_memory_mb: The maximum memory of the process, in MB (10^6 bytes).
        patience_sec: The grace period, in seconds, between spending the budget and abandoning the analysis; 0 for code that never checks
                      whether to stop.
        clock: The clock of the time limit: by default, processor time. For work in other processes, pass `time.monotonic`.
        on_progress: Called repeatedly with the progress of a search, in the thread of the analysis.
        memory: Returns the memory of the process, in MB (10^6 bytes). The default is the peak memory, which never
            decreases, so it only suits a process that ends with the analysis.

    Attributes:
        reason: The reason why the budget is spent, in words; empty until then.
        is_interrupted: Whether a signal that ends a command, such as Ctrl-C, has spent the budget.
    """

    def __init__(
        self,
        max_sec: float = math.inf,
        max_memory_mb: float = math.inf,
        patience_sec: float = 2.0,
        clock: Callable[[], float] = time.process_time,
        on_progress: Callable[[Progress], object] = lambda _progress: None,
        memory: Callable[[], float] | None = None,
    ) -> None:
        self.reason = ""
        self.is_interrupted = False
        self._interrupt_status = INTERRUPTED
        self._max_sec, self._max_memory_mb, self._patience_sec = max_sec, max_memory_mb, patience_sec
        self._clock, self._begun, self._spent_at = clock, clock(), math.inf
        self._published: Callable[[], object] | None = None
        self._on_progress, self._memory = on_progress, memory or memory_mb

    def report(self, progress: Progress) -> bool:
        """Report the progress of a search; return whether it must stop."""
        self._on_progress(progress)
        return self.is_spent()

    def is_spent(self) -> bool:
        """Return whether the analysis must stop."""
        if not self.reason and self._clock() - self._begun > self._max_sec:
            self.spend(f"stopped after {self._max_sec:g} s. Raise the limit with --max-seconds")
        if not self.reason and self._memory() > self._max_memory_mb:
            self.spend(f"stopped at {self._max_memory_mb:g} MB of memory. Raise the limit with --max-memory")
        return bool(self.reason)

    @property
    def exit_status(self) -> int:
        """The exit status of a command whose budget is spent: 130 after Ctrl-C, otherwise 1 (an undecided result)."""
        return self._interrupt_status if self.is_interrupted else 1

    def spend(self, reason: str) -> None:
        """Mark the budget as spent. Only the first reason is kept."""
        if not self.reason:
            self.reason, self._spent_at = reason, time.monotonic()

    def spend_by(self, interrupt: KeyboardInterrupt) -> None:
        """Mark the budget as spent because of Ctrl-C or another signal.

        Raises:
            KeyboardInterrupt: At the second Ctrl-C.
        """
        if self.is_interrupted:
            raise interrupt
        self.is_interrupted, self.reason = True, ""
        self._interrupt_status = status = status_of_interrupt(interrupt)
        self.spend(f"stopped by {'Ctrl-C' if status == INTERRUPTED else signal.Signals(status - 128).name}")

    def divide_memory(self, processes: int) -> None:
        """Divide the memory limit of this process by the number of processes that share the budget."""
        self._max_memory_mb /= processes

    def publish(self, result: Callable[[], object]) -> None:
        """Set the function that builds the result so far. `run` calls it if the analysis is abandoned."""
        self._published = result

    def run(self, work: Callable[[], T]) -> T:
        """Run an analysis and return its result. If the analysis is abandoned, return its last published result.

        Args:
            work: The analysis. It can be abandoned anywhere, so it must hold no lock and write no file.

        Raises:
            BudgetSpentError: If the analysis was abandoned before it published a result.
            KeyboardInterrupt: At the second Ctrl-C.
            Exception: Any exception of the analysis.
        """
        self._published = None
        outcome = _WorkOutcome()
        thread = threading.Thread(target=outcome.execute, args=(work,), name="analysis", daemon=True)
        # `is_started` is set first, because Ctrl-C can interrupt `start` when the thread already runs but has no `ident` yet.
        is_started = False
        while True:
            try:
                if self.is_spent() and self._must_abandon():
                    _raise_exit_in(thread)
                    return cast("T", self._last_published())
                if not is_started:
                    is_started = True
                    thread.start()
                if outcome.is_available.wait(_POLL_SEC):
                    break
            except KeyboardInterrupt as interrupt:
                self.spend_by(interrupt)
        if outcome.error is not None:
            raise outcome.error
        return cast("T", outcome.result)

    def _must_abandon(self) -> bool:
        patience_sec = self._patience_sec
        if patience_sec and not self.is_interrupted:
            patience_sec = max(patience_sec, _EXTRA_TIME * min(self._max_sec, MAX_SEC))
        is_too_large = self._memory() > self._max_memory_mb * (1.0 + _EXTRA_MEMORY)
        return is_too_large or time.monotonic() - self._spent_at >= patience_sec

    def _last_published(self) -> object:
        if self._published is None:
            raise BudgetSpentError(self)
        return self._published()


class _WorkOutcome:
    """The result or the exception of a function that another thread calls."""

    def __init__(self) -> None:
        self.result: object = None
        self.error: BaseException | None = None
        self.is_available = threading.Event()

    def execute(self, work: Callable[[], object]) -> None:
        try:
            self.result = work()
        except BaseException as error:  # noqa: BLE001 - raised again in the waiting thread
            self.error = error
        finally:
            self.is_available.set()


class _AbandonedExit(SystemExit):
    """The exception that ends the thread of an abandoned analysis. As a `SystemExit`, it prints no traceback."""


def _raise_exit_in(thread: threading.Thread) -> None:
    """Raise `_AbandonedExit` in a thread at its next Python instruction.

    Nothing is raised under a debugger or a coverage tool. In CPython 3.11, the calling thread would then stop at its next
    function call until the exception is raised, possibly forever.
    """
    if thread.ident is not None and sys.gettrace() is None:
        import ctypes

        error = ctypes.py_object(_AbandonedExit)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), error)


def memory_now_mb() -> float:
    """Return the memory that this process currently uses, in MB (10^6 bytes).

    If the system does not report this value, return the peak memory.
    """
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return memory_mb()
    return pages * os.sysconf("SC_PAGESIZE") / _MB


def memory_mb() -> float:
    """Return the peak memory of this process, in MB (10^6 bytes)."""
    try:
        import resource
    except ImportError:  # a browser has no such module
        return 0.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _RSS_UNIT / _MB
