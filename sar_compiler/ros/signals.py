"""Handling of SIGINT, SIGTERM and SIGHUP with a flag instead of an interruption."""

import signal
import socket
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

from sar_compiler.process_end import end_at_once

_NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Signals that arrive together are one request: closing a terminal sends two, and so does `timeout`.
_TOGETHER_SEC = 0.5
UNNOTICED_SEC = 1.0
"""The time in which a request to stop must be noticed, steady seconds."""
# Time limit for the last steps before an immediate end, seconds.
_LAST_WORDS_SEC = 1.0


class StopSignals:
    """Records requests to stop the process, from its creation on.

    rclpy's own handlers would shut ROS down in the middle of a callback, before an active goal could be cancelled.
    Python's own raises `KeyboardInterrupt` at an arbitrary point. A signal that was ignored at the start of the process
    (`nohup`) stays ignored.

    The first signal requests an orderly end. The second SIGINT or SIGTERM ends the process, whatever its main thread is
    doing, because a separate thread listens. Only code that holds Python's interpreter lock is not interrupted.

    Attributes:
        came_at: The time of the first request to stop, steady seconds; None before.
        is_noticed: Whether the program has seen the request by `came`.
        ends_unnoticed: Whether a request that stays unnoticed for 1 s ends the process, as during the start.
        last_words: Called in that thread before an immediate end, which it can delay by 1 s at most; returns the exit
            status of that end, or None for the signal's.
    """

    def __init__(self) -> None:
        self.last_words: Callable[[], int | None] | None = None
        self.came_at: float | None = None
        self.is_noticed = self.ends_unnoticed = False
        self._number = self._own = 0
        self._interrupts = False
        self._came = threading.Event()
        # Python writes the number of each signal here on arrival, even if the main thread is busy.
        self._ear, mouth = socket.socketpair()
        mouth.settimeout(0.0)  # it never blocks
        self._mouth = mouth
        self._listener_before = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
        self._before = {
            number: signal.signal(number, self._on_signal)
            for number in _NUMBERS
            if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN
        }
        self._listener = threading.Thread(target=self._listen, name="signals", daemon=True)
        self._listener.start()

    @property
    def came(self) -> bool:
        """Whether a request to stop has arrived."""
        self.is_noticed = self._came.is_set()
        return self.is_noticed

    @property
    def exit_status(self) -> int:
        """The exit status of a process ended by the received signal (129, 130, 143)."""
        return 128 + self._number

    def wait(self, timeout_sec: float) -> bool:
        """Wait for a request to stop, with a time limit in seconds; return whether there was one."""
        return self._came.wait(timeout_sec)

    def interrupt_main(self) -> None:
        """Raise `KeyboardInterrupt` in the main thread, even if it does not wait for an executor."""
        number = next(iter(self._before), None)
        if number is not None:
            self._interrupts, self._own = True, number
            signal.pthread_kill(threading.main_thread().ident or 0, number)

    def restore_handlers(self) -> None:
        """Restore the previous handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._listener_before)
        self._mouth.close()
        self._listener.join(_LAST_WORDS_SEC)

    def _listen(self) -> None:
        while numbers := self._read_signals():
            for number in (each for each in numbers if each in self._before):
                if number == self._own:
                    self._own = 0
                elif self.came_at is None:
                    self.came_at, self._number = time.monotonic(), number
                    self._came.set()
                    self._ear.settimeout(UNNOTICED_SEC)
                elif number != signal.SIGHUP and time.monotonic() - self.came_at > _TOGETHER_SEC:
                    self._number = number
                    self._exit_at_once()
        self._ear.close()

    def _read_signals(self) -> bytes:
        """Return the numbers of the next signals; empty after listening has ended."""
        try:
            return self._ear.recv(64)
        except TimeoutError:
            self._ear.settimeout(None)
        if self.ends_unnoticed and not self.is_noticed:
            self._exit_at_once()
        return self._read_signals()

    def _exit_at_once(self) -> NoReturn:
        """End the process at once."""
        end_at_once(self.exit_status, self.last_words or (lambda: None), _LAST_WORDS_SEC)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        """Interrupt the main thread if requested; otherwise the listening thread handles the signal."""
        if self._interrupts:
            self._interrupts = False
            raise KeyboardInterrupt
