"""Tests that the tables of course requirements name existing files and tests."""

import ast
import re
from pathlib import Path

from tests.docs.markdown import codes, links, tables

PAGE = Path("docs/how-to/course-project.md")
DETAILS = Path("docs/reference/course-requirements.md")
COURSE = "course only"
BY_HAND = "by hand"
ROWS = [
    (f"{page.name}:{line}", cells)
    for page in (PAGE, DETAILS)
    for _, line, cells in tables(page)
    if len(cells) == 3
]
TEST = re.compile(r"(tests/[\w/]+\.py)((?:::\w+)*)")


def names_in(path):
    """Return the functions and classes of a file, and the methods as `Class::method`."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.ClassDef):
            names |= {node.name, *(f"{node.name}::{each.name}" for each in node.body
                                   if isinstance(each, ast.FunctionDef))}  # fmt: skip
    return names


def test_every_requirement_names_a_file_and_a_test():
    wrong = []
    for line, (_, where, shown_by) in ROWS:
        if COURSE in where:
            continue
        named = [code for code in codes(shown_by) if code.startswith("tests/")]
        if "](" not in where:
            wrong.append(f"{line}: no file is linked")
        if not named and BY_HAND not in shown_by:
            wrong.append(f"{line}: no test is named")
        wrong += [f"{line}: {code}" for code in named if not is_test(code)]
    assert ROWS
    assert wrong == []


def is_test(code):
    """Return whether a text names an existing test file, or a test in it."""
    found = TEST.fullmatch(code)
    if found is None or not Path(found[1]).is_file():
        return False
    name = found[2].removeprefix("::")
    return not name or name in names_in(Path(found[1]))


def test_every_course_task_has_a_row():
    tasks = [cells[0] for heading, _, cells in tables(PAGE) if heading == "Tasks"]
    assert [task.split(".")[0] for task in tasks] == [str(number) for number in range(1, 12)]


def test_at_most_eight_requirements_are_course_only():
    left_out = [cells[0] for _, cells in ROWS if COURSE in cells[1]]
    assert len(left_out) <= 8, left_out
    assert links(PAGE)
