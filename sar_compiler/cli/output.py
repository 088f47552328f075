"""Standard output of a run, which must continue even if the output is closed."""

import sys
from collections.abc import Callable

from sar_compiler.commands import discard_output, print_error, print_text


class RunOutput:
    """The output of a run for people; the run does not end when its reader does (`| head`).

    Attributes:
        lost: Whether standard output is closed.
        leave: To be called before anything that must stand below what is drawn in place.
    """

    def __init__(self) -> None:
        self.lost = False
        self.leave: Callable[[], object] = lambda: None

    def show(self, text: str) -> None:
        """Print a text of momentary interest; nothing once standard output is closed."""
        if not self.lost:
            self._try(lambda: print_text(text, flush=True))

    def draw(self, text: str) -> None:
        """Write what a terminal is to obey; nothing once standard output is closed."""
        if not self.lost:
            self._try(lambda: _write(text))

    def say(self, text: str) -> None:
        """Print a text that must be seen; on standard error once standard output is closed."""
        self.show(text)
        if self.lost:
            print_error(text)

    def _try(self, write: Callable[[], object]) -> None:
        try:
            write()
        except (OSError, UnicodeError) as error:
            self.lost = True
            reason = error.strerror if isinstance(error, OSError) else str(error)
            print_error(
                f"sar-run: standard output cannot be written any more ({reason}); "
                "nothing is shown from here on, and the run goes on"
            )
            if isinstance(error, OSError):
                discard_output()


def _write(text: str) -> None:
    """Write a text at once, so that nothing comes in between; what the encoding lacks is a question mark."""
    stream = sys.stdout.buffer
    sys.stdout.flush()
    stream.write(text.encode(sys.stdout.encoding, "replace"))
    stream.flush()
