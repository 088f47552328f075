"""The page about flights that are compared with proofs does what it says."""

from pathlib import Path

import pytest

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/compare-runs.md").resolve()


@pytest.mark.costly
@pytest.mark.ros
def test_the_page_about_comparing_flights_with_proofs_does_what_it_says(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 4
    assert otherwise == [], "\n".join(otherwise)
