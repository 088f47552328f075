"""A bound on work that does not depend on how fast the machine is: the number of Python calls."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class TooMuchWorkError(Exception):
    """More calls were made than the work is worth."""


@contextmanager
def at_most(calls: int) -> Iterator[None]:
    """Stop what runs inside after a number of calls of Python functions.

    Raises:
        TooMuchWorkError: If there were more.
    """
    left, before = calls, sys.getprofile()

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal left
        if event == "call":
            left -= 1
            if left < 0:
                raise TooMuchWorkError

    sys.setprofile(count)
    try:
        yield
    finally:
        sys.setprofile(before)
