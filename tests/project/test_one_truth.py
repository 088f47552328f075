"""What is known of a file does not depend on which command asks."""

import functools
import io
import json
import re
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest

from sar_compiler.cli.compile import main
from tests.chance import rounds
from tests.project.random_repositories import MISTAKES, SETTINGS, Repository

# What is measured here, cheaper tests of each rule and each setting reach.
pytestmark = pytest.mark.unmeasured

COUNT = rounds(20)
HEAD = re.compile(
    r"^(?P<file>[^\n]+?):(?P<line>\d+):\d+: (?:error|warning|info)\[(?P<code>[\w-]+)\]: (?P<text>.*)$",
    re.MULTILINE,
)


class Reported(NamedTuple):
    """A finding, as any command reports it."""

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
    """Return the notes about palettes: a folder is given with the trees in it, so that none of these is one that nobody has named."""
    return {line for line in text.splitlines() if line.startswith("note: nodes are described by")}


def run(*words: object) -> tuple[int, str, str]:
    """Run a command; return its status, and what it prints on both streams."""
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        status = main([*map(str, words)])
    return status, out.getvalue(), err.getvalue()


def validated(name: object) -> tuple[set[Reported], str]:
    """Return what `validate` reports of a file or folder, and what it prints besides."""
    _, out, err = run("validate", "--no-deep", "--format", "json", name)
    found = {
        Reported(str(Path(each["file"]).resolve()), each["line"], each["code"], each["message"])
        for each in json.loads(out)
    }
    return found, err


validated_file = functools.cache(validated)


@pytest.fixture(scope="module", params=range(COUNT))
def made(request, tmp_path_factory) -> Repository:
    return Repository(tmp_path_factory.mktemp("made") / "repository", request.param)


@pytest.fixture
def repository(made: Repository, monkeypatch) -> Repository:
    monkeypatch.chdir(made.folder)
    return made


@pytest.mark.parametrize("command", ["show", "simulate", "verify"])
def test_every_command_reports_the_findings_that_validate_reports(repository, command):
    for path in repository.trees:
        found, err = validated_file(path)
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


def test_a_folder_has_the_findings_of_all_its_files_wherever_it_is_named(repository, tmp_path, monkeypatch):
    each = [validated_file(path) for path in repository.trees]
    whole, err = validated(".")
    assert whole == set().union(*(found for found, _ in each))
    listed = {
        name for _, said in each for note in notes_in(said) for name in note.partition(" by ")[2].split(", ")
    }
    assert {name for note in notes_in(err) for name in note.partition(" by ")[2].split(", ")} == listed
    monkeypatch.chdir(tmp_path)
    assert validated(repository.folder)[0] == whole


def test_the_repositories_have_all_that_can_be_around_a_file(tmp_path):
    there = set().union(*(Repository(tmp_path / str(seed), seed).has for seed in range(COUNT)))
    assert {*MISTAKES, *(f"the setting {key}" for key in SETTINGS)} <= there
    assert {"a package", "a nested package", "an include", "a set of trees", "a malformed file"} <= there
    assert {f"a palette at depth {depth}" for depth in range(4)} <= there
