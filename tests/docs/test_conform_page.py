"""Tests of the how-to page about comparing runs: its commands print the shown output."""

from pathlib import Path

import pytest

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/compare-runs.md").resolve()


@pytest.mark.costly
@pytest.mark.ros
def test_commands_on_compare_runs_page_print_shown_output(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 4
    assert otherwise == [], "\n".join(otherwise)
