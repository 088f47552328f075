"""Tests of the pre- and post-conditions of a node at run time."""

import pytest
from py_trees import composites
from py_trees.common import Status
from py_trees.decorators import SuccessIsFailure

from sar_compiler.runtime.kernel.cells import RUNNING
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.scripting import NodeScriptError
from sar_compiler.runtime.stock import Sequence
from tests.conformance.leaves import ScriptedError
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

WhileDoElse = own("WhileDoElse")
LoopInt = own("LoopInt")


COUNTERS = {"on_success": "s+=1", "on_failure": "f+=1", "on_halted": "h+=1", "post": "p+=1"}


def with_conditions(stage, node, **scripts):
    parsed = {attribute(name): parse(text) for name, text in scripts.items()}
    return Conditions("conditions", node, parsed, stage.scope, stage.enums)


def attribute(name):
    """Return the attribute of a condition: `_failureIf` for `failure_if`."""
    first, *others = name.strip("_").split("_")
    return f"_{first}{''.join(map(str.capitalize, others))}"


def stage_with_counters(**entries):
    return Stage(s=0, f=0, h=0, p=0, **entries)


def counts(stage):
    return "".join(str(stage.entry(key).read()) for key in "sfhp")


@pytest.mark.parametrize(
    ("scripts", "answer", "because"),
    [
        ({"failure_if": "x==1", "success_if": "x==1"}, "F:", "decided by _failureIf"),
        ({"success_if": "x==1", "skip_if": "x==1"}, "S:", "decided by _successIf"),
        ({"skip_if": "x==1", "while_": "x==1"}, "K:", "decided by _skipIf"),
        ({"while_": "x==0"}, "K:", "decided by _while"),
        ({"failure_if": "x==0", "success_if": "x==0", "skip_if": "x==0", "while_": "x==1"}, "S: a=S", ""),
    ],
)
def test_first_true_condition_decides_and_is_reported(scripts, answer, because):
    stage = Stage(x=1)
    root = with_conditions(stage, stage.leaf("a"), **scripts)
    assert stage.tick(root) == answer
    assert root.feedback_message == because


def test_conditions_of_stopped_leaf_are_evaluated_again():
    stage = Stage(x=0)
    leaf = stage.leaf("a", "R")
    tree = LiveTree(
        Sequence(
            "root",
            memory=True,
            children=[with_conditions(stage, leaf, success_if="x==1"), stage.leaf("b", "R")],
        )
    )
    assert tree.tick() == RUNNING
    leaf.stop(Status.INVALID)
    stage.entry("x").write(1)
    assert tree.tick() == RUNNING
    assert leaf.status is Status.SUCCESS
    assert stage.new_events() == "a=R halt a b=R"


def test_only_while_condition_is_evaluated_while_node_runs():
    stage = Stage(x=1)
    root = with_conditions(
        stage, stage.leaf("a", "R"), failure_if="x==2", success_if="x==2", skip_if="x==2", while_="x<3"
    )
    stage.tick(root)
    stage.entry("x").write(2)
    assert stage.tick(root) == "R: a=R"
    stage.entry("x").write(3)
    assert stage.tick(root) == "K: halt a"
    assert root.feedback_message == "halted by _while"
    assert root.status == Status.INVALID


@pytest.mark.parametrize(
    ("outcomes", "expected"), [("S", "1001"), ("F", "0101"), ("K", "0000"), ("R", "0000")]
)
def test_scripts_run_after_node_ends(outcomes, expected):
    stage = stage_with_counters()
    stage.tick(with_conditions(stage, stage.leaf("a", outcomes), **COUNTERS))
    assert counts(stage) == expected


@pytest.mark.parametrize(
    ("condition", "expected"), [("success_if", "1001"), ("failure_if", "0101"), ("skip_if", "0000")]
)
def test_scripts_run_after_outcome_decided_by_condition(condition, expected):
    stage = stage_with_counters()
    stage.tick(with_conditions(stage, stage.leaf("a"), **{condition: "true"}, **COUNTERS))
    assert stage.new_events() == ""
    assert counts(stage) == expected


def test_halt_scripts_run_after_children_are_halted():
    stage = stage_with_counters()
    inner = with_conditions(stage, stage.leaf("a", "R"), on_halted="order := 'inner'")
    root = with_conditions(
        stage, Sequence("s", memory=True, children=[inner]), on_halted="order += ' outer'; h+=1", post="p+=1"
    )
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt a"
    assert stage.entry("order").read() == "inner outer"
    assert counts(stage) == "0011"


def test_halt_scripts_run_when_while_condition_halts_node():
    stage = stage_with_counters(x=1)
    root = with_conditions(stage, stage.leaf("a", "R"), while_="x==1", **COUNTERS)
    stage.tick(root)
    stage.entry("x").write(0)
    stage.tick(root)
    assert counts(stage) == "0011"


def test_halting_node_that_is_not_running_runs_no_script():
    stage = stage_with_counters()
    root = with_conditions(stage, stage.leaf("a"), on_halted="h+=1", post="p+=1")
    root.stop(Status.INVALID)
    stage.tick(root)
    root.stop(Status.INVALID)
    assert counts(stage) == "0001"


def test_node_and_its_conditions_share_one_status():
    stage = Stage()
    child = stage.leaf("a", "R,S")
    root = with_conditions(stage, child, skip_if="false")
    for expected in (Status.RUNNING, Status.SUCCESS):
        stage.tick(root)
        assert (root.status, child.status) == (expected, expected)
    root.status = Status.INVALID
    assert child.status == Status.INVALID


def test_skipped_control_with_conditions_keeps_status_running():
    stage = Stage()
    root = with_conditions(
        stage, Sequence("s", memory=True, children=[stage.leaf("a", "K")]), failure_if="false"
    )
    assert stage.tick(root) == "K: a=K"
    assert root.status == Status.RUNNING


def test_conditions_below_py_trees_composite_are_evaluated_at_every_start():
    stage = Stage(x=0)
    root = composites.Selector(
        "stock", memory=False, children=[with_conditions(stage, stage.leaf("a", "F"), success_if="x==1")]
    )
    assert stage.tick(root) == "F: a=F"
    stage.entry("x").write(1)
    assert stage.tick(root) == "S:"


def test_conditions_are_not_evaluated_again_while_parent_runs():
    # WhileDoElse ticks its first child in every tick, but starts it only once.
    stage = Stage(x=0)
    condition = with_conditions(stage, stage.leaf("c", "S"), failure_if="x==1")
    root = WhileDoElse("w", [condition, stage.leaf("d", "R")])
    stage.tick(root)
    stage.entry("x").write(1)
    assert stage.tick(root) == "R: c=S d=R"


@pytest.mark.parametrize("attribute", ["failure_if", "while_", "on_success", "post"])
def test_failing_condition_script_reports_node_and_attribute(attribute):
    stage = Stage()
    root = with_conditions(stage, stage.leaf("a"), **{attribute: "true && nope == 1"})
    written = {"failure_if": "_failureIf", "while_": "_while", "on_success": "_onSuccess", "post": "_post"}
    with pytest.raises(NodeScriptError) as caught:
        root.tick_once()
    assert str(caught.value).startswith(f"'a': {written[attribute]}, column 9: there is no variable 'nope'")


def test_assignment_as_condition_raises_error_suggesting_comparison():
    stage = Stage(level=1)
    with pytest.raises(NodeScriptError, match="'==' to compare"):
        with_conditions(stage, stage.leaf("a"), skip_if="level = 2").tick_once()


def test_node_can_start_again_after_exception():
    stage = stage_with_counters()
    root = with_conditions(stage, stage.leaf("a", "X,S"), **COUNTERS)
    with pytest.raises(ScriptedError):
        root.tick_once()
    stage.new_events()
    assert stage.tick(root) == "S: a=S"
    assert counts(stage) == "1001"


def test_loop_with_conditions_restarts_below_py_trees_decorator():
    stage = stage_with_counters()
    loop = LoopInt("l", stage.leaf("a"), Input("7"))
    root = SuccessIsFailure("f", with_conditions(stage, loop, on_success="s+=1"))
    assert stage.ticks(root, 4) == ["R: a=S", "F:", "R: a=S", "F:"]
    assert counts(stage) == "2000"
