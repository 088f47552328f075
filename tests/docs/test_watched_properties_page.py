"""The page about flights that are watched for properties does what it says."""

from pathlib import Path

import pytest

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/watch-a-run.md").resolve()


@pytest.mark.costly
def test_the_page_about_watched_flights_does_what_it_says(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 3
    assert otherwise == [], "\n".join(otherwise)
