"""A limit of work that does not depend on the machine's speed: the number of Python calls."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class TooMuchWorkError(Exception):
    """The limit of calls was exceeded."""


@contextmanager
def at_most(calls: int) -> Iterator[None]:
    """Limit the number of calls of Python functions in the block.

    Raises:
        TooMuchWorkError: If there are more calls.
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
