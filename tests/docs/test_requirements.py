"""The tables of requirements name existing files and tests."""

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
    """Return the tests of a file, those of a class as `Class::test`, and the classes."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.ClassDef):
            names |= {node.name, *(f"{node.name}::{each.name}" for each in node.body
                                   if isinstance(each, ast.FunctionDef))}  # fmt: skip
    return names


def test_every_requirement_names_the_file_and_the_test_that_show_it():
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
    """Return whether a text names a file of tests, or one of its tests."""
    found = TEST.fullmatch(code)
    if found is None or not Path(found[1]).is_file():
        return False
    name = found[2].removeprefix("::")
    return not name or name in names_in(Path(found[1]))


def test_every_task_of_the_text_has_its_row():
    tasks = [cells[0] for heading, _, cells in tables(PAGE) if heading == "Tasks"]
    assert [task.split(".")[0] for task in tasks] == [str(number) for number in range(1, 12)]


def test_only_what_belongs_to_a_course_is_left_out():
    left_out = [cells[0] for _, cells in ROWS if COURSE in cells[1]]
    assert len(left_out) <= 8, left_out
    assert links(PAGE)
