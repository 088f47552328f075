"""Tests of nodes that run scripts, and of their errors."""

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
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

Precondition = own("Precondition")


def run(stage, text, scope=None):
    RunScript("run", stage.code(text), scope or stage.scope, stage.enums).tick_once()


def test_script_reads_and_writes_entries():
    stage = Stage(i=3, flag=True)
    run(stage, "n := i + 1; i += 2; f := flag == 1; c := BLUE")
    assert stage.values == {"i": 5, "flag": True, "n": 4.0, "f": 1.0, "c": 2.0}
    assert type(stage.values["i"]) is int


def test_entry_written_by_script_keeps_its_type():
    stage = Stage(flag=True, text="x")
    run(stage, "flag := 0; text += 'y'")
    assert stage.values == {"flag": False, "text": "xy"}
    assert type(stage.values["flag"]) is bool


def test_declared_entry_can_be_assigned_without_creating_it():
    stage = Stage()
    stage.entry("n").declare(int)
    run(stage, "n = 1.5")
    assert stage.values == {"n": 1.5}


def test_string_assigned_to_typed_entry_is_parsed_as_its_type():
    stage = Stage()
    stage.entry("n").declare(int)
    run(stage, "n := '5'; m := n")
    assert stage.values == {"n": 5, "m": 5}


def test_string_assigned_to_untyped_number_becomes_float():
    stage = Stage()
    run(stage, "n := 1; n = '5'; m := 1; m = 'RED'")
    assert stage.values == {"n": 5.0, "m": 1.0}
    assert {type(value) for value in stage.values.values()} == {float}


def test_bool_is_read_as_integer():
    stage = Stage(flag=True)
    run(stage, "n := flag")
    assert type(stage.values["n"]) is int


def test_bool_entry_accepts_integers_but_no_fractions():
    stage = Stage(seen=True)
    stage.entry("seen").declare(bool)
    run(stage, "seen := seen + 1")
    assert stage.values == {"seen": 2}
    run(stage, "seen -= 1; n := seen")
    assert repr(stage.values) == "{'seen': 1, 'n': 1}"
    with pytest.raises(NodeScriptError, match=r"0\.5 is not an integer"):
        run(stage, "seen := 0.5")


def test_script_in_subtree_writes_own_entries_and_root_entries_with_at_sign():
    stage = Stage()
    run(stage, "x := 1; @y := 2", Scope(stage.scope.board, "sub", stage.scope))
    assert stage.values == {"sub/x": 1, "y": 2}


def test_every_assignment_counts_as_update():
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
def test_failing_script_reports_node_and_location(text, message):
    stage = Stage(thing=object())
    with pytest.raises(NodeScriptError) as caught:
        run(stage, text)
    assert str(caught.value).startswith(message)
    assert (caught.value.node, caught.value.attribute) == ("run", "code")


def test_assignments_before_error_are_kept():
    stage = Stage()
    with pytest.raises(NodeScriptError):
        run(stage, "a := 1; nope = 3")
    assert stage.values == {"a": 1}


def test_empty_script_succeeds():
    stage = Stage()
    empty = Input(parse("", allow_empty=True))
    assert stage.tick(RunScript("run", empty, stage.scope, stage.enums)) == "S:"


def test_script_on_blackboard_is_read_in_every_tick():
    stage = Stage(code="a := 1")
    node = RunScript("run", stage.code_in("code"), stage.scope, stage.enums)
    node.tick_once()
    stage.entry("code").write("a := 2")
    node.tick_once()
    assert stage.entry("a").read() == 2


@pytest.mark.parametrize(("code", "what"), [("a :=", "{code}"), ((7,), "is not a script")])
def test_invalid_script_on_blackboard_raises_error_with_node(code, what):
    stage = Stage(code=code)
    with pytest.raises(NodeScriptError) as caught:
        RunScript("run", stage.code_in("code"), stage.scope, stage.enums).tick_once()
    assert str(caught.value).startswith("'run': code: {code}: ")
    assert what in str(caught.value)


@pytest.mark.parametrize(("code", "ended"), [(1, "S:"), (0, "F:"), (1.0, "S:"), (True, "S:")])
def test_number_on_blackboard_is_used_as_script(code, ended):
    stage = Stage(code=code)
    assert stage.tick(ScriptCondition("c", stage.code_in("code"), stage.scope, stage.enums)) == ended


def test_condition_accepts_truth_values_but_no_other_integer():
    stage = Stage(x=2)
    conditions = [
        ScriptCondition("c", stage.code(text), stage.scope, stage.enums) for text in ("x > 1", "x > 3")
    ]
    assert [stage.tick(condition) for condition in conditions] == ["S:", "F:"]
    with pytest.raises(NodeScriptError, match="'c': code, column 1: "):
        ScriptCondition("c", stage.code("x"), stage.scope, stage.enums).tick_once()


def precondition(stage, outcomes, **more):
    return Precondition("p", stage.leaf("a", outcomes), stage.code("x > 0"), stage.scope, stage.enums, **more)


def test_precondition_is_not_evaluated_while_child_runs():
    stage = Stage(x=1)
    root = precondition(stage, "R,R,S")
    stage.tick(root)
    stage.entry("x").write(0)
    assert stage.ticks(root, 3) == ["R: a=R", "S: a=S", "F:"]
    assert root.feedback_message == "the condition is false"


@pytest.mark.parametrize("outcome", ReturnedStatus)
def test_false_precondition_returns_configured_outcome(outcome):
    stage = Stage(x=0)
    letter = "K" if outcome is ReturnedStatus.SKIPPED else outcome.name[0]
    assert stage.tick(precondition(stage, "S", else_=Input(outcome))) == f"{letter}:"


def test_precondition_is_evaluated_again_after_halt():
    stage = Stage(x=1)
    root = precondition(stage, "R")
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt a"
    stage.entry("x").write(0)
    assert stage.tick(root) == "F:"


def test_precondition_is_evaluated_again_after_child_was_skipped():
    stage = Stage(x=1)
    root = precondition(stage, "K,S")
    assert stage.tick(root) == "K: a=K"
    stage.entry("x").write(0)
    assert stage.tick(root) == "F:"


def test_entry_holding_none_is_no_variable():
    stage = Stage(x=None)
    with pytest.raises(NodeScriptError, match="there is no variable 'x'"):
        run(stage, "y := x")


@pytest.mark.parametrize(
    ("leaf", "text"), [(RunScript, "n := n + 1; n"), (ScriptCondition, "(n := n + 1) > 0")]
)
def test_script_leaf_does_not_call_update_from_second_tick_on(leaf, text, monkeypatch):
    stage = Stage(n=1)
    node = leaf("s", stage.code(text), stage.scope, stage.enums)
    node.tick_once()
    monkeypatch.setattr(leaf, "update", None)
    node.tick_once()
    assert (node.status, stage.values) == (Status.SUCCESS, {"n": 3})


def test_condition_is_evaluated_in_every_tick():
    stage = Stage(n=1)
    node = ScriptCondition("s", stage.code("n == 1"), stage.scope, stage.enums)
    answers = []
    for value in (1, 2, "2", 1):
        stage.entry("n").write(value)
        node.tick_once()
        answers.append(node.status)
    assert answers == [Status.SUCCESS, Status.FAILURE, Status.FAILURE, Status.SUCCESS]


def test_overridden_or_wrapped_update_of_script_leaf_is_still_called(monkeypatch):
    stage, called = Stage(n=1), []

    class RecordingScript(RunScript):
        def update(self):
            called.append("class")
            return super().update()

    derived = RecordingScript("s", stage.code("n += 1"), stage.scope, stage.enums)
    wrapped = RunScript("s", stage.code("n += 1"), stage.scope, stage.enums)
    update = wrapped.update

    def recorded():
        called.append("object")
        return update()

    monkeypatch.setattr(wrapped, "update", recorded)
    for node in (derived, derived, wrapped, wrapped):
        node.tick_once()
    assert (called, stage.values) == (["class"] * 2 + ["object"] * 2, {"n": 5})


def test_script_of_leaf_with_wrapped_update_is_compiled_once(monkeypatch):
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
