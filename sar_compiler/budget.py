"""The limits of an analysis: its time, its memory, and a user who presses Ctrl-C.

A tree of a few lines can have more states than any machine can hold, because its numbers multiply. Every analysing command therefore has a
budget, and prints its results when the budget is spent. There are two steps, because not all code can be asked to stop:

1. The budget is *spent*: a search checks this every few hundred ticks, stops, and evaluates its results.
2. After some patience the analysis is *abandoned*. It runs in a thread of its own, so that the waiting thread handles signals at any time,
   even while a library computes. The last published result is used (`publish`). An exception is raised in the abandoned thread, which ends
   it at its next Python instruction.
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
"""The default work for trying the runs of a file: some 80,000 ticks of 10 nodes, or 4,000 of 4,000."""
_FILES_TRIED = 10
"""For more files, less of each is tried, down to a sixteenth."""

_MB = 1_000_000
_RSS_UNIT = 1 if sys.platform == "darwin" else 1024
_POLL_SEC = 0.05
# Evaluating results may exceed the time limit by this share, and the memory limit by this share until the analysis is abandoned.
_MORE_TIME, _MORE_MEMORY = 0.2, 0.5


def work_for(files: int) -> int:
    """Return the work for trying the runs of each of some files, which depends only on their number."""
    return min(WORK, max(WORK * _FILES_TRIED // max(files, 1), WORK // 16))


class Progress(NamedTuple):
    """The progress of a search.

    Attributes:
        states: Number of states found.
        expanded: Number of states explored.
        steps: Number of steps.
        depth: Number of ticks to the current state.
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
        budget: Its budget.
    """

    def __init__(self, budget: "Budget") -> None:
        super().__init__(f"nothing is known yet: {budget.reason}")
        self.exit_status = budget.exit_status


class Budget:
    """The limits of an analysis.

    Args:
        max_sec: Its processor time, seconds, from now on.
        max_memory_mb: The memory of the process, 10^6 bytes.
        patience_sec: How long it may continue after its user stopped it, seconds; 0 for code that never checks whether to stop.
        clock: The clock of the time limit; `time.monotonic` for work in other processes.
        on_progress: Called now and then with the progress of a search, in the thread of the analysis.
        memory: Returns the memory of the process, 10^6 bytes: by default the peak, which only suits a process that ends with
                the analysis.

    Attributes:
        reason: Why it is spent, in words; empty before.
        is_interrupted: Whether the reason is Ctrl-C, or another signal that ends a command like it.
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
            self.spend(f"stopped after {self._max_sec:g} s: raise the limit with --max-seconds")
        if not self.reason and self._memory() > self._max_memory_mb:
            self.spend(f"stopped at {self._max_memory_mb:g} MB of memory: raise the limit with --max-memory")
        return bool(self.reason)

    @property
    def exit_status(self) -> int:
        """The status of a command whose budget is spent: 130 after Ctrl-C, otherwise 1, as for an undecided result."""
        return self._interrupt_status if self.is_interrupted else 1

    def spend(self, reason: str) -> None:
        """Spend the budget; only the first reason is kept."""
        if not self.reason:
            self.reason, self._spent_at = reason, time.monotonic()

    def divide_memory(self, processes: int) -> None:
        """Let this process, one of several that share the budget, stop at its part of the memory."""
        self._max_memory_mb /= processes

    def publish(self, result: Callable[[], object]) -> None:
        """Set the function that builds the result so far, which `run` returns for an abandoned analysis."""
        self._published = result

    def run(self, work: Callable[[], T]) -> T:
        """Return the result of an analysis, or its last published one.

        Args:
            work: The analysis. It can be abandoned anywhere, so it must hold no lock and write no file.

        Raises:
            BudgetSpentError: If it was abandoned before it published a result.
            KeyboardInterrupt: At the second Ctrl-C.
            Exception: Any exception of the work.
        """
        self._published = None
        outcome = _Work()
        thread = threading.Thread(target=outcome.work_out, args=(work,), name="analysis", daemon=True)
        # Set before the start: Ctrl-C can interrupt `start` after the thread began but before its `ident` is set.
        is_started = False
        while True:
            try:
                if self.is_spent() and self._is_left_behind():
                    _end(thread)
                    return cast("T", self._last_published())
                if not is_started:
                    is_started = True
                    thread.start()
                if outcome.is_there.wait(_POLL_SEC):
                    break
            except KeyboardInterrupt as interrupt:
                if self.is_interrupted:
                    raise
                self.is_interrupted, self.reason = True, ""
                self._interrupt_status = status = status_of_interrupt(interrupt)
                self.spend(
                    f"stopped by {'Ctrl-C' if status == INTERRUPTED else signal.Signals(status - 128).name}"
                )
        if outcome.error is not None:
            raise outcome.error
        return cast("T", outcome.result)

    def _is_left_behind(self) -> bool:
        patience_sec = self._patience_sec
        if patience_sec and not self.is_interrupted:
            patience_sec = max(patience_sec, _MORE_TIME * min(self._max_sec, MAX_SEC))
        is_too_large = self._memory() > self._max_memory_mb * (1.0 + _MORE_MEMORY)
        return is_too_large or time.monotonic() - self._spent_at >= patience_sec

    def _last_published(self) -> object:
        if self._published is None:
            raise BudgetSpentError(self)
        return self._published()


class _Work:
    """Some work of a thread, and its result."""

    def __init__(self) -> None:
        self.result: object = None
        self.error: BaseException | None = None
        self.is_there = threading.Event()

    def work_out(self, work: Callable[[], object]) -> None:
        try:
            self.result = work()
        except BaseException as error:  # noqa: BLE001 - raised again in the waiting thread
            self.error = error
        finally:
            self.is_there.set()


class _LeftBehindExit(SystemExit):
    """Ends an abandoned analysis; threads print nothing for a SystemExit."""


def _end(thread: threading.Thread) -> None:
    """Raise an exception in a thread at its next Python instruction."""
    if thread.ident is not None:
        import ctypes

        error = ctypes.py_object(_LeftBehindExit)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), error)


def memory_now_mb() -> float:
    """Return the current memory of this process, 10^6 bytes; the peak if the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return memory_mb()
    return pages * os.sysconf("SC_PAGESIZE") / _MB


def memory_mb() -> float:
    """Return the peak memory of this process, 10^6 bytes."""
    try:
        import resource
    except ImportError:  # in a browser
        return 0.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _RSS_UNIT / _MB
