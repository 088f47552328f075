"""Tests of the how-to page about agents: its commands print the shown output."""

from pathlib import Path

import pytest

from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/agents.md").resolve()


@pytest.mark.ros
def test_commands_on_agents_page_print_shown_output(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 4
    assert otherwise == [], "\n".join(otherwise)
