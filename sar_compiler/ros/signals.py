"""SIGINT and SIGTERM as something that can be asked, instead of something that interrupts."""

import signal
import threading
from types import FrameType

_NUMBERS = (signal.SIGINT, signal.SIGTERM)


class StopSignals:
    """Notes that the process was asked to stop; takes the two signals over from its making on.

    rclpy's own handlers would take ROS down in the midst of a callback, before a goal in flight could be
    cancelled; Python's own raises `KeyboardInterrupt` wherever it happens to be.
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
        """The exit status of a process ended by the signal that came (130, 143)."""
        return 128 + self._number

    def wait(self, timeout_sec: float) -> bool:
        """Wait until the process is asked to stop, at most for a time in seconds; say whether it was."""
        return self._came.wait(timeout_sec)

    def give_back(self) -> None:
        """Restore the handlers that there were before."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, _: FrameType | None) -> None:
        self._number = number
        self._came.set()
