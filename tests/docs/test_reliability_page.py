"""Each promise of the page on reliability names tests that there are, and so does every other page that names one."""

import functools
import re
from pathlib import Path

from tests.docs.markdown import PAGES, codes, tables
from tests.docs.test_requirements import names_in

PAGE = Path("docs/concepts/failures-and-recovery.md")
ROWS = [(line, cells) for _, line, cells in tables(PAGE)]
# What nobody can promise, and so no test can hold.
BEYOND = "the computer is gone"


@functools.cache
def all_tests():
    """Return the names of all tests."""
    return {name.rpartition("::")[2] for path in Path("tests").rglob("test_*.py") for name in names_in(path)}


def test_every_promise_names_its_tests():
    wrong = [
        f"{line} {cells[0]}"
        for line, cells in ROWS
        if not (cells[-1] == "the same" or codes(cells[-1]) or cells[0] == BEYOND)
        or not all_tests().issuperset(codes(cells[-1]))
    ]
    assert ROWS
    assert wrong == []


def test_every_test_that_a_page_names_is_there():
    missing = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        named = {name for name in codes(text) if re.fullmatch(r"test_\w+", name)}
        files = set(re.findall(r"\btests/\w+/[\w/]+\.py\b", text))
        missing += [(str(page), name) for name in named - all_tests()]
        missing += [(str(page), path) for path in files if not Path(path).is_file()]
    assert missing == []
