"""Each promise of the page on reliability names tests that there are, and so does every other page that names one."""

import functools
import re
from pathlib import Path

import pytest

from tests.docs.markdown import PAGES, codes, tables
from tests.docs.test_requirements import names_in

PAGE = Path("docs/reliability.md")
ROWS = [pytest.param(cells, id=f"{line} {cells[0][:60]}") for _, line, cells in tables(PAGE)]
# What nobody can promise, and so no test can hold.
BEYOND = "the computer is gone"


@functools.cache
def all_tests():
    """Return the names of all tests."""
    return {name.rpartition("::")[2] for path in Path("tests").rglob("test_*.py") for name in names_in(path)}


@pytest.mark.parametrize("cells", ROWS)
def test_every_promise_names_its_tests(cells):
    shown_by = cells[-1]
    assert shown_by == "the same" or codes(shown_by) or cells[0] == BEYOND
    assert [name for name in codes(shown_by) if name not in all_tests()] == []


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_test_that_a_page_names_is_there(page):
    text = page.read_text(encoding="utf-8")
    named = {name for name in codes(text) if re.fullmatch(r"test_\w+", name)}
    files = set(re.findall(r"\btests/\w+/[\w/]+\.py\b", text))
    assert named - all_tests() == set()
    assert {path for path in files if not Path(path).is_file()} == set()
