"""The page about predictions does what it says."""

from pathlib import Path

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/success-probability.md").resolve()


def test_the_page_about_predictions_does_what_it_says(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 1
    assert otherwise == [], "\n".join(otherwise)
