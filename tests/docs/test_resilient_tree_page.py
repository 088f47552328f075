"""The page about the resilient tree does what it says."""

from pathlib import Path

import pytest

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/missions/resilient-tree.md").resolve()


@pytest.mark.costly
def test_the_page_about_the_resilient_tree_does_what_it_says(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 5
    assert otherwise == [], "\n".join(otherwise)
