"""Worker processes that compute a text for each number in a list."""

import math
import os
import select
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import NamedTuple

_POLL_SEC = 0.05
_NUMBER, _LENGTH = 4, 8
# The maximum number of tasks that are sent to a worker in advance, so that it does not wait for the next task.
_MOST_PENDING = 2


class _WorkerProcess(NamedTuple):
    process: int
    tasks: int
    results: int
    pending: deque[int]
    received: bytearray


class ForkedWorkers:
    """Worker processes, which are forked from this process.

    A worker inherits the imported modules and the data of this process, so it starts immediately. Workers ignore Ctrl-C.
    They end with this process, even if this process is killed.

    Args:
        work: A function that returns the text for a number, or None if this process must compute the text itself.
        numbers: The numbers.
        max_sec: The maximum processor time of each worker, in seconds.
    """

    def __init__(self, work: Callable[[int], str | None], numbers: Iterable[int], max_sec: float) -> None:
        self._work = work
        self._waiting = deque(numbers)
        self._workers: list[_WorkerProcess] = []
        self._max_sec = max_sec

    def start(self, count: int) -> None:
        """Start workers. This must be done before any thread is started: a worker contains only the calling thread.

        Args:
            count: The number of workers.

        Raises:
            KeyboardInterrupt: If Ctrl-C was pressed meanwhile. All workers have been started, and must be terminated.
        """
        signals = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            for _ in range(count):
                self._start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, signals)

    @staticmethod
    def are_possible() -> bool:
        """Return whether this process can be forked in its current state."""
        return hasattr(os, "fork") and threading.active_count() == 1

    def _start(self) -> None:
        tasks_in, tasks = os.pipe()
        results, results_out = os.pipe()
        process = os.fork()
        if process == 0:
            with suppress(BaseException):
                # The worker must not keep the pipes of other workers open after the parent has ended.
                for descriptor in (
                    tasks,
                    results,
                    *(each for worker in self._workers for each in worker[1:3]),
                ):
                    os.close(descriptor)
                self._serve(tasks_in, results_out)
            os._exit(0)
        os.close(tasks_in)
        os.close(results_out)
        self._workers.append(_WorkerProcess(process, tasks, results, deque(), bytearray()))
        self._send_tasks(self._workers[-1])

    def _serve(self, tasks: int, results: int) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self._limit_time()
        while task := os.read(tasks, _NUMBER):
            text = self._work(int.from_bytes(task, "big"))
            data = b"" if text is None else text.encode("utf-8", "surrogatepass")
            message = memoryview(len(data).to_bytes(_LENGTH, "big") + data)
            while message:
                message = message[os.write(results, message) :]

    def _limit_time(self) -> None:
        import resource

        if math.isfinite(self._max_sec):
            limit = math.ceil(time.process_time() + self._max_sec) + 1
            with suppress(ValueError, OSError):
                resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

    def _send_tasks(self, worker: _WorkerProcess) -> None:
        while self._waiting and len(worker.pending) < _MOST_PENDING:
            worker.pending.append(self._waiting.popleft())
            with suppress(BrokenPipeError):  # a killed worker is detected when its results are read
                os.write(worker.tasks, worker.pending[-1].to_bytes(_NUMBER, "big"))

    def results(self, is_over: Callable[[], bool]) -> Iterator[tuple[int, str | None]]:
        """Yield each number with its text, in any order.

        The text is None if this process must compute it.

        Args:
            is_over: A function that returns whether no more results are needed. It is called repeatedly.
        """
        while not is_over() and any(worker.pending for worker in self._workers):
            busy = {worker.results: worker for worker in self._workers if worker.pending}
            for descriptor in select.select([*busy], [], [], _POLL_SEC)[0]:
                yield from self._receive(busy[descriptor])
        while not is_over() and self._waiting:  # numbers that are left because all workers were killed
            yield self._waiting.popleft(), None

    def _receive(self, worker: _WorkerProcess) -> Iterator[tuple[int, str | None]]:
        data = os.read(worker.results, 1 << 20)
        if not data:  # the worker was killed, for instance for lack of memory
            yield from ((number, None) for number in worker.pending)
            worker.pending.clear()
        worker.received.extend(data)
        while len(worker.received) >= _LENGTH:
            end = _LENGTH + int.from_bytes(worker.received[:_LENGTH], "big")
            if len(worker.received) < end:
                return
            text = bytes(worker.received[_LENGTH:end])
            del worker.received[:end]
            number = worker.pending.popleft()
            self._send_tasks(worker)
            yield number, text.decode("utf-8", "surrogatepass") or None

    def terminate_workers(self) -> None:
        """Kill all workers."""
        for worker in self._workers:
            with suppress(ProcessLookupError):
                os.kill(worker.process, signal.SIGKILL)
            os.close(worker.tasks)
            os.close(worker.results)
            with suppress(ChildProcessError):
                os.waitpid(worker.process, 0)
        self._workers.clear()
