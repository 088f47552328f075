"""Tests that all commands report the same findings about a file."""

import functools
import io
import json
import re
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest

from sar_compiler.cli.compile import main
from tests.project.random_repositories import MISTAKES, SETTINGS, Repository
from tests.random_inputs import rounds

# Cheaper tests of each rule and each setting cover the same lines.
pytestmark = pytest.mark.unmeasured

COUNT = rounds(20)
HEAD = re.compile(
    r"^(?P<file>[^\n]+?):(?P<line>\d+):\d+: (?:error|warning|info)\[(?P<code>[\w-]+)\]: (?P<text>.*)$",
    re.MULTILINE,
)


class Reported(NamedTuple):
    """A finding as reported by a command."""

    file: str
    line: int
    code: str
    text: str


def reported_as_text(text: str) -> set[Reported]:
    return {
        Reported(str(Path(each["file"]).resolve()), int(each["line"]), each["code"], each["text"])
        for each in HEAD.finditer(text)
    }


def notes_in(text: str) -> set[str]:
    """Return the notes about palettes. Notes about trees that are not given are left out, because a folder gives all its trees."""
    return {line for line in text.splitlines() if line.startswith("note: nodes are described by")}


def run(*words: object) -> tuple[int, str, str]:
    """Run a command, and return its status and its output on both streams."""
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        status = main([*map(str, words)])
    return status, out.getvalue(), err.getvalue()


def findings_and_notes(name: object) -> tuple[set[Reported], str]:
    """Return the findings of `validate` about a file or folder, and its other output."""
    _, out, err = run("validate", "--no-deep", "--format", "json", name)
    found = {
        Reported(str(Path(each["file"]).resolve()), each["line"], each["code"], each["message"])
        for each in json.loads(out)
    }
    return found, err


findings_and_notes_of_file = functools.cache(findings_and_notes)


@pytest.fixture(scope="module", params=range(COUNT))
def random_repository(request, tmp_path_factory) -> Repository:
    return Repository(tmp_path_factory.mktemp("made") / "repository", request.param)


@pytest.fixture
def repository(random_repository: Repository, monkeypatch) -> Repository:
    monkeypatch.chdir(random_repository.folder)
    return random_repository


@pytest.mark.parametrize("command", ["show", "simulate", "verify"])
def test_every_command_reports_same_findings_as_validate(repository, command):
    for path in repository.trees:
        found, err = findings_and_notes_of_file(path)
        if command != "show" and any(each.code in ("no-tree", "no-main-tree") for each in found):
            continue
        status, _, said = run(command, "--max-seconds", "60", path.relative_to(repository.folder))
        others = {
            "no-tree",
            "no-main-tree",
            "only-described",
        }  # of what is asked of the tree, not of the file
        assert {each for each in reported_as_text(said) if each.code not in others} == found, path
        assert status in (0, 1, 2)
        assert notes_in(said) == notes_in(err)


def test_validating_folder_reports_findings_of_all_its_files(repository, tmp_path, monkeypatch):
    each = [findings_and_notes_of_file(path) for path in repository.trees]
    whole, err = findings_and_notes(".")
    assert whole == set().union(*(found for found, _ in each))
    listed = {
        name for _, said in each for note in notes_in(said) for name in note.partition(" by ")[2].split(", ")
    }
    assert {name for note in notes_in(err) for name in note.partition(" by ")[2].split(", ")} == listed
    monkeypatch.chdir(tmp_path)
    assert findings_and_notes(repository.folder)[0] == whole


def test_random_repositories_cover_every_setting_and_error(tmp_path):
    there = set().union(*(Repository(tmp_path / str(seed), seed).has for seed in range(COUNT)))
    assert {*MISTAKES, *(f"the setting {key}" for key in SETTINGS)} <= there
    assert {"a package", "a nested package", "an include", "a set of trees", "a malformed file"} <= there
    assert {f"a palette at depth {depth}" for depth in range(4)} <= there
