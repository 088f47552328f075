"""Tests of the JSON schema for YAML: the committed file is up to date, and the schema is never stricter than the rules."""

import json
import re
from pathlib import Path

import jsonschema
import pytest
import referencing
import yaml
from hypothesis import given

from sar_compiler.checks import RULES, check
from sar_compiler.checks.rules import CheckContext
from sar_compiler.nodes.binding.attributes import CONDITIONS, ONESHOT
from sar_compiler.nodes.registry import Registry, default_registry, load_registry
from sar_compiler.nodes.schemas.json_schema import json_schema
from sar_compiler.nodes.spec import Kind, NodeSpec, Signature
from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form, Severity
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from tests.checks.test_schema import ELEMENTS, written
from tests.checks.test_tree_errors import CORRECT
from tests.trees import document

SCHEMA = json_schema(default_registry())
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def errors(text):
    """Return the paths at which the schema rejects a YAML file that is read by a standard YAML reader."""
    return [list(error.absolute_path) for error in VALIDATOR.iter_errors(yaml.safe_load(text))]


def as_yaml(text):
    return convert(parse_xml(text), Form.YAML).text


def in_a_tree(*nodes):
    tree = {"ID": "Main", "children": list(nodes)}
    return yaml.safe_dump({"root": {"BTCPP_format": 4, "children": [{"BehaviorTree": tree}]}})


def test_committed_schema_equals_generated_schema():
    committed = Path("schemas/sar_tree.schema.json").read_text(encoding="utf-8")
    assert json.loads(committed) == SCHEMA, "make schemas"


def test_schema_is_valid_json_schema():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


FRAGMENT = re.compile(r"#(?:[A-Za-z0-9\-._~!$&'()*+,;=:@/?]|%[0-9A-F]{2})*")
"""A reference within the same document (RFC 3986)."""
NON_ASCII_NODE = NodeSpec("Überflug", None, Kind.ACTION, signature=Signature({}))


def references_in(part):
    """Yield every `$ref` in a schema."""
    parts = part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    if isinstance(part, dict) and isinstance(part.get("$ref"), str):
        yield part["$ref"]
    for each in parts:
        yield from references_in(each)


def target_of(reference, schema):
    """Return the target of a reference."""
    resource = referencing.Resource.from_contents(schema)
    return referencing.Registry().with_resource("", resource).resolver().lookup(reference).contents


def test_every_reference_is_uri_of_definition():
    schema = json_schema(Registry([*default_registry().specs(), NON_ASCII_NODE]))
    references = set(references_in(schema))
    assert "#/$defs/tag.%C3%9Cberflug" in references
    assert len(references) > 100
    assert [each for each in references if not FRAGMENT.fullmatch(each)] == []
    assert [each for each in references if not isinstance(target_of(each, schema), dict)] == []


@pytest.mark.parametrize("path", sorted(Path("trees").glob("*.yaml")), ids=str)
def test_shipped_trees_are_valid(path):
    assert errors(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("path", sorted(Path("examples").glob("*/*.xml")), ids=str)
def test_examples_have_errors_only_at_children(path):
    found = errors(convert(read_tree_file(path), Form.YAML).text)
    assert all(place[-1] == "children" or isinstance(place[-1], int) for place in found)


@pytest.mark.parametrize("name", sorted(CORRECT))
def test_schema_accepts_correct_trees(name):
    assert errors(as_yaml(document(CORRECT[name]))) == []


@pytest.mark.parametrize(
    ("node", "place"),
    [
        ({"Sey": {}}, []),
        ({"Sequence": {"memory": "ture", "children": ["Success"]}}, ["Sequence", "memory"]),
        ({"Sequence": {"memroy": True, "children": ["Success"]}}, ["Sequence"]),
        ({"Sequence": {"name": "a"}}, ["Sequence"]),
        ({"Inverter": {"children": ["Success", "Failure"]}}, ["Inverter", "children"]),
        ({"Success": {}, "Failure": {}}, []),
        ("Sey", []),
        ({"SubTree": {"name": "a"}}, ["SubTree"]),
    ],
    ids=str,
)
def test_schema_rejects_error_at_its_location(node, place):
    assert errors(in_a_tree(node)) == [["root", "children", 0, "BehaviorTree", "children", 0, *place]]


AGREED_CASES = [
    "Success: {children: []}",
    "Sleep: {msec: 5, children: []}",
    "Action: {ID: Success, children: []}",
    "Sequence: {children: []}",
    "Sequence: {}",
    "Inverter: {children: []}",
    "Control: {ID: Sequence, children: []}",
    "Decorator: {ID: Inverter, children: []}",
    "Decorator: {ID: Inverter, children: [Success, Failure]}",
    "IfThenElse: {children: [Success]}",
    "Switch2: {variable: a, case_1: b, case_2: c, children: [Success, Success]}",
    "Action: {ID: ''}",
    "Sequence: {_skipIf: '', children: [Success]}",
    "Sleep: {msec: 4294967295}",
    "Sleep: {msec: 4294967296}",
    "Sleep: {msec: '4294967296'}",
    "Sleep: {msec: -1}",
    "Sleep: {msec: 1.5}",
    "Repeat: {num_cycles: 1.5, children: [Success]}",
]


@pytest.mark.parametrize("node", AGREED_CASES)
def test_schema_and_rules_agree(node):
    text = in_a_tree(yaml.safe_load(node))
    findings = check(Forest.from_file(parse_yaml(text, "test.yaml")), default_registry())
    refused = any(finding.severity is Severity.ERROR for finding in findings)
    assert bool(errors(text)) == refused


@pytest.mark.parametrize(
    "text",
    [
        "root: {}",
        "root: {children: []}",
        "root: {children: [BehaviorTree: {ID: A}]}",
        "root: {children: [BehaviorTree: {ID: A, children: []}]}",
        "root: {children: [BehaviorTree: {ID: A, children: [Success, Success]}]}",
    ],
)
def test_schema_and_rules_reject_wrong_number_of_trees_or_nodes(text):
    assert errors(text)
    assert check(Forest.from_file(parse_yaml(text, "test.yaml")), default_registry())


def test_unknown_attribute_is_named():
    text = in_a_tree({"Sequence": {"memroy": True, "children": ["Success"]}})
    (error,) = VALIDATOR.iter_errors(yaml.safe_load(text))
    assert "'memroy'" in error.message


@given(ELEMENTS)
def test_schema_accepts_everything_that_rules_accept(element):
    forest = Forest.from_file(parse_xml(document(written(element))))
    if not [finding for rule in RULES for finding in rule(CheckContext(forest, default_registry()))]:
        assert errors(as_yaml(document(written(element)))) == []
        assert check(forest, default_registry()) == []


def test_schema_describes_bare_tags_and_common_attributes():
    bare = SCHEMA["$defs"]["node"]["then"]
    assert dict(zip(bare["enum"], bare["enumDescriptions"], strict=True))["Sleep"] == "Waits, then succeeds."
    common = SCHEMA["$defs"]["tag.Sleep"]["properties"]
    for name in (ONESHOT, *CONDITIONS):
        assert common[name] == {"$ref": f"#/$defs/{name}"}
        assert SCHEMA["$defs"][name]["description"]


def test_only_fields_of_ros_leaves_may_be_mappings():
    validator = jsonschema.Draft202012Validator(json_schema(load_registry(palettes=["ros:jazzy"])))

    def is_valid(**attributes):
        text = in_a_tree({"RosService": {"service": "a", "type": "b/srv/C", **attributes}})
        return validator.is_valid(yaml.safe_load(text))

    assert is_valid(request={"data": True})
    assert is_valid(request="data: true", fields={"message": {"text": None}})
    assert not is_valid(request=["data"])
    assert not is_valid(success={"a": "b"})
