"""The page about trees that agents write does what it says."""

from pathlib import Path

import pytest

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/agents.md").resolve()


@pytest.mark.ros
def test_the_page_about_agents_does_what_it_says(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 4
    assert otherwise == [], "\n".join(otherwise)
