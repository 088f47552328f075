"""The end of this process, used by every command, and by a program that ticks a tree with `sar_compiler.running_tree`.

The order is always the same: set an alarm, print the reason, cancel goals, flush buffers, exit the process. The alarm comes first, because
every later step can hang: other threads, exit functions, the native parts of ROS. This module needs no ROS, and importing it takes no
time.
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

# Time limits for other threads to finish, and for exit functions, seconds.
_THREADS_SEC, _EXIT_FUNCTIONS_SEC = 3.0, 3.0
# Time limit for flushing a stream, seconds.
_FLUSH_SEC = 1.0
# Time limit for shutting down ROS, seconds.
_TAKING_DOWN_SEC = 3.0
# Delay with which a process notices that its parent has ended, seconds.
_PARENT_SEC = 0.5
_PARENT = "SAR_PARENT"
_CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)


def end_process(status: int, take_down: Callable[[], object] | None = None, name: str = "") -> NoReturn:
    """End this process, whose work is done and written, with its status; no thread, exit function or crash prevents that.

    A further signal ends it at once. ROS is shut down nevertheless: a participant that ends gracefully leaves the graph of others at once, and
    frees its memory in `/dev/shm`. But its native parts have crashed there when servers had died, which must not change the status.

    Args:
        status: The exit status.
        take_down: Shuts down ROS; None without ROS.
        name: The name of the command, for the line that names an abandoned thread.
    """

    def leave(_number: int, _frame: FrameType | None) -> None:
        os._exit(status)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, leave)
    _await_threads(name)
    call_with_limit(_EXIT_FUNCTIONS_SEC, atexit._run_exitfuncs)  # noqa: SLF001 - the interpreter's regular end never comes
    if take_down is not None:
        shut_down(status, take_down)
    flush()
    os._exit(status)


def end_after_program(status: int, name: str) -> None:
    """End this process with its status after its main thread has ended, as `end_process` does.

    The interpreter would wait for other threads forever. It would also keep daemon threads running while it is torn down: one that
    spins an executor then crashes occasionally.

    Args:
        status: The exit status.
        name: The name of the program.
    """

    def end() -> None:
        _await_threads(name)
        call_with_limit(_EXIT_FUNCTIONS_SEC, atexit._run_exitfuncs)  # noqa: SLF001
        flush()
        os._exit(status)

    # `atexit` is too late: the interpreter waits for the threads before it.
    threading._register_atexit(end)  # type: ignore[attr-defined]  # noqa: SLF001


def dependent_environment() -> dict[str, str]:
    """Return the environment of a command that must end together with this process, however this one ends."""
    return {**os.environ, _PARENT: str(os.getpid())}


def end_with_parent() -> None:
    """End this process by SIGTERM when the parent that started it with `dependent_environment` has ended."""
    parent = os.environ.pop(_PARENT, "")
    if not parent:
        return

    def watch() -> None:
        while str(os.getppid()) == parent:
            time.sleep(_PARENT_SEC)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent", daemon=True).start()


def flush() -> None:
    """Flush Python's streams; a blocked thread may hold the lock of one."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            call_with_limit(_FLUSH_SEC, stream.flush)


def end_at_once(status: int, cancel: Callable[[], int | None], limit_sec: float) -> NoReturn:
    """End this process from any thread, regardless of the others.

    Args:
        status: The exit status, if cancelling returns none or takes too long.
        cancel: Prints the reason and cancels goals; returns the exit status, or None for *status*.
        limit_sec: Time limit for it, seconds.
    """
    found: list[int | None] = []
    call_with_limit(limit_sec, lambda: found.append(cancel()))
    flush()
    os._exit(next((each for each in found if each is not None), status))


def call_with_limit(limit_sec: float, call: Callable[[], object]) -> None:
    """Call a function in a separate thread, and wait for it up to a limit."""

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
    """Wait until non-daemon threads have ended, as the interpreter does, but up to a limit; name those that have not."""
    deadline = time.monotonic() + _THREADS_SEC
    if (pools := sys.modules.get("concurrent.futures.thread")) is not None:
        call_with_limit(_THREADS_SEC, pools._python_exit)  # noqa: SLF001 - idle threads of a pool end only on request
    for thread in _other_threads():
        thread.join(max(0.0, deadline - time.monotonic()))
    from sar_compiler.commands import print_error

    for thread in _other_threads():
        where = f" in {place}" if (place := thread_location(thread.ident)) else ""
        print_error(
            f"{name}{': ' if name else ''}thread '{thread.name}' is still running{where}, so the process ends without it. "
            "Stop the thread in the leaf's shutdown(), or start it with daemon=True."
        )


def _other_threads() -> Iterator[threading.Thread]:
    own = threading.current_thread(), threading.main_thread()
    return (each for each in threading.enumerate() if not each.daemon and each not in own)


def is_program_file(file: str) -> bool:
    """Return whether a source file belongs to a program or another package, not to Python's library or to this package."""
    library = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120 - of a module of the library
    ours = os.path.dirname(__file__) + os.sep  # noqa: PTH120
    is_packaged = f"{os.sep}site-packages{os.sep}" in file
    ticks = file.startswith(ours) or (is_packaged and f"{os.sep}rclpy{os.sep}" in file)
    return not ticks and (is_packaged or not file.startswith((library, "<frozen")))


def thread_location(ident: int | None) -> str:
    """Return the line of a program that a thread executes, with its function; empty if it is in none."""
    import traceback

    frame = sys._current_frames().get(ident or 0)  # noqa: SLF001 - the only access to another thread's stack
    for each, line in traceback.walk_stack(frame) if frame is not None else ():
        if is_program_file(each.f_code.co_filename):
            return f"{each.f_code.co_filename}:{line}, in {each.f_code.co_name}"
    return ""


def shut_down(status: int, take_down: Callable[[], object]) -> None:
    """Shut down ROS; a crash or a hang in it ends the process with its status."""
    import ctypes

    libc = ctypes.CDLL(None)
    _flush(libc)
    # Python's own handlers would run only after the crashing call has returned; this one runs in the crashing thread.
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
    """Flush Python's streams, and the files of ROS's log."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    libc.fflush(None)
