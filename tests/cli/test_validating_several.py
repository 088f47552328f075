"""`validate` on several files, folders and standard input, and how it shows what it finds."""

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
from tests.cli import running
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
    return running.run(capsys, "validate", *arguments)


def test_the_files_of_a_folder_are_checked_and_counted_and_correct_ones_are_not_named(capsys):
    write("ws/a.xml", CORRECT)
    write("ws/deep/b.xml", WRONG)
    write("ws/package.xml", "<package/>")
    status, out, err = run(capsys, "ws")
    assert (status, err) == (1, "1 error in 2 files\n")
    assert out.startswith("ws/deep/b.xml:3:1: error[unknown-node]")
    assert "no findings" not in out


def test_files_of_a_folder_may_include_each_other(capsys):
    write("ws/home.xml", document("<NavigateToBase/>", "Home"))
    text = document('<SubTree ID="Home"/>').replace("<Beh", '<include path="../home.xml"/><Beh')
    write("ws/deep/main.xml", text.replace("<root", '<root main_tree_to_execute="Main"'))
    assert run(capsys, "ws") == (0, "", "no findings in 2 files\n")
    assert run(capsys, "ws/deep/main.xml") == (0, "ws/deep/main.xml: no findings\n", "")
    assert "error[include-outside]" in run(capsys, "--isolated", "ws/deep")[1]


def test_a_folder_without_findings_is_counted(capsys):
    write("ws/a.xml", CORRECT)
    write("ws/b.xml", CORRECT)
    assert run(capsys, "ws") == (0, "", "no findings in 2 files\n")


def test_a_folder_without_tree_files_has_status_2(capsys):
    write("ws/package.xml", "<package/>")
    assert run(capsys, "ws") == (2, "", "sar-compile: ws has no tree file\n")


def test_a_file_that_is_named_twice_is_checked_once(capsys):
    write("ws/a.xml", WRONG)
    Path("ws/link.xml").symlink_to("a.xml")
    status, out, err = run(capsys, "ws/a.xml", "ws")
    assert (status, out.count("unknown-node"), err) == (1, 1, "1 error in 1 file\n")


def test_one_correct_file_is_not_counted(capsys):
    write("a.xml", CORRECT)
    assert run(capsys, "a.xml") == (0, "a.xml: no findings\n", "")


def test_findings_are_counted_by_severity_with_those_that_can_be_fixed(capsys):
    write("a.xml", document('<Sequence><NavigateToZone _skipif="true"/><NavigateToBse/></Sequence>'))
    write("b.xml", NEEDLESS)
    write("c.xml", document('<Script code="a := b"/>'))
    counts = "2 errors, 1 warning, 2 infos in 3 files; 1 fixable with --fix\n"
    assert run(capsys, "a.xml", "b.xml", "c.xml")[2] == counts


@pytest.mark.parametrize("form", ["json", "sarif", "github"])
def test_tools_are_given_no_count(capsys, form):
    write("a.xml", WRONG)
    assert run(capsys, "--format", form, "a.xml")[2] == ""


def test_the_files_are_one_set(capsys):
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


def test_a_mistake_that_several_files_come_to_is_said_once(capsys):
    for name in ("one", "two"):
        write(f"{name}.xml", document('<SubTree ID="Home"/>', name))
    write("home.xml", document("<NavigateToBse/>", "Home"))
    status, out, err = run(capsys, "one.xml", "two.xml", "home.xml")
    assert (status, out.count("error["), err) == (1, 1, "1 error in 3 files\n")
    _, out, _ = run(capsys, "--format", "json", "one.xml", "two.xml", "home.xml")
    assert [finding["file"] for finding in json.loads(out)] == ["home.xml"]


def test_what_is_mended_in_one_file_is_mended_for_those_that_use_it(capsys):
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
def test_standard_input_is_xml_or_yaml_by_its_content(capsys, monkeypatch, text, place):
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(text.encode())))
    status, out, err = run(capsys, "-")
    assert (status, err) == (1, "1 error in 1 file\n")
    assert out.startswith(f"<stdin>:{place}: error[unknown-node]: there is no node 'NavigateToBse'")


def test_standard_input_has_the_configuration_of_the_current_folder_and_includes_from_it(capsys, monkeypatch):
    write("sar.toml", '[findings]\nneedless-node = "error"\n')
    write("home.xml", document("<NavigateToBase/>", "Home"))
    text = NEEDLESS.replace("<ZonesRemaining/>", '<SubTree ID="Home"/>').replace(
        '"4">', '"4" main_tree_to_execute="Main"><include path="home.xml"/>'
    )
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(text.encode())))
    status, out, _ = run(capsys, "-")
    assert (status, out.count("error[")) == (1, 1)
    assert "<stdin>:3:1: error[needless-node]" in out


def test_hints_are_data_too(capsys):
    write("a.xml", document("<Nothing/>"))
    _, out, _ = run(capsys, "--format", "json", "a.xml")
    (finding,) = json.loads(out)
    assert (finding["suggestion"], finding["hint"][:20]) == (None, "list the known nodes")
    for form in ("sarif", "github"):
        assert finding["hint"] in run(capsys, "--format", form, "a.xml")[1]


def many(monkeypatch):
    monkeypatch.setattr("sar_compiler.checks.MOST", 2)
    write("a.xml", document(f"<Sequence>{'<NavigateToBse/>' * 5}</Sequence>"))


def test_that_there_are_more_findings_of_a_kind_is_said_to_people(capsys, monkeypatch):
    many(monkeypatch)
    status, out, err = run(capsys, "a.xml")
    assert (status, err) == (1, "2 errors, others not shown in 1 file\n")
    assert "info[more-findings]: 3 more unknown-node findings are not shown" in out


def test_that_there_are_more_findings_of_a_kind_is_said_to_tools(capsys, monkeypatch):
    many(monkeypatch)
    last = json.loads(run(capsys, "--format", "json", "a.xml")[1])[-1]
    assert (last["severity"], last["code"], last["message"]) == (
        "info",
        "more-findings",
        "3 more unknown-node findings are not shown",
    )
    result = json.loads(run(capsys, "--format", "sarif", "a.xml")[1])["runs"][0]["results"][-1]
    assert (result["ruleId"], result["level"]) == ("more-findings", "note")
    assert "::notice " in run(capsys, "--format", "github", "a.xml")[1].splitlines()[-1]


def on_a_terminal(*arguments, columns=60, **variables):
    """Run a command on a terminal; return what it shows."""
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
            except OSError:  # nobody writes any more
                break
            if not part:
                break
            shown += part
    os.close(ours)
    return shown.decode().replace("\r\n", "\n")


def test_on_a_terminal_findings_have_colours_and_its_width():
    write("a.xml", LONG)
    head, excerpt, *_ = on_a_terminal("validate", "a.xml").splitlines()
    assert "\x1b[1;31merror[unknown-node]\x1b[0m" in head
    assert len(excerpt.replace("\x1b[2m", "").replace("\x1b[0m", "")) == 60
    assert "\x1b" not in on_a_terminal("validate", "a.xml", NO_COLOR="1")
    assert "\x1b[1;31merror[unknown-node]" in on_a_terminal("show", "a.xml")


class Terminal(BytesIO):
    """A stream that says it is a terminal."""

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
def test_the_environment_decides_on_colours(monkeypatch, variables, in_file, on_terminal):
    monkeypatch.setenv("TERM", "xterm")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert terminal.has_colours(TextIOWrapper(BytesIO())) is in_file
    assert terminal.has_colours(TextIOWrapper(Terminal())) is on_terminal


def test_a_finding_without_colours_is_the_same_text(capsys, monkeypatch):
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
def test_each_severity_has_a_colour(monkeypatch, severity, style):
    monkeypatch.setenv("CLICOLOR_FORCE", "1")
    source = Source("a.xml", "<a/>", NO_SPANS)
    finding = Diagnostic("unknown-node", "no node", source, Span(1, 1, 1, 5), severity=severity)
    coloured = terminal.findings_as_text([finding], TextIOWrapper(BytesIO()))
    assert f"\x1b[{style}m{severity.value}[unknown-node]" in coloured


def test_a_folder_hides_the_shipped_tree_of_its_name_only_if_it_has_trees(capsys):
    Path("search_and_rescue").mkdir()
    status, out, err = run(capsys, "search_and_rescue")
    assert (status, err) == (0, "")
    assert out.endswith("search_and_rescue.xml: no findings\n")
    write("search_and_rescue/mine.xml", WRONG)
    assert "search_and_rescue/mine.xml" in run(capsys, "search_and_rescue")[1]
