"""Tests of the page about Python: its commands print the shown output, and it lists all public names."""

import ast
import importlib
from pathlib import Path

import pytest

from tests.docs.markdown import blocks, codes, tables
from tests.docs.test_worked_pages import follow, matches, typed_in

PAGE = Path("docs/how-to/use-from-python.md").resolve()
PYTHON = [block for block in blocks(PAGE) if block.language == "python"]


@pytest.mark.ros
def test_commands_on_python_page_print_shown_output(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 2
    assert otherwise == [], "\n".join(otherwise)


def test_notebook_cell_displays_shown_output(tmp_path):
    (cell,) = [block for block in PYTHON if not block.file]
    every = blocks(PAGE)
    shown = every[every.index(cell) + 1]
    *before, last = ast.parse(cell.text).body
    assert isinstance(last, ast.Expr)
    # A notebook displays the value of the last line.
    before.append(ast.parse(f"print(repr({ast.unparse(last)}))").body[0])
    (tmp_path / "cell.py").write_text(ast.unparse(ast.Module(before, [])), encoding="utf-8")
    done = typed_in(tmp_path, "python cell.py")
    assert matches(shown.text, done.stdout), done.stdout


def test_embedding_a_tree_in_a_node_takes_at_most_eight_lines():
    (robot,) = [block.text for block in PYTHON if block.file == "robot.py"]
    _, tree, _ = robot.split("\n\n")[-3:]
    assert "load(" in tree
    assert "running_tree(" in tree
    assert len(tree.splitlines()) <= 8


@pytest.mark.parametrize("group", ["", ".execution", ".leaves", ".missions", ".testing"])
def test_page_lists_all_public_names(group):
    name = f"sar_compiler{group}"
    named = [each for heading, _, cells in tables(PAGE) if heading == f"`{name}`" for each in codes(cells[0])]
    assert sorted(named) == sorted(importlib.import_module(name).__all__)
