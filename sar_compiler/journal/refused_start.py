"""Stores the last refused start of a run, in a file beside the journal that the run would write.

A run that never started does not write a journal, because an empty journal would look like a mission that can
be resumed. `sar-journal why` therefore reads this file.
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
    """The record of a run whose start was refused.

    Attributes:
        wall: The time of the refusal, in seconds since 1970.
        status: The exit status.
        reason: The error message.
    """

    wall: float
    status: int
    reason: str

    @property
    def sentence(self) -> str:
        """The refusal as a sentence."""
        return (
            f"The run on {day_and_time(self.wall)} did not start (exit status {self.status}): {self.reason}"
        )


def record_refusal(journal: Path, status: int, reason: str) -> None:
    """Record that the start of a run was refused. If this fails, record nothing."""
    with suppress(OSError, ValueError):
        place = _marker_path(journal)
        written = place.with_name(f"{place.name}.{os.getpid()}")
        place.parent.mkdir(parents=True, exist_ok=True)
        written.write_text(json.dumps(RefusedStart(time.time(), status, reason)), encoding="utf-8")
        written.replace(place)


def forget_refusal(journal: Path) -> None:
    """Delete the record of a refused start, because a run has started."""
    with suppress(OSError, ValueError):
        _marker_path(journal).unlink(missing_ok=True)


def read_refusal(journal: Path) -> RefusedStart | None:
    """Return the start that was refused after the last run of a journal, or None if no start was recorded."""
    with suppress(SarError, ValueError, TypeError, RecursionError):
        place = _marker_path(journal)
        wall, status, reason = json.loads(
            read_file(NamedPath.confined_to(place, [place.parent.resolve()]), DOCUMENT).all_bytes()
        )
        return RefusedStart(float(wall), int(status), str(reason))
    return None


def _marker_path(journal: Path) -> Path:
    return journal.with_name(f"{journal.name}{SUFFIX}")
