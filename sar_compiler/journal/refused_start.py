"""The last start of a run that was refused, in a file beside the journal that the run would have written.

A run that never begins writes no journal: an empty one would count as a mission that can be resumed. `sar-journal why` reads this file instead.
"""

import json
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import day_and_time
from sar_compiler.opener import DOCUMENT, NamedPath, read_file

SUFFIX = "-refused"


class RefusedStart(NamedTuple):
    """A start of a run that was refused.

    Attributes:
        wall: When it was refused, in seconds since 1970.
        status: The exit status.
        reason: The message.
    """

    wall: float
    status: int
    reason: str

    @property
    def text(self) -> str:
        """The refusal in words."""
        return f"The run of {day_and_time(self.wall)} did not begin (status {self.status}): {self.reason}"


def record_refusal(journal: Path, status: int, reason: str) -> None:
    """Write down that the start of a run was refused; where that cannot be written, only the terminal has said it."""
    with suppress(OSError, ValueError):
        place = _beside(journal)
        written = place.with_name(f"{place.name}.{os.getpid()}")
        place.parent.mkdir(parents=True, exist_ok=True)
        written.write_text(json.dumps(RefusedStart(time.time(), status, reason)), encoding="utf-8")
        written.replace(place)


def forget_refusal(journal: Path) -> None:
    """Delete what is known of a refused start, because a run has begun."""
    with suppress(OSError, ValueError):
        _beside(journal).unlink(missing_ok=True)


def read_refusal(journal: Path) -> RefusedStart | None:
    """Return the start that was refused since the last run of a journal has begun; None if there is none, or it cannot be read."""
    with suppress(SarError, ValueError, TypeError, RecursionError):
        place = _beside(journal)
        wall, status, reason = json.loads(
            read_file(NamedPath.within(place, [place.parent.resolve()]), DOCUMENT).whole()
        )
        return RefusedStart(float(wall), int(status), str(reason))
    return None


def _beside(journal: Path) -> Path:
    return journal.with_name(f"{journal.name}{SUFFIX}")
