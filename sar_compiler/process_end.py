"""The end of this process: every command ends here, and so does a program that ticks a tree by `sar_compiler.running`.

It always goes in the same order: an alarm is set, what happens is printed, what is under way is canceled, what is buffered is
written, the process exits. The alarm comes first, because everything after it can hang: others' threads, what is registered for
the exit, the native parts of ROS. Nothing here needs ROS, and importing it takes no time.
"""

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    import ctypes

# How long others' threads have for what they have to finish, and how long the functions that are registered for the exit have, seconds.
_THREADS_SEC, _EXIT_FUNCTIONS_SEC = 3.0, 3.0
# How long a stream may take to be written, seconds.
_FLUSH_SEC = 1.0
# How long ROS may take to be taken down, seconds.
_TAKING_DOWN_SEC = 3.0
# How soon a process notices that the one that has started it has ended, seconds.
_PARENT_SEC = 0.5
_PARENT = "SAR_PARENT"
_CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)


def end_process(status: int, take_down: Callable[[], object] | None = None, name: str = "") -> NoReturn:
    """End this process, whose work is done and written, with its status; no thread, no exit function and no crash prevents that.

    A signal from here on ends it at once. ROS is taken down all the same: a participant that ends in order leaves the graph of others at once, and its memory in
    `/dev/shm`. But what is native in it has crashed there where servers had died, and must not change the status.

    Args:
        status: The exit status.
        take_down: Takes ROS down; None where there is none.
        name: The name of the command, for the line that names a thread which is left behind.
    """

    def leave(_number: int, _frame: FrameType | None) -> None:
        os._exit(status)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, leave)
    _await_threads(name)
    try_for(_EXIT_FUNCTIONS_SEC, atexit._run_exitfuncs)  # noqa: SLF001 - the interpreter's own end does not come
    if take_down is not None:
        shut_down(status, take_down)
    flush()
    os._exit(status)


def end_after_program(status: int, name: str) -> None:
    """End this process with its status once its main thread has come to its end, as `end_process` does.

    The interpreter would wait for others' threads for ever. It would also go on in daemon threads while it is taken apart: one that
    spins an executor crashes then now and again.

    Args:
        status: The exit status.
        name: The name of the program.
    """

    def end() -> None:
        _await_threads(name)
        try_for(_EXIT_FUNCTIONS_SEC, atexit._run_exitfuncs)  # noqa: SLF001
        flush()
        os._exit(status)

    # `atexit` comes too late: the interpreter waits for the threads before.
    threading._register_atexit(end)  # type: ignore[attr-defined]  # noqa: SLF001


def dependent_environment() -> dict[str, str]:
    """Return the environment of a command that is to end when this process does, however this one ends."""
    return {**os.environ, _PARENT: str(os.getpid())}


def end_with_parent() -> None:
    """End this process by SIGTERM when the one that has started it with `dependent_environment` has ended."""
    parent = os.environ.pop(_PARENT, "")
    if not parent:
        return

    def watch() -> None:
        while str(os.getppid()) == parent:
            time.sleep(_PARENT_SEC)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent", daemon=True).start()


def flush() -> None:
    """Write out what is buffered in Python's streams; the thread that is stuck may hold the lock of one."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            try_for(_FLUSH_SEC, stream.flush)


def end_at_once(status: int, cancel: Callable[[], int | None], limit_sec: float) -> NoReturn:
    """End this process from any thread, whatever the others do.

    Args:
        status: The exit status, if cancelling returns none or takes too long.
        cancel: Prints what happens and cancels what is under way; returns the exit status, or None for the other one.
        limit_sec: How long that may take, seconds.
    """
    found: list[int | None] = []
    try_for(limit_sec, lambda: found.append(cancel()))
    flush()
    os._exit(next((each for each in found if each is not None), status))


def try_for(limit_sec: float, call: Callable[[], object]) -> None:
    """Call a function in a thread of its own, and wait for it within a limit."""

    def call_safely() -> None:
        with suppress(Exception):
            call()

    caller = threading.Thread(target=call_safely, name="end of the process", daemon=True)
    try:
        caller.start()
    except RuntimeError:  # there is no memory for another thread
        call_safely()
        return
    caller.join(limit_sec)


def _await_threads(name: str) -> None:
    """Wait until the threads that are no daemons have ended, as the interpreter does, but within a limit; name those that have not."""
    deadline = time.monotonic() + _THREADS_SEC
    if (pools := sys.modules.get("concurrent.futures.thread")) is not None:
        try_for(_THREADS_SEC, pools._python_exit)  # noqa: SLF001 - idle threads of a pool end only when they are told to
    for thread in _others():
        thread.join(max(0.0, deadline - time.monotonic()))
    from sar_compiler.commands import print_error

    for thread in _others():
        where = f" in {place}" if (place := place_of_thread(thread.ident)) else ""
        print_error(
            f"{name}{': ' if name else ''}thread '{thread.name}' is still running{where}; the process ends without it. "
            "Stop the thread in the leaf's shutdown(), or start it with daemon=True."
        )


def _others() -> Iterator[threading.Thread]:
    own = threading.current_thread(), threading.main_thread()
    return (each for each in threading.enumerate() if not each.daemon and each not in own)


def is_of_program(file: str) -> bool:
    """Return whether a file of Python's is a program's or a package's own: neither of Python's library, nor of what ticks trees."""
    library = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120 - of a module of the library
    ours = os.path.dirname(__file__) + os.sep  # noqa: PTH120
    is_packaged = f"{os.sep}site-packages{os.sep}" in file
    ticks = file.startswith(ours) or (is_packaged and f"{os.sep}rclpy{os.sep}" in file)
    return not ticks and (is_packaged or not file.startswith((library, "<frozen")))


def place_of_thread(ident: int | None) -> str:
    """Return the line of a program that a thread is in, with its function; empty if it is in none."""
    import traceback

    frame = sys._current_frames().get(ident or 0)  # noqa: SLF001 - the one way to another thread's stack
    for each, line in traceback.walk_stack(frame) if frame is not None else ():
        if is_of_program(each.f_code.co_filename):
            return f"{each.f_code.co_filename}:{line}, in {each.f_code.co_name}"
    return ""


def shut_down(status: int, take_down: Callable[[], object]) -> None:
    """Take ROS down; a crash or a hang in it ends the process with its status."""
    import ctypes

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
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number in (*_CRASHES, signal.SIGALRM):
        libc.signal(number, None)


def _flush(libc: "ctypes.CDLL") -> None:
    """Write out what is buffered: Python's streams, and ROS' files of its log."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    libc.fflush(None)
