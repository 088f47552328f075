"""Tests of message fields in YAML trees, which are written as YAML."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.checks.fixing import apply_fixes, fixes
from sar_compiler.nodes.ros_fields import DESTINATIONS, FIELDS, read_fields
from sar_compiler.nodes.ros_leaves import specs
from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form, TreeError
from sar_compiler.tree.model import UnfinishedFileError, synthetic_element, synthetic_file
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_fields import FIELD_ATTRIBUTES
from sar_compiler.tree.yaml_writer import write_yaml
from tests.tree.strategies import ODD, VALUES, everything
from tests.tree.test_value_locations import cut

# The YAML written for `request`, and the string it is read as.
WRITTEN = [
    ("{data: true}", "{data: true}"),
    ("{a: {x}, b: {@y}}", "{a: {x}, b: {@y}}"),
    ("{results[0].ok: {x}}", "{results[0].ok: {x}}"),
    ("{req}", "{req}"),
    ("{a: 1,\n            # why\n            b: 2}", "{a: 1,\n# why\nb: 2}"),
    ("\n      data: true", "data: true"),
    ("\n      a: 1\n      b:\n        - {c: {x}}\n        - d: 2", "a: 1\nb:\n  - {c: {x}}\n  - d: 2"),
    ("\n      a: 1  # one\n      # two\n      b: 2  # three", "a: 1  # one\n# two\nb: 2  # three"),
    ("\n      'a': 1\n      \"b\": 'c'", "'a': 1\n\"b\": 'c'"),
    ("\n      a: |\n        one\n\n        two\n", "a: |\n  one\n\n  two\n"),
    ("\n      a: |+\n        one\n\n\n", "a: |+\n  one\n\n\n\n"),
    ("\n      a: >-\n        one\n        two\n", "a: >-\n  one\n  two"),
    ("\n      a:", "a:"),
    ("\n      a: !!binary AQL/", "a: !!binary AQL/"),
    ("\n    - a: 1\n    - b", "- a: 1\n- b"),
    ("[1, 2]", "[1, 2]"),
]


def file_with(written, line_end="\n"):
    return f"RosService:\n    request: {written}\n    service: s\n".replace("\n", line_end)


def findings_of(text):
    with pytest.raises(TreeError) as caught:
        parse_yaml(text)
    return [(one.code, one.span.line, one.span.column) for one in caught.value.findings]


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize(("written", "text"), WRITTEN)
def test_mapping_or_list_for_fields_is_read_as_string(written, text, line_end):
    root = parse_yaml(file_with(written, line_end)).root
    assert root.attributes == {"request": text, "service": "s"}
    assert not root.comments


@pytest.mark.parametrize(("written", "text"), WRITTEN)
def test_each_word_of_fields_has_its_location_in_file(written, text):
    for line_end in ("\n", "\r\n"):
        root = parse_yaml(file_with(written, line_end)).root
        for word in text.split():
            assert cut(root, "request", word) == word
        whole = root.source.offsets(root.value_span("request"))
        assert root.source.text[slice(*whole)].split() == text.split()


@pytest.mark.parametrize(("written", "text"), WRITTEN)
def test_fields_survive_round_trip_through_xml_and_canonical_form(written, text):
    tree_file = parse_yaml(file_with(written))
    canonical = write_yaml(tree_file)
    assert parse_yaml(canonical).root == tree_file.root
    assert write_yaml(parse_yaml(canonical)) == canonical
    in_xml = parse_xml(convert(tree_file, Form.XML).text)
    assert in_xml.root.attributes["request"] == text
    assert convert(in_xml, Form.YAML).text == canonical


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("{data: true}", ["request: {data: true}"]),
        ("data: true", ["request:", "  data: true"]),
        ("a: 1\nb: {x}", ["request:", "  a: 1", "  b: {x}"]),
        ("a: |\n  b\n", ["request:", "  a: |", "    b"]),
        ("a: 1, b: 2", ["request: 'a: 1, b: 2'"]),
        ("{req}", ["request: '{req}'"]),
        ("{@req}", ["request: '{@req}'"]),
        ("{a: *b}", ["request: '{a: *b}'"]),
        ("{a: 1", ["request: '{a: 1'"]),
        ("", ["request: ''"]),
        ("word", ["request: word"]),
    ],
)
def test_fields_are_written_as_yaml_if_they_read_back_as_same_string(text, lines):
    for tag, attributes in (("RosService", {}), ("Action", {"ID": "RosService"})):
        element = synthetic_element(tag, {**attributes, "request": text})
        written = write_yaml(synthetic_file(element))
        assert written.split("\n")[1 + len(attributes) : -1] == [f"  {line}" for line in lines]
        assert parse_yaml(written).root == element


FIELD_TEXTS = st.lists(
    st.sampled_from(
        ["a: 1", "b:", "  c: {x}", "- {d: [1, '2']}", "{e: 3}", "  - f", "# g", "h: |", "{@k}", ""]
    )
    | st.text(ODD, max_size=4),
    max_size=5,
).map("\n".join)


@given(texts=st.lists(FIELD_TEXTS | VALUES, min_size=2, max_size=2), deep=st.booleans())
def test_any_fields_string_survives_round_trip(texts, deep):
    leaf = synthetic_element("RosService", dict(zip(("request", "fields"), texts, strict=True)))
    root = synthetic_element("Sequence", {"name": "x"}, [leaf]) if deep else leaf
    written = write_yaml(synthetic_file(root))
    read = parse_yaml(written)
    assert read.root == root
    assert write_yaml(read) == written
    assert everything(parse_yaml(write_yaml(read))) == everything(read)


def test_comments_around_fields_belong_to_their_attribute():
    text = (
        "RosService:\n"
        "  # above\n"
        "  request:  # beside\n"
        "    a: 1  # inside\n"
        "  # below\n"
        "  fields: {b: {x}}  # behind\n"
        "  service: s\n"
    )
    tree_file = parse_yaml(text)
    said = [(one.text, one.attribute, one.trailing) for one in tree_file.root.comments]
    assert said == [
        ("above", "request", False),
        ("beside", "request", True),
        ("below", "fields", False),
        ("behind", "fields", True),
    ]
    assert write_yaml(tree_file) == text


@pytest.mark.parametrize(
    "text",
    [
        "Action: {ID: RosService, request: {a: 1}}",
        "Action: {request: {a: 1}, ID: RosService}",
        "Action:\n  request:\n    a: 1\n  ID: RosService",
    ],
)
def test_explicit_form_accepts_fields_before_or_after_its_id(text):
    assert read_fields(parse_yaml(text).root.attributes["request"]).fields.keys() == {"a"}


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("RosService: {service: {a: 1}}", (1, 14)),
        ("RosAction: {request: {a: 1}}", (1, 13)),
        ("Sleep: {request: {a: 1}}", (1, 9)),
        ("Action: {ID: Sleep, request: {a: 1}}", (1, 21)),
        ("Action: {request: {a: 1}}", (1, 10)),
        ("RosPublish: {topic: {@where}}", (1, 21)),
    ],
)
def test_mapping_for_attribute_without_fields_is_reported(text, place):
    assert findings_of(text) == [("wrong-shape", *place)]


def test_invalid_mapping_does_not_shift_locations_of_other_attributes():
    text = "A: {first: {a: 1}, second: two, third: [3], fourth: four}"
    with pytest.raises(UnfinishedFileError) as caught:
        parse_yaml(text)
    assert caught.value.beginning is not None
    root = caught.value.beginning.tree_file.root
    assert root.attributes == {"second": "two", "fourth": "four"}
    assert [cut(root, name, value) for name, value in root.attributes.items()] == ["two", "four"]


def test_yaml_only_features_are_rejected_within_fields():
    assert findings_of("RosService: {request: {a: &b 1}}") == [("yaml-anchor", 1, 27)]
    assert findings_of("RosService: {request: !x {a: 1}}")[0] == ("yaml-tag", 1, 23)
    assert findings_of("RosService: {request: {a: 1}, service: !x y}") == [("yaml-tag", 1, 40)]


def test_malformed_fields_are_reported_as_malformed_yaml():
    assert [code for code, *_ in findings_of("RosService:\n  request: {a: [1\n  service: s\n")] == [
        "malformed-yaml"
    ]


def test_fix_within_fields_changes_only_its_word():
    text = "RosPublish:\n  message:\n    'date': |\n      x\n    dato: {y}  # z\n"
    tree_file = parse_yaml(text)
    root = tree_file.root
    start = root.attributes["message"].index("dato")
    finding = root.finding(
        "wrong-value", "no field", root.value_part_span("message", start, start + 4), suggestion="data"
    )
    fixed = apply_fixes(text, fixes(root.source, tree_file, [finding], lambda _finding: True))
    assert fixed == text.replace("dato", "data")


def test_attributes_with_fields_match_those_declared_by_leaves():
    declared = {
        spec.tag: {
            name for name, each in spec.parameters.items() if each.value_type in (FIELDS, DESTINATIONS)
        }
        for spec in specs("jazzy")
    }
    assert {tag: set(names) for tag, names in FIELD_ATTRIBUTES.items()} == {
        tag: names for tag, names in declared.items() if names
    }
