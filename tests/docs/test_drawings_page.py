"""The drawings in the documentation are what the project draws."""

import re
import runpy
from pathlib import Path

import pytest

from sar_compiler.testing import compiled
from sar_compiler.views.drawing import mermaid
from sar_compiler.views.outline import unicode_tree, with_tags
from tests.docs.markdown import PAGES, blocks

PAGE = Path("docs/drawings.md")
PICTURES = runpy.run_path("docs/pictures/trees.py")["pictures"]()
_IMAGE = re.compile(r"!\[[^\]]+\]\(([^)\s]+)\)|<(?:img|source)[^>]* src(?:set)?=\"([^\"]+)\"")


@pytest.mark.parametrize("path", PICTURES, ids=lambda path: path.name)
def test_a_picture_is_what_the_tree_looks_like(path):
    assert path.read_text(encoding="utf-8") == PICTURES[path], "make pictures draws it anew"


@pytest.mark.parametrize(
    "path", sorted(Path("docs/pictures").glob("*.[ps][nv]g")), ids=lambda path: path.name
)
def test_a_picture_is_small(path):
    assert path.stat().st_size < 200_000


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_picture_of_a_page_is_there(page):
    shown = [one or other for one, other in _IMAGE.findall(page.read_text(encoding="utf-8"))]
    assert [each for each in shown if "://" not in each and not (page.parent / each).is_file()] == []


def test_the_page_shows_one_tree_in_every_language():
    tree = compiled("examples/decorators/retry.xml", nodes=["examples.decorators.leaves"])
    shown = [(block.language, block.text) for block in blocks(PAGE)][1:]
    assert shown == [
        ("", with_tags(unicode_tree(tree.root), tree)),
        ("mermaid", mermaid(tree)),
    ]
