"""Nodes that run scripts, and what is said when one cannot be run."""

import pytest
from py_trees.common import Status

from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.kernel.leaf_nodes import StrictUpdate
from sar_compiler.runtime.language_nodes import RunScript, ScriptCondition
from sar_compiler.runtime.outcomes import ReturnedStatus
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.script_code import compile_fast_script
from sar_compiler.runtime.scripting import NodeScriptError
from tests.runtime.own import own
from tests.runtime.stage import Stage

Precondition = own("Precondition")


def run(stage, text, scope=None):
    RunScript("run", stage.code(text), scope or stage.scope, stage.enums).tick_once()


def test_a_script_makes_changes_and_reads_entries():
    stage = Stage(i=3, flag=True)
    run(stage, "n := i + 1; i += 2; f := flag == 1; c := BLUE")
    assert stage.values == {"i": 5, "flag": True, "n": 4.0, "f": 1.0, "c": 2.0}
    assert type(stage.values["i"]) is int


def test_an_entry_keeps_its_type_when_a_script_writes_it():
    stage = Stage(flag=True, text="x")
    run(stage, "flag := 0; text += 'y'")
    assert stage.values == {"flag": False, "text": "xy"}
    assert type(stage.values["flag"]) is bool


def test_an_entry_that_a_port_has_named_needs_no_other_maker():
    stage = Stage()
    stage.entry("n").declare(int)
    run(stage, "n = 1.5")
    assert stage.values == {"n": 1.5}


def test_a_text_given_to_an_entry_with_a_type_is_read_as_one_of_it():
    stage = Stage()
    stage.entry("n").declare(int)
    run(stage, "n := '5'; m := n")
    assert stage.values == {"n": 5, "m": 5}


def test_a_text_given_to_a_number_without_a_type_of_its_own_is_a_real_number():
    stage = Stage()
    run(stage, "n := 1; n = '5'; m := 1; m = 'RED'")
    assert stage.values == {"n": 5.0, "m": 1.0}
    assert {type(value) for value in stage.values.values()} == {float}


def test_a_truth_value_is_a_whole_number_to_a_script():
    stage = Stage(flag=True)
    run(stage, "n := flag")
    assert type(stage.values["n"]) is int


def test_a_script_may_count_on_from_a_truth_value():
    stage = Stage(seen=True)
    stage.entry("seen").declare(bool)
    run(stage, "seen := seen + 1")
    assert stage.values == {"seen": 2}
    run(stage, "seen -= 1; n := seen")
    assert repr(stage.values) == "{'seen': 1, 'n': 1}"
    with pytest.raises(NodeScriptError, match=r"0\.5 is not an integer"):
        run(stage, "seen := 0.5")


def test_a_script_in_a_subtree_writes_its_own_entries_and_those_of_the_root_with_a_sign():
    stage = Stage()
    run(stage, "x := 1; @y := 2", Scope(stage.scope.board, "sub", stage.scope))
    assert stage.values == {"sub/x": 1, "y": 2}


def test_every_assignment_counts_as_an_update():
    stage = Stage(k=1)
    before = stage.entry("k").stamp
    run(stage, "k = 1; k := 1")
    assert stage.entry("k").stamp == before + 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "a := 1; nope = 3",
            "'run': code, column 9: there is no variable 'nope' (to create it, write nope := ...)",
        ),
        ("a := 1;\n  b := nope", "'run': code, line 2, column 8: there is no variable 'nope'"),
        ("z := 10; z /= 4", "'run': code, column 10: "),
        ("thing + 1", "'run': code, column 1: 'thing' has a value of type object"),
    ],
)
def test_a_script_that_cannot_be_run_says_which_node_and_where(text, message):
    stage = Stage(thing=object())
    with pytest.raises(NodeScriptError) as caught:
        run(stage, text)
    assert str(caught.value).startswith(message)
    assert (caught.value.node, caught.value.attribute) == ("run", "code")


def test_what_came_before_the_mistake_stays():
    stage = Stage()
    with pytest.raises(NodeScriptError):
        run(stage, "a := 1; nope = 3")
    assert stage.values == {"a": 1}


def test_an_empty_script_does_nothing_and_is_no_condition():
    stage = Stage()
    empty = Input(parse("", allow_empty=True))
    assert stage.tick(RunScript("run", empty, stage.scope, stage.enums)) == "S:"


def test_a_script_from_the_blackboard_is_read_whenever_it_is_run():
    stage = Stage(code="a := 1")
    node = RunScript("run", stage.code_in("code"), stage.scope, stage.enums)
    node.tick_once()
    stage.entry("code").write("a := 2")
    node.tick_once()
    assert stage.entry("a").read() == 2


@pytest.mark.parametrize(("code", "what"), [("a :=", "{code}"), ((7,), "is not a script")])
def test_what_is_no_script_on_the_blackboard_is_an_error_that_names_the_node(code, what):
    stage = Stage(code=code)
    with pytest.raises(NodeScriptError) as caught:
        RunScript("run", stage.code_in("code"), stage.scope, stage.enums).tick_once()
    assert str(caught.value).startswith("'run': code: {code}: ")
    assert what in str(caught.value)


@pytest.mark.parametrize(("code", "ended"), [(1, "S:"), (0, "F:"), (1.0, "S:"), (True, "S:")])
def test_a_number_on_the_blackboard_is_read_as_the_script_of_its_text(code, ended):
    stage = Stage(code=code)
    assert stage.tick(ScriptCondition("c", stage.code_in("code"), stage.scope, stage.enums)) == ended


def test_a_condition_is_true_or_false_and_no_other_whole_number():
    stage = Stage(x=2)
    conditions = [
        ScriptCondition("c", stage.code(text), stage.scope, stage.enums) for text in ("x > 1", "x > 3")
    ]
    assert [stage.tick(condition) for condition in conditions] == ["S:", "F:"]
    with pytest.raises(NodeScriptError, match="'c': code, column 1: "):
        ScriptCondition("c", stage.code("x"), stage.scope, stage.enums).tick_once()


def precondition(stage, outcomes, **more):
    return Precondition("p", stage.leaf("a", outcomes), stage.code("x > 0"), stage.scope, stage.enums, **more)


def test_a_precondition_is_not_asked_while_its_child_runs():
    stage = Stage(x=1)
    root = precondition(stage, "R,R,S")
    stage.tick(root)
    stage.entry("x").write(0)
    assert stage.ticks(root, 3) == ["R: a=R", "S: a=S", "F:"]
    assert root.feedback_message == "the condition is false"


@pytest.mark.parametrize("outcome", ReturnedStatus)
def test_a_false_precondition_gives_the_answer_that_was_chosen(outcome):
    stage = Stage(x=0)
    letter = "K" if outcome is ReturnedStatus.SKIPPED else outcome.name[0]
    assert stage.tick(precondition(stage, "S", else_=Input(outcome))) == f"{letter}:"


def test_a_precondition_is_asked_again_after_a_halt():
    stage = Stage(x=1)
    root = precondition(stage, "R")
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == "halt a"
    stage.entry("x").write(0)
    assert stage.tick(root) == "F:"


def test_a_precondition_is_asked_again_after_its_child_was_skipped():
    stage = Stage(x=1)
    root = precondition(stage, "K,S")
    assert stage.tick(root) == "K: a=K"
    stage.entry("x").write(0)
    assert stage.tick(root) == "F:"


def test_an_entry_that_holds_nothing_is_no_variable():
    stage = Stage(x=None)
    with pytest.raises(NodeScriptError, match="there is no variable 'x'"):
        run(stage, "y := x")


@pytest.mark.parametrize(
    ("leaf", "text"), [(RunScript, "n := n + 1; n"), (ScriptCondition, "(n := n + 1) > 0")]
)
def test_a_leaf_with_a_script_calls_nothing_but_its_quick_form_from_its_second_tick_on(
    leaf, text, monkeypatch
):
    stage = Stage(n=1)
    node = leaf("s", stage.code(text), stage.scope, stage.enums)
    node.tick_once()
    monkeypatch.setattr(leaf, "update", None)
    node.tick_once()
    assert (node.status, stage.values) == (Status.SUCCESS, {"n": 3})


def test_a_condition_answers_anew_in_each_tick():
    stage = Stage(n=1)
    node = ScriptCondition("s", stage.code("n == 1"), stage.scope, stage.enums)
    answers = []
    for value in (1, 2, "2", 1):
        stage.entry("n").write(value)
        node.tick_once()
        answers.append(node.status)
    assert answers == [Status.SUCCESS, Status.FAILURE, Status.FAILURE, Status.SUCCESS]


def test_whoever_has_put_something_around_the_update_of_a_script_stays_there(monkeypatch):
    stage, called = Stage(n=1), []

    class Telling(RunScript):
        def update(self):
            called.append("class")
            return super().update()

    derived = Telling("s", stage.code("n += 1"), stage.scope, stage.enums)
    wrapped = RunScript("s", stage.code("n += 1"), stage.scope, stage.enums)
    update = wrapped.update

    def told():
        called.append("object")
        return update()

    monkeypatch.setattr(wrapped, "update", told)
    for node in (derived, derived, wrapped, wrapped):
        node.tick_once()
    assert (called, stage.values) == (["class"] * 2 + ["object"] * 2, {"n": 5})


def test_a_script_around_whose_update_somebody_has_put_something_is_made_code_once(monkeypatch):
    stage, made = Stage(n=1), []

    def counted(*given):
        made.append(given)
        return compile_fast_script(*given)

    monkeypatch.setattr("sar_compiler.runtime.scripting.compile_fast_script", counted)
    node = RunScript("s", stage.code("n += 1"), stage.scope, stage.enums)
    monkeypatch.setattr(node, "update", StrictUpdate(node))
    for _ in range(3):
        node.tick_once()
    assert (len(made), stage.values) == (1, {"n": 4})
