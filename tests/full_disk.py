"""A disk that is full, for a moment, without one: no file of this process can be written."""

import resource
from contextlib import contextmanager


@contextmanager
def full_disk():
    """Let the system refuse what is written to files, as it does above a limit of their size."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
