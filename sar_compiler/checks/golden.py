"""Comparing texts with reviewed and committed files."""

import difflib
import os
from pathlib import Path

RENEW = "SAR_RENEW_GOLDEN"
"""The environment variable that has such files written anew."""


def difference(path: Path, text: str, what: str) -> str | None:
    """Compare a text with a committed file; where the files are to be written anew, write it instead.

    Args:
        path: The file.
        text: The text.
        what: What it is, for the difference: "my_mission.xml (compiled now)".

    Returns:
        None if they are the same, else what is different, or that there is no file yet.
    """
    if os.environ.get(RENEW):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return None
    if not path.is_file():
        return f"there is no golden file {path} yet: run with {RENEW}=1, then review and commit it"
    expected = path.read_text(encoding="utf-8")
    if text == expected:
        return None
    lines = difflib.unified_diff(
        expected.splitlines(), text.splitlines(), f"{path} (committed)", what, lineterm=""
    )
    return "\n".join([*lines, f"If this is meant, run with {RENEW}=1 and review the change."])
