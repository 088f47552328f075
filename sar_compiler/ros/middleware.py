"""The start of ROS in a process: checks before it, and the clean-up of shared memory.

If the middleware in `RMW_IMPLEMENTATION` is not installed, rcl would end the process, so this is checked first. Fast DDS keeps
half a megabyte of shared memory for a process, and a killed process leaves it there for good. It is removed here.
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
# The package that loads the other middlewares; it registers itself among them.
_LOADER = "rmw_implementation"
# rclpy's warning if a client is destroyed while it is being answered. The client has a deadline of its own.
_UNHEARD = r"failed to send response \(timeout\)"


class MiddlewareError(SarError):
    """The requested middleware is not installed."""


def require_middleware() -> None:
    """Check that the middleware of `RMW_IMPLEMENTATION` is installed; call it before importing rclpy.

    If it is unknown which middlewares are installed, rcl decides.

    Raises:
        MiddlewareError: If it is not. The message names the installed ones.
    """
    wanted, installed = os.environ.get(_VARIABLE, ""), sorted(set(_installed_middlewares()))
    if not wanted or not installed or wanted in installed:
        return
    raise MiddlewareError(
        f"{_VARIABLE} is '{wanted}', which is not installed. Installed: {', '.join(installed)}. Unset {_VARIABLE}, "
        f"or install it (on a robot: sudo apt install ros-jazzy-{wanted.replace('_', '-')})"
    )


@contextmanager
def ros_up(arguments: Sequence[str]) -> "Iterator[Context]":
    """Initialise ROS in its own context, and shut it down at the end of the block.

    Signals are left to the caller: rclpy's handlers would shut ROS down before an active goal could be cancelled.
    Within the block rclpy does not warn about answers to clients that were just destroyed.

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
            warnings.filterwarnings("ignore", _UNHEARD, RuntimeWarning)
            yield context
    finally:
        context.try_shutdown()


def _installed_middlewares() -> Iterator[str]:
    """Yield the middlewares that are installed in sourced workspaces or this environment."""
    for prefix in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        folder = Path(prefix) / _INDEX
        if prefix and folder.is_dir():
            yield from (path.name for path in folder.iterdir() if path.name != _LOADER)


_FOLDER = Path("/dev/shm")  # noqa: S108 - where Linux has it
# The lock file of a segment, which its process holds as long as it lives, has the segment's name with this ending.
_LOCK = "_el"
# A port, unlike a segment, has a number as its name: a process that is just starting may be about to use the same one.
_PORTS = "fastrtps_port"
# Time between the creation of a file and its lock; seconds.
_NEW_SEC = 60.0
# A file is created and sized by two system calls. An empty file of this age has lost its process in between; seconds.
_UNFINISHED_SEC = 2.0


def remove_stale_segments(folder: Path = _FOLDER) -> int:
    """Remove shared-memory segments of this user's ended processes; return their number.

    A segment with a held lock is left alone, and so is one that is younger than a minute or belongs to another user.
    Ports are left alone too: a starting process takes over those of dead processes, under a mutex of Fast DDS. It would
    find the port's lock held during this check, or hold the lock of a file that no longer exists, and another process
    would listen at the same port. Segments have random names, which no process uses again.

    An empty file of a port or segment is always removed: its process was killed while creating it. Each process that
    opens the file, such as the next one with this port, waits in Fast DDS forever for the missing size.

    Args:
        folder: The folder of the segments.
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
    with suppress(OSError):  # it is held, or another process has just removed it
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
