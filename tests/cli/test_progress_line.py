"""How far something is, in a line on standard error."""

import io

import pytest

from sar_compiler.terminal import ProgressLine

TERMINAL, FILE = True, False


class Screen(io.StringIO):
    """Standard error, on a terminal or not."""

    def __init__(self, is_terminal):
        super().__init__()
        self._is_terminal = is_terminal

    def isatty(self):
        return self._is_terminal


@pytest.fixture
def shown(monkeypatch):
    """Return what was shown after texts, each with the seconds since the beginning."""

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


def test_what_is_over_within_a_second_says_nothing(shown):
    assert shown(TERMINAL, (0.5, "half"), (0.9, "nearly")) == ""


def test_on_a_terminal_a_line_is_overwritten_and_goes_away(shown):
    assert shown(TERMINAL, (1.0, "10 %"), (1.1, "11 %"), (2.0, "20 %")) == "\r\x1b[K10 %\r\x1b[K20 %\r\x1b[K"


def test_a_line_that_is_wider_than_the_terminal_is_cut(shown):
    assert shown(TERMINAL, (1.0, "x" * 100)) == f"\r\x1b[K{'x' * 79}\r\x1b[K"


@pytest.mark.parametrize("where", [{"is_terminal": FILE}, {"is_terminal": TERMINAL, "term": "dumb"}])
def test_where_nothing_can_be_overwritten_nothing_is_said(shown, where):
    term = where.get("term", "xterm")
    assert shown(where["is_terminal"], (5.0, "5"), (60.0, "60"), term=term) == ""
