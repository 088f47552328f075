"""Tests of the pages about findings: the bad example of each page produces the finding, the good example produces none."""

import ast
import os
import re
import shlex
import subprocess
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from sar_compiler.testing import RENEW
from sar_compiler.tree.kinds import KINDS, SEVERITIES
from tests.docs.markdown import Block, blocks
from tests.processes import BIN

PAGES = Path("docs/findings")
TABLE = PAGES / "README.md"
CODES = list(KINDS)
_SECTIONS = ["Bad", "Finding", "Good"]
_PLACE = re.compile(r"(?<![\w.])\S+:\d+:\d+: (error|warning|info)\[([a-z-]+)\]: ")
# Functions whose arguments are the code of a finding and its message.
_FINDING_FACTORIES = {
    "Diagnostic",
    "SchemaViolation",
    "add",
    "finding",
    "report",
    "report_finding",
    "text_of_output",
    "_refuse",
    "_report",
}
# A single command that can run in this process. With --nodes it could not, because the modules would stay imported.
ALONE = re.compile(r"sar-compile (?!.*--nodes)[^\n|>;&$]*\n")
# The title of a page and the severity below it.
_HEAD = re.compile(r"\A# .*\n\n\*\w+\*\n")
_OMITTED = re.compile(r"\[INFO\]|[\d,]+ (error|warning|info)s?\b.* in \d+ files?\b")
_CODE = re.compile(r"[a-z]+(-[a-z]+)*")
# A command may have to start ROS first.
_TIMEOUT_SEC = 120.0


@dataclass
class Page:
    """A page about a finding, with the code blocks of its sections."""

    text: str
    sections: dict[str, list[Block]]

    def commands(self, section: str) -> str | None:
        """Return the commands of a section; None if the example is only validated."""
        return next((block.text for block in self.sections[section] if block.language == "sh"), None)

    def shown(self) -> str:
        """Return the output that the page shows."""
        return next(block.text for block in self.sections["Finding"] if block.language == "text")


def page_of(code):
    path = PAGES / f"{code}.md"
    text = path.read_text(encoding="utf-8")
    starts = [text[: match.start()].count("\n") for match in re.finditer(r"^## ", text, re.MULTILINE)]
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == _SECTIONS
    sections: dict[str, list[Block]] = {name: [] for name in _SECTIONS}
    for block in blocks(path):
        index = sum(start < block.line for start in starts) - 1
        sections[_SECTIONS[index]].append(block)
    return Page(text, sections)


def write(files, folder, default):
    """Write the files of a section; return the name of the file whose stem is the default, or the default."""
    written = default
    for block in files:
        if block.language in {"sh", "text"}:
            continue
        name = block.file or f"{default}.{block.language}"
        if Path(name).stem == default:
            written = name
        (folder / name).write_text(block.text, encoding="utf-8")
    return written


def seen(commands, name, folder, monkeypatch):
    """Return the output of a section's commands. Several commands, or commands with --nodes, run in a new process."""
    line = commands or f"sar-compile validate {name}\n"
    if ALONE.fullmatch(line):
        monkeypatch.chdir(folder)
        written = BytesIO()
        output = TextIOWrapper(written, encoding="utf-8", write_through=True)
        with redirect_stdout(output), redirect_stderr(output), suppress(SystemExit):
            main(shlex.split(line)[1:])
        return written.getvalue().decode()
    environment = {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["/bin/bash", "-c", commands],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=_TIMEOUT_SEC,
    )
    return done.stdout


def needs_ros(code):
    return "sar-run" in (PAGES / f"{code}.md").read_text(encoding="utf-8")


CODE_PARAMETERS = [pytest.param(code, marks=[pytest.mark.ros] if needs_ros(code) else []) for code in CODES]


@pytest.mark.parametrize("code", CODE_PARAMETERS)
def test_bad_example_produces_shown_finding(code, tmp_path, monkeypatch):
    page = page_of(code)
    name = write(page.sections["Bad"], tmp_path, "bad")
    output = seen(page.commands("Finding"), name, tmp_path, monkeypatch)
    assert plain(output) == plain(page.shown())
    assert set(_PLACE.findall(output)) == {(SEVERITIES[code].value, code)}


@pytest.mark.parametrize("code", CODE_PARAMETERS)
def test_good_example_has_no_findings(code, tmp_path, monkeypatch):
    page = page_of(code)
    write(page.sections["Bad"], tmp_path, "bad")
    name = write(page.sections["Good"], tmp_path, "good")
    output = seen(page.commands("Good"), name, tmp_path, monkeypatch)
    assert _PLACE.findall(output) == []
    if page.commands("Good") is None:
        assert output == f"{name}: no findings\n"


def plain(output):
    """Return the output of a command without ROS log lines, which contain times, and without counts."""
    kept = (f"{line.rstrip()}\n" for line in output.splitlines() if not _OMITTED.match(line))
    return "".join(kept).rstrip("\n")


def test_head_of_every_page_matches_declaration_as_reviewed():
    old = []
    for code in CODES:
        head, path = f"# `{code}`\n\n*{SEVERITIES[code].value}*\n", PAGES / f"{code}.md"
        if os.environ.get(RENEW):
            written = path.read_text(encoding="utf-8") if path.exists() else ""
            path.write_text(head + _HEAD.sub("", written), encoding="utf-8")
        if not path.is_file() or not path.read_text(encoding="utf-8").startswith(head):
            old.append(code)
    assert old == [], "renew them: make schemas"


def test_list_of_findings_matches_declarations_as_reviewed():
    rows = (f"- **[`{code}`]({code}.md)** ({SEVERITIES[code].value}): {KINDS[code]}\n" for code in CODES)
    sign = "<!-- Made of the kinds of findings by `make schemas`. -->\n"
    above = TABLE.read_text(encoding="utf-8").partition(sign)[0]
    wanted = f"{above}{sign}\n{''.join(rows)}"
    if os.environ.get(RENEW):
        TABLE.write_text(wanted, encoding="utf-8")
    assert TABLE.read_text(encoding="utf-8") == wanted, "renew it: make schemas"


def test_every_page_documents_a_finding_code():
    assert sorted(path.stem for path in PAGES.glob("*.md") if path != TABLE) == CODES


def constants(node):
    """Yield the finding codes that an expression can evaluate to."""
    if isinstance(node, ast.IfExp):
        yield from (*constants(node.body), *constants(node.orelse))
    elif isinstance(node, ast.Constant) and isinstance(node.value, str) and _CODE.fullmatch(node.value):
        yield node.value


def codes_in(path):
    """Yield the codes of a module's findings: first arguments of factory calls, and values assigned to `code`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in _FINDING_FACTORIES and len(node.args) > 1:
                yield from constants(node.args[0])
        elif isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "code":
            yield from constants(node.value)


def test_codes_in_sources_match_declared_kinds():
    made = {code for path in Path("sar_compiler").rglob("*.py") for code in codes_in(path)}
    assert sorted(made) == CODES


def test_explain_prints_page(capsys):
    code = CODES[0]
    assert main(["explain", code]) == 0
    assert capsys.readouterr().out == (PAGES / f"{code}.md").read_text(encoding="utf-8")


def test_explain_suggests_nearest_code_for_unknown_one(capsys):
    assert main(["explain", "unknown-nod"]) == 2
    error = "sar-compile: there is no finding code 'unknown-nod'; did you mean 'unknown-node'?\n"
    assert capsys.readouterr().err == error
