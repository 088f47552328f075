"""Tests of `--view text` on a terminal: the screen during a run, after a resize, and at the end."""

import re
import signal
import sys
import urllib.request

import pytest

from tests.processes import BIN
from tests.terminals import Terminal
from tests.trees import document

pytestmark = pytest.mark.ros

WAIT = '<Sequence name="Main"><Sleep name="Wait" msec="1000000"/><AlwaysSuccess name="Then"/></Sequence>'
TREE_ROWS = ["[*] Main", "[*] Wait", "[-] Then"]


@pytest.fixture
def start_on_terminal():
    """Return a function that runs a command on a terminal."""
    opened_terminals = []

    def run(*command, **size):
        opened_terminals.append(Terminal(*command, **size))
        return opened_terminals[-1]

    yield run
    for terminal in opened_terminals:
        terminal.kill()


@pytest.fixture
def run_on_terminal(tmp_path, start_on_terminal):
    """Return a function that runs a tree on a terminal."""

    def run(tree, *arguments, **size):
        path = tmp_path / "tree.xml"
        path.write_text(document(tree), encoding="utf-8")
        return start_on_terminal("sar-run", path, "--view", "text", *arguments, **size)

    return run


def tree_of(rows):
    """Return the lines of the tree without times and messages."""
    return [row.strip().split("  ")[0] for row in rows if "[" in row and "]: " not in row]


def shows_tree(*expected):
    return lambda rows: tree_of(rows) == list(expected)


def test_tree_is_drawn_in_place_on_last_lines(run_on_terminal):
    terminal = run_on_terminal(WAIT).wait_for(shows_tree(*TREE_ROWS))
    assert [row.split("  ")[0] for row in terminal.rows[-5:-3]] == ["Main", "[*] Main"]
    terminal.wait_for(lambda rows: any("[*] Wait  0:01" in row for row in rows))
    assert tree_of(terminal.history) == TREE_ROWS


def test_tree_is_redrawn_after_resize(run_on_terminal):
    terminal = run_on_terminal(WAIT).wait_for(shows_tree(*TREE_ROWS))
    for columns, lines in ((40, 12), (100, 40), (80, 24)):
        terminal.resize(columns, lines)
        # Redrawn: no row appears twice, and the last row of the tree is above one line of padding.
        terminal.wait_for(
            lambda rows, lines=lines: shows_tree(*TREE_ROWS)(rows) and "Then" in rows[lines - 2]
        )


def test_terminal_that_becomes_too_small_scrolls_as_whole(run_on_terminal):
    terminal = run_on_terminal(WAIT).wait_for(shows_tree(*TREE_ROWS))
    assert terminal.screen.margins is not None
    # Only the reported size changes, because a resize of the screen would reset its margins.
    terminal.tell_size(80, 6)
    terminal.wait_for(lambda _: terminal.screen.margins is None)
    terminal.send(signal.SIGINT)
    assert terminal.end() == 130
    assert terminal.screen.margins is None


def test_tree_appears_when_small_terminal_is_enlarged(run_on_terminal):
    terminal = run_on_terminal(WAIT, lines=6)
    terminal.resize(80, 24)
    terminal.wait_for(shows_tree(*TREE_ROWS))


def test_log_scrolls_above_tree(run_on_terminal):
    ros = ("--until", "success", "--ros-args", "-p", "tick_rate_hz:=50.0")
    terminal = run_on_terminal(
        '<ForceFailure name="Again"><AlwaysSuccess/></ForceFailure>', *ros, columns=120
    )
    terminal.wait_for(lambda _: any("starting again (40th time)" in row for row in terminal.history))
    terminal.wait_for(shows_tree("[✕] Again", "[✓] AlwaysSuccess"))
    log = [row for row in terminal.history if "starting again (" in row]
    assert "(1st time)" in log[0]
    assert len(log) >= 13


def test_large_tree_on_80_by_24_shows_running_nodes_and_folds_rest(run_on_terminal):
    folded = "".join(f'<Sequence name="Part {each}"><AlwaysSuccess/></Sequence>' for each in range(50))
    terminal = run_on_terminal(
        f'<Sequence name="Main">{folded}<Sleep name="Wait" msec="1000000"/></Sequence>'
    )
    terminal.wait_for(
        lambda rows: any("[*] Wait" in row for row in rows) and any("more" in row for row in rows)
    )
    shown = tree_of(terminal.rows)
    assert shown[0] == "[*] Main"
    assert shown[-2:] == ["[✓] Part 49 > AlwaysSuccess", "[*] Wait"]


def test_view_remains_at_end_and_terminal_is_restored(run_on_terminal):
    terminal = run_on_terminal(WAIT).wait_for(shows_tree(*TREE_ROWS))
    terminal.send(signal.SIGINT)
    assert terminal.end() == 130
    assert tree_of(terminal.rows) == TREE_ROWS
    assert terminal.screen.margins is None
    assert not terminal.screen.cursor.hidden
    # The next output, such as a shell's prompt, is below.
    assert not any(terminal.rows[terminal.screen.cursor.y :])


def test_last_view_shows_result_of_run(run_on_terminal):
    terminal = run_on_terminal('<AlwaysFailure name="No"/>')
    assert terminal.end() == 1
    assert any(
        row.startswith("No  0:0") and "FAILED: The root of the tree ended with FAILURE." in row
        for row in terminal.rows
    )


def test_suspended_run_releases_terminal_and_redraws_when_resumed(tmp_path, start_on_terminal):
    path = tmp_path / "tree.xml"
    path.write_text(document(WAIT), encoding="utf-8")
    # With job control, because without it, a suspended process could not be resumed, so the run is not suspended.
    script = '"$@"; echo "stopped: $?"; read; kill -CONT %1; wait %1; echo "ended: $?"'
    terminal = start_on_terminal("/bin/bash", "-mc", script, "bash", BIN / "sar-run", path, "--view", "text")
    terminal.wait_for(shows_tree(*TREE_ROWS))
    terminal.send_to_child(signal.SIGTSTP)
    terminal.wait_for(f"stopped: {128 + signal.SIGTSTP}")
    assert terminal.screen.margins is None
    assert not terminal.screen.cursor.hidden
    terminal.type("\n")
    terminal.wait_for(lambda _: terminal.screen.margins is not None)
    terminal.wait_for(lambda rows: "Then" in rows[22])
    terminal.send_to_child(signal.SIGINT)
    terminal.wait_for("ended: 130")
    assert terminal.screen.margins is None


def test_dumb_terminal_gets_line_for_each_change(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document('<AlwaysSuccess name="Done"/>'), encoding="utf-8")
    terminal = Terminal("sar-run", path, "--view", "text", env={"TERM": "dumb"})
    assert terminal.end() == 0
    assert any(row.endswith(":00  Done SUCCESS, success") for row in terminal.rows), terminal.rows
    terminal.kill()


def test_log_of_simulation_has_no_wall_time(run_on_terminal):
    terminal = run_on_terminal("<AlwaysFailure/>", "--sim", "empty", "--until", "success", columns=120)
    terminal.wait_for(lambda rows: any(row.startswith("[INFO] [sar_run]: Root FAILURE") for row in rows))


def address(rows):
    """Return the address of the page on a screen."""
    return next((found[0] for row in rows if (found := re.search(r"http://\S+", row))), "")


def test_page_of_ended_run_stays_until_ctrl_c_and_status_is_that_of_mission(start_on_terminal, tmp_path):
    path, seen = tmp_path / "tree.xml", tmp_path / "opened"
    path.write_text(document('<AlwaysFailure name="No"/>'), encoding="utf-8")
    browser = f'{sys.executable} -c \'import sys; open("{seen}", "w").write(sys.argv[1])\' %s'
    options = ("--sim", "empty", "--view", "web", "--web-port", 0, "--open")
    terminal = start_on_terminal("sar-run", path, *options, columns=200, env={"BROWSER": browser})
    terminal.wait_for("The run has ended. Its page stays open until Ctrl-C: http://")
    url = address(terminal.rows)
    with urllib.request.urlopen(url.partition("#")[0]) as page:  # noqa: S310 - the one that was printed
        assert page.status == 200
    assert seen.read_text(encoding="utf-8") == url
    assert any("To replay it: sar-journal replay " in row for row in terminal.rows)
    terminal.send(signal.SIGINT)
    assert terminal.end() == 1


def test_ascii_terminal_gets_replacement_characters(run_on_terminal):
    terminal = run_on_terminal(
        WAIT.replace("Then", "Thén"), env={"PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"}
    )
    terminal.wait_for(shows_tree("[*] Main", "[*] Wait", "[-] Th?n"))
