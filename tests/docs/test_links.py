"""Tests of the links in the documentation."""

from pathlib import Path

from tests.docs.markdown import PAGES, anchors, links

FINDINGS = sorted(Path("docs/findings").glob("*.md"))


def test_every_internal_link_has_a_target():
    dead = []
    for page in (*PAGES, *FINDINGS):
        for line, target in links(page):
            if target.startswith(("https://", "http://", "mailto:")):
                continue
            path, _, anchor = target.partition("#")
            goal = (page.parent / path) if path else page
            if not goal.exists() or (anchor and anchor not in anchors(goal)):
                dead.append(f"{page}:{line} {target}")
    assert dead == []


def test_index_lists_every_page():
    index = Path("docs/README.md")
    listed = {index.parent / target.partition("#")[0] for _, target in links(index)}
    missing = [str(page) for page in PAGES if index.parent in page.parents and page not in {index, *listed}]
    assert missing == []
