"""Communication between a run of `sar-run` and its supervisor, through the environment and a pipe."""

import json
import os
from collections.abc import MutableMapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

ALIVE, ENDING, JOURNAL, DEAF = b".", b"=", b"/", b"?"
"""The signs of a run, each the first letter of a line: heartbeat, end, place of the journal, lost discovery.
The guardian has one more (`ros.guardian.MAY_MOVE_SIGN`)."""

_VARIABLE = "SAR_SUPERVISION"
PERIOD_SEC = 1.0
"""Interval of heartbeats, steady seconds."""

NOT_READY = 3
"""The exit status of a run whose requirement did not appear in time."""


class Supervision(NamedTuple):
    """The supervision of this process.

    Attributes:
        signs: The descriptor of the pipe to the supervisor; None without one.
        deaths: How the previous runs ended, in words.
        has_begun: Whether the mission has started, so that it must be resumed.
    """

    signs: int | None = None
    deaths: Sequence[str] = ()
    has_begun: bool = False

    @property
    def is_there(self) -> bool:
        """Whether there is a supervisor."""
        return self.signs is not None

    def environment(self) -> dict[str, str]:
        """Return the environment that passes this to a process."""
        return {_VARIABLE: json.dumps(self)}

    def send_heartbeat(self) -> None:
        """Send a heartbeat; call this every `PERIOD_SEC` in the thread that ticks the tree."""
        self._write(ALIVE)

    def send_journal_path(self, place: Path) -> None:
        """Send the place of the journal."""
        self._write(JOURNAL + json.dumps(str(place.resolve())).encode())

    def send_discovery_lost(self) -> None:
        """Report that discovery is lost, so that the supervisor resumes the mission in a new process."""
        self._write(DEAF)

    def send_end(self) -> None:
        """Report that the run has ended, except for its reports and shutdown."""
        self._write(ENDING)

    def summary_text(self) -> str:
        """Return the text for the summary; empty for the first run."""
        if not self.deaths:
            return ""
        times = "once" if len(self.deaths) == 1 else f"{len(self.deaths)} times"
        return f"The supervisor restarted the mission {times}: {'; '.join(self.deaths)}."

    def _write(self, line: bytes) -> None:
        if self.signs is not None:
            with suppress(OSError):  # the supervisor has ended, or is suspended
                os.write(self.signs, line + b"\n")


def own_supervision(environment: MutableMapping[str, str] = os.environ) -> Supervision:
    """Return the supervision of this process; further calls return one without a supervisor."""
    supervision = Supervision(*json.loads(environment.pop(_VARIABLE, "[]")))
    if supervision.signs is not None:
        os.set_inheritable(supervision.signs, False)  # noqa: FBT003 - its only form
        os.set_blocking(supervision.signs, False)
    return supervision
