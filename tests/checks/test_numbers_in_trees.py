"""Tests of findings about unlikely numbers, keys and outputs, and of their suggestions."""

import py_trees
import pytest
from py_trees.common import Status

from sar_compiler.checks import check
from sar_compiler.leaves import Kind, register
from sar_compiler.nodes.registry import Registry, load_registry
from sar_compiler.tree.diagnostic import Severity, TreeError
from sar_compiler.tree.yaml import parse_yaml
from tests.trees import forest

REGISTRY = load_registry(palettes=["nav2:main"])


def findings_in(body):
    return [each for each in check(forest(body), REGISTRY) if each.severity is not Severity.INFO]


@pytest.mark.parametrize(
    ("body", "message", "hint"),
    [
        (
            '<Spin spin_dist="90.0"/>',
            "spin_dist: 90.0 is unusual, because radians are usually from -6.2832 to 6.2832",
            "90 degrees are 1.5708 rad: write 1.5708",
        ),
        (
            '<Spin spin_dist="-45"/>',
            "spin_dist: -45 is unusual, because radians are usually from -6.2832 to 6.2832",
            "-45 degrees are -0.7854 rad: write -0.7854",
        ),
        ('<Spin spin_dist="1e300"/>', "radians are usually from -6.2832 to 6.2832", None),
        ('<Wait wait_duration="5000000"/>', "seconds are usually from 0 to 604800", "5000000 ms are 5000 s: write 5000"),
        ('<Delay delay_msec="700000000"><AlwaysSuccess/></Delay>', "milliseconds are usually from 0 to 604800000", None),
        ('<DriveOnHeading dist_to_travel="200000" speed="0.2" time_allowance="10"/>', "metres are", "200000 mm are 200 m: write 200"),
    ],
)  # fmt: skip
def test_unusual_number_is_warning_with_conversion(body, message, hint):
    [finding] = findings_in(body)
    assert (finding.code, finding.severity) == ("out-of-range", Severity.WARNING)
    assert message in finding.message
    assert finding.hint == hint


@pytest.mark.parametrize(
    "body",
    [
        '<Spin spin_dist="-6.28"/>',
        '<Wait wait_duration="604800"/>',
        '<Delay delay_msec="600000000"><AlwaysSuccess/></Delay>',
        '<Spin spin_dist="{turn}"/>',
    ],
)
def test_number_at_end_of_usual_range_is_no_warning(body):
    assert [each for each in findings_in(body) if each.code == "out-of-range"] == []


@pytest.mark.parametrize("text", ["", "{}", " { } ".replace(" ", "")])
def test_empty_output_is_warning(text):
    [finding] = findings_in(
        f'<Sequence><ComputePathToPose goal="1;map;0;0;0;0;0;0;1" path="{text}"/></Sequence>'
    )
    assert (finding.code, finding.severity) == ("ignored-attribute", Severity.WARNING)
    assert finding.hint == 'remove path, or write path="{key}"'
    assert findings_in('<Sequence><ComputePathToPose goal="1;map;0;0;0;0;0;0;1"/></Sequence>') == []


@pytest.mark.parametrize(("text", "suggestion"), [("road", "{road}"), ("${road}", "{road}"), ("a b", None)])
def test_literal_for_output_is_error(text, suggestion):
    [finding] = findings_in(f'<ComputePathToPose goal="1;map;0;0;0;0;0;0;1" path="{text}"/>')
    assert (finding.code, finding.severity, finding.suggestion) == ("wrong-value", Severity.ERROR, suggestion)


@pytest.mark.parametrize(
    ("text", "suggestion"),
    [("${g}", "{g}"), (" ${@g} ", "{@g}"), ("$g", None), ("a ${g}", None), ("${g", None)],
)
def test_key_with_dollar_sign_gets_suggestion(text, suggestion):
    body = f'<Sequence><Script code="g := 1"/><SetBlackboard output_key="out" value="{text}"/></Sequence>'
    keys = [each for each in findings_in(body) if each.code == "unclosed-key"]
    assert [each.suggestion for each in keys] == ([suggestion] if suggestion else [])


def errors(text):
    with pytest.raises(TreeError) as raised:
        parse_yaml(
            f"root:\n  children:\n    - BehaviorTree:\n        ID: Main\n        children:\n{text}", "t.yaml"
        )
    return [(each.code, each.span.line, each.span.column, each.advice) for each in raised.value.findings]


@pytest.mark.parametrize(
    ("text", "column", "advice"),
    [
        ("          - Sleep: {msec: 0,5}\n", 27, "did you mean '0.5'?"),
        ("          - Sleep: {name: a, msec: -0,25}\n", 36, "did you mean '-0.25'?"),
        ("          - Sleep: {msec: 1,500}\n", 27, "the comma is ambiguous: write 1500, or 1.500"),
    ],
)
def test_decimal_comma_between_braces_is_one_number(text, column, advice):
    assert errors(text) == [("wrong-value", 6, column, advice)]


def test_key_of_digits_with_value_is_no_decimal_comma():
    [(code, *_)] = errors("          - Sleep: {msec: 0,5: 3}\n")
    assert code == "wrong-name"


@pytest.mark.parametrize(
    "text",
    [
        "          - Sequence:\n              children:\n                - Sleep\n                  - AlwaysFailure\n",
        "          - Sequence:\n              name: a\n                - AlwaysFailure\n              children: [Sleep]\n",
    ],
)
def test_node_indented_too_deep_is_reported_at_its_own_line(text):
    line = 6 + text[: text.index("- AlwaysFailure")].count("\n")
    column = text.splitlines()[line - 6].index("-") + 1
    assert errors(text) == [
        ("wrong-shape", line, column, "indent this line like the lines with the '- ' of its siblings")
    ]


class Drive(py_trees.behaviour.Behaviour):
    """A leaf whose parameters state their units only in their names."""

    def __init__(self, name: str, timeout_sec: float = 1.0, yaw: float = 0.0, speed: float = 0.0) -> None:
        super().__init__(name)
        self.given = timeout_sec, yaw, speed

    def update(self) -> Status:
        return Status.SUCCESS


@pytest.mark.parametrize(
    ("attribute", "advice"),
    [
        ('timeout_sec="20s"', "did you mean '20'?"),
        ('timeout_sec="500ms"', "did you mean '0.5'?"),
        ('timeout_sec="2 V"', "write only the number, in the unit that the node's documentation states"),
        ('yaw="90 degrees"', "write 1.5708 if 'yaw' is in radians"),
        ('yaw="0,5"', "did you mean '0.5'?"),
        ('speed="3m"', "write only the number, in the unit that the node's documentation states"),
        ('yaw="180"', "180 degrees are 3.1416 rad: write 3.1416"),
        ('timeout_sec="1e7"', "10000000 ms are 10000 s: write 10000"),
    ],
)
def test_unit_follows_from_attribute_name(attribute, advice):
    registry = Registry()
    registry.add_class(register("Drive", kind=Kind.ACTION, outcomes=[Status.SUCCESS])(Drive))
    [finding] = check(forest(f"<Drive {attribute}/>"), registry)
    assert finding.advice == advice
