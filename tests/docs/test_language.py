"""The page about the language: nothing forgotten, nothing made up, and its example runs."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

from sar_compiler import opener
from sar_compiler.checks import MOST, check
from sar_compiler.checks.document import INCLUDE_ATTRIBUTES, ROOT_ATTRIBUTES
from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.binding.attributes import CONDITIONS, NOTES
from sar_compiler.nodes.binding.nesting import MAX_LEVELS, MAX_NODES
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.values import ConversionError, value_type_of
from sar_compiler.runtime import operators, script
from sar_compiler.tree import content, forest
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import MOST_COMPARED
from sar_compiler.tree.model import SUBTREE_TAG
from sar_compiler.tree.xml import parse_xml
from tests.docs.markdown import blocks, codes, prose, tables

PAGE = Path("docs/reference/language.md")
TAGS = {spec.tag for spec in default_registry()} | {SUBTREE_TAG}
# Tags that the page names because they are not there.
ABSENT = {"ManualSelector", "ConsumeQueue"}
# Words that look like tags and are none.
OTHERS = {
    *("BehaviorTree", "TreeNodesModel", "MetadataFields", "Action", "Control", "Decorator", "DOCTYPE"),
    *("Say", "Input", "Output", "InOut", "SkippableLeaf", "SKIPPED", "True", "False", "TRUE", "FALSE"),
}


def written():
    return [code for _, line in prose(PAGE) for code in codes(line)]


def test_every_node_that_is_registered_stands_on_the_page():
    assert set(written()) >= TAGS


def test_every_node_on_the_page_is_registered():
    named = {code for code in written() if re.fullmatch(r"[A-Z][A-Za-z]*[a-z]\d?", code)} - OTHERS
    assert named - ABSENT == TAGS & named
    assert not ABSENT & TAGS


@pytest.mark.parametrize("names", [CONDITIONS, NOTES, ROOT_ATTRIBUTES], ids=["conditions", "notes", "root"])
def test_every_attribute_of_any_node_stands_on_the_page(names):
    assert set(written()) >= set(names)


def test_the_attributes_of_an_include_stand_on_the_page():
    assert all(any(name in code for code in written()) for name in INCLUDE_ATTRIBUTES)


def test_every_row_says_how_it_is_here():
    points = [
        (line, cells)
        for heading, line, cells in tables(PAGE)
        if heading in ("The file", "Nodes", "Subtrees", "Conditions", "Scripts", "Nodes of BehaviorTree.CPP")
    ]
    assert len(points) > 50
    said = re.compile(r"BehaviorTree\.CPP|UTF-8")
    assert [line for line, cells in points if not said.search(cells[1])] == []


def limits():
    return {cells[0]: cells[1] for heading, _, cells in tables(PAGE) if heading == "Limits"}


def test_the_limits_are_those_of_the_code():
    figures = [
        opener.TREE.limit // 2**20,
        content.MAX_ELEMENTS,
        content.MAX_ATTRIBUTES,
        content.MAX_DEPTH,
        forest.MAX_FILES,
        forest.MAX_INCLUDE_DEPTH,
        MAX_NODES,
        MAX_LEVELS,
        script.MAX_DEPTH,
        script.MAX_WORDS,
        operators.LONGEST_TEXT,
        100,
        MOST,
        MOST_COMPARED,
    ]
    assert [int(re.sub(r"\D", "", text)) for text in limits().values()] == figures


def test_a_whole_number_has_as_many_digits_as_the_page_says():
    whole = value_type_of(int)
    assert whole is not None
    assert whole.convert("9" * 100)
    with pytest.raises(ConversionError):
        whole.convert("9" * 101)


def named(name):
    (block,) = [block for block in blocks(PAGE) if block.file == name]
    return block.text


@pytest.fixture
def example(tmp_path, monkeypatch):
    """Return the registry with the page's leaf, and the page's tree."""
    path = tmp_path / "language_ports.py"
    path.write_text(named("ports.py"), encoding="utf-8")
    spec = importlib.util.spec_from_file_location("language_ports", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "language_ports", module)
    spec.loader.exec_module(module)
    registry = Registry(default_registry().specs())
    registry.add_module(module)
    return registry, Forest.from_file(parse_xml(named("ports.xml"), "ports.xml"))


def test_the_example_of_ports_is_correct(example):
    registry, tree = example
    assert check(tree, registry) == []
    assert preview_tree(bind_main(tree, registry)).root.name == "Sequence"


def test_the_example_of_ports_does_what_the_page_says(example):
    registry, tree = example
    compiled = compile_tree(bind_main(tree, registry), {}, {"largest": 20})
    compiled.root.tick_once()
    scope = compiled.instance.scope
    assert [scope.resolve(key).read() for key in ("twice", "four_times")] == [3.0, 6.0]
    assert not scope.resolve("eight_times").exists
    assert not scope.resolve("times").exists
