"""`--view text` on a terminal: what is on the screen while a mission runs, after a change of size, and at the end."""

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
SHOWN = ["[*] Main", "[*] Wait", "[-] Then"]


@pytest.fixture
def begin():
    """Run commands on terminals."""
    begun = []

    def run(*command, **size):
        begun.append(Terminal(*command, **size))
        return begun[-1]

    yield run
    for terminal in begun:
        terminal.kill()


@pytest.fixture
def on_terminal(tmp_path, begin):
    """Run trees on terminals."""

    def run(tree, *arguments, **size):
        path = tmp_path / "tree.xml"
        path.write_text(document(tree), encoding="utf-8")
        return begin("sar-run", path, "--view", "text", *arguments, **size)

    return run


def tree_of(rows):
    """Return the lines of the tree without times and messages."""
    return [row.strip().split("  ")[0] for row in rows if "[" in row and "]: " not in row]


def stands(*expected):
    return lambda rows: tree_of(rows) == list(expected)


def test_the_tree_is_drawn_in_place_on_the_last_lines(on_terminal):
    terminal = on_terminal(WAIT).wait_for(stands(*SHOWN))
    assert [row.split("  ")[0] for row in terminal.rows[-5:-3]] == ["Main", "[*] Main"]
    terminal.wait_for(lambda rows: any("[*] Wait  0:01" in row for row in rows))
    assert tree_of(terminal.history) == SHOWN


def test_it_is_right_after_the_terminal_has_another_size(on_terminal):
    terminal = on_terminal(WAIT).wait_for(stands(*SHOWN))
    for columns, lines in ((40, 12), (100, 40), (80, 24)):
        terminal.resize(columns, lines)
        # Drawn anew: nothing stands twice, and the last line of the tree above the padding of one line at the end.
        terminal.wait_for(lambda rows, lines=lines: stands(*SHOWN)(rows) and "Then" in rows[lines - 2])


def test_a_terminal_that_becomes_too_small_scrolls_as_a_whole_again(on_terminal):
    terminal = on_terminal(WAIT).wait_for(stands(*SHOWN))
    assert terminal.screen.margins is not None
    # The margins of a screen whose lines are left as they are; of others they end by themselves.
    terminal.tell_size(80, 6)
    terminal.wait_for(lambda _: terminal.screen.margins is None)
    terminal.send(signal.SIGINT)
    assert terminal.end() == 130
    assert terminal.screen.margins is None


def test_a_terminal_that_is_too_small_gets_it_back_once_it_is_large_enough(on_terminal):
    terminal = on_terminal(WAIT, lines=6)
    terminal.resize(80, 24)
    terminal.wait_for(stands(*SHOWN))


def test_the_log_scrolls_above_it(on_terminal):
    ros = ("--until", "success", "--ros-args", "-p", "tick_rate_hz:=50.0")
    terminal = on_terminal('<ForceFailure name="Again"><AlwaysSuccess/></ForceFailure>', *ros, columns=120)
    terminal.wait_for(lambda _: any("starting again (40th time)" in row for row in terminal.history))
    terminal.wait_for(stands("[✕] Again", "[✓] AlwaysSuccess"))
    log = [row for row in terminal.history if "starting again (" in row]
    assert "(1st time)" in log[0]
    assert len(log) >= 13


def test_a_large_tree_at_80_by_24_shows_what_runs_and_folds_the_rest(on_terminal):
    folded = "".join(f'<Sequence name="Part {each}"><AlwaysSuccess/></Sequence>' for each in range(50))
    terminal = on_terminal(f'<Sequence name="Main">{folded}<Sleep name="Wait" msec="1000000"/></Sequence>')
    terminal.wait_for(
        lambda rows: any("[*] Wait" in row for row in rows) and any("more" in row for row in rows)
    )
    shown = tree_of(terminal.rows)
    assert shown[0] == "[*] Main"
    assert shown[-2:] == ["[✓] Part 49 > AlwaysSuccess", "[*] Wait"]


def test_at_the_end_the_view_stays_and_the_terminal_is_as_before(on_terminal):
    terminal = on_terminal(WAIT).wait_for(stands(*SHOWN))
    terminal.send(signal.SIGINT)
    assert terminal.end() == 130
    assert tree_of(terminal.rows) == SHOWN
    assert terminal.screen.margins is None
    assert not terminal.screen.cursor.hidden
    # What comes next, a shell's prompt, stands below.
    assert not any(terminal.rows[terminal.screen.cursor.y :])


def test_the_last_picture_says_what_has_come_of_the_run(on_terminal):
    terminal = on_terminal('<AlwaysFailure name="No"/>')
    assert terminal.end() == 1
    assert any(
        row.startswith("No  0:0") and "FAILED: The root of the tree ended with FAILURE." in row
        for row in terminal.rows
    )


def test_while_it_is_stopped_the_terminal_is_the_shell_s(tmp_path, begin):
    path = tmp_path / "tree.xml"
    path.write_text(document(WAIT), encoding="utf-8")
    # With job control, without which nobody could go on with what was stopped, and it is not.
    script = '"$@"; echo "stopped: $?"; read; kill -CONT %1; wait %1; echo "ended: $?"'
    terminal = begin("/bin/bash", "-mc", script, "bash", BIN / "sar-run", path, "--view", "text")
    terminal.wait_for(stands(*SHOWN))
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


def test_a_terminal_that_obeys_nothing_gets_a_line_for_each_change(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document('<AlwaysSuccess name="Done"/>'), encoding="utf-8")
    terminal = Terminal("sar-run", path, "--view", "text", env={"TERM": "dumb"})
    assert terminal.end() == 0
    assert any(row.endswith(":00  Done SUCCESS, success") for row in terminal.rows), terminal.rows
    terminal.kill()


def test_of_a_simulation_the_log_does_not_have_the_time_of_the_wall(on_terminal):
    terminal = on_terminal("<AlwaysFailure/>", "--sim", "empty", "--until", "success", columns=120)
    terminal.wait_for(lambda rows: any(row.startswith("[INFO] [sar_run]: Root FAILURE") for row in rows))


def address(rows):
    """Return the address of the page in what is on a screen."""
    return next((found[0] for row in rows if (found := re.search(r"http://\S+", row))), "")


def test_on_a_terminal_the_page_of_an_ended_run_stays_until_ctrl_c_and_the_status_is_the_mission_s(
    begin, tmp_path
):
    path, seen = tmp_path / "tree.xml", tmp_path / "opened"
    path.write_text(document('<AlwaysFailure name="No"/>'), encoding="utf-8")
    browser = f'{sys.executable} -c \'import sys; open("{seen}", "w").write(sys.argv[1])\' %s'
    options = ("--sim", "empty", "--view", "web", "--web-port", 0, "--open")
    terminal = begin("sar-run", path, *options, columns=200, env={"BROWSER": browser})
    terminal.wait_for("The run has ended. Its page stays open until Ctrl-C: http://")
    url = address(terminal.rows)
    with urllib.request.urlopen(url.partition("#")[0]) as page:  # noqa: S310 - the one that was printed
        assert page.status == 200
    assert seen.read_text(encoding="utf-8") == url
    assert any("To replay it: sar-journal replay " in row for row in terminal.rows)
    terminal.send(signal.SIGINT)
    assert terminal.end() == 1


def test_a_terminal_that_has_no_such_signs_gets_others(on_terminal):
    terminal = on_terminal(WAIT.replace("Then", "Thén"), env={"PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"})
    terminal.wait_for(stands("[*] Main", "[*] Wait", "[-] Th?n"))
