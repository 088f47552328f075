"""Comparing texts with reviewed and committed files."""

import difflib
import os
from pathlib import Path

from sar_compiler.errors import SarError
from sar_compiler.opener import RECORDED_OUTPUT, read_file

RENEW = "SAR_RENEW_GOLDEN"
"""The environment variable that has such files written anew."""


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
    if not path.is_file():
        return f"there is no golden file {path} yet: run with {RENEW}=1, then review and commit it"
    expected = read_file(path, RECORDED_OUTPUT).data.decode("utf-8", "replace")
    if text == expected:
        return None
    lines = difflib.unified_diff(
        expected.splitlines(), text.splitlines(), f"{path} (committed)", what, lineterm=""
    )
    return "\n".join([*lines, f"If this is meant, run with {RENEW}=1 and review the change."])


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise SarError(f"cannot write {path}: {error.strerror}") from error
