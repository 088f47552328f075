"""Tests that tables and drawings in the documentation match the project."""

import inspect
import re
from dataclasses import fields
from itertools import takewhile
from pathlib import Path

import yaml
from py_trees.common import Status

from sar_compiler.compiler.outline import unicode_tree
from sar_compiler.leaves import Clock, register
from sar_compiler.missions import Journal
from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.missions.parameter_reader import RunParameters
from sar_compiler.nodes.registry import default_registry
from sar_compiler.nodes.spec import Kind
from sar_compiler.testing import compile_for_test
from sar_compiler.tree.discovery import read_tree_file
from search_and_rescue.plugin import MISSION as SEARCH_AND_RESCUE
from tests.docs.markdown import blocks, codes, tables

README = Path("README.md")
LEAVES = Path("docs/reference/leaf-classes.md")
MISSION = Path("docs/missions/search-and-rescue.md")
TREE = Path("trees/search_and_rescue.xml")


def block_with(page, text):
    found = [block.text for block in blocks(page) if text in block.text]
    assert found, f"{page} has no block with '{text}'"
    return found[0]


def test_readme_leaf_works_in_a_tree(tmp_path, monkeypatch):
    (tmp_path / "readme_leaf.py").write_text(block_with(README, "@register"), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    body = '<Sequence><Script code="battery := 30.0"/><Above level="{battery}" limit="20"/></Sequence>'
    tree = tmp_path / "above.xml"
    tree.write_text(
        f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>', encoding="utf-8"
    )
    root = compile_for_test(tree, nodes=["readme_leaf"]).root
    root.tick_once()
    assert root.status == Status.SUCCESS


def test_mission_drawing_matches_compiled_tree():
    drawn = block_with(MISSION, "[o] MissionOrReturnToBase")
    # The page adds a description after each composite.
    bare = [re.sub(r"(?<=\S) {2,}\S.*$", "", line) for line in drawn.splitlines()]
    assert bare == [line.rstrip() for line in unicode_tree(compile_for_test(TREE).root).splitlines()]


def test_memory_flags_table_matches_shipped_tree():
    explained = {
        codes(cells[0])[0]: cells[1]
        for heading, _, cells in tables(MISSION)
        if "memory flags" in heading and cells[1] in {"true", "false"}
    }
    assert explained == memory_flags()


def memory_flags():
    """Return the memory flags of the composites in the shipped tree."""
    return {
        element.attributes["name"]: element.attributes["memory"]
        for element in read_tree_file(TREE).root.iterate()
        if "memory" in element.attributes
    }


def test_every_run_parameter_is_in_the_parameter_table():
    page = Path("docs/reference/parameters.md")
    explained = " ".join(cells[0] for _, _, cells in tables(page))
    assert [field.name for field in fields(RunParameters) if f"`{field.name}" not in explained] == []
    shipped = yaml.safe_load(Path("config/mission_params.yaml").read_text(encoding="utf-8"))
    keys = shipped["/**"]["ros__parameters"]
    assert [key for key in keys if f"`{key}" not in explained] == []


def test_every_mission_member_is_in_its_table():
    for described in (Mission, MissionRun):
        names = {
            name for name in {**vars(described), **described.__annotations__} if not name.startswith("_")
        }
        heading = f"Member of `{described.__name__}`"
        listed = {
            codes(cells[0])[0].split("(")[0]
            for cells in rows_below(Path("docs/how-to/write-a-mission.md"), heading)
        }
        assert listed == names


def test_every_register_argument_is_in_the_table():
    said = [name for cells in rows_below(LEAVES, "Argument of `register`") for name in codes(cells[0])]
    assert ["tag", *said] == list(inspect.signature(register).parameters)


def test_every_context_object_of_leaves_is_named():
    (row,) = [
        cells[0] for cells in rows_below(LEAVES, "Constructor parameter") if "@mission_context" in cells[0]
    ]
    shared = {each.__name__ for each in (Clock, Journal, *SEARCH_AND_RESCUE.context_types)}
    assert shared <= set(codes(row))


def rows_below(page, head):
    """Return the rows of the table whose first column has a given head."""
    lines = iter(page.read_text(encoding="utf-8").splitlines())
    next(line for line in lines if line.startswith(f"| {head} |"))
    next(lines)
    return [line.strip("| ").split(" | ") for line in takewhile(lambda line: line.startswith("|"), lines)]


def test_every_mission_leaf_is_in_the_leaf_table():
    explained = {codes(cells[0])[0]: cells[1] for heading, _, cells in tables(MISSION) if heading == "Leaves"}
    leaves = {
        spec.tag: "condition" if spec.kind is Kind.CONDITION else "action"
        for spec in default_registry()
        if spec.class_path.startswith("search_and_rescue")
    }
    assert explained == leaves


def test_decorators_in_the_table_are_registered():
    explained = {
        code.split()[0]
        for heading, _, cells in tables(Path("docs/reference/tree-files.md"))
        if heading == "Decorators"
        for code in codes(cells[0])
    }
    # The language page has all decorators, and a separate test.
    assert len(explained) > 10
    assert explained <= {spec.tag for spec in default_registry() if spec.kind is Kind.DECORATOR}
