"""The end of the process of a command, or of a program that ticks a tree with `sar_compiler.running_tree`.

Other threads, exit functions or native code of ROS can block every step of the end: cancelling goals, flushing streams, shutting down ROS.
Each step therefore has a time limit. This module does not need ROS, and loads quickly.
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

# The time limits for the end of other threads and for exit functions, in seconds.
_THREADS_SEC, _EXIT_FUNCTIONS_SEC = 3.0, 3.0
# The time limit for flushing a stream, in seconds.
_FLUSH_SEC = 1.0
# The time limit for shutting down ROS, in seconds.
_SHUTDOWN_SEC = 3.0
# The interval at which a process checks whether its parent has ended, in seconds.
_PARENT_SEC = 0.5
_PARENT = "SAR_PARENT"
_CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)


def end_process(status: int, shutdown: Callable[[], object] | None = None, name: str = "") -> NoReturn:
    """End this process after its work, with an exit status that no thread, exit function or crash can change.

    A further signal ends the process immediately. ROS is shut down properly, so that other processes immediately remove its participant
    from their graph, and its memory in `/dev/shm` is freed. Native code of ROS may crash during the shutdown if a server has crashed
    before. Such a crash does not change the exit status.

    Args:
        status: The exit status.
        shutdown: A function that shuts down ROS; None without ROS.
        name: The name of the command, for the message about a thread that is still running.
    """

    def leave(_number: int, _frame: FrameType | None) -> None:
        os._exit(status)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, leave)
    _await_threads(name)
    call_with_limit(_EXIT_FUNCTIONS_SEC, atexit._run_exitfuncs)  # noqa: SLF001 - the interpreter will not call them
    if shutdown is not None:
        shut_down(status, shutdown)
    flush()
    os._exit(status)


def end_after_program(status: int, name: str) -> None:
    """Register a function that ends this process like `end_process` after the main thread has ended.

    The interpreter would wait for other threads without a limit. It would also keep daemon threads running during its shutdown, and a
    daemon thread that spins an executor sometimes crashes then.

    Args:
        status: The exit status.
        name: The name of the program.
    """

    def end() -> None:
        _await_threads(name)
        call_with_limit(_EXIT_FUNCTIONS_SEC, atexit._run_exitfuncs)  # noqa: SLF001
        flush()
        os._exit(status)

    # A function registered with `atexit` would be called too late, after the interpreter has waited for the threads.
    threading._register_atexit(end)  # type: ignore[attr-defined]  # noqa: SLF001


def dependent_environment() -> dict[str, str]:
    """Return the environment variables for a command that must end together with this process, even if this process is killed."""
    return {**os.environ, _PARENT: str(os.getpid())}


def end_with_parent() -> None:
    """Send SIGTERM to this process when its parent has ended, if the parent started it with `dependent_environment`."""
    parent = os.environ.pop(_PARENT, "")
    if not parent:
        return

    def watch() -> None:
        while str(os.getppid()) == parent:
            time.sleep(_PARENT_SEC)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent", daemon=True).start()


def flush() -> None:
    """Flush standard output and standard error. There is a time limit, because a blocked thread may hold the lock of a stream."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            call_with_limit(_FLUSH_SEC, stream.flush)


def end_at_once(status: int, cancel: Callable[[], int | None], limit_sec: float) -> NoReturn:
    """End this process from any thread, regardless of the state of other threads.

    Args:
        status: The exit status if *cancel* returns None or takes too long.
        cancel: A function that prints the reason, cancels goals and returns the exit status, or None for *status*.
        limit_sec: The time limit for *cancel*, in seconds.
    """
    found: list[int | None] = []
    call_with_limit(limit_sec, lambda: found.append(cancel()))
    flush()
    os._exit(next((each for each in found if each is not None), status))


def call_with_limit(limit_sec: float, call: Callable[[], object]) -> None:
    """Call a function in a separate thread, and wait until it returns or a time limit expires. Its exceptions are ignored."""

    def call_safely() -> None:
        with suppress(Exception):
            call()

    caller = threading.Thread(target=call_safely, name="end of the process", daemon=True)
    try:
        caller.start()
    except RuntimeError:  # there is not enough memory for another thread
        call_safely()
        return
    caller.join(limit_sec)


def _await_threads(name: str) -> None:
    """Wait until all non-daemon threads have ended or a time limit expires. Report the threads that are still running."""
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
    """Return whether a source file belongs to neither Python's standard library nor rclpy nor this package."""
    library = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120 - importing pathlib is slow
    ours = os.path.dirname(__file__) + os.sep  # noqa: PTH120
    is_packaged = f"{os.sep}site-packages{os.sep}" in file
    is_engine = file.startswith(ours) or (is_packaged and f"{os.sep}rclpy{os.sep}" in file)
    return not is_engine and (is_packaged or not file.startswith((library, "<frozen")))


def thread_location(ident: int | None) -> str:
    """Return the file, line and function of the user's code that a thread is executing; empty if there is none."""
    import traceback

    frame = sys._current_frames().get(ident or 0)  # noqa: SLF001 - the only access to another thread's stack
    for each, line in traceback.walk_stack(frame) if frame is not None else ():
        if is_program_file(each.f_code.co_filename):
            return f"{each.f_code.co_filename}:{line}, in {each.f_code.co_name}"
    return ""


def shut_down(status: int, shutdown: Callable[[], object]) -> None:
    """Shut down ROS, or end the process with *status* if the shutdown crashes or takes too long."""
    import ctypes

    libc = ctypes.CDLL(None)
    _flush(libc)
    # Python runs its handlers only after the crashing call has returned. The C handler runs immediately, in the crashing thread.
    handler = ctypes.CFUNCTYPE(None, ctypes.c_int)(lambda _: os._exit(status))
    for number in (*_CRASHES, signal.SIGALRM):
        libc.signal(number, handler)
    signal.setitimer(signal.ITIMER_REAL, _SHUTDOWN_SEC)
    with suppress(Exception):
        shutdown()
    _flush(libc)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number in (*_CRASHES, signal.SIGALRM):
        libc.signal(number, None)


def _flush(libc: "ctypes.CDLL") -> None:
    """Flush standard output and standard error, and the log files of ROS."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    libc.fflush(None)
