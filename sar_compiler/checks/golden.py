"""Comparing texts with reviewed and committed files."""

import difflib
import os
from pathlib import Path

from sar_compiler.errors import SarError
from sar_compiler.opener import RECORDED_OUTPUT, is_there, read_file
from sar_compiler.tree.showing import shortened

RENEW = "SAR_RENEW_GOLDEN"
"""The environment variable that has such files written anew."""


_MOST_COMPARED, _MOST_SHOWN = 2000, 500
"""How many lines are compared, and how many lines of differences are shown."""


def compare_golden(path: Path, text: str, what: str) -> str | None:
    """Compare a text with a committed file; where the files are to be written anew, write it instead.

    Returns:
        None if they are the same, else what is different, or that there is no file yet.

    Raises:
        UnreadableFileError: If the file cannot be read.
        SarError: If it cannot be written.
    """
    if os.environ.get(RENEW):
        _write(path, text)
        return None
    if not is_there(path):
        return f"there is no golden file {path} yet: run with {RENEW}=1, then review and commit it"
    expected = read_file(path, RECORDED_OUTPUT).data.decode("utf-8", "replace")
    if text == expected:
        return None
    # What it takes to compare two texts grows with the product of their lengths, and somebody reads the differences.
    old, new = (each.splitlines()[:_MOST_COMPARED] for each in (expected, text))
    lines = [*difflib.unified_diff(old, new, f"{path} (committed)", what, lineterm="")]
    if not lines or len(lines) > _MOST_SHOWN:
        lines = [
            *lines[:_MOST_SHOWN],
            f"... there are more differences, some maybe after line {_MOST_COMPARED:,}",
        ]
    return "\n".join([*map(shortened, lines), f"If this is meant, run with {RENEW}=1 and review the change."])


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise SarError(f"cannot write {path}: {error.strerror}") from error
