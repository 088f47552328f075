"""A file that is checked again and again while it is typed has the same findings as one that is checked for the first time."""

import functools
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sar_compiler.errors import SarError
from sar_compiler.project import Workspace
from sar_compiler.tree.gathering import parse_tree
from sar_compiler.tree.retyped import TextReader
from tests.chance import rounds
from tests.checks.test_mistakes import IN_A_FILE, IN_A_TREE
from tests.checks.test_mistakes_in_files import IN_XML, IN_YAML
from tests.trees import document

TREES = Path(__file__).parents[2] / "trees"


def _text(written: Any) -> str:
    text = written[0] if isinstance(written, tuple) else written
    return text if isinstance(text, str) else text.decode("utf-8", "replace")


@functools.cache
def written() -> list[tuple[str, str]]:
    """Return texts with the endings of their files: what is shipped, and every mistake."""
    shipped = [(path.suffix, path.read_text("utf-8")) for path in sorted(TREES.glob("*.*ml"))]
    in_xml = [
        *map(document, map(_text, IN_A_TREE.values())),
        *map(_text, (*IN_A_FILE.values(), *IN_XML.values())),
    ]
    return [
        *shipped * 8,  # larger, and with more in them
        *((".xml", text) for text in in_xml),
        *((".yaml", _text(each)) for each in IN_YAML.values()),
    ]


@st.composite
def typed(draw: st.DrawFn) -> tuple[str, list[str]]:
    """Return the ending of a file, and the texts that it has one after the other."""
    ending, text = draw(st.sampled_from(written()))
    texts = [text]
    for _ in range(draw(st.integers(1, 4))):
        before = draw(st.sampled_from(texts))  # what is undone comes again
        start = draw(st.integers(0, len(before)))
        end = min(len(before), start + draw(st.sampled_from((0, 0, 1, 2, 10, 200))))
        begin = draw(st.integers(0, len(text)))
        copied = text[begin : begin + draw(st.sampled_from((1, 5, 50, 300)))]
        new = draw(st.sampled_from(("", "1", "x", "{", "\n", "<", '"', " ", copied)))
        texts.append(before[:start] + new + before[end:])
    return ending, texts


def found(workspace: Workspace, path: Path) -> object:
    """Return what a check says; of a file whose project cannot be used, why."""
    try:
        findings = workspace.load_file(path).check()
    except SarError as error:
        return type(error), str(error)
    return [
        (each.source.path, each.span, each.code, each.severity, each.message, each.suggestion, each.hint)
        for each in findings
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("typed")


class Typed:
    """A text that is typed, and the file that it is of."""

    def __init__(self, path: Path) -> None:
        self.path, self.text = path, ""
        path.touch()
        reader = TextReader()
        self._again = Workspace(read=lambda of: reader.read(self.text, str(of)), checks_again=True)

    def found_again(self, text: str) -> object:
        """Return what is found where texts before this one were checked."""
        self.text = text
        return found(self._again, self.path)

    def found_afresh(self) -> object:
        return found(Workspace(read=lambda of: parse_tree(self.text, str(of))), self.path)


@given(typed())
@settings(max_examples=rounds(150), deadline=None)
def test_a_text_that_is_typed_has_the_findings_that_a_fresh_check_has(folder, typed):
    ending, texts = typed
    file = Typed(folder / f"tree{ending}")
    for number, text in enumerate([*texts, texts[0]]):
        again = file.found_again(text)
        assert again == file.found_afresh(), f"text {number}"


def test_a_node_that_a_file_describes_anew_is_bound_anew(folder):
    def described(port: str) -> str:
        model = f'<TreeNodesModel><Action ID="Own"><input_port name="{port}" type="int"/></Action></TreeNodesModel>'
        return document('<Own speed="2"/>').replace("</root>", f"{model}</root>")

    file = Typed(folder / "described.xml")
    before, now = map(file.found_again, map(described, ("speed", "height")))
    assert "unknown-attribute" not in str(before)
    assert "unknown-attribute" in str(now)
