"""Tests of the prose lint: it finds unused words and phrases in each kind of text, and applies the ceilings."""

import subprocess
import sys

import pytest

from tests.docs import prose

PAGE = """# The nobody

The robot goes on. Then it
is `told` and
returns.

- Nobody knows this.

| Name | Description |
|---|---|
| x y z | somebody writes `anew` here |

```text
nobody runs this at all
```
"""
MODULE = '''"""Return the flight of a robot."""

OPTION = "--mend-all"
MESSAGE = f"the flight of {OPTION} goes on now"
SHORT = "a flight"


class FlightPlan:
    def mend(self) -> None:
        """Correct a file.

        The flight is not in the first paragraph.
        """

    def _improve_locally(self) -> None: ...
'''


@pytest.fixture
def module(tmp_path):
    (tmp_path / "module.py").write_text(MODULE, encoding="utf-8")
    found: dict[str, list[prose.Text]] = {kind: [] for kind in prose.WORD_CEILINGS}
    for kind, text in prose.code_texts(tmp_path / "module.py"):
        found[kind].append(text)
    return found


def test_page_texts_are_sentences_items_and_cells_outside_code(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    assert [(place.rpartition(":")[2], text) for place, text in prose.page_texts(page)] == [
        ("3", "The robot goes on."),
        ("3", "Then it is `told` and returns."),
        ("7", "Nobody knows this."),
        ("11", "x y z"),
        ("11", "somebody writes `anew` here"),
    ]


def test_each_kind_of_text_is_searched_for_unused_words(module):
    found = {kind: [text for _, text in prose.with_words(texts)] for kind, texts in module.items()}
    assert found == {
        "pages": [],
        "docstrings": ["Return the flight of a robot."],
        "messages": ["the flight of {…} goes on now"],
        "options": ["mend all"],
        "names": ["Flight Plan", "mend"],
    }


def test_words_in_code_or_within_other_words_are_not_counted():
    assert prose.with_words([("a:1", "`mend`"), ("a:2", "amend it"), ("docs/glossary.md:3", "mend")]) == []
    assert prose.with_words([("a:1", "it was Mended")]) != []


def test_kind_above_ceiling_is_reported(module, monkeypatch):
    monkeypatch.setattr(prose, "WORD_CEILINGS", {**dict.fromkeys(module, 1), "names": 2})
    monkeypatch.setattr(prose, "MARK_CEILINGS", {"messages": 50})
    module["options"] *= 2
    assert [each.partition(":")[0] for each in prose.excesses(module)] == ["messages", "options"]


@pytest.mark.parametrize("shown", [[], ["names"]])
def test_lint_succeeds_below_all_ceilings(shown):
    done = subprocess.run(
        [sys.executable, "-m", "tests.docs.prose", *shown], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr, "with words" in done.stdout) == (0, "", bool(shown))
