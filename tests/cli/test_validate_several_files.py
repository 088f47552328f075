"""Tests of `validate` on several files, folders and standard input, and of its text output."""

import json
import os
import pty
import subprocess
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest

from sar_compiler import terminal
from sar_compiler.tree.diagnostic import Diagnostic, Severity, Source, Span
from sar_compiler.tree.model import NO_SPANS
from tests.cli import command_runner
from tests.processes import BIN
from tests.trees import document

CORRECT = document("<NavigateToBase/>")
WRONG = document("<NavigateToBse/>")
NEEDLESS = document("<Sequence><ZonesRemaining/></Sequence>")
LONG = document(f'<Sequence name="{"x" * 300}"><NavigateToBse/></Sequence>')


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)


def write(name, text):
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(text, encoding="utf-8")


def run(capsys, *arguments):
    return command_runner.run(capsys, "validate", *arguments)


def test_files_of_folder_are_counted_and_correct_files_are_not_named(capsys):
    write("ws/a.xml", CORRECT)
    write("ws/deep/b.xml", WRONG)
    write("ws/package.xml", "<package/>")
    status, out, err = run(capsys, "ws")
    assert (status, err) == (1, "1 error in 2 files\n")
    assert out.startswith("ws/deep/b.xml:3:1: error[unknown-node]")
    assert "no findings" not in out


def test_files_of_folder_may_include_each_other(capsys):
    write("ws/home.xml", document("<NavigateToBase/>", "Home"))
    text = document('<SubTree ID="Home"/>').replace("<Beh", '<include path="../home.xml"/><Beh')
    write("ws/deep/main.xml", text.replace("<root", '<root main_tree_to_execute="Main"'))
    assert run(capsys, "ws") == (0, "", "no findings in 2 files\n")
    assert run(capsys, "ws/deep/main.xml") == (0, "ws/deep/main.xml: no findings\n", "")
    assert "error[include-outside]" in run(capsys, "--isolated", "ws/deep")[1]


def test_files_of_folder_without_findings_are_counted(capsys):
    write("ws/a.xml", CORRECT)
    write("ws/b.xml", CORRECT)
    assert run(capsys, "ws") == (0, "", "no findings in 2 files\n")


def test_folder_without_tree_files_has_status_2(capsys):
    write("ws/package.xml", "<package/>")
    assert run(capsys, "ws") == (2, "", "sar-compile: ws has no tree file\n")


def test_file_named_twice_is_checked_once(capsys):
    write("ws/a.xml", WRONG)
    Path("ws/link.xml").symlink_to("a.xml")
    status, out, err = run(capsys, "ws/a.xml", "ws")
    assert (status, out.count("unknown-node"), err) == (1, 1, "1 error in 1 file\n")


def test_single_correct_file_has_no_count(capsys):
    write("a.xml", CORRECT)
    assert run(capsys, "a.xml") == (0, "a.xml: no findings\n", "")


def test_findings_are_counted_by_severity_and_fixability(capsys):
    write("a.xml", document('<Sequence><NavigateToZone _skipif="true"/><NavigateToBse/></Sequence>'))
    write("b.xml", NEEDLESS)
    write("c.xml", document('<Script code="a := b"/>'))
    counts = "2 errors, 1 warning, 2 infos in 3 files; 1 fixable with --fix\n"
    assert run(capsys, "a.xml", "b.xml", "c.xml")[2] == counts


@pytest.mark.parametrize("form", ["json", "sarif", "github"])
def test_machine_readable_formats_have_no_count(capsys, form):
    write("a.xml", WRONG)
    assert run(capsys, "--format", form, "a.xml")[2] == ""


def test_files_may_use_trees_of_each_other(capsys):
    write("main.xml", document('<SubTree ID="Home"/>'))
    write("trees/home.xml", document("<NavigateToBase/>", "Home"))
    assert run(capsys, "main.xml", "trees/home.xml")[0] == 0
    assert run(capsys, ".") == (0, "", "no findings in 2 files\n")
    assert run(capsys, "main.xml") == (
        0,
        "main.xml: no findings\n",
        "note: trees are taken from trees/home.xml\n",
    )
    assert run(capsys, "--isolated", "main.xml")[0] == 1


def test_error_in_shared_tree_is_reported_once(capsys):
    for name in ("one", "two"):
        write(f"{name}.xml", document('<SubTree ID="Home"/>', name))
    write("home.xml", document("<NavigateToBse/>", "Home"))
    status, out, err = run(capsys, "one.xml", "two.xml", "home.xml")
    assert (status, out.count("error["), err) == (1, 1, "1 error in 3 files\n")
    _, out, _ = run(capsys, "--format", "json", "one.xml", "two.xml", "home.xml")
    assert [finding["file"] for finding in json.loads(out)] == ["home.xml"]


def test_fix_in_shared_file_applies_to_files_that_use_it(capsys):
    write("main.xml", document('<SubTree ID="Home"/>'))
    write("home.xml", document('<NavigateToBase oneshott="ON_COMPLETION"/>', "Home"))
    status, out, _ = run(capsys, "--fix", "main.xml", "home.xml")
    assert (status, out.splitlines()) == (
        0,
        [
            "home.xml:3:17: fixed[unknown-attribute]: oneshott -> oneshot",
            "main.xml: no findings",
            "home.xml: no findings",
        ],
    )


YAML = "root:\n  children:\n    - BehaviorTree:\n        ID: Main\n        children: [NavigateToBse]\n"


@pytest.mark.parametrize(("text", "place"), [(WRONG, "3:1"), (YAML, "5:20")])
def test_form_of_standard_input_is_detected_from_content(capsys, monkeypatch, text, place):
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(text.encode())))
    status, out, err = run(capsys, "-")
    assert (status, err) == (1, "1 error in 1 file\n")
    assert out.startswith(f"<stdin>:{place}: error[unknown-node]: there is no node 'NavigateToBse'")


def test_standard_input_uses_configuration_and_includes_of_current_folder(capsys, monkeypatch):
    write("sar.toml", '[findings]\nneedless-node = "error"\n')
    write("home.xml", document("<NavigateToBase/>", "Home"))
    text = NEEDLESS.replace("<ZonesRemaining/>", '<SubTree ID="Home"/>').replace(
        '"4">', '"4" main_tree_to_execute="Main"><include path="home.xml"/>'
    )
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(text.encode())))
    status, out, _ = run(capsys, "-")
    assert (status, out.count("error[")) == (1, 1)
    assert "<stdin>:3:1: error[needless-node]" in out


def test_machine_readable_formats_contain_hints(capsys):
    write("a.xml", document("<Nothing/>"))
    _, out, _ = run(capsys, "--format", "json", "a.xml")
    (finding,) = json.loads(out)
    assert (finding["suggestion"], finding["hint"][:20]) == (None, "list the known nodes")
    for form in ("sarif", "github"):
        assert finding["hint"] in run(capsys, "--format", form, "a.xml")[1]


def write_many_errors(monkeypatch):
    monkeypatch.setattr("sar_compiler.checks.MOST", 2)
    write("a.xml", document(f"<Sequence>{'<NavigateToBse/>' * 5}</Sequence>"))


def test_text_output_reports_number_of_hidden_findings(capsys, monkeypatch):
    write_many_errors(monkeypatch)
    status, out, err = run(capsys, "a.xml")
    assert (status, err) == (1, "2 errors, others not shown in 1 file\n")
    assert "info[more-findings]: 3 more unknown-node findings are not shown" in out


def test_machine_readable_formats_report_hidden_findings(capsys, monkeypatch):
    write_many_errors(monkeypatch)
    last = json.loads(run(capsys, "--format", "json", "a.xml")[1])[-1]
    assert (last["severity"], last["code"], last["message"]) == (
        "info",
        "more-findings",
        "3 more unknown-node findings are not shown",
    )
    result = json.loads(run(capsys, "--format", "sarif", "a.xml")[1])["runs"][0]["results"][-1]
    assert (result["ruleId"], result["level"]) == ("more-findings", "note")
    assert "::notice " in run(capsys, "--format", "github", "a.xml")[1].splitlines()[-1]


def run_on_terminal(*arguments, columns=60, **variables):
    """Run a command on a terminal; return its output."""
    ours, theirs = pty.openpty()
    environment = {name: value for name, value in os.environ.items() if name not in variables}
    environment |= {"TERM": "xterm", **variables}
    script = f"stty cols {columns} < /dev/stdin; exec {BIN / 'sar-compile'} {' '.join(arguments)}"
    with subprocess.Popen(
        ["/bin/sh", "-c", script], stdin=theirs, stdout=theirs, stderr=theirs, env=environment
    ):
        os.close(theirs)
        shown = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # the command has ended
                break
            if not part:
                break
            shown += part
    os.close(ours)
    return shown.decode().replace("\r\n", "\n")


def test_findings_on_terminal_are_coloured_and_fit_its_width():
    write("a.xml", LONG)
    head, excerpt, *_ = run_on_terminal("validate", "a.xml").splitlines()
    assert "\x1b[1;31merror[unknown-node]\x1b[0m" in head
    assert len(excerpt.replace("\x1b[2m", "").replace("\x1b[0m", "")) == 60
    assert "\x1b" not in run_on_terminal("validate", "a.xml", NO_COLOR="1")
    assert "\x1b[1;31merror[unknown-node]" in run_on_terminal("show", "a.xml")


class Terminal(BytesIO):
    """A stream that reports that it is a terminal."""

    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("variables", "in_file", "on_terminal"),
    [
        ({}, False, True),
        ({"NO_COLOR": "1"}, False, False),
        ({"NO_COLOR": ""}, False, True),
        ({"CLICOLOR": "0"}, False, False),
        ({"CLICOLOR_FORCE": "1"}, True, True),
        ({"CLICOLOR_FORCE": "0"}, False, True),
        ({"CLICOLOR_FORCE": "1", "NO_COLOR": "1"}, False, False),
        ({"TERM": "dumb"}, False, False),
    ],
)
def test_environment_variables_control_colours(monkeypatch, variables, in_file, on_terminal):
    monkeypatch.setenv("TERM", "xterm")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert terminal.has_colours(TextIOWrapper(BytesIO())) is in_file
    assert terminal.has_colours(TextIOWrapper(Terminal())) is on_terminal


def test_coloured_finding_has_same_text_as_plain_finding(capsys, monkeypatch):
    write("a.xml", LONG)
    plain = run(capsys, "a.xml")[1]
    monkeypatch.setenv("CLICOLOR_FORCE", "1")
    coloured = run(capsys, "a.xml")[1]
    for number in ("1", "1;31", "2", "32", "0"):
        coloured = coloured.replace(f"\x1b[{number}m", "")
    assert (coloured, len(plain.splitlines()[1])) == (plain, 128)


@pytest.mark.parametrize(
    ("severity", "style"), [(Severity.ERROR, "1;31"), (Severity.WARNING, "1;33"), (Severity.INFO, "1;36")]
)
def test_each_severity_has_its_colour(monkeypatch, severity, style):
    monkeypatch.setenv("CLICOLOR_FORCE", "1")
    source = Source("a.xml", "<a/>", NO_SPANS)
    finding = Diagnostic("unknown-node", "no node", source, Span(1, 1, 1, 5), severity=severity)
    coloured = terminal.findings_as_text([finding], TextIOWrapper(BytesIO()))
    assert f"\x1b[{style}m{severity.value}[unknown-node]" in coloured


def test_folder_hides_shipped_tree_of_same_name_only_if_it_has_trees(capsys):
    Path("search_and_rescue").mkdir()
    status, out, err = run(capsys, "search_and_rescue")
    assert (status, err) == (0, "")
    assert out.endswith("search_and_rescue.xml: no findings\n")
    write("search_and_rescue/mine.xml", WRONG)
    assert "search_and_rescue/mine.xml" in run(capsys, "search_and_rescue")[1]
