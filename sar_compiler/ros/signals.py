"""SIGINT, SIGTERM and SIGHUP as a flag to query, instead of an interruption."""

import signal
import socket
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

from sar_compiler.process_end import end_at_once

_NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Signals that come together are one request: a terminal that is closed sends two, and so does `timeout`.
_TOGETHER_SEC = 0.5
UNNOTICED_SEC = 1.0
"""How long a request to stop may stay unnoticed, steady seconds."""
# How long what is done before a hurried end may take, seconds.
_LAST_WORDS_SEC = 1.0


class StopSignals:
    """Records that the process was asked to stop; handles the signals from its creation on.

    rclpy's own handlers would shut ROS down in the middle of a callback, before a goal in flight could be
    cancelled; Python's own raises `KeyboardInterrupt` at an arbitrary place. A signal that whoever started the
    process has turned off (`nohup`) stays so.

    The first signal asks for an end in order. The second SIGINT or SIGTERM ends the process, whatever its main thread
    is doing: a thread of its own listens. Only what keeps Python's interpreter lock to itself is not interrupted.

    Attributes:
        came_at: When the process was asked to stop, steady seconds; None until then.
        is_noticed: Whether anybody has learned of it by `came`.
        ends_unnoticed: Whether a request that nobody has learned of after 1 s ends the process: while it starts, there is nothing to cancel.
        last_words: Called in that thread before a hurried end, which it can delay by 1 s at most; returns the exit status of
            that end, or None for the signal's.
    """

    def __init__(self) -> None:
        self.last_words: Callable[[], int | None] | None = None
        self.came_at: float | None = None
        self.is_noticed = self.ends_unnoticed = False
        self._number = self._own = 0
        self._interrupts = False
        self._came = threading.Event()
        # Python writes the number of each signal here as it arrives, not only when the main thread gets to it.
        self._ear, mouth = socket.socketpair()
        mouth.settimeout(0.0)  # it never blocks
        self._mouth = mouth
        self._listener_before = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
        self._before = {
            number: signal.signal(number, self._let_go)
            for number in _NUMBERS
            if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN
        }
        self._listener = threading.Thread(target=self._listen, name="signals", daemon=True)
        self._listener.start()

    @property
    def came(self) -> bool:
        """Whether the process was asked to stop."""
        self.is_noticed = self._came.is_set()
        return self.is_noticed

    @property
    def exit_status(self) -> int:
        """The exit status of a process ended by the received signal (129, 130, 143)."""
        return 128 + self._number

    def wait(self, timeout_sec: float) -> bool:
        """Wait until the process is asked to stop, with a time limit in seconds; return whether it was."""
        return self._came.wait(timeout_sec)

    def interrupt_main(self) -> None:
        """Raise `KeyboardInterrupt` in the main thread, also where that waits for something else than an executor."""
        number = next(iter(self._before), None)
        if number is not None:
            self._interrupts, self._own = True, number
            signal.pthread_kill(threading.main_thread().ident or 0, number)

    def give_back(self) -> None:
        """Restore the previous handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._listener_before)
        self._mouth.close()
        self._listener.join(_LAST_WORDS_SEC)

    def _listen(self) -> None:
        while numbers := self._heard():
            for number in (each for each in numbers if each in self._before):
                if number == self._own:
                    self._own = 0
                elif self.came_at is None:
                    self.came_at, self._number = time.monotonic(), number
                    self._came.set()
                    self._ear.settimeout(UNNOTICED_SEC)
                elif number != signal.SIGHUP and time.monotonic() - self.came_at > _TOGETHER_SEC:
                    self._number = number
                    self._leave()
        self._ear.close()

    def _heard(self) -> bytes:
        """Return the numbers of the signals that come next; empty once no more are listened to."""
        try:
            return self._ear.recv(64)
        except TimeoutError:
            self._ear.settimeout(None)
        if self.ends_unnoticed and not self.is_noticed:
            self._leave()
        return self._heard()

    def _leave(self) -> NoReturn:
        """End the process at once."""
        end_at_once(self.exit_status, self.last_words or (lambda: None), _LAST_WORDS_SEC)

    def _let_go(self, _number: int, _frame: FrameType | None) -> None:
        """Interrupt the main thread if that is wanted; else system calls go on waiting, and the listening thread receives the signal."""
        if self._interrupts:
            self._interrupts = False
            raise KeyboardInterrupt
