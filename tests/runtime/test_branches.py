"""Tests of IfThenElse, WhileDoElse, Switch and TryCatch."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from sar_compiler.runtime import operators
from sar_compiler.runtime.operators import equal_texts
from sar_compiler.runtime.ports import Input, PortError
from tests.conformance.leaves import ScriptedError
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

IfThenElse = own("IfThenElse")
TryCatch = own("TryCatch")
WhileDoElse = own("WhileDoElse")


def Switch(name, children, variable, enums, *cases, **named):  # noqa: N802
    return own(f"Switch{len(children) - 1}")(name, children, variable, enums, *cases, **named)


def test_if_then_else_evaluates_condition_once_and_reports_branch():
    stage = Stage()
    root = IfThenElse("i", stage.leaves(c="F,S", t="S", e="R,S"))
    assert stage.tick(root) == "R: c=F e=R"
    assert root.feedback_message == "else"
    assert stage.ticks(root, 2) == ["S: e=S", "S: c=S t=S"]


def test_if_then_else_without_else_fails_if_condition_fails():
    stage = Stage()
    assert stage.ticks(IfThenElse("i", stage.leaves(c="F,S", t="S")), 2) == ["F: c=F", "S: c=S t=S"]


def test_if_then_else_evaluates_condition_again_after_halt():
    stage = Stage()
    root = IfThenElse("i", stage.leaves(c="S,F", t="R", e="S"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt t"
    assert stage.tick(root) == "S: c=F e=S"


def test_if_then_else_is_skipped_if_condition_is_skipped():
    stage = Stage()
    root = IfThenElse("i", stage.leaves(c="K,S", t="S", e="S"))
    assert stage.ticks(root, 2) == ["K: c=K", "S: c=S t=S"]


def test_while_do_else_switches_branch_with_condition():
    stage = Stage()
    root = WhileDoElse("w", stage.leaves(c="S,F,S", d="R", e="R"))
    assert stage.ticks(root, 3) == ["R: c=S d=R", "R: c=F halt d e=R", "R: c=S halt e d=R"]
    assert root.feedback_message == "do"


def test_while_do_else_is_running_while_condition_is_running():
    stage = Stage()
    assert stage.tick(WhileDoElse("w", stage.leaves(c="R", d="S"))) == "R: c=R"


def test_while_do_else_halts_branch_if_condition_is_skipped():
    stage = Stage()
    root = WhileDoElse("w", stage.leaves(c="S,K", d="R"))
    assert stage.ticks(root, 2) == ["R: c=S d=R", "K: c=K halt d"]


def switch(stage, variable="v", **cases):
    children = [stage.leaf(f"on{number}", "R") for number in range(len(cases))]
    ports = {name: Input(text) for name, text in cases.items()}
    return Switch("s", [*children, stage.leaf("other", "S")], stage.port(variable), stage.enums, **ports)


def test_switch_halts_running_child_when_variable_changes():
    stage = Stage(v="1")
    root = switch(stage, case_1="1", case_2="2")
    assert stage.tick(root) == "R: on0=R"
    assert root.feedback_message == "case 1"
    stage.entry("v").write("2")
    assert stage.tick(root) == "R: halt on0 on1=R"
    stage.entry("v").remove()
    assert stage.tick(root) == "S: halt on1 other=S"
    assert root.feedback_message == "no case"


def test_halted_switch_halts_running_child():
    stage = Stage(v="1")
    root = switch(stage, case_1="1", case_2="2")
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt on0"
    stage.entry("v").write("2")
    assert stage.tick(root) == "R: on1=R"


def test_switch_is_skipped_in_every_tick_if_child_is_skipped():
    stage = Stage(v="1")
    children = stage.leaves(a="K", b="S", c="S")
    root = Switch("s", children, stage.port("v"), stage.enums, Input("1"), Input("2"))
    assert stage.ticks(root, 2) == ["K: a=K", "K: a=K"]


def test_switch_has_up_to_six_cases():
    stage = Stage(v="f")
    cases = {f"case_{number}": letter for number, letter in enumerate("abcdef", start=1)}
    assert stage.tick(switch(stage, **cases)) == "R: on5=R"


def test_switch_ignores_case_without_value():
    stage = Stage(v="1")
    children = stage.leaves(a="S", b="S", other="S")
    root = Switch("s", children, stage.port("v"), stage.enums, stage.port("nothing"), Input("1"))
    assert stage.tick(root) == "S: b=S"


@pytest.mark.parametrize(
    ("first", "second"),
    [("x", "x"), ("1", "01"), ("1", "1.0"), ("RED", "1"), ("1.0", "RED"), ("0.1", "0.10000001"), ("", "")],
)
def test_strings_are_equal_as_strings_or_as_numbers(first, second):
    assert equal_texts(first, second, {"RED": 1})


@pytest.mark.parametrize(
    ("first", "second"),
    [("x", "X"), ("1", "1 "), ("RED", "2"), ("1", "1.00001"), ("", "0"), ("inf", "infinity"), ("true", "1")],
)
def test_other_strings_are_not_equal(first, second):
    assert not equal_texts(first, second, {"RED": 1})


@given(first=st.text(), second=st.text())
def test_string_equality_is_symmetric(first, second):
    assert equal_texts(first, first, {})
    assert equal_texts(first, second, {}) == equal_texts(second, first, {})


def test_try_catch_runs_catch_branch_over_several_ticks_and_fails():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="S", b="F,S", clean="R,S"))
    assert stage.tick(root) == "R: a=S b=F clean=R"
    assert root.feedback_message == "b failed"
    assert stage.ticks(root, 2) == ["F: clean=S", "S: a=S b=S"]


def test_try_catch_fails_if_catch_branch_is_skipped():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="K", b="F", clean="K"))
    assert stage.tick(root) == "F: a=K b=F clean=K"


def test_halted_try_catch_does_not_run_catch_branch_by_default():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="R", clean="S"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt a"


def test_halted_try_catch_halts_catch_branch_after_one_tick():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="R", clean="R"), Input(source=True))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt a clean=R halt clean"


def test_try_catch_halted_while_catching_does_not_catch_again():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="F,S", clean="R"), Input(source=True))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt clean"
    assert stage.tick(root) == "S: a=S"


def test_halting_ended_try_catch_does_not_run_catch_branch():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="S", clean="S"), Input(source=True))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == ""


def test_halted_try_catch_resets_children_even_if_catch_branch_raises():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="R", clean="X,S"), Input(source=True))
    stage.tick(root)
    with pytest.raises(ScriptedError):
        root.stop(Status.INVALID)
    assert stage.new_events() == "halt a clean=E"
    assert {child.status for child in root.children} == {Status.INVALID}


def test_switch_variable_of_wrong_type_raises_error():
    stage = Stage(v=2)

    def text(value):
        raise ValueError(f"{value} is not a string")

    variable: Input[str] = Input(stage.entry("v"), text, "variable")
    root = Switch("s", stage.leaves(a="S", b="S", c="S"), variable, stage.enums, Input("1"), Input("2"))
    with pytest.raises(PortError, match=r"variable: \{v\}: 2 is not a string"):
        root.tick_once()


def test_number_in_string_is_parsed_once(monkeypatch):
    read = []

    def number_of(text):
        read.append(text)
        return float(text)

    operators._number_in.cache_clear()
    monkeypatch.setattr(operators, "number_of", number_of)
    assert [equal_texts("5.0", case, {}) for case in ("4", "5", "4", "5")] == [False, True, False, True]
    assert read == ["5.0", "4", "5"]
    operators._number_in.cache_clear()
