"""Communication between a run of `sar-run` and its supervisor, through the environment and a pipe."""

import json
import os
from collections.abc import MutableMapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

ALIVE, ENDING, JOURNAL, DEAF = b".", b"=", b"/", b"?"
"""The first byte of each message from a run to its supervisor: heartbeat, end of the run, path of the journal, lost discovery. The guardian
sends a fifth message (`ros.guardian.MAY_MOVE_SIGN`)."""

_VARIABLE = "SAR_SUPERVISION"
PERIOD_SEC = 1.0
"""The interval between heartbeats, in seconds of the steady clock."""

NOT_READY = 3
"""The exit status of a run that ended because a requirement of the tree did not appear in time."""


class Supervision(NamedTuple):
    """The connection of this process to its supervisor.

    Attributes:
        signs: The file descriptor of the pipe to the supervisor; None without a supervisor.
        deaths: How the earlier runs crashed, in words.
        has_begun: Whether the mission has already started in an earlier run and must be resumed.
    """

    signs: int | None = None
    deaths: Sequence[str] = ()
    has_begun: bool = False

    @property
    def is_there(self) -> bool:
        """Whether this process has a supervisor."""
        return self.signs is not None

    def environment(self) -> dict[str, str]:
        """Return the environment variables that pass this connection to a child process."""
        return {_VARIABLE: json.dumps(self)}

    def send_heartbeat(self) -> None:
        """Send a heartbeat; called every `PERIOD_SEC` in the thread that ticks the tree."""
        self._write(ALIVE)

    def send_journal_path(self, place: Path) -> None:
        """Send the path of the journal."""
        self._write(JOURNAL + json.dumps(str(place.resolve())).encode())

    def send_discovery_lost(self) -> None:
        """Report that this process no longer discovers other nodes, so that the supervisor resumes the mission in a new process."""
        self._write(DEAF)

    def send_end(self) -> None:
        """Report that the run has ended, and that only the reports and the shutdown of ROS follow."""
        self._write(ENDING)

    def summary_text(self) -> str:
        """Return the sentence about restarts for the run's summary, or an empty string if there were no restarts."""
        if not self.deaths:
            return ""
        times = "once" if len(self.deaths) == 1 else f"{len(self.deaths)} times"
        return f"The supervisor restarted the mission {times}: {'; '.join(self.deaths)}."

    def _write(self, line: bytes) -> None:
        if self.signs is not None:
            with suppress(OSError):  # the supervisor has ended, or is suspended
                os.write(self.signs, line + b"\n")


def own_supervision(environment: MutableMapping[str, str] = os.environ) -> Supervision:
    """Read this process's connection to its supervisor from the environment, and delete it from the environment."""
    supervision = Supervision(*json.loads(environment.pop(_VARIABLE, "[]")))
    if supervision.signs is not None:
        os.set_inheritable(supervision.signs, False)  # noqa: FBT003 - its only form
        os.set_blocking(supervision.signs, False)
    return supervision
