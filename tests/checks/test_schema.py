"""Tests of the generated XML schema: the committed file is up to date, and the schema is never stricter than the rules."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.checks import RULES, check
from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.schema_acceptance import is_surely_accepted
from sar_compiler.checks.schema_validation import check_schema, schema_errors
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.schemas.xml_schema import xml_schema
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from tests.checks.test_tree_errors import CORRECT, IN_A_TREE
from tests.nodes import leaves
from tests.trees import document


def test_committed_schema_equals_generated_schema():
    committed = Path("schemas/sar_tree.xsd").read_text(encoding="utf-8")
    assert committed == xml_schema(default_registry()), "run `make schemas` and review the change"


def test_custom_leaves_are_in_schema_of_their_registry():
    registry = Registry()
    registry.add_module(leaves)
    wrong = parse_xml(document('<Say message="hi" times="often"/>'))
    assert any("'often'" in message for _, message in schema_errors(wrong, registry))
    assert schema_errors(parse_xml(document('<Say message="hi" times="{n}"/>')), registry) == []


@pytest.mark.parametrize("name", CORRECT)
def test_schema_accepts_correct_trees(name):
    assert schema_errors(parse_xml(document(CORRECT[name])), default_registry()) == []


# Errors that no XSD can express: references by name, large numbers, interaction of children.
BEYOND_XSD = {name for name, case in IN_A_TREE.items() if "reference" in case[1]} | {
    "a number of too many digits",
    "more successes than children",
    "two children that interrupt each other",
}


@pytest.mark.parametrize("name", sorted(set(IN_A_TREE) - BEYOND_XSD))
def test_schema_rejects_errors_that_xsd_can_express(name):
    errors = schema_errors(parse_xml(document(IN_A_TREE[name][0])), default_registry())
    assert [line for line, _ in errors]


def test_schema_error_is_reported_if_rules_find_nothing():
    tree = parse_xml(document("<Sequence/>\n"), "test.xml")
    (alone,) = check_schema(tree, default_registry(), described=(), findings=[])
    assert (alone.code, alone.span.line, alone.span.column) == ("schema", 3, 1)
    found = check(Forest.from_file(tree), default_registry())
    assert [finding.code for finding in found] == ["empty-control"]


def test_errors_of_one_file_do_not_leak_into_next_validation():
    schema_errors(parse_xml(document("<Sequence/>")), default_registry())
    assert schema_errors(parse_xml(document("<Success/>")), default_registry()) == []


TAGS = st.sampled_from([spec.tag for spec in default_registry()] + ["Sequnce", "BehaviorTree"])
ATTRIBUTES = st.dictionaries(
    st.sampled_from(
        ["name", "memory", "policy", "duration", "num_failures", "oneshot", "detect_node", "ID", "x"]
    ),
    st.sampled_from(["", "a", "true", "ture", "1", "1.5", "ON_COMPLETION", "{key}", "{}", " 1"]),
    max_size=3,
)
ELEMENTS: st.SearchStrategy[Any] = st.recursive(
    st.builds(lambda tag, attributes: (tag, attributes, []), TAGS, ATTRIBUTES),
    lambda inner: st.builds(lambda t, a, c: (t, a, c), TAGS, ATTRIBUTES, st.lists(inner, max_size=3)),
    max_leaves=8,
)


def written(element):
    tag, attributes, children = element
    start = f"<{tag}" + "".join(f' {name}="{value}"' for name, value in attributes.items())
    return f"{start}>\n" + "".join(written(child) for child in children) + f"</{tag}>\n"


@given(ELEMENTS)
def test_rules_find_everything_that_schema_rejects(element):
    tree = parse_xml(document(written(element)))
    found = [
        finding
        for rule in RULES
        for finding in rule(CheckContext(Forest.from_file(tree), default_registry()))
    ]
    if schema_errors(tree, default_registry()):
        assert found
    assert not list(check_schema(tree, default_registry(), (), found)) or found


@pytest.mark.parametrize("name", CORRECT)
def test_correct_file_is_accepted_without_schema(name):
    tree = parse_xml(document(CORRECT[name]))
    assert is_surely_accepted(tree, default_registry())


# Files that the schema or its validation library may reject, although each tag and attribute looks correct.
UNUSUAL = {
    "a namespace": document("<AlwaysSuccess/>").replace("<root", '<root xmlns="urn:x"'),
    "an unbound prefix": document('<SubTree ID="Other" a:b="1"/>'),
    "text after a tag": document("<Sequence><AlwaysSuccess/> text </Sequence>"),
    "text that looks like a value": document('<Sequence><AlwaysSuccess/> " > " </Sequence>'),
    "a single quotation mark": document('<Sequence><AlwaysSuccess name="a"/> " </Sequence>'),
    "text that ends like a tag": document("<Sequence><AlwaysSuccess/> text > </Sequence>"),
    "text with an apostrophe and quotes": document("<Sequence><AlwaysSuccess/> ' > \" </Sequence>"),
    "an include with a line break": '<root BTCPP_format="4"><include path="a.xml">\n</include></root>',
    "an instruction": document("<Sequence><?sar?><AlwaysSuccess/></Sequence>"),
    "a marked section": document("<Sequence><![CDATA[text]]><AlwaysSuccess/></Sequence>"),
    "two trees of one ID": '<root BTCPP_format="4">'
    + 2 * '<BehaviorTree ID="A"><AlwaysSuccess/></BehaviorTree>'
    + "</root>",
    "a tree without nodes": '<root BTCPP_format="4"><BehaviorTree ID="A"/></root>',
    "no trees": '<root BTCPP_format="4"/>',
    "another format": document("<AlwaysSuccess/>").replace('"4"', '"3"'),
    "a condition outside of a tree": document("<AlwaysSuccess/>").replace("<root", '<root _skipIf="1"'),
    "a child of a subtree": document('<SubTree ID="Other"><AlwaysSuccess/></SubTree>'),
    "an explicit form without an ID": document("<Action/>"),
    "a note that is empty for a condition": document('<AlwaysSuccess _skipIf=" "/>'),
}


@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_file_is_left_to_schema(name):
    assert not is_surely_accepted(parse_xml(UNUSUAL[name]), default_registry())


@given(ELEMENTS, st.sampled_from(["", "\n", " x", ' " ', ' " > " ', "<!-- > \" ' -->", "&#160;"]))
def test_file_accepted_without_schema_is_accepted_by_schema(element, text):
    tree = parse_xml(document(f"<Sequence>{written(element)}{text}<AlwaysSuccess/></Sequence>"))
    assert not is_surely_accepted(tree, default_registry()) or not schema_errors(tree, default_registry())
