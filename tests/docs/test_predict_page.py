"""Tests of the how-to page about predictions: its commands print the shown output."""

from pathlib import Path

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/success-probability.md").resolve()


def test_commands_on_prediction_page_print_shown_output(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 1
    assert otherwise == [], "\n".join(otherwise)
