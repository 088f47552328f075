"""Handle SIGINT, SIGTERM and SIGHUP by setting a flag instead of interrupting the main thread."""

import signal
import socket
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

from sar_compiler.process_end import end_at_once

_NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Signals within this time, in seconds, are one request, because a closing terminal and `timeout` send two signals.
_TOGETHER_SEC = 0.5
UNNOTICED_SEC = 1.0
"""The maximum time until the program notices a request to stop, in seconds of the steady clock."""
# Time limit for the last steps before an immediate end, in seconds.
_LAST_WORDS_SEC = 1.0


class StopSignals:
    """Receives the signals that request to stop the process, as soon as this object is created.

    rclpy's handlers would shut ROS down during a callback, before active goals are cancelled. Python's handler would raise a
    `KeyboardInterrupt` at an arbitrary point. A signal that was ignored at the start of the process (`nohup`) stays ignored.

    The first signal requests a graceful end. A second SIGINT or SIGTERM ends the process even if the main thread is busy, because a
    separate thread receives the signal. Only code that holds Python's interpreter lock can prevent this.

    Attributes:
        came_at: The time of the first request to stop, in seconds of the steady clock; None if no request has arrived.
        is_noticed: Whether the program has noticed the request by reading `came`.
        ends_unnoticed: Whether a request ends the process if the program does not notice it within 1 s, as during the start.
        last_words: Called in the separate thread before an immediate end of the process. This function can delay the end by at most 1 s. It
            returns the exit status, or None for the signal's exit status.
    """

    def __init__(self) -> None:
        self.last_words: Callable[[], int | None] | None = None
        self.came_at: float | None = None
        self.is_noticed = self.ends_unnoticed = False
        self._number = self._own = 0
        self._interrupts = False
        self._came = threading.Event()
        # Python writes the number of each signal to this socket when the signal arrives, even if the main thread is busy.
        self._receiver, sender = socket.socketpair()
        sender.settimeout(0.0)  # writing never blocks
        self._sender = sender
        self._previous_wakeup_fd = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
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
        """The exit status that stands for the received signal (129, 130 or 143)."""
        return 128 + self._number

    def wait(self, timeout_sec: float) -> bool:
        """Wait at most *timeout_sec* for a request to stop; return whether a request has arrived."""
        return self._came.wait(timeout_sec)

    def interrupt_main(self) -> None:
        """Raise `KeyboardInterrupt` in the main thread, even if that thread does not spin an executor."""
        number = next(iter(self._before), None)
        if number is not None:
            self._interrupts, self._own = True, number
            signal.pthread_kill(threading.main_thread().ident or 0, number)

    def restore_handlers(self) -> None:
        """Restore the previous signal handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._previous_wakeup_fd)
        self._sender.close()
        self._listener.join(_LAST_WORDS_SEC)

    def _listen(self) -> None:
        while numbers := self._read_signals():
            for number in (each for each in numbers if each in self._before):
                if number == self._own:
                    self._own = 0
                elif self.came_at is None:
                    self.came_at, self._number = time.monotonic(), number
                    self._came.set()
                    self._receiver.settimeout(UNNOTICED_SEC)
                elif number != signal.SIGHUP and time.monotonic() - self.came_at > _TOGETHER_SEC:
                    self._number = number
                    self._exit_at_once()
        self._receiver.close()

    def _read_signals(self) -> bytes:
        """Wait for the next signals and return their numbers; return no numbers when the handlers are restored."""
        try:
            return self._receiver.recv(64)
        except TimeoutError:
            self._receiver.settimeout(None)
        if self.ends_unnoticed and not self.is_noticed:
            self._exit_at_once()
        return self._read_signals()

    def _exit_at_once(self) -> NoReturn:
        """End the process at once, after a call of `last_words`."""
        end_at_once(self.exit_status, self.last_words or (lambda: None), _LAST_WORDS_SEC)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        """Raise `KeyboardInterrupt` if `interrupt_main` requests it; leave other signals to the separate thread."""
        if self._interrupts:
            self._interrupts = False
            raise KeyboardInterrupt
