"""SIGINT and SIGTERM as a flag to query, instead of an interruption."""

import signal
import threading
from types import FrameType

_NUMBERS = (signal.SIGINT, signal.SIGTERM)


class StopSignals:
    """Records that the process was asked to stop; handles both signals from its creation on.

    rclpy's own handlers would shut ROS down in the middle of a callback, before a goal in flight could be
    cancelled; Python's own raises `KeyboardInterrupt` at an arbitrary place.
    """

    def __init__(self) -> None:
        self._number = 0
        self._came = threading.Event()
        self._before = {number: signal.signal(number, self._note) for number in _NUMBERS}

    @property
    def came(self) -> bool:
        """Whether the process was asked to stop."""
        return self._came.is_set()

    @property
    def exit_status(self) -> int:
        """The exit status of a process ended by the received signal (130, 143)."""
        return 128 + self._number

    def wait(self, timeout_sec: float) -> bool:
        """Wait until the process is asked to stop, with a time limit in seconds; return whether it was."""
        return self._came.wait(timeout_sec)

    def give_back(self) -> None:
        """Restore the previous handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, _: FrameType | None) -> None:
        self._number = number
        self._came.set()
