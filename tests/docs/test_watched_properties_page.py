"""Tests of the how-to page about watching a run: its commands print the shown output."""

from pathlib import Path

import pytest

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/watch-a-run.md").resolve()


@pytest.mark.costly
def test_commands_on_watched_run_page_print_shown_output(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 3
    assert otherwise == [], "\n".join(otherwise)
