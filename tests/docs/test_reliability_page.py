"""Tests that each promise on the page about failures names existing tests, and that tests named on pages exist."""

import functools
import json
import re
from pathlib import Path

from tests.docs.markdown import PAGES, codes, tables
from tests.docs.test_requirements import names_in

PAGE = Path("docs/concepts/failures-and-recovery.md")
# The tests by promise, which is named by section and failure. "the same" stands for the tests of the previous promise.
PROMISES = json.loads(Path(__file__).with_name("promises.json").read_text(encoding="utf-8"))
# No test can make the computer fail.
UNTESTABLE = "How it ends: The computer fails"


def promise(heading, cells):
    """Return the name of a promise of the page."""
    return f"{heading}: {cells[0]}"


@functools.cache
def all_tests():
    """Return the names of all tests."""
    return {name.rpartition("::")[2] for path in Path("tests").rglob("test_*.py") for name in names_in(path)}


def test_every_promise_names_its_tests():
    promised = [promise(heading, cells) for heading, _, cells in tables(PAGE)]
    assert promised == [*PROMISES]
    untested = [name for name, held_by in PROMISES.items() if not held_by and name != UNTESTABLE]
    missing = [
        test for held_by in PROMISES.values() if held_by != "the same" for test in {*held_by} - all_tests()
    ]
    assert (untested, missing) == ([], [])


def test_every_test_named_on_a_page_exists():
    missing = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        named = {name for name in codes(text) if re.fullmatch(r"test_\w+", name)}
        files = set(re.findall(r"\btests/\w+/[\w/]+\.py\b", text))
        missing += [(str(page), name) for name in named - all_tests()]
        missing += [(str(page), path) for path in files if not Path(path).is_file()]
    assert missing == []
