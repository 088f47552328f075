"""Worker processes that compute a text for each item of a list."""

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
# The number of items that a copy is sent in advance, so that it does not wait for the next one.
_AHEAD = 2


class _WorkerProcess(NamedTuple):
    process: int
    orders: int
    answers: int
    pending: deque[int]
    received: bytearray


class ForkedWorkers:
    """Worker processes, forked from this process.

    A worker has everything that this process has imported and read, so it starts immediately. It has only the thread
    that created it, so create the workers before any other thread is started. Workers ignore Ctrl-C, and end with
    this process, even if it is killed.

    Args:
        work: Returns the text for a number; None if this process must compute it itself.
        numbers: The numbers.
        count: The number of workers.
        max_sec: The processor time of each worker, in seconds.
    """

    def __init__(
        self, work: Callable[[int], str | None], numbers: Iterable[int], count: int, max_sec: float
    ) -> None:
        self._work = work
        self._waiting = deque(numbers)
        self._copies: list[_WorkerProcess] = []
        self._max_sec = max_sec
        for _ in range(count):
            self._start()

    @staticmethod
    def are_possible() -> bool:
        """Return whether this process can be forked in its current state."""
        return hasattr(os, "fork") and threading.active_count() == 1

    def _start(self) -> None:
        orders_in, orders = os.pipe()
        answers, answers_out = os.pipe()
        process = os.fork()
        if process == 0:
            with suppress(BaseException):
                # Otherwise the pipes of the others would stay open when this process's parent ends.
                for descriptor in (orders, answers, *(each for copy in self._copies for each in copy[1:3])):
                    os.close(descriptor)
                self._serve(orders_in, answers_out)
            os._exit(0)
        os.close(orders_in)
        os.close(answers_out)
        self._copies.append(_WorkerProcess(process, orders, answers, deque(), bytearray()))
        self._send_orders(self._copies[-1])

    def _serve(self, orders: int, answers: int) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self._limit_time()
        while order := os.read(orders, _NUMBER):
            text = self._work(int.from_bytes(order, "big"))
            data = b"" if text is None else text.encode("utf-8", "surrogatepass")
            message = memoryview(len(data).to_bytes(_LENGTH, "big") + data)
            while message:
                message = message[os.write(answers, message) :]

    def _limit_time(self) -> None:
        import resource

        if math.isfinite(self._max_sec):
            limit = math.ceil(time.process_time() + self._max_sec) + 1
            with suppress(ValueError, OSError):
                resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

    def _send_orders(self, copy: _WorkerProcess) -> None:
        while self._waiting and len(copy.pending) < _AHEAD:
            copy.pending.append(self._waiting.popleft())
            with suppress(BrokenPipeError):  # it has died, which is detected when its results are read
                os.write(copy.orders, copy.pending[-1].to_bytes(_NUMBER, "big"))

    def results(self, is_over: Callable[[], bool]) -> Iterator[tuple[int, str | None]]:
        """Yield each item's number and text, in any order; None for a text that this process must compute.

        Args:
            is_over: Returns whether no more results are needed; called repeatedly.
        """
        while not is_over() and any(copy.pending for copy in self._copies):
            open_ones = {copy.answers: copy for copy in self._copies if copy.pending}
            for descriptor in select.select([*open_ones], [], [], _POLL_SEC)[0]:
                yield from self._receive(open_ones[descriptor])
        while not is_over() and self._waiting:  # all copies were killed
            yield self._waiting.popleft(), None

    def _receive(self, copy: _WorkerProcess) -> Iterator[tuple[int, str | None]]:
        data = os.read(copy.answers, 1 << 20)
        if not data:  # it was killed, for instance for lack of memory
            yield from ((number, None) for number in copy.pending)
            copy.pending.clear()
        copy.received.extend(data)
        while len(copy.received) >= _LENGTH:
            end = _LENGTH + int.from_bytes(copy.received[:_LENGTH], "big")
            if len(copy.received) < end:
                return
            text = bytes(copy.received[_LENGTH:end])
            del copy.received[:end]
            number = copy.pending.popleft()
            self._send_orders(copy)
            yield number, text.decode("utf-8", "surrogatepass") or None

    def terminate_workers(self) -> None:
        """Terminate the workers, regardless of their state."""
        for copy in self._copies:
            with suppress(ProcessLookupError):
                os.kill(copy.process, signal.SIGKILL)
            os.close(copy.orders)
            os.close(copy.answers)
            with suppress(ChildProcessError):
                os.waitpid(copy.process, 0)
        self._copies.clear()
