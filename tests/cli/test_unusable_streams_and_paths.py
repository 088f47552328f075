"""Tests of standard streams and paths that cannot be used: each is reported in one line, with status 2."""

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


def run_in_shell(line, **variables):
    """Run a line in a shell; return the status and the standard error."""
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
def test_full_disk_is_reported(command):
    prog = command.split()[0]
    full = f"{prog}: standard output cannot be written: No space left on device\n"
    assert run_in_shell(f"{command} > /dev/full") == (2, full)


@pytest.mark.parametrize(
    "command",
    ["sar-compile validate tree.xml", "sar-compile show tree.xml", "sar-run tree.xml", "sar-sim map"],
)
def test_closed_standard_output_is_reported(command):
    assert run_in_shell(f"{command} >&-") == (2, f"{command.split()[0]}: standard output is closed\n")


@pytest.mark.parametrize(
    "command", ["validate wrong.xml", "validate --format json wrong.xml", "show tree.xml"]
)
def test_character_outside_output_encoding_is_reported(command):
    status, error = run_in_shell(f"sar-compile {command} > out.txt", **ASCII)
    assert (status, error.count("\n")) == (2, 1)
    assert error.startswith(
        "sar-compile: standard output cannot be written: its encoding is ascii, which cannot represent '\\u04"
    )
    assert error.endswith("'. Choose a UTF-8 locale, or set PYTHONUTF8=1\n")


def test_closed_standard_error_is_not_redirected_to_standard_output():
    assert run_in_shell("sar-compile validate wrong.xml 2>&- > out.txt") == (1, "")
    assert "in 1 file" not in Path("out.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_status_is_2_if_no_output_can_be_written(unbuffered):
    assert run_in_shell("sar-compile validate tree.xml > /dev/full 2>&1", PYTHONUNBUFFERED=unbuffered)[0] == 2


def test_closed_standard_input_is_reported():
    told = "sar-compile: cannot read standard input: it is closed\n"
    assert run_in_shell("sar-compile validate - <&-") == (2, told)


def test_ascii_output_is_written_in_ascii_locale():
    assert run_in_shell("sar-compile validate tree.xml > out.txt", **ASCII) == (0, "")


def test_closed_pipe_is_no_error():
    assert run_in_shell("sar-compile nodes | true")[1] == ""


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
def test_circular_links_are_reported(command, capsys):
    Path("one.xml").symlink_to("two.xml")
    Path("two.xml").symlink_to("one.xml")
    assert main([*command, "one.xml"]) == 2
    assert capsys.readouterr() == (
        "",
        "sar-compile: cannot read one.xml: Too many levels of symbolic links\n",
    )


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_named_pipe_is_reported_without_waiting(command, capsys):
    os.mkfifo("pipe.xml")
    assert main([*command, "pipe.xml"]) == 2
    assert capsys.readouterr() == ("", "sar-compile: cannot read pipe.xml: it is a pipe, not a file\n")


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_empty_file_name_is_reported(command, capsys):
    assert main([*command, ""]) == 2
    assert capsys.readouterr() == ("", "sar-compile: the name of the tree file is empty\n")


def test_circular_output_link_is_reported_and_kept(capsys):
    Path("out.yaml").symlink_to("out.yaml")
    assert main(["convert", "--to", "yaml", "tree.xml", "-o", "out.yaml"]) == 2
    assert (
        capsys.readouterr().err == "sar-compile: cannot write out.yaml: Too many levels of symbolic links\n"
    )
    assert Path("out.yaml").is_symlink()


@pytest.mark.ros
def test_sar_run_with_empty_name_does_not_start_default_mission():
    status, error = run_in_shell("sar-run ''")
    assert status == 2
    assert error.endswith("sar-run: error: the name of the tree file is empty\n")


@pytest.mark.ros
def test_sar_run_runs_tree_chosen_by_id():
    two = "".join(
        f'<BehaviorTree ID="To{name}"><Always{name}/></BehaviorTree>' for name in ("Success", "Failure")
    )
    Path("two.xml").write_text(f"<root>{two}</root>", encoding="utf-8")
    assert run_in_shell("sar-run two.xml --tree ToSuccess > out.txt")[0] == 0
    assert run_in_shell("sar-run two.xml --tree ToFailure > out.txt")[0] == 1
    status, error = run_in_shell("sar-run two.xml > out.txt")
    assert status == 2
    assert "(ToSuccess, ToFailure), but does not say which is the main tree" in error
