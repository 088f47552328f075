"""What Fast DDS keeps in shared memory for a process: half a megabyte, which one that was killed leaves there for good."""

import fcntl
import os
import time
from contextlib import suppress
from pathlib import Path

_FOLDER = Path("/dev/shm")  # noqa: S108 - where Linux has it
# The file of a segment's lock, which its process holds as long as it lives, is called like the segment, with this ending.
_LOCK = "_el"
# A port, unlike a segment, is called by a number: whoever starts next may be about to take the same one.
_PORTS = "fastrtps_port"
# Between the making of the file and its lock is a moment; seconds.
_NEW_SEC = 60.0


def remove_what_the_dead_left(folder: Path = _FOLDER) -> int:
    """Remove the segments of this user's processes that are dead; return how many there were.

    A segment whose lock somebody holds is left alone, and so is whatever is younger than a minute, or another user's.
    So are ports: a process that starts takes over those of the dead, under a mutex of Fast DDS'. It would find such a port's
    lock taken while it is being looked at here, or hold the lock of a file that is no longer there, and another process
    would listen at the same port. Segments have names by chance, which nobody takes again.

    Args:
        folder: Where segments are.
    """
    locks = (lock for lock in folder.glob(f"fastrtps_*{_LOCK}") if not lock.name.startswith(_PORTS))
    return sum(map(_remove_if_dead, locks))


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
