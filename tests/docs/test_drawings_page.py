"""The drawings in the documentation are what the project draws."""

import json
import re
import runpy
from pathlib import Path

from sar_compiler.compiler.outline import unicode_tree, with_tags
from sar_compiler.testing import compiled
from sar_compiler.views.drawing import mermaid
from tests.docs.markdown import PAGES, blocks

PAGE = Path("docs/how-to/draw-a-tree.md")
PICTURES = runpy.run_path("docs/pictures/trees.py")["pictures"]()
_IMAGE = re.compile(r"!\[[^\]]+\]\(([^)\s]+)\)|<(?:img|source)[^>]* src(?:set)?=\"([^\"]+)\"")


def test_every_picture_is_what_the_tree_looks_like():
    old = [path.name for path, drawn in PICTURES.items() if path.read_text(encoding="utf-8") != drawn]
    assert old == [], "make pictures draws them anew"


def test_pictures_are_small():
    pictures = sorted(Path("docs/pictures").glob("*.[ps][nv]g"))
    assert pictures
    assert [path.name for path in pictures if path.stat().st_size >= 200_000] == []


def test_every_picture_of_a_page_is_there():
    missing = [
        (str(page), each)
        for page in PAGES
        for pair in _IMAGE.findall(page.read_text(encoding="utf-8"))
        if "://" not in (each := pair[0] or pair[1]) and not (page.parent / each).is_file()
    ]
    assert missing == []


def test_the_page_shows_one_tree_in_every_language():
    tree = compiled("examples/decorators/retry.xml", nodes=["examples.decorators.leaves"])
    shown = [(block.language, block.text) for block in blocks(PAGE)][1:]
    assert shown == [
        ("", with_tags(unicode_tree(tree.root), tree)),
        ("mermaid", mermaid(tree)),
    ]


def test_the_figures_of_the_readme_are_those_of_the_benchmarks():
    """Within the factor by which `make bench` finds a row worse."""
    results = json.loads(Path("benchmarks/recorded.json").read_text(encoding="utf-8"))["results"]
    readme = Path("README.md").read_text(encoding="utf-8")
    for row, said in {
        "a tick of six trees of usual shapes and sizes, the median": r"takes \[([\d.]+) times\]",
        "`validate` of a folder of 300 files, cold": r"300 files takes ([\d.]+) s",
        "`validate` of a folder of 300 files, again": r"unchanged files ([\d.]+) s",
    }.items():
        [figure] = re.findall(said, readme)
        [first, *_], *_ = results[row]
        assert 1 / 1.5 <= float(figure) / first <= 1.5, row
