"""Tests of the texts for each condition of a mission: every row of the table in `docs/operate/page.md`, in all views."""

import re
import signal
import sys
from contextlib import ExitStack, closing
from functools import partial
from html import unescape
from pathlib import Path
from typing import NamedTuple

import pytest

from sar_compiler.cli.journal_command import main
from sar_compiler.web.feed import ReplayFeed
from sar_compiler.web.page_server import PageServer
from sar_compiler.web.replay import Replay
from tests.processes import Command

pytestmark = pytest.mark.unmeasured


class Row(NamedTuple):
    """The scenes, signal and view that show a condition.

    Attributes:
        scenes: The scenes of `tests.web.run_scene`, one for each robot.
        sent: The signal that is sent to the process of the first robot afterwards.
        seen: The view: its own page, a replay, or `sar-journal watch`.
    """

    scenes: tuple[str, ...]
    sent: int = 0
    seen: str = "own"


ROWS = {
    "the robot drives": Row(("driving",)),
    "the operator has paused the mission": Row(("paused",)),
    "Nav2 is not available": Row(("waiting for Nav2",)),
    "the localisation has stopped": Row(("no localisation",)),
    "the mission's process is frozen": Row(("driving",), signal.SIGSTOP),
    "the mission's process was killed": Row(("driving",), signal.SIGKILL),
    "the mission is complete": Row(("complete",)),
    "the mission has failed": Row(("failed",)),
    "the operator has aborted the mission": Row(("aborted",)),
    "replay": Row(("driving",), seen="replay"),
    "replay of a killed run, at its end": Row(("driving",), signal.SIGKILL, "replay"),
    "`watch`, and the process was killed": Row(("driving",), signal.SIGKILL, "watch"),
    "`watch` of two robots": Row(("driving", "paused"), seen="watch"),
}


def table():
    """Return the table of the docs: the cells by column name, by the first column."""
    text = (
        Path("docs/operate/page.md").read_text(encoding="utf-8").partition("\n### Texts of each state\n")[2]
    )
    lines = [line for line in text.partition("\n#")[0].splitlines() if line.startswith("|")]
    names, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {name: dict(zip(names[1:], cells, strict=True)) for name, *cells in rows}


def plain(text):
    """Return a text with all times as 0:00, because they vary, and without backticks."""
    return re.sub(r"\d+:\d\d\b", "0:00", text.replace("`", "")).strip()


@pytest.fixture
def start():
    """Return a function that starts commands; they are killed after the test, also if they are suspended."""
    with ExitStack() as stack:

        def begin(*command):
            started = Command(*command)
            stack.callback(started.kill)
            return started

        yield begin


def address(command):
    """Return the address of the page that a command serves."""
    found = re.search(r"http://\S+", command.wait_for("http://").output)
    assert found
    return found[0]


def go_to_end(browser):
    """Move the slider of a replay to its end."""
    browser.js(
        "const time = document.getElementById('time'); time.value = time.max; time.dispatchEvent(new Event('input'))"
    )


def open_view(row, journals, start, stack, browser):
    """Bring runs to a condition, and open their page; return the runs."""
    python = Path(sys.executable).name
    runs = [
        start(python, "-m", "tests.web.run_scene", scene, journal)
        for scene, journal in zip(row.scenes, journals, strict=True)
    ]
    own = [address(run) for run in runs]
    if row.seen == "own":
        browser.open(own[0])
    if row.sent:
        runs[0].send(row.sent)
    if row.sent == signal.SIGKILL:
        runs[0].end()
    if row.seen == "watch":
        browser.open(address(start("sar-journal", "watch", *journals, "--web-port", 0)))
    elif row.seen == "replay":
        feed = ReplayFeed(Replay(journals), {"robots": ["run"]})
        server = stack.enter_context(closing(PageServer(feed, 0)))
        server.start()
        browser.open(server.url)
        go_to_end(browser)
    return runs


def terminal_line(run):
    """Return the text that a run prints on its terminal after its name and time."""
    before = run.output
    run.send(signal.SIGUSR1)
    said = lambda: run.output.removeprefix(before).strip()  # noqa: E731
    run.wait_until(said, "the line of the terminal")
    return said().split("  ")[2]


def report_outcome(journal):
    """Return the outcome at the top of a journal's report."""
    page = journal.with_suffix(".html")
    assert main(["report", str(journal), "-o", str(page)]) == 0
    (said,) = re.findall(r'<p class="outcome[^>]*>([^<]*)</p>', page.read_text(encoding="utf-8"))
    return unescape(said)


def show_outcome(capsys, journal):
    """Return the state in the first line of `sar-journal show`."""
    capsys.readouterr()
    assert main(["show", str(journal)]) == 0
    return capsys.readouterr().out.splitlines()[0].removeprefix("patrol, ")


def join_robots(said):
    """Return the text about one robot, or the texts about several robots with their names."""
    first, *others = said
    if not others:
        return first
    return "; ".join(f"robot{number}: {each}" for number, each in enumerate([first, *others], 1))


def all_match(read, journals, wanted):
    """Return whether the texts that are read from journals equal a cell."""
    return plain(join_robots(map(read, journals))) == plain(wanted)


STATE_TEXT = """
const said = (place) => [...place.querySelectorAll('strong, time, span')].map((each) => each.textContent).filter(Boolean).join(' ');
const cards = [...document.querySelectorAll('.card')].map((card) => `${card.firstChild.textContent}: ${said(card.querySelector('.state'))}`);
return cards.length ? cards.join('; ') : said(document.getElementById('condition'));
"""
COMMANDS_ENABLED = """
return [...document.querySelectorAll('.stop, .toggle')].some((each) => !each.disabled && each.offsetParent !== null);
"""


@pytest.mark.parametrize("name", ROWS)
def test_all_views_show_documented_texts(name, start, browser, tmp_path, capsys):
    row, wanted = ROWS[name], table()[name]
    journals = [tmp_path / f"robot{number}.journal" for number, _ in enumerate(row.scenes, 1)]
    browser.allow("ERR_CONNECTION_REFUSED", "ERR_INCOMPLETE_CHUNKED_ENCODING", "ERR_CONNECTION_RESET")
    with ExitStack() as stack:
        runs = open_view(row, journals, start, stack, browser)
        said = plain(wanted["Page"])
        browser.wait(lambda: plain(browser.js(STATE_TEXT)) == said, f"{said!r}")
        browser.wait(lambda: browser.js(COMMANDS_ENABLED) == (wanted["Commands"] == "yes"), "the orders")
        is_silent = row.sent != 0
        assert browser.js("return document.body.classList.contains('stale')") == is_silent
        others = wanted["Terminal, report, `sar-journal show`"]
        if row.sent == 0:  # a suspended or killed run prints nothing
            assert plain(join_robots(map(terminal_line, runs))) == plain(others)
        for place, read in (
            ("a report", report_outcome),
            ("`sar-journal show`", partial(show_outcome, capsys)),
        ):
            browser.wait(partial(all_match, read, journals, others), f"{others} in {place}")


def test_every_row_of_table_is_tested():
    assert set(table()) == set(ROWS)
