"""Tests of the language page: it lists all nodes, attributes and limits, and its example runs."""

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
# Tags that the page names because the project lacks them.
ABSENT = {"ManualSelector", "ConsumeQueue"}
# Words that look like tags but are not.
OTHERS = {
    *("BehaviorTree", "TreeNodesModel", "MetadataFields", "Action", "Control", "Decorator", "DOCTYPE"),
    *("Say", "Input", "Output", "InOut", "SkippableLeaf", "SKIPPED", "True", "False", "TRUE", "FALSE"),
}


def codes_on_page():
    return [code for _, line in prose(PAGE) for code in codes(line)]


def test_every_registered_node_is_on_the_page():
    assert set(codes_on_page()) >= TAGS


def test_every_node_on_the_page_is_registered():
    named = {code for code in codes_on_page() if re.fullmatch(r"[A-Z][A-Za-z]*[a-z]\d?", code)} - OTHERS
    assert named - ABSENT == TAGS & named
    assert not ABSENT & TAGS


@pytest.mark.parametrize("names", [CONDITIONS, NOTES, ROOT_ATTRIBUTES], ids=["conditions", "notes", "root"])
def test_every_common_attribute_is_on_the_page(names):
    assert set(codes_on_page()) >= set(names)


def test_include_attributes_are_on_the_page():
    assert all(any(name in code for code in codes_on_page()) for name in INCLUDE_ATTRIBUTES)


def test_every_row_compares_with_behaviortree_cpp():
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


def test_limits_match_code():
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


def test_integer_has_at_most_100_digits():
    whole = value_type_of(int)
    assert whole is not None
    assert whole.convert("9" * 100)
    with pytest.raises(ConversionError):
        whole.convert("9" * 101)


def text_of_file(name):
    (block,) = [block for block in blocks(PAGE) if block.file == name]
    return block.text


@pytest.fixture
def example(tmp_path, monkeypatch):
    """Return the registry with the page's leaf, and the page's tree."""
    path = tmp_path / "language_ports.py"
    path.write_text(text_of_file("ports.py"), encoding="utf-8")
    spec = importlib.util.spec_from_file_location("language_ports", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "language_ports", module)
    spec.loader.exec_module(module)
    registry = Registry(default_registry().specs())
    registry.add_module(module)
    return registry, Forest.from_file(parse_xml(text_of_file("ports.xml"), "ports.xml"))


def test_ports_example_has_no_findings(example):
    registry, tree = example
    assert check(tree, registry) == []
    assert preview_tree(bind_main(tree, registry)).root.name == "Sequence"


def test_ports_example_behaves_as_documented(example):
    registry, tree = example
    compiled = compile_tree(bind_main(tree, registry), {}, {"largest": 20})
    compiled.root.tick_once()
    scope = compiled.instance.scope
    assert [scope.resolve(key).read() for key in ("twice", "four_times")] == [3.0, 6.0]
    assert not scope.resolve("eight_times").exists
    assert not scope.resolve("times").exists
