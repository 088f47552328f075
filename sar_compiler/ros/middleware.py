"""The start of ROS in a process: what is checked before, and what is cleaned up.

Whether the middleware that `RMW_IMPLEMENTATION` asks for is installed is looked at before rcl ends the process over it. What Fast DDS
keeps in shared memory for a process, half a megabyte, one that was killed leaves there for good; it is removed here.
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
# The package that loads the others; it registers itself among them.
_LOADER = "rmw_implementation"
# What rclpy says when a client is being taken down while it is answered; the client has a deadline of its own.
_UNHEARD = r"failed to send response \(timeout\)"


class MiddlewareError(SarError):
    """The middleware that is asked for is not installed."""


def require_middleware() -> None:
    """Check that the middleware of `RMW_IMPLEMENTATION` is installed; to be called before rclpy is imported.

    Where nothing says what is installed, rcl decides.

    Raises:
        MiddlewareError: If it is not; names those that are.
    """
    wanted, installed = os.environ.get(_VARIABLE, ""), sorted(set(_installed_middlewares()))
    if not wanted or not installed or wanted in installed:
        return
    raise MiddlewareError(
        f"{_VARIABLE} is '{wanted}', which is not installed; there is {', '.join(installed)}: "
        f"unset {_VARIABLE}, or install it (on a robot: sudo apt install ros-jazzy-{wanted.replace('_', '-')})"
    )


@contextmanager
def ros_up(arguments: Sequence[str]) -> "Iterator[Context]":
    """Initialise ROS in a context of its own, and shut that down in the end; what killed processes have left is removed before.

    Signals are left to the caller: rclpy's handlers would take ROS down before a goal in flight could be cancelled.
    Meanwhile rclpy does not warn of an answer that its client does not hear, because it has just been taken down.

    Args:
        arguments: Those of `rclpy.init`.
    """
    import rclpy
    from rclpy.context import Context
    from rclpy.signals import SignalHandlerOptions

    from sar_compiler.ros.arguments import readable_ros_errors

    remove_what_the_dead_left()
    context = Context()
    try:
        with readable_ros_errors():
            rclpy.init(args=list(arguments), context=context, signal_handler_options=SignalHandlerOptions.NO)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", _UNHEARD, RuntimeWarning)
            yield context
    finally:
        context.try_shutdown()


def _installed_middlewares() -> Iterator[str]:
    """Yield the middlewares that are registered where ROS is: in sourced workspaces, or in this environment."""
    for prefix in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        folder = Path(prefix) / _INDEX
        if prefix and folder.is_dir():
            yield from (path.name for path in folder.iterdir() if path.name != _LOADER)


_FOLDER = Path("/dev/shm")  # noqa: S108 - where Linux has it
# The file of a segment's lock, which its process holds as long as it lives, is called like the segment, with this ending.
_LOCK = "_el"
# A port, unlike a segment, is called by a number: whoever starts next may be about to take the same one.
_PORTS = "fastrtps_port"
# Between the making of the file and its lock is a moment; seconds.
_NEW_SEC = 60.0
# Between the making of a file and its size are two system calls: so old an empty one has lost its process there, seconds.
_UNFINISHED_SEC = 2.0


def remove_what_the_dead_left(folder: Path = _FOLDER) -> int:
    """Remove the segments of this user's processes that are dead; return how many there were.

    A segment whose lock somebody holds is left alone, and so is whatever is younger than a minute, or another user's.
    So are ports: a process that starts takes over those of the dead, under a mutex of Fast DDS'. It would find such a port's
    lock taken while it is being looked at here, or hold the lock of a file that is no longer there, and another process
    would listen at the same port. Segments have names by chance, which nobody takes again.

    An empty file, of a port or of a segment, is removed in any case: its process was killed while it made it, and each
    process that opens it, such as the next one with this port, waits in Fast DDS forever for the size that the dead one would have set.

    Args:
        folder: Where segments are.
    """
    made = list(folder.glob("fastrtps_*"))
    locks = [each for each in made if each.name.endswith(_LOCK)]
    dead = [_remove_if_dead(lock) for lock in locks if not lock.name.startswith(_PORTS)]
    return sum(dead) + sum(_remove_if_unfinished(each) for each in made if each not in locks)


def _remove_if_unfinished(file: Path) -> bool:
    with suppress(OSError):
        about = file.lstat()
        is_old = time.time() - about.st_mtime >= _UNFINISHED_SEC
        if about.st_uid == os.geteuid() and stat.S_ISREG(about.st_mode) and not about.st_size and is_old:
            file.unlink()
            return True
    return False


def _remove_if_dead(lock: Path) -> bool:
    with suppress(OSError):  # it is held, or somebody else has just removed it
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
