"""The start of ROS in a process: a check of the middleware, and the clean-up of shared memory.

rcl would end the process if the middleware in `RMW_IMPLEMENTATION` were not installed, so this module checks the middleware first. Fast DDS
uses half a megabyte of shared memory for each process. If the process is killed, this memory is not released. This module removes it.
"""

import fcntl
import os
import stat
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from rclpy.context import Context

_VARIABLE = "RMW_IMPLEMENTATION"
_INDEX = Path("share", "ament_index", "resource_index", "rmw_typesupport")
# The package that loads the middleware. It is registered like a middleware.
_LOADER = "rmw_implementation"
# rclpy's warning if a client is destroyed before it receives the response. Such a client no longer needs the response.
_RESPONSE_NOT_SENT = r"failed to send response \(timeout\)"


class MiddlewareError(SarError):
    """Raised if the requested middleware is not installed."""


def require_middleware() -> None:
    """Check that the middleware in `RMW_IMPLEMENTATION` is installed; call this function before rclpy is imported.

    If this function cannot determine which middlewares are installed, rcl checks the middleware instead.

    Raises:
        MiddlewareError: If the middleware is not installed. The error names the installed middlewares.
    """
    wanted, installed = os.environ.get(_VARIABLE, ""), sorted(set(_installed_middlewares()))
    if not wanted or not installed or wanted in installed:
        return
    raise MiddlewareError(
        f"{_VARIABLE} is set to '{wanted}', which is not installed. The installed middlewares are: {', '.join(installed)}. Unset "
        f"{_VARIABLE}, or install '{wanted}' (on a robot: sudo apt install ros-jazzy-{wanted.replace('_', '-')})"
    )


@contextmanager
def ros_up(arguments: Sequence[str]) -> "Iterator[Context]":
    """Initialise ROS in a new context, and shut the context down at the end of the block.

    The caller must handle signals, because rclpy's handlers would shut ROS down before active goals are cancelled.
    Within the block, rclpy does not warn about responses to clients that were just destroyed.

    Args:
        arguments: The arguments of `rclpy.init`.
    """
    import rclpy
    from rclpy.context import Context
    from rclpy.signals import SignalHandlerOptions

    from sar_compiler.ros.arguments import convert_ros_errors

    remove_stale_segments()
    context = Context()
    try:
        with convert_ros_errors():
            rclpy.init(args=list(arguments), context=context, signal_handler_options=SignalHandlerOptions.NO)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", _RESPONSE_NOT_SENT, RuntimeWarning)
            yield context
    finally:
        context.try_shutdown()


def _installed_middlewares() -> Iterator[str]:
    """Yield the names of the middlewares that are installed in sourced workspaces or this environment."""
    for prefix in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        folder = Path(prefix) / _INDEX
        if prefix and folder.is_dir():
            yield from (path.name for path in folder.iterdir() if path.name != _LOADER)


_FOLDER = Path("/dev/shm")  # noqa: S108 - the folder for shared memory on Linux
# The suffix of a segment's lock file. The process of the segment holds the lock until the process ends.
_LOCK = "_el"
# The prefix of a port's files. Unlike a segment, a port has a number as its name, so another process may be about to use the same port.
_PORTS = "fastrtps_port"
# Maximum time between the creation of a file and of its lock, in seconds.
_NEW_SEC = 60.0
# A process creates a file and sets its size in two system calls. If a file is still empty after this time, in seconds, its process has ended in
# between.
_UNFINISHED_SEC = 2.0


def remove_stale_segments(folder: Path = _FOLDER) -> int:
    """Remove the shared-memory segments that this user's ended processes have left; return the number of segments.

    A segment is not removed if its lock is held, it is younger than a minute, or it belongs to another user. Ports are not removed either,
    because a starting process takes over ports of ended processes, protected by a mutex of Fast DDS. If this function checked a port at
    that moment, the starting process would find the port's lock held. If this function deleted the port's file, the starting process would
    hold the lock of a deleted file while another process uses the same port. Segments do not have this problem: their names are random, so
    no process uses them again.

    An empty file of a port or segment is always removed. Such a file exists because a process was killed while it created the file. Any
    process that opened the file, such as the next process with this port, would wait forever in Fast DDS.

    Args:
        folder: The folder of the segments.
    """
    files = list(folder.glob("fastrtps_*"))
    locks = [each for each in files if each.name.endswith(_LOCK)]
    removed = [_remove_if_stale(lock) for lock in locks if not lock.name.startswith(_PORTS)]
    return sum(removed) + sum(_remove_if_unfinished(each) for each in files if each not in locks)


def _remove_if_unfinished(file: Path) -> bool:
    with suppress(OSError):
        about = file.lstat()
        is_old = time.time() - about.st_mtime >= _UNFINISHED_SEC
        if about.st_uid == os.geteuid() and stat.S_ISREG(about.st_mode) and not about.st_size and is_old:
            file.unlink()
            return True
    return False


def _remove_if_stale(lock: Path) -> bool:
    with suppress(OSError):  # the lock is held, or another process has just removed it
        about = lock.lstat()
        if about.st_uid != os.geteuid() or time.time() - about.st_mtime < _NEW_SEC:
            return False
        descriptor = os.open(lock, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            lock.with_name(lock.name.removesuffix(_LOCK)).unlink(missing_ok=True)
            lock.unlink()
        finally:
            os.close(descriptor)
        return True
    return False
