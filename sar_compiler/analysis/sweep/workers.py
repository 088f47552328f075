"""Provides the workers that play Monte Carlo runs: the current process or several worker processes."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from typing_extensions import Self

_Result = TypeVar("_Result")


class InlineExecutor(Executor):
    """Executes tasks immediately in the calling thread."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """Execute a task, and return a completed future with the result."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class ReplaceableExecutor:
    """An executor that is replaced by a new one if any of its processes is killed.

    Args:
        make: Creates an executor.
        count: The number of tasks that the executor runs in parallel.
        stop: Stops an executor, and drops tasks that have not started.

    Attributes:
        ahead: The number of tasks to submit before a result is awaited, so that no worker is idle.
    """

    def __init__(
        self, make: Callable[[], Executor], count: int, stop: Callable[[Executor], object] | None = None
    ) -> None:
        self.ahead = 2 * count if count > 1 else 1
        self._make = make
        self._stop = stop or (lambda executor: executor.shutdown(cancel_futures=True))
        self._executor = make()
        self._is_over = False

    def submit(self, work: "Callable[..., _Result]", *arguments: object) -> "Future[_Result]":
        """Submit a task. If the executor is broken, its tasks are lost, and a new executor receives the task.

        Raises:
            CancelledError: If the executor was stopped.
        """
        if self._is_over:
            raise CancelledError
        try:
            return self._executor.submit(work, *arguments)
        except BrokenExecutor:
            self._executor = self._make()
            return self._executor.submit(work, *arguments)

    def __enter__(self) -> "Self":
        return self

    def __exit__(self, error: object, *_: object) -> None:
        self._is_over = True
        if error is not None:
            # A run may take forever, and its result is no longer needed.
            for process in multiprocessing.active_children():
                process.kill()
        self._stop(self._executor)


def worker_processes(count: int) -> ReplaceableExecutor:
    """Return an executor with *count* worker processes. If *count* is 1, use the current process."""
    if count == 1:
        return ReplaceableExecutor(InlineExecutor, 1)
    # Spawned, because a forked process would copy locks that this process's threads hold.
    context = multiprocessing.get_context("spawn")
    return ReplaceableExecutor(lambda: ProcessPoolExecutor(count, context, live_with_parent), count)


def live_with_parent() -> None:
    """Make this worker process end when its parent ends, and ignore Ctrl-C, which the parent handles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None  # noqa: S101 - this is a worker
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)
