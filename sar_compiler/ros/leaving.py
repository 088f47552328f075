"""The end of a process that has used ROS: with the status that was decided, whatever DDS does while it is taken down."""

import atexit
import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

_CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)
# How long ROS may take to be taken down, seconds.
_TAKING_DOWN_SEC = 3.0


def leave(status: int, take_down: Callable[[], object]) -> NoReturn:
    """End this process, whose work is done and written, with its status.

    ROS is taken down all the same: a participant that ends in order leaves the graph of others at once, and its memory in
    `/dev/shm`. But what is native in it has crashed there where servers had died, and must not change the status: a crash
    or a hang ends the process as its end would have.

    Args:
        status: The exit status.
        take_down: Takes ROS down.
    """
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    # What the end of the interpreter does, which there is none of.
    threading._shutdown()  # type: ignore[attr-defined]  # noqa: SLF001 - others' threads may have work to finish
    atexit._run_exitfuncs()  # noqa: SLF001
    libc = ctypes.CDLL(None)
    _flush(libc)
    # Python's own handlers would run after what crashed has returned; this one does in the thread that did.
    handler = ctypes.CFUNCTYPE(None, ctypes.c_int)(lambda _: os._exit(status))
    for number in (*_CRASHES, signal.SIGALRM):
        libc.signal(number, handler)
    signal.setitimer(signal.ITIMER_REAL, _TAKING_DOWN_SEC)
    with suppress(Exception):
        take_down()
    _flush(libc)
    os._exit(status)


def _flush(libc: ctypes.CDLL) -> None:
    """Write out what is buffered: Python's streams, and ROS' files of its log."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    libc.fflush(None)
