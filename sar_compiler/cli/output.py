"""Standard output of a run, which must continue even if the output is closed."""

import sys
from contextlib import suppress

from sar_compiler.commands import discard_output


class RunOutput:
    """The output of a run for people; the run does not end when its reader does (`| head`).

    Attributes:
        lost: Whether standard output is closed.
    """

    def __init__(self) -> None:
        self.lost = False

    def show(self, text: str) -> None:
        """Print a text of momentary interest; nothing once standard output is closed."""
        if not self.lost:
            self._print(text)

    def say(self, text: str) -> None:
        """Print a text that must be seen; on standard error once standard output is closed."""
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
                discard_output()


def _print_error(text: str) -> None:
    with suppress(OSError, UnicodeError):  # its reader may be gone, too
        print(text, file=sys.stderr, flush=True)
