"""Tests of attributes that accept only some numbers or strings: durations, counts, queues."""

import re
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.checks import check
from sar_compiler.checks.schema_validation import schema_errors
from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.nodes.values import UNSIGNED, ConversionError, at_least, plausible_number, type_of_cpp_name
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.runtime.ports import PortError
from sar_compiler.tree.diagnostic import Severity, TreeError
from sar_compiler.tree.xml import parse_xml
from tests.trees import document, errors, forest

REGISTRY = default_registry()
LARGEST = 2**32 - 1


def error_locations(body):
    findings = errors(forest(body), REGISTRY)
    return [(f.code, f.span.column, f.message) for f in findings if f.severity is Severity.ERROR]


@pytest.mark.parametrize("number", [0, 1, 4294967295])
def test_milliseconds_accept_unsigned_integers(number):
    assert error_locations(f'<Sleep msec="{number}"/>') == []
    assert schema_errors(parse_xml(document(f'<Sleep msec="{number}"/>')), REGISTRY) == []


@pytest.mark.parametrize("number", ["-1", "-0", "4294967296", "10000000000"])
@pytest.mark.parametrize(
    "node",
    [
        '<Sleep msec="{}"/>',
        '<Delay delay_msec="{}"><Success/></Delay>',
        '<Timeout msec="{}"><Success/></Timeout>',
    ],
)
def test_number_outside_unsigned_range_is_rejected_by_check_and_schema(node, number):
    ((code, column, message),) = error_locations(node.format(number))
    assert (code, column) == ("wrong-value", node.index("{}") + 1)
    assert f"'{number}' is not an integer from 0 to 4294967295" in message
    assert schema_errors(parse_xml(document(node.format(number))), REGISTRY)


@given(st.integers(-10, 10) | st.integers(LARGEST - 10, LARGEST + 10) | st.integers(0, 10**12))
def test_schema_pattern_matches_exactly_accepted_numbers(number):
    matches = re.fullmatch(UNSIGNED.pattern, str(number)) is not None
    assert matches == (0 <= number <= LARGEST)
    if matches:
        assert UNSIGNED.convert(str(number)) == number
    else:
        with pytest.raises(ConversionError):
            UNSIGNED.convert(str(number))


@pytest.mark.parametrize("held", [-1, 2**32, "-1"])
def test_number_on_blackboard_outside_range_raises_error_with_range(held):
    binding = bind_main(forest('<Sleep msec="{pause}"/>'), REGISTRY)
    tree = compile_tree(binding, {Clock: ManualClock()}, {})
    tree.instance.scope.resolve("pause").write(held)
    with pytest.raises(
        PortError,
        match=r"msec: \{pause\}: .* is not an? (integer|duration \(milliseconds) from 0 to 4294967295",
    ):
        tree.root.tick_once()


def test_unsigned_int_in_model_has_same_type():
    assert type_of_cpp_name("unsigned int") is UNSIGNED


class Patient(Behaviour):
    """Tries.

    Args:
        name: The node's name.
        attempts: How often.
        speed: How fast.
        share: How much.
    """

    def __init__(
        self,
        name: str,
        attempts: Annotated[int, at_least(1)] = 3,
        speed: Annotated[float, "m/s"] = 0.5,
        share: Annotated[float, plausible_number(0, 1)] = 0.5,
    ) -> None:
        super().__init__(name)
        self.share = share
        self.given = (attempts, speed)

    def update(self) -> Status:
        return Status.SUCCESS


@pytest.fixture
def registry():
    return Registry([NodeSpec("Patient", Patient, Kind.ACTION)])


def test_at_least_annotation_limits_attribute(registry):
    assert errors(forest('<Patient attempts="1" speed="2"/>'), registry) == []
    (finding,) = errors(forest('<Patient attempts="0"/>'), registry)
    assert finding.message == "attempts: '0' is not an integer, 1 or more"
    assert (finding.code, finding.suggestion) == ("wrong-value", None)  # 1 would be another number


@pytest.mark.parametrize("share", ["60", "-0.1", "1.001"])
def test_plausible_number_annotation_leads_to_warning(registry, share):
    (finding,) = check(forest(f'<Patient share="{share}"/>'), registry)
    assert (finding.code, finding.severity) == ("out-of-range", Severity.WARNING)
    assert finding.hint == "write a number from 0 to 1"
    assert check(forest('<Patient share="1"/>'), registry) == []


@pytest.mark.parametrize(
    "leaf",
    ['RefineSweep until_pod="60"', 'PlanSweep coverage="0"', 'PlanSweep clearance="-0.3"', 'BatterySuffices at_least="20"'],
)  # fmt: skip
def test_implausible_numbers_of_search_leaves_are_reported(leaf):
    findings = check(forest(f"<{leaf}/>"), REGISTRY)
    assert "out-of-range" in [each.code for each in findings]


def test_mission_parameter_is_checked_against_annotation(registry):
    binding = bind_main(forest('<Patient attempts="{@tries}"/>'), registry)
    with pytest.raises(TreeError, match="the mission parameter 'tries' is invalid: '0' is not"):
        compile_tree(binding, {}, {"tries": 0})
    root = compile_tree(binding, {}, {"tries": 2}).root
    assert isinstance(root, Patient)
    assert root.given == (2, 0.5)


@pytest.mark.parametrize(
    ("node", "column", "words"),
    [
        ('<LoopInt queue="1;x"><Success/></LoopInt>', 17, "'x' is not an integer"),
        ('<LoopDouble queue="fast"><Success/></LoopDouble>', 20, "'fast' is not a number"),
        ('<LoopBool queue="maybe"><Success/></LoopBool>', 18, "'maybe' is not true or false"),
    ],
)
def test_invalid_item_of_literal_queue_is_reported(node, column, words):
    ((code, at, message),) = error_locations(node)
    assert (code, at) == ("wrong-value", column)
    assert f"queue: {words}" in message


@pytest.mark.parametrize(
    "node",
    [
        '<SuccessEveryN n="{@n}"/>',
        '<StatusQueue queue="{@q}"/>',
        '<CheckBlackboardVariableValues checks="{@c}" operator="and"/>',
        '<Parallel policy="{@p}" selected="Success"><Success/></Parallel>',
        '<Parallel policy="SuccessOnSelected" selected="{@s}"><Success/></Parallel>',
    ],
)
def test_node_with_mission_parameters_can_be_previewed(node):
    assert error_locations(node) == []
    assert preview_tree(bind_main(forest(node), REGISTRY)).root.name == node[1:].split(" ", maxsplit=1)[0]
