"""Tests of the checks before a resume: tree, mission and parameters must match the journal."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sar_compiler.compiler import CompiledTree
from sar_compiler.compiler.outline import outline
from sar_compiler.execution.resume_checks import require_same_identity, require_same_tree
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.json_values import json_data
from sar_compiler.loaded_tree import load
from sar_compiler.missions.parameter_reader import ParameterError
from sar_compiler.tree.diagnostic import TreeError
from tests.trees import document

BODY = '<Sequence name="S"><RetryUntilSuccessful num_attempts="2"><AlwaysFailure name="F"/></RetryUntilSuccessful></Sequence>'
IDENTITY = {"zones": [{"id": "zone_a", "x": 1.0}], "base_station": {"x": 0.0}}


@pytest.fixture
def journal_path(tmp_path: Path) -> Path:
    return tmp_path / "mission.journal"


def compile_body(folder: Path, body: str) -> CompiledTree:
    path = folder / "tree.xml"
    path.write_text(document(body), encoding="utf-8")
    return load(path).compile()


@pytest.fixture
def journal(journal_path: Path, tmp_path: Path) -> Iterator[Journal]:
    """A resumed journal."""
    first = open_journal(journal_path)
    tree = json_data(outline(compile_body(tmp_path, BODY)))
    about = {"mission": "patrol", "simulated": False, "identity": json_data(IDENTITY), "tree": tree}
    first.begin(about, {})
    first.close()
    journal = open_journal(journal_path, resume=True)
    yield journal
    journal.close()


def check_tree(journal: Journal, tree: CompiledTree) -> None:
    require_same_tree(journal, tree, json_data(outline(tree)))


def test_moved_and_reformatted_tree_is_the_same(journal: Journal, tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    check_tree(journal, compile_body(folder, f"<!-- moved -->\n\n{BODY.replace('><', '> <')}"))


@pytest.mark.parametrize(
    ("body", "words", "line"),
    [
        (BODY.replace('"2"', '"3"'), "num_attempts is 3 here, but was 2", "<RetryUntilSuccessful"),
        (BODY.replace('"F"', '"G"'), "name is 'G' here, but was 'F'", "<AlwaysFailure"),
        (BODY.replace("AlwaysFailure", "AlwaysSuccess"), "class is ", "<AlwaysSuccess"),
        (BODY.replace("</Seq", "<AlwaysSuccess/></Seq"), "'S' has 2 children here, but had 1", "<Sequence"),
        ('<AlwaysSuccess name="S"/>', "class is ", "<AlwaysSuccess"),
    ],
)
def test_different_tree_is_an_error_at_first_difference(
    journal: Journal, tmp_path: Path, body: str, words: str, line: str
) -> None:
    with pytest.raises(TreeError) as error:
        check_tree(journal, compile_body(tmp_path, body))
    (finding,) = error.value.findings
    assert finding.code == "other-tree"
    assert words in finding.message
    assert finding.source.line(finding.span.line)[finding.span.column - 1 :].startswith(line)
    assert finding.hint is not None
    assert "--new" in finding.hint


@pytest.mark.parametrize("tree", [None, 7, "text", {"children": 5}, {"attributes": []}, {"children": [None]}])
def test_damaged_tree_in_journal_is_a_different_tree(journal_path: Path, tmp_path: Path, tree: Any) -> None:
    first = open_journal(journal_path)
    first.begin({"tree": tree, "identity": tree, "simulated": False}, {})
    first.close()
    journal = open_journal(journal_path, resume=True)
    with pytest.raises(TreeError, match="has a different tree"):
        check_tree(journal, compile_body(tmp_path, BODY))
    with pytest.raises(ParameterError):
        require_same_identity(journal, about(mission=None))
    journal.close()


def about(**changes: Any) -> dict[str, Any]:
    return {"mission": "patrol", "simulated": False, "identity": json_data(IDENTITY), **changes}


def test_same_mission_can_be_resumed(journal: Journal) -> None:
    require_same_identity(journal, about())


def test_every_changed_parameter_is_named(journal: Journal) -> None:
    other = {"zones": [{"id": "zone_a", "x": 2.0}], "base_station": {"x": 1.0}}
    with pytest.raises(ParameterError) as error:
        require_same_identity(journal, about(identity=other))
    assert [problem.key for problem in error.value.problems] == ["zones", "base_station"]
    assert "{'x': 1.0}, but " in str(error.value)


def test_different_mission_is_named(journal: Journal) -> None:
    with pytest.raises(
        JournalError, match="belongs to the mission 'patrol', but this is a tree without a mission"
    ):
        require_same_identity(journal, about(mission=None))


def test_simulation_cannot_resume_run_of_a_robot(journal: Journal) -> None:
    with pytest.raises(
        JournalError, match="was started with a robot, and cannot be resumed with a simulation"
    ):
        require_same_identity(journal, about(simulated=True))


def test_parameters_are_compared_as_json_values() -> None:
    from array import array

    assert json_data({"points": (1, 2.5), "order": array("d", [1.0]), "name": "a", "none": None}) == {
        "points": [1, 2.5],
        "order": [1.0],
        "name": "a",
        "none": None,
    }
