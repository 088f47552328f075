"""Comparison of generated text with golden files, which were reviewed and committed."""

import difflib
import os
from pathlib import Path

from sar_compiler.errors import SarError
from sar_compiler.opener import RECORDED_OUTPUT, is_there, read_file
from sar_compiler.tree.display_text import shorten

RENEW = "SAR_RENEW_GOLDEN"
"""The environment variable that makes tests rewrite the golden files instead of comparing them."""


_MOST_COMPARED, _MOST_SHOWN = 2000, 500
"""The maximum number of lines to compare, and the maximum number of lines to show of the difference."""


def compare_golden(path: Path, text: str, what: str) -> str | None:
    """Compare a text with a golden file, or rewrite the golden file if `SAR_RENEW_GOLDEN` is set.

    Returns:
        None if the text is equal to the file or was written to the file; otherwise a message about the difference.

    Raises:
        UnreadableFileError: If the file cannot be read.
        SarError: If the file cannot be written.
    """
    if os.environ.get(RENEW):
        _write(path, text)
        return None
    if not is_there(path):
        return f"the golden file {path} does not exist. Run with {RENEW}=1 to write the file, then review and commit it"
    expected = read_file(path, RECORDED_OUTPUT).data.decode("utf-8", "replace")
    if text == expected:
        return None
    # The time of a comparison is proportional to the product of both lengths, and people do not read long differences.
    old, new = (each.splitlines()[:_MOST_COMPARED] for each in (expected, text))
    lines = [*difflib.unified_diff(old, new, f"{path} (committed)", what, lineterm="")]
    if not lines or len(lines) > _MOST_SHOWN:
        lines = [
            *lines[:_MOST_SHOWN],
            f"... there are more differences, possibly after line {_MOST_COMPARED:,}",
        ]
    return "\n".join(
        [
            *map(shorten, lines),
            f"If the change is intended, run with {RENEW}=1 and review the rewritten file.",
        ]
    )


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise SarError(f"cannot write {path}: {error.strerror}") from error
