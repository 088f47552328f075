"""What a command's output is shown on: the width of a terminal, and whether to use its colours."""

import os
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TextIO

from sar_compiler.commands import columns

if TYPE_CHECKING:
    from sar_compiler.tree.diagnostic import Diagnostic

_SGR = {
    "place": "1",
    "error": "1;31",
    "warning": "1;33",
    "info": "1;36",
    "margin": "2",
    "carets": "1;31",
    "advice": "32",
}
"""The parts of a text that are coloured, with the numbers by which terminals know the colours."""


def has_colours(stream: TextIO) -> bool:
    """Return whether to colour what is written to a stream: on a terminal, unless the environment says otherwise.

    `NO_COLOR` (not empty), `CLICOLOR=0` and `TERM=dumb` mean no; `CLICOLOR_FORCE` (not 0) means yes, in files as well.
    """
    environment = os.environ
    if environment.get("NO_COLOR"):
        return False
    if environment.get("CLICOLOR_FORCE", "0") not in ("", "0"):
        return True
    plain = environment.get("CLICOLOR") == "0" or environment.get("TERM") == "dumb"
    return not plain and stream is not None and stream.isatty()


def painter(stream: TextIO) -> Callable[[str, str], str]:
    """Return a function that colours a text by what it is (a key of `_SGR`), if the stream shows colours."""
    if not has_colours(stream):
        return lambda text, _part: text
    return lambda text, part: f"\x1b[{_SGR[part]}m{text}\x1b[0m" if text else text


def findings_as_text(findings: "Iterable[Diagnostic]", stream: TextIO) -> str:
    """Return findings as they are shown on a stream."""
    from sar_compiler.tree.diagnostic import WIDTH

    width, paint = columns(stream) or WIDTH, painter(stream)
    return "\n".join(finding.render(width, paint) for finding in findings)
