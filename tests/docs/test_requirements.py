"""The table of requirements names what there is."""

import ast
import re
from pathlib import Path

import pytest

from tests.docs.markdown import codes, links, tables

PAGE = Path("docs/requirements.md")
COURSE = "course only"
BY_HAND = "by hand"
ROWS = [
    pytest.param(cells, id=f"{line} {cells[0][:60]}")
    for heading, line, cells in tables(PAGE)
    if len(cells) == 3
]
TEST = re.compile(r"(tests/[\w/]+\.py)((?:::\w+)*)")


def names_in(path):
    """Return the tests of a file, those of a class as `Class::test`, and the classes."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.ClassDef):
            names |= {node.name, *(f"{node.name}::{each.name}" for each in node.body
                                   if isinstance(each, ast.FunctionDef))}  # fmt: skip
    return names


@pytest.mark.parametrize("cells", ROWS)
def test_a_requirement_names_the_file_and_the_test_that_show_it(cells):
    _, where, shown_by = cells
    if COURSE in where:
        return
    assert "](" in where, "no file is linked"
    tests = [TEST.fullmatch(code) for code in codes(shown_by) if code.startswith("tests/")]
    assert tests or BY_HAND in shown_by, "no test is named"
    for found in tests:
        assert found is not None, f"not of the form tests/file.py::name: {shown_by}"
        path, name = Path(found[1]), found[2].removeprefix("::")
        assert path.is_file(), f"there is no {path}"
        assert not name or name in names_in(path), f"{path} has no {name}"


def test_every_task_of_the_text_has_its_row():
    tasks = [cells[0] for heading, _, cells in tables(PAGE) if heading == "Tasks"]
    assert [task.split(".")[0] for task in tasks] == [str(number) for number in range(1, 12)]


def test_only_what_belongs_to_a_course_is_left_out():
    left_out = [cells[0] for _, _, cells in tables(PAGE) if COURSE in cells[1]]
    assert len(left_out) <= 8, left_out
    assert links(PAGE)
