"""Tests of the progress line on standard error."""

import io

import pytest

from sar_compiler.terminal import ProgressLine

TERMINAL, FILE = True, False


class Screen(io.StringIO):
    """Standard error that is a terminal or a file."""

    def __init__(self, is_terminal):
        super().__init__()
        self._is_terminal = is_terminal

    def isatty(self):
        return self._is_terminal


@pytest.fixture
def render(monkeypatch):
    """Return a function that shows texts, each at a time in seconds, and returns the output."""

    def show(is_terminal, *texts, term="xterm"):
        monkeypatch.setenv("TERM", term)
        screen, now = Screen(is_terminal), [0.0]
        monkeypatch.setattr("sys.stderr", screen)
        monkeypatch.setattr("sar_compiler.terminal.time.monotonic", lambda: now[0])
        line = ProgressLine()
        for now[0], text in texts:
            line.show(str(text).strip)
        line.clear()
        return screen.getvalue()

    return show


def test_nothing_is_shown_within_first_second(render):
    assert render(TERMINAL, (0.5, "half"), (0.9, "nearly")) == ""


def test_line_on_terminal_is_overwritten_and_cleared(render):
    assert render(TERMINAL, (1.0, "10 %"), (1.1, "11 %"), (2.0, "20 %")) == "\r\x1b[K10 %\r\x1b[K20 %\r\x1b[K"


def test_line_wider_than_terminal_is_cut(render):
    assert render(TERMINAL, (1.0, "x" * 100)) == f"\r\x1b[K{'x' * 79}\r\x1b[K"


@pytest.mark.parametrize("where", [{"is_terminal": FILE}, {"is_terminal": TERMINAL, "term": "dumb"}])
def test_nothing_is_shown_if_line_cannot_be_overwritten(render, where):
    term = where.get("term", "xterm")
    assert render(where["is_terminal"], (5.0, "5"), (60.0, "60"), term=term) == ""
