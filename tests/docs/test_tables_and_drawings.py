"""What the documentation repeats of the project is what the project says."""

import inspect
import re
from dataclasses import fields
from itertools import takewhile
from pathlib import Path

import pytest
import yaml

from sar_compiler import Clock, Journal, register
from sar_compiler.checks import check
from sar_compiler.cli import compile as sar_compile
from sar_compiler.cli import run as sar_run
from sar_compiler.cli import sim as sar_sim
from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.missions.search_and_rescue.plugin import MISSION as SEARCH_AND_RESCUE
from sar_compiler.nodes.registry import default_registry
from sar_compiler.nodes.spec import Kind
from sar_compiler.ros.run_parameters import RunParameters
from sar_compiler.testing import compiled
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.reading import read_tree_file
from sar_compiler.tree.xml import parse_xml
from sar_compiler.views.text import unicode_tree
from tests.docs.markdown import blocks, codes, tables

README = Path("README.md")
LEAVES = Path("docs/writing_a_leaf.md")
MISSION = Path("docs/mission.md")
TREE = Path("trees/search_and_rescue.xml")


def block_with(page, text):
    found = [block.text for block in blocks(page) if text in block.text]
    assert found, f"{page} has no block with '{text}'"
    return found[0]


def test_the_readme_shows_the_shipped_tree():
    shown = parse_xml(block_with(README, "<root"), "readme.xml").root
    shipped = read_tree_file(TREE).root
    assert [(each.tag, each.attributes) for each in shown.iterate()] == [
        (each.tag, each.attributes) for each in shipped.iterate()
    ]


def test_the_readme_shows_the_findings_that_four_slips_bring():
    text = TREE.read_text(encoding="utf-8")
    for right, wrong in (
        ("<DetectSurvivor/>", "<DetectSurvivr/>"),
        ('name="HandleDetection" memory="false"', 'name="HandleDetection" memory="flase"'),
        (
            '<NotifyBase detect_node="DetectSurvivor"/>',
            '<NotifyBase detect_node="Patrol" timeout_sec="1,5"/>',
        ),
    ):
        assert text.count(right) == 1
        text = text.replace(right, wrong)
    findings = check(Forest.of(parse_xml(text, "mission.xml")), default_registry())
    assert block_with(README, "DetectSurvivr") == "".join(f"{finding.render()}\n" for finding in findings)


@pytest.mark.parametrize("page", [README, MISSION], ids=str)
def test_the_mission_is_drawn_as_it_compiles(page):
    drawn = block_with(page, "[o] MissionOrReturnToBase")
    # The README says behind each composite what it is.
    bare = [re.sub(r"(?<=\S) {2,}\S.*$", "", line) for line in drawn.splitlines()]
    assert bare == [line.rstrip() for line in unicode_tree(compiled(TREE).root).splitlines()]


@pytest.mark.parametrize("page", [README, MISSION], ids=str)
def test_the_memory_flags_are_explained_as_they_are(page):
    written = {
        element.attributes["name"]: element.attributes["memory"]
        for element in read_tree_file(TREE).root.iterate()
        if "memory" in element.attributes
    }
    explained = {
        codes(cells[0])[0]: cells[1]
        for heading, _, cells in tables(page)
        if "memory flags" in heading and cells[1] in {"true", "false"}
    }
    assert explained == written


def test_every_parameter_of_a_run_is_in_the_table_of_parameters():
    page = Path("docs/parameter_file.md")
    explained = " ".join(cells[0] for _, _, cells in tables(page))
    assert [field.name for field in fields(RunParameters) if f"`{field.name}" not in explained] == []
    shipped = yaml.safe_load(Path("config/mission_params.yaml").read_text(encoding="utf-8"))
    keys = shipped["/**"]["ros__parameters"]
    assert [key for key in keys if f"`{key}" not in explained] == []


def test_everything_that_a_mission_says_is_in_the_tables_of_missions():
    for described in (Mission, MissionRun):
        names = {
            name for name in {**vars(described), **described.__annotations__} if not name.startswith("_")
        }
        heading = f"of a `{described.__name__}`"
        listed = {codes(cells[0])[0].split("(")[0] for cells in rows_below(Path("docs/missions.md"), heading)}
        assert listed == names


def test_everything_that_is_said_in_registering_is_in_the_table_of_arguments():
    said = [name for cells in rows_below(LEAVES, "argument of `register`") for name in codes(cells[0])]
    assert ["tag", *said] == list(inspect.signature(register).parameters)


def test_every_object_that_leaves_are_handed_is_named():
    (row,) = [
        cells[0] for cells in rows_below(LEAVES, "constructor parameter") if "@mission_context" in cells[0]
    ]
    shared = {each.__name__ for each in (Clock, Journal, *SEARCH_AND_RESCUE.context_types)}
    assert shared <= set(codes(row))


def rows_below(page, head):
    """Return the rows of the table whose first column has a title."""
    lines = iter(page.read_text(encoding="utf-8").splitlines())
    next(line for line in lines if line.startswith(f"| {head} |"))
    next(lines)
    return [line.strip("| ").split(" | ") for line in takewhile(lambda line: line.startswith("|"), lines)]


def test_every_leaf_of_the_mission_is_in_the_table_of_leaves():
    explained = {codes(cells[0])[0]: cells[1] for heading, _, cells in tables(MISSION) if heading == "Leaves"}
    leaves = {
        spec.tag: "condition" if spec.kind is Kind.CONDITION else "action"
        for spec in default_registry()
        if spec.cls.__module__.startswith("sar_compiler.missions.search_and_rescue")
    }
    assert explained == leaves


def test_the_decorators_in_the_table_are_there():
    explained = {
        code.split()[0]
        for heading, _, cells in tables(Path("docs/writing_a_tree.md"))
        if heading == "Decorators"
        for code in codes(cells[0])
    }
    # All of them are on the page of the language, which has a test of its own.
    assert len(explained) > 10
    assert explained <= {spec.tag for spec in default_registry() if spec.kind is Kind.DECORATOR}


@pytest.mark.parametrize(
    "parser", [sar_run._parser(), sar_compile._parser(), sar_sim._parser()], ids=lambda each: str(each.prog)
)
def test_every_option_is_in_the_readme(parser):
    text = README.read_text(encoding="utf-8")
    missing = [option for option in options_of(parser) if not re.search(rf"`[^`]*{option}\b", text)]
    assert missing == []


def options_of(parser):
    """Return the long options of a parser and of its commands; `-o` where there is a short one."""
    for action in parser._actions:
        if isinstance(action.choices, dict):
            for command in action.choices.values():
                yield from options_of(command)
        elif action.option_strings and action.dest != "help":
            yield action.option_strings[0]
