"""Tests of nearly right attributes: a tree without errors can be previewed."""

from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.spec import Direction
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from tests.fuzz.random_trees import REGISTRY, SPECS
from tests.random_inputs import TIMES, rounds
from tests.trees import class_of, document

# Nodes that the installed py_trees is too old for are registered, but cannot be constructed.
CONSTRUCTIBLE = [spec for spec in SPECS if class_of(spec) is not None]
NEAR_MISSES = [
    *("", " ", "0", "-0", "-1", "+5", "1", "2.5", "12abc", "0x10", "4294967295", "4294967296", "9" * 101),
    *("1e999", "inf", "nan", "true", "True", "yes", "a", "a b", "/a", "a/b", ".a", "a.b", "@", "@a", "@.a"),
    *("{a}", "{a b}", "{/a}", "{.a}", "{a.b}", "{=}", "=", "{@a}", "{@}", "{", "{}", "{a", "json:", "json:3"),
    *("1;2", "1;2;3", "1;", ";", "1;;2", " 1; 2", "0;0;0", "1;-1;1", "json:[1]", 'json:["a"]', "json:{"),
    *("SUCCESS", "INVALID", "SUCCESS;RUNNING", "SUCCESS; X", "ON_COMPLETION", "SuccessOnSelected"),
    *("b eq 1", "b eq 1;c gt 2", "b is 1;c gt 2", "/b eq 1;c gt 2", "b eq {x};c gt 2", "child", "child;x"),
]


def valid_text(parameter):
    """Return a valid text for a parameter."""
    if parameter.direction not in (None, Direction.INPUT):
        return "{k}"
    return parameter.value_type.example if parameter.value_type else "x"


def required_values(spec):
    return {parameter.name: valid_text(parameter) for parameter in spec.required_attributes}


def tree_with_attributes(spec, attributes):
    text = "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
    children = '<Success name="child"/>' * spec.child_count[0]
    return document(f"<Sequence><DetectSurvivor/><{spec.tag}{text}>{children}</{spec.tag}></Sequence>")


def assert_sound(text):
    """Assert that findings have locations in the text, and that a tree without errors can be previewed."""
    forest = Forest.from_file(parse_xml(text))
    findings = check(forest, REGISTRY)
    for finding in findings:
        assert finding.code != "internal-error", finding.message
        assert 1 <= finding.span.column <= len(text.split("\n")[finding.span.line - 1]) + 1
    if not any(finding.severity is Severity.ERROR for finding in findings):
        preview_tree(bind_main(forest, REGISTRY))


@pytest.mark.parametrize("tag", sorted({spec.tag for spec in CONSTRUCTIBLE}))
def test_one_nearly_right_attribute_is_reported_or_harmless(tag):
    for spec in REGISTRY.variants(tag):
        for place, parameter in enumerate(spec.attributes, len(tag)):
            # By default each value is tried in a third of the attributes, in a longer run in all.
            for value in NEAR_MISSES if TIMES > 1 else NEAR_MISSES[place % 3 :: 3]:
                assert_sound(tree_with_attributes(spec, {**required_values(spec), parameter.name: value}))


@st.composite
def nearly_right(draw):
    spec = draw(st.sampled_from(CONSTRUCTIBLE))
    names = [parameter.name for parameter in spec.attributes if parameter.name != "name"]
    more = st.dictionaries(st.sampled_from(names), st.sampled_from(NEAR_MISSES)) if names else st.just({})
    return tree_with_attributes(spec, {**required_values(spec), **draw(more)})


@settings(max_examples=rounds(125))
@given(nearly_right())
def test_several_nearly_right_attributes_are_reported_or_harmless(text):
    assert_sound(text)
