"""IfThenElse, WhileDoElse, Switch and TryCatch."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from sar_compiler.runtime import operators
from sar_compiler.runtime.operators import equal_texts
from sar_compiler.runtime.ports import Input, PortError
from tests.conformance.leaves import ScriptedError
from tests.runtime.own import own
from tests.runtime.stage import Stage

IfThenElse = own("IfThenElse")
TryCatch = own("TryCatch")
WhileDoElse = own("WhileDoElse")


def Switch(name, children, variable, enums, *cases, **named):  # noqa: N802
    return own(f"Switch{len(children) - 1}")(name, children, variable, enums, *cases, **named)


def test_if_then_else_asks_once_and_says_which_way_it_went():
    stage = Stage()
    root = IfThenElse("i", stage.leaves(c="F,S", t="S", e="R,S"))
    assert stage.tick(root) == "R: c=F e=R"
    assert root.feedback_message == "else"
    assert stage.ticks(root, 2) == ["S: e=S", "S: c=S t=S"]


def test_if_then_else_without_an_else_fails_if_the_condition_does():
    stage = Stage()
    assert stage.ticks(IfThenElse("i", stage.leaves(c="F,S", t="S")), 2) == ["F: c=F", "S: c=S t=S"]


def test_if_then_else_asks_again_after_it_was_halted():
    stage = Stage()
    root = IfThenElse("i", stage.leaves(c="S,F", t="R", e="S"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == "halt t"
    assert stage.tick(root) == "S: c=F e=S"


def test_if_then_else_is_skipped_if_its_condition_is():
    stage = Stage()
    root = IfThenElse("i", stage.leaves(c="K,S", t="S", e="S"))
    assert stage.ticks(root, 2) == ["K: c=K", "S: c=S t=S"]


def test_while_do_else_changes_sides_with_its_condition():
    stage = Stage()
    root = WhileDoElse("w", stage.leaves(c="S,F,S", d="R", e="R"))
    assert stage.ticks(root, 3) == ["R: c=S d=R", "R: c=F halt d e=R", "R: c=S halt e d=R"]
    assert root.feedback_message == "do"


def test_while_do_else_waits_for_its_condition():
    stage = Stage()
    assert stage.tick(WhileDoElse("w", stage.leaves(c="R", d="S"))) == "R: c=R"


def test_while_do_else_halts_its_branch_if_its_condition_is_skipped():
    stage = Stage()
    root = WhileDoElse("w", stage.leaves(c="S,K", d="R"))
    assert stage.ticks(root, 2) == ["R: c=S d=R", "K: c=K halt d"]


def switch(stage, variable="v", **cases):
    children = [stage.leaf(f"on{number}", "R") for number in range(len(cases))]
    ports = {name: Input(text) for name, text in cases.items()}
    return Switch("s", [*children, stage.leaf("other", "S")], stage.port(variable), stage.enums, **ports)


def test_a_switch_halts_the_child_that_ran_when_the_variable_changes():
    stage = Stage(v="1")
    root = switch(stage, case_1="1", case_2="2")
    assert stage.tick(root) == "R: on0=R"
    assert root.feedback_message == "case 1"
    stage.entry("v").write("2")
    assert stage.tick(root) == "R: halt on0 on1=R"
    stage.entry("v").remove()
    assert stage.tick(root) == "S: halt on1 other=S"
    assert root.feedback_message == "no case"


def test_a_halted_switch_has_no_child_running():
    stage = Stage(v="1")
    root = switch(stage, case_1="1", case_2="2")
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == "halt on0"
    stage.entry("v").write("2")
    assert stage.tick(root) == "R: on1=R"


def test_a_switch_whose_child_is_skipped_is_skipped_and_stays_so():
    stage = Stage(v="1")
    children = stage.leaves(a="K", b="S", c="S")
    root = Switch("s", children, stage.port("v"), stage.enums, Input("1"), Input("2"))
    assert stage.ticks(root, 2) == ["K: a=K", "K: a=K"]


def test_a_switch_has_up_to_six_cases():
    stage = Stage(v="f")
    cases = {f"case_{number}": letter for number, letter in enumerate("abcdef", start=1)}
    assert stage.tick(switch(stage, **cases)) == "R: on5=R"


def test_a_case_without_a_value_is_none():
    stage = Stage(v="1")
    children = stage.leaves(a="S", b="S", other="S")
    root = Switch("s", children, stage.port("v"), stage.enums, stage.port("nothing"), Input("1"))
    assert stage.tick(root) == "S: b=S"


@pytest.mark.parametrize(
    ("first", "second"),
    [("x", "x"), ("1", "01"), ("1", "1.0"), ("RED", "1"), ("1.0", "RED"), ("0.1", "0.10000001"), ("", "")],
)
def test_texts_are_equal_as_texts_or_as_numbers(first, second):
    assert equal_texts(first, second, {"RED": 1})


@pytest.mark.parametrize(
    ("first", "second"),
    [("x", "X"), ("1", "1 "), ("RED", "2"), ("1", "1.00001"), ("", "0"), ("inf", "infinity"), ("true", "1")],
)
def test_other_texts_are_not(first, second):
    assert not equal_texts(first, second, {"RED": 1})


@given(first=st.text(), second=st.text())
def test_equality_of_texts_is_symmetric(first, second):
    assert equal_texts(first, first, {})
    assert equal_texts(first, second, {}) == equal_texts(second, first, {})


def test_try_catch_tidies_up_over_several_ticks_and_fails():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="S", b="F,S", clean="R,S"))
    assert stage.tick(root) == "R: a=S b=F clean=R"
    assert root.feedback_message == "b failed"
    assert stage.ticks(root, 2) == ["F: clean=S", "S: a=S b=S"]


def test_try_catch_halts_what_it_tried_before_it_catches():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="K", b="F", clean="K"))
    assert stage.tick(root) == "F: a=K b=F clean=K"


def test_try_catch_is_halted_without_catching_unless_it_is_told_to():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="R", clean="S"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == "halt a"


def test_try_catch_halts_the_last_child_if_one_tick_was_not_enough():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="R", clean="R"), Input(source=True))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == "halt a clean=R halt clean"


def test_try_catch_does_not_catch_twice_when_it_is_halted_while_catching():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="F,S", clean="R"), Input(source=True))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == "halt clean"
    assert stage.tick(root) == "S: a=S"


def test_try_catch_that_does_not_run_is_halted_without_catching():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="S", clean="S"), Input(source=True))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == ""


def test_try_catch_is_at_rest_even_if_the_last_child_raises_while_it_is_halted():
    stage = Stage()
    root = TryCatch("t", stage.leaves(a="R", clean="X,S"), Input(source=True))
    stage.tick(root)
    with pytest.raises(ScriptedError):
        root.stop(Status.INVALID)
    assert stage.told() == "halt a clean=E"
    assert {child.status for child in root.children} == {Status.INVALID}


def test_a_variable_that_does_not_fit_is_an_error():
    stage = Stage(v=2)

    def text(value):
        raise ValueError(f"{value} is not a string")

    variable: Input[str] = Input(stage.entry("v"), text, "variable")
    root = Switch("s", stage.leaves(a="S", b="S", c="S"), variable, stage.enums, Input("1"), Input("2"))
    with pytest.raises(PortError, match=r"variable: \{v\}: 2 is not a string"):
        root.tick_once()


def test_a_switch_looks_once_at_the_digits_of_a_text(monkeypatch):
    read = []

    def number_of(text):
        read.append(text)
        return float(text)

    operators._number_in.cache_clear()
    monkeypatch.setattr(operators, "number_of", number_of)
    assert [equal_texts("5.0", case, {}) for case in ("4", "5", "4", "5")] == [False, True, False, True]
    assert read == ["5.0", "4", "5"]
    operators._number_in.cache_clear()
