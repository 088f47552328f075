"""Tests of what all commands share: suggestions for wrong words, rarely used options, and `-` for standard input."""

import io
import sys
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from sar_compiler.cli.run import main as run_main
from sar_compiler.commands import CommandParser
from tests.trees import document

TREE = document("<Sequence><NavigateToZone/><NavigateToBase/></Sequence>")


@pytest.fixture
def parser():
    made = CommandParser("fly", "Fly.")
    made.add_argument("--speed", type=int, default=1, help="how fast")
    made.add_argument("--engine", help="the engine that ticks")
    made.abridge("--engine", speed="speed")
    return made


@pytest.fixture
def set_stdin(monkeypatch):
    """Return a function that puts a text on standard input."""

    def put(text):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))

    return put


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        (["validate", "--formt", "json"], "did you mean '--format'?"),
        (["show", "tree.xml", "--treee", "Main"], "did you mean '--tree'?"),
        (["validate", "tree.xml", "--quux"], "unrecognized arguments: --quux\n"),
    ],
)
def test_unknown_option_is_reported_in_usage_line_and_error_line(capsys, line, meant):
    with pytest.raises(SystemExit) as end:
        main(line)
    usage, error = capsys.readouterr().err.splitlines(keepends=True)
    assert (end.value.code, usage.startswith(f"usage: sar-compile {line[0]} [options] FILE")) == (2, True)
    assert meant in error


@pytest.mark.parametrize(
    ("command", "line", "meant"),
    [
        ("sar-run", ["--simulate"], "unrecognized arguments: --simulate; did you mean '--sim'?"),
        ("sar-run", ["--port", "80"], "unrecognized arguments: --port; did you mean '--web-port'?"),
        ("sar-compile", ["check", "tree.xml"], "; did you mean 'validate'?"),
        ("sar-compile", ["draw", "tree.xml"], "; did you mean 'show'?"),
        ("sar-compile", ["fly", "tree.xml"], "'completion')\n"),
    ],
)
def test_words_of_other_programs_suggest_matching_option_or_command(command, line, meant, capsys):
    with pytest.raises(SystemExit):
        {"sar-run": run_main, "sar-compile": main}[command](line)
    assert meant in capsys.readouterr().err


def test_unknown_node_error_explains_how_to_list_and_add_nodes(capsys):
    assert main(["nodes", "MoveTo"]) == 2
    error = capsys.readouterr().err
    assert "List known nodes with `sar-compile nodes`, and add your own with --nodes PACKAGE.MODULE" in error


def test_rare_option_is_accepted_and_shown_only_by_help_all(parser, capsys):
    assert parser.parse_args(["--engine", "own"]).engine == "own"
    brief = parser.format_help()
    assert "--engine" not in brief
    assert "--speed SPEED  speed\n" in brief
    with pytest.raises(SystemExit):
        parser.parse_args(["--help-all"])
    full = capsys.readouterr().out
    assert "--engine ENGINE  the engine that ticks" in full
    assert "--speed SPEED    how fast" in full


@pytest.mark.parametrize(
    ("line", "status", "shown"),
    [
        (["validate", "-"], 0, "<stdin>: no findings"),
        (["show", "-"], 0, "--> NavigateToZone"),
        (["simulate", "-"], 0, "NavigateToZone"),
        (["verify", "-"], 0, "states"),
        (["convert", "-", "--to", "yaml"], 0, "- NavigateToZone"),
        (["format", "-"], 0, "<NavigateToZone/>"),
        (["diff", "-", "search_and_rescue"], 1, "NavigateToZone"),
    ],
)
def test_each_command_reads_tree_from_standard_input(set_stdin, capsysbinary, line, status, shown):
    set_stdin(TREE)
    assert main(line) == status
    out, err = map(bytes.decode, capsysbinary.readouterr())
    assert shown in out
    assert "error" not in err


def test_format_of_standard_input_writes_to_standard_output(set_stdin, capsysbinary, tmp_path):
    set_stdin(TREE)
    assert main(["format", "-"]) == 0
    canonical = capsysbinary.readouterr().out
    Path(tmp_path, "tree.xml").write_bytes(canonical)
    assert main(["format", "--check", str(tmp_path / "tree.xml")]) == 0
