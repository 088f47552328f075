"""Standard output of a run, which must go on whoever reads along."""

import os
import sys
from contextlib import suppress


class RunOutput:
    """What a run prints for people; where nobody reads it any more (`| head`), the run does not end.

    Attributes:
        lost: Whether standard output is gone.
    """

    def __init__(self) -> None:
        self.lost = False

    def show(self, text: str) -> None:
        """Print what is of interest just now; nothing once standard output is gone."""
        if not self.lost:
            self._print(text)

    def say(self, text: str) -> None:
        """Print what somebody should see; on standard error once standard output is gone."""
        self.show(text)
        if self.lost:
            _print_error(text)

    def _print(self, text: str) -> None:
        try:
            print(text, flush=True)
        except (OSError, UnicodeError) as error:
            self.lost = True
            reason = error.strerror if isinstance(error, OSError) else str(error)
            _print_error(
                f"sar-run: standard output cannot be written any more ({reason}); "
                "nothing is shown from here on, and the run goes on"
            )
            if isinstance(error, OSError):
                _silence()


def _print_error(text: str) -> None:
    with suppress(OSError, UnicodeError):  # nobody may be reading that either
        print(text, file=sys.stderr, flush=True)


def _silence() -> None:
    """Let what is still in the buffer go nowhere when the process ends."""
    with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 - os.devnull is no path of a file
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
