"""What a run of `sar-run` and who supervises it tell each other: through the environment, and through a pipe."""

import json
import os
from collections.abc import MutableMapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

ALIVE, ENDING, JOURNAL, DEAF = b".", b"=", b"/", b"?"
"""The signs of a run, each the first letter of a line: it lives, it comes to its end, where its journal is, and that it hears nothing.
One more is the guardian's (`ros.guardian.ADRIFT_SIGN`)."""

_VARIABLE = "SAR_SUPERVISION"
PERIOD_SEC = 1.0
"""How often a run tells that it lives, steady seconds."""

NOT_READY = 3
"""The exit status of a run: something that it needs did not appear in time."""


class Supervision(NamedTuple):
    """The supervision of this process.

    Attributes:
        signs: The descriptor of the pipe to who supervises it; None if nobody does.
        deaths: How the runs before it have ended, in words.
        has_begun: Whether the mission has begun, so that it is resumed.
    """

    signs: int | None = None
    deaths: Sequence[str] = ()
    has_begun: bool = False

    @property
    def is_there(self) -> bool:
        """Whether somebody supervises it."""
        return self.signs is not None

    def environment(self) -> dict[str, str]:
        """Return the environment that hands this to a process."""
        return {_VARIABLE: json.dumps(self)}

    def tell_alive(self) -> None:
        """Tell, each `PERIOD_SEC`, that the thread that ticks the tree does not stand still."""
        self._write(ALIVE)

    def tell_journal(self, place: Path) -> None:
        """Tell where the journal is."""
        self._write(JOURNAL + json.dumps(str(place.resolve())).encode())

    def tell_deaf(self) -> None:
        """Tell that another process has to go on."""
        self._write(DEAF)

    def tell_end(self) -> None:
        """Tell that the run has ended, and has only to be written and taken down."""
        self._write(ENDING)

    def in_words(self) -> str:
        """Return what the summary says of it; empty for the first run."""
        if not self.deaths:
            return ""
        times = "once" if len(self.deaths) == 1 else f"{len(self.deaths)} times"
        return f"The mission was begun again {times} by its supervisor: {'; '.join(self.deaths)}."

    def _write(self, line: bytes) -> None:
        if self.signs is not None:
            with suppress(OSError):  # who supervises is gone, or sleeps
                os.write(self.signs, line + b"\n")


def own_supervision(environment: MutableMapping[str, str] = os.environ) -> Supervision:
    """Return the supervision of this process; called again, nobody's."""
    supervision = Supervision(*json.loads(environment.pop(_VARIABLE, "[]")))
    if supervision.signs is not None:
        os.set_inheritable(supervision.signs, False)  # noqa: FBT003 - its only form
        os.set_blocking(supervision.signs, False)
    return supervision
