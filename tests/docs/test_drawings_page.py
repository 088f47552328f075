"""Tests of the pictures, drawings and figures in the documentation: they match the current project."""

import json
import re
import runpy
from pathlib import Path

import pytest

from sar_compiler.compiler.outline import add_tags, unicode_tree
from sar_compiler.testing import compile_for_test
from sar_compiler.views.drawing import mermaid
from tests.docs.markdown import PAGES, blocks

PAGE = Path("docs/how-to/draw-a-tree.md")
_IMAGE = re.compile(r"!\[[^\]]+\]\(([^)\s]+)\)|<(?:img|source)[^>]* src(?:set)?=\"([^\"]+)\"")


def test_tree_pictures_match_current_trees():
    pictures = runpy.run_path("docs/pictures/trees.py")["pictures"]()
    old = [path.name for path, drawn in pictures.items() if path.read_text(encoding="utf-8") != drawn]
    assert old == [], "make pictures draws them anew"


def test_pictures_are_small():
    pictures = sorted(Path("docs/pictures").glob("*.[ps][nv]g"))
    assert pictures
    assert [path.name for path in pictures if path.stat().st_size >= 200_000] == []


def test_every_picture_on_a_page_exists():
    missing = [
        (str(page), each)
        for page in PAGES
        for pair in _IMAGE.findall(page.read_text(encoding="utf-8"))
        if "://" not in (each := pair[0] or pair[1]) and not (page.parent / each).is_file()
    ]
    assert missing == []


def test_drawing_page_shows_tree_in_each_format():
    tree = compile_for_test("examples/decorators/retry.xml", nodes=["examples.decorators.leaves"])
    shown = [(block.language, block.text) for block in blocks(PAGE)][1:]
    assert shown == [
        ("", add_tags(unicode_tree(tree.root), tree)),
        ("mermaid", mermaid(tree)),
    ]


README = Path("README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("a tick of six trees of usual shapes and sizes, the median", r"takes \[([\d.]+) times\]"),
        ("`validate` of a folder of 300 files, cold", r"300 files takes ([\d.]+) s"),
        ("`validate` of a folder of 300 files, again", r"or ([\d.]+) s if no file has changed"),
        ("the result of a goal to the next goal", r"is sent ([\d.]+) ms after"),
    ],
)
def test_readme_figure_matches_recorded_benchmark(row, said):
    """Allow the factor above which `make bench` reports a slower row."""
    results = json.loads(Path("benchmarks/recorded.json").read_text(encoding="utf-8"))["results"]
    [figure] = re.findall(said, README)
    [measured, *_], *_ = results[row]
    assert 1 / 1.5 <= float(figure) / measured <= 1.5


def test_readme_counts_match_findings_traces_and_proofs():
    [kinds] = re.findall(r"(\d+) kinds of findings", README)
    assert int(kinds) == (len(list(Path("docs/findings").glob("*.md"))) - 1) // 10 * 10
    traces = [
        json.loads(path.read_text(encoding="utf-8"))
        for path in Path("tests/conformance").glob("btcpp_*traces.json")
    ]
    assert f"traces of {sum(len(each['cases']) for each in traces)} trees" in README
    [states, properties] = re.findall(r"explores ([\d,]+) states and proves (\d+) properties", README)[0]
    proof = Path("docs/missions/resilient-tree.md").read_text(encoding="utf-8")
    assert f"\n{states} states, " in proof
    assert f"\n{properties} outcomes: {properties} proved\n" in proof
