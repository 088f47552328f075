"""Tests of findings about parts of scripts that raise for all values of the variables, and about statements without effect."""

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from sar_compiler.checks import check
from sar_compiler.checks.rules.scripts import find_certain_errors
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.variables import PlainVariables
from sar_compiler.tree.diagnostic import Severity
from tests.random_inputs import rounds
from tests.trees import forest

CODES = {"failing-script", "idle-statement"}
VALUES = (0, 1, 7, 1.0, -2.5, 1e300, "", "1", "text")
"""Values of variables."""


def findings_in(script, attribute="_onSuccess"):
    text = script.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    findings = check(forest(f'<AlwaysSuccess {attribute}="{text}"/>'), default_registry())
    return [
        (each.code, each.span.column - len(f'<AlwaysSuccess {attribute}="'))
        for each in findings
        if each.code in CODES
    ]


# BehaviorTree.CPP 4.8.2 and 4.10 raise when they tick any of these.
@pytest.mark.parametrize(
    ("script", "column"),
    [
        ("x := 'goal' * 2", 6),
        ("x := 2 * 'goal'", 6),
        ("x := y * 'goal'", 6),
        ("x := 1 + (y - ('a' .. y))", 11),
        ("x := -'a'", 6),
        ("x := ~1e300", 6),
        ("x := 'a' ? 1 : 2", 6),
        ("x := 1.5 & 1", 6),
        ("x := 2 && y", 6),
        ("x := y || (0 - 1)", 6),
        ("x := 1; x *= 'a'", 9),
        ("x := y ? 'b' * 2 : ('a' - 1)", 10),
    ],
)
def test_part_that_always_raises_is_error_at_its_location(script, column):
    assert findings_in(script)[:1] == [("failing-script", column)]
    assert set(severities(script)) == {Severity.ERROR}


# BehaviorTree.CPP evaluates only the chosen branch.
@pytest.mark.parametrize(
    "script",
    [
        "x := y ? 1 : ('a' - 1)",
        "x := y ? -'a' : 2",
        "x := y ? (z ? -'a' : -'b') : 2",
        "x := y ? z ? 1 : -'a' : 2",
    ],
)
def test_error_in_branch_of_choice_is_warning(script):
    assert set(severities(script)) == {Severity.WARNING}


@pytest.mark.parametrize("script", ["'abc'", "2", "0 - 1", "x .. 'a'"])
def test_condition_that_is_neither_true_nor_false_always_raises(script):
    assert findings_in(script, "_skipIf") == [("failing-script", 1)]
    assert findings_in(f"y := {script}") == []


@pytest.mark.parametrize(
    "script",
    [
        "x := true ? 1 : ('a' * 2)",
        "x := 'LOW' < 3",
        "x := 'a' + 'b' .. 2",
        "x := y + 'a'",
        "x := (y - 2) && 1",
        "x := y ? 'a' : 1; z := x * 2",
        "x := 1 / 0",
        "x += 'a'",
    ],
)
def test_script_that_may_succeed_has_no_findings(script):
    assert findings_in(script) == []


@pytest.mark.parametrize(
    ("script", "columns"),
    [("x := 1;2;3", [8]), ("x == 1", [1]), ("x; y := 1; 2; 3; z := 4; z", [1, 12, 26]), ("'1;2;3'", [1])],
)
def test_consecutive_idle_statements_are_one_finding(script, columns):
    assert findings_in(script) == [("idle-statement", column) for column in columns]


def test_last_statement_of_condition_is_not_idle():
    assert findings_in("x := 1; x == 1", "_skipIf") == []
    assert findings_in("y; x == 1", "_skipIf") == [("idle-statement", 1)]


def test_deeply_nested_script_has_one_finding():
    assert findings_in("x := " + "(" * 60 + "'a' * 2" + ") + 1" * 60) == [("failing-script", 66)]


def severities(script):
    findings = check(
        forest(f'<AlwaysSuccess _onSuccess="{script.replace("&", "&amp;")}"/>'), default_registry()
    )
    return [each.severity for each in findings if each.code == "failing-script"]


OPERAND = st.sampled_from(["x", "y", "0", "1", "2", "0.5", "1e300", "'a'", "'1'", "''"])
PART = st.recursive(
    OPERAND,
    lambda part: st.one_of(
        st.builds("({}{})".format, st.sampled_from("-~!"), part),
        st.builds(
            "({} {} {})".format, part, st.sampled_from(["+", "-", "..", "*", "/", "&", "|", "&&", "||"]), part
        ),
    ),
    max_leaves=6,
)


def raises(script, x, y):
    try:
        Program(script).holds(PlainVariables({"x": x, "y": y}))
    except EvaluationError:
        return True
    return False


@settings(max_examples=rounds(100))
@given(PART)
def test_certain_errors_raise_for_all_values_and_cover_constant_scripts(text):
    script = parse(text)
    is_raised = bool(find_certain_errors(script, is_condition=True)[0])
    runs = [raises(script, x, y) for x in VALUES for y in VALUES]
    if is_raised:
        assert all(runs)
    if not {"x", "y"} & set(text):
        assert is_raised == runs[0]
