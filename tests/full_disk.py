"""Simulates a full disk: for a moment this process cannot write any file."""

import resource
from contextlib import contextmanager


@contextmanager
def full_disk():
    """Make the system refuse writes to files by setting the limit of file sizes to 0."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
