"""The page about sweeps does what it says."""

from pathlib import Path

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/monte-carlo.md").resolve()


def test_the_page_about_sweeps_does_what_it_says(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 2
    assert otherwise == [], "\n".join(otherwise)
