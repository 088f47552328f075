"""What surrounds a command: standard output that cannot be written, paths that lead nowhere; each is a line, and status 2."""

import os
import subprocess
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from tests.processes import BIN
from tests.trees import document

ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = document('<Sequence name="Поиск"><NavigateToZone/><NavigateToBase/></Sequence>')
    Path("tree.xml").write_text(text, encoding="utf-8")
    Path("wrong.xml").write_text(text.replace("<NavigateToBase/>", "<Вернуться/>"), encoding="utf-8")


def typed(line, **variables):
    """Type a line in a shell; return the status and what stands on standard error."""
    done = subprocess.run(
        ["/bin/sh", "-c", line],
        env={**os.environ, **variables, "PATH": f"{BIN}:{os.environ['PATH']}"},
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        timeout=120.0,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    "command",
    [
        "sar-compile validate tree.xml",
        "sar-compile validate --format json wrong.xml",
        "sar-compile show tree.xml",
        "sar-compile nodes",
        "sar-compile convert --to yaml tree.xml",
        "sar-compile --version",
        "sar-run --version",
    ],
)
def test_a_full_disk_is_told(command):
    prog = command.split()[0]
    full = f"{prog}: standard output cannot be written: No space left on device\n"
    assert typed(f"{command} > /dev/full") == (2, full)


@pytest.mark.parametrize(
    "command",
    ["sar-compile validate tree.xml", "sar-compile show tree.xml", "sar-run tree.xml", "sar-sim map"],
)
def test_a_closed_standard_output_is_told_before_anything_is_done(command):
    assert typed(f"{command} >&-") == (2, f"{command.split()[0]}: standard output is closed\n")


@pytest.mark.parametrize(
    "command", ["validate wrong.xml", "validate --format json wrong.xml", "show tree.xml"]
)
def test_a_character_that_standard_output_cannot_show_is_told(command):
    status, error = typed(f"sar-compile {command} > out.txt", **ASCII)
    assert (status, error.count("\n")) == (2, 1)
    assert error.startswith(
        "sar-compile: standard output cannot be written: its encoding is ascii, which cannot represent '\\u04"
    )
    assert error.endswith("'. Choose a UTF-8 locale, or set PYTHONUTF8=1\n")


def test_a_closed_standard_error_sends_nothing_to_standard_output():
    assert typed("sar-compile validate wrong.xml 2>&- > out.txt") == (1, "")
    assert "in 1 file" not in Path("out.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_where_nobody_can_be_told_the_status_tells(unbuffered):
    assert typed("sar-compile validate tree.xml > /dev/full 2>&1", PYTHONUNBUFFERED=unbuffered)[0] == 2


def test_a_closed_standard_input_is_told():
    told = "sar-compile: cannot read standard input: it is closed\n"
    assert typed("sar-compile validate - <&-") == (2, told)


def test_what_has_no_such_character_is_shown():
    assert typed("sar-compile validate tree.xml > out.txt", **ASCII) == (0, "")


def test_a_reader_who_leaves_early_is_no_error():
    assert typed("sar-compile nodes | true")[1] == ""


COMMANDS = [
    ["validate"],
    ["show"],
    ["simulate"],
    ["verify"],
    ["format", "--check"],
    ["convert", "--to", "yaml"],
    ["convert", "--to", "btcpp"],
]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_links_that_lead_round_in_a_circle_are_told(command, capsys):
    Path("one.xml").symlink_to("two.xml")
    Path("two.xml").symlink_to("one.xml")
    assert main([*command, "one.xml"]) == 2
    assert capsys.readouterr() == (
        "",
        "sar-compile: cannot read one.xml: Too many levels of symbolic links\n",
    )


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_named_pipe_is_told_and_not_waited_for(command, capsys):
    os.mkfifo("pipe.xml")
    assert main([*command, "pipe.xml"]) == 2
    assert capsys.readouterr() == ("", "sar-compile: cannot read pipe.xml: it is a pipe, not a file\n")


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_an_empty_name_is_told(command, capsys):
    assert main([*command, ""]) == 2
    assert capsys.readouterr() == ("", "sar-compile: the name of the tree file is empty\n")


def test_an_output_whose_links_lead_round_in_a_circle_is_told_and_stays(capsys):
    Path("out.yaml").symlink_to("out.yaml")
    assert main(["convert", "--to", "yaml", "tree.xml", "-o", "out.yaml"]) == 2
    assert (
        capsys.readouterr().err == "sar-compile: cannot write out.yaml: Too many levels of symbolic links\n"
    )
    assert Path("out.yaml").is_symlink()


@pytest.mark.ros
def test_an_empty_name_does_not_fly_the_default_mission():
    status, error = typed("sar-run ''")
    assert status == 2
    assert error.endswith("sar-run: error: the name of the tree file is empty\n")


@pytest.mark.ros
def test_sar_run_runs_one_of_several_trees_by_its_id():
    two = "".join(
        f'<BehaviorTree ID="To{name}"><Always{name}/></BehaviorTree>' for name in ("Success", "Failure")
    )
    Path("two.xml").write_text(f"<root>{two}</root>", encoding="utf-8")
    assert typed("sar-run two.xml --tree ToSuccess > out.txt")[0] == 0
    assert typed("sar-run two.xml --tree ToFailure > out.txt")[0] == 1
    status, error = typed("sar-run two.xml > out.txt")
    assert status == 2
    assert "(ToSuccess, ToFailure), but does not say which is the main tree" in error
