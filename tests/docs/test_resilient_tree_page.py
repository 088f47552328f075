"""Tests of the page about the resilient tree: its commands print the shown output."""

from pathlib import Path

import pytest

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/missions/resilient-tree.md").resolve()


@pytest.mark.costly
def test_commands_on_resilient_tree_page_print_shown_output(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 5
    assert otherwise == [], "\n".join(otherwise)
