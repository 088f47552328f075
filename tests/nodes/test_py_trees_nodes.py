"""py_trees' own decorators and leaves in a tree file: the stock classes, working on the tree's keys and clock."""

import gc
import operator
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees import behaviours, composites, decorators
from py_trees.blackboard import Blackboard
from py_trees.common import OneShotPolicy, ParallelPolicy, Status

from sar_compiler.compiler import bind_main, compile_tree
from sar_compiler.nodes.language import decorators as ours
from sar_compiler.nodes.language import leaves
from sar_compiler.nodes.registry import default_registry
from sar_compiler.nodes.schemas.xml_schema import xml_schema
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.runtime.stock import Timeout, Timer
from sar_compiler.tree.diagnostic import TreeError
from tests.trees import document, errors, forest_of

SPECS = {registration.tag: registration for registration in [*ours.PY_TREES, *leaves.PY_TREES]}
S, F, R = Status.SUCCESS, Status.FAILURE, Status.RUNNING
LACKING = [name for name in ("ForEach",) if not hasattr(decorators, name)]
LACKING += [name for name in ("CompareBlackboardVariables",) if not hasattr(behaviours, name)]
since_2_4 = pytest.mark.skipif(bool(LACKING), reason=f"this py_trees does not have {LACKING}")
before_2_4 = pytest.mark.skipif(not LACKING, reason="this py_trees has all of them")


def compiled(body, clock=None, parameters=None, trees=""):
    text = document(body).replace("</root>", f"{trees}</root>")
    forest = forest_of(text.replace("<root ", '<root main_tree_to_execute="Main" ') if trees else text)
    assert [finding.render() for finding in errors(forest, default_registry())] == []
    return compile_tree(
        bind_main(forest, default_registry()), {Clock: clock or ManualClock()}, parameters or {}
    )


def ticked(tree, times):
    statuses = []
    for _ in range(times):
        tree.root.tick_once()
        statuses.append(tree.root.status)
    return statuses


def ticks(body, times, **options):
    return ticked(compiled(body, **options), times)


def findings(body):
    """Return what keeps a tree from being made, by the checks or by the compiler."""
    forest = forest_of(document(body))
    found = errors(forest, default_registry())
    if not found:
        with pytest.raises(TreeError) as caught:
            compile_tree(bind_main(forest, default_registry()), {Clock: ManualClock()}, {})
        found = list(caught.value.findings)
    return [(finding.code, finding.span.line, finding.span.column, finding.message) for finding in found]


def key(tree, name):
    return tree.instance.scope.resolve(name)


def queue(statuses, name="Queue"):
    return f'<StatusQueue name="{name}" queue="{statuses}"/>'


# What is written, the class it becomes, and what the node then has.
WRITTEN: dict[str, tuple[str, Any, dict[str, Any]]] = {
    "OneShot": (
        '<OneShot policy="ON_COMPLETION"><Success/></OneShot>',
        decorators.OneShot,
        {"policy": OneShotPolicy.ON_COMPLETION},
    ),
    "Timeout": ('<Timeout duration="2.5"><Success/></Timeout>', Timeout, {"duration": 2.5}),
    "Retry": ('<Retry num_failures="3"><Success/></Retry>', decorators.Retry, {"num_failures": 3}),
    "Repeat": ('<Repeat num_success="-1"><Success/></Repeat>', decorators.Repeat, {"num_success": -1}),
    "Condition": (
        '<Condition status="FAILURE"><Success/></Condition>',
        decorators.Condition,
        {"succeed_status": F},
    ),
    "Count": ("<Count><Success/></Count>", decorators.Count, {"total_tick_count": 0}),
    "EternalGuard": ('<EternalGuard condition="true"><Success/></EternalGuard>', decorators.EternalGuard, {}),
    "PassThrough": ("<PassThrough><Success/></PassThrough>", decorators.PassThrough, {}),
    "StatusToBlackboard": (
        '<StatusToBlackboard variable_name="how"><Success/></StatusToBlackboard>',
        decorators.StatusToBlackboard,
        {"variable_name": "/Main/how"},
    ),
    "ForEach": (
        '<ForEach source_key="zones" target_key="{zone}"><Success/></ForEach>',
        getattr(decorators, "ForEach", None),
        {"source_key": "/Main/zones", "target_key": "/Main/zone"},
    ),
    **{
        name: (f"<{name}><Success/></{name}>", getattr(decorators, name), {})
        for name in (
            "SuccessIsRunning",
            "SuccessIsFailure",
            "FailureIsSuccess",
            "FailureIsRunning",
            "RunningIsSuccess",
            "RunningIsFailure",
        )
    },
    **{
        name: (f"<{name}/>", getattr(behaviours, name), {})
        for name in ("Success", "Failure", "Running", "Dummy")
    },
    "Periodic": ('<Periodic n="2"/>', behaviours.Periodic, {"period": 2}),
    "StatusQueue": (
        '<StatusQueue queue="RUNNING; SUCCESS" eventually="FAILURE"/>',
        behaviours.StatusQueue,
        {"queue": [R, S], "eventually": F},
    ),
    "SuccessEveryN": ('<SuccessEveryN n="3"/>', behaviours.SuccessEveryN, {"every_n": 3}),
    "TickCounter": (
        '<TickCounter duration="2" completion_status="FAILURE"/>',
        behaviours.TickCounter,
        {"duration": 2, "completion_status": F},
    ),
    "ProbabilisticBehaviour": (
        '<ProbabilisticBehaviour weights="1;0;2.5"/>',
        behaviours.ProbabilisticBehaviour,
        {"_weights": [1.0, 0.0, 2.5]},
    ),
    "Timer": ('<Timer duration="3"/>', Timer, {"duration": 3.0}),
    "BlackboardToStatus": (
        '<BlackboardToStatus variable_name="{how}"/>',
        behaviours.BlackboardToStatus,
        {"variable_name": "/Main/how"},
    ),
    "CheckBlackboardVariableExists": (
        '<CheckBlackboardVariableExists variable_name="battery.percentage"/>',
        behaviours.CheckBlackboardVariableExists,
        {"variable_name": "/Main/battery.percentage", "key_attributes": "percentage"},
    ),
    "WaitForBlackboardVariable": (
        '<WaitForBlackboardVariable variable_name="goal"/>',
        behaviours.WaitForBlackboardVariable,
        {"variable_name": "/Main/goal"},
    ),
    "SetBlackboardVariable": (
        '<SetBlackboardVariable variable_name="@goal" variable_value="7" overwrite="false"/>',
        behaviours.SetBlackboardVariable,
        {"variable_name": "/Main/goal", "overwrite": False},
    ),
    "UnsetBlackboardVariable": (
        '<UnsetBlackboardVariable key="{goal}"/>',
        behaviours.UnsetBlackboardVariable,
        {"key": "/Main/goal"},
    ),
    "CheckBlackboardVariableValue": (
        '<CheckBlackboardVariableValue variable="x" operator="ge" value="2"/>',
        behaviours.CheckBlackboardVariableValue,
        {"check.variable": "/Main/x", "check.operator": operator.ge},
    ),
    "WaitForBlackboardVariableValue": (
        '<WaitForBlackboardVariableValue variable="x" operator="ne" value="2"/>',
        behaviours.WaitForBlackboardVariableValue,
        {"check.variable": "/Main/x", "check.operator": operator.ne},
    ),
    "CheckBlackboardVariableValues": (
        '<CheckBlackboardVariableValues checks="x gt 1; y eq red" operator="xor" namespace="results"/>',
        behaviours.CheckBlackboardVariableValues,
        {"operator": operator.xor},
    ),
    "CompareBlackboardVariables": (
        '<CompareBlackboardVariables var1_key="x" var2_key="{y}" operator="lt"/>',
        getattr(behaviours, "CompareBlackboardVariables", None),
        {"var1_key": "/Main/x", "var2_key": "/Main/y", "operator": operator.lt},
    ),
}


def test_every_node_has_its_line_in_the_table():
    assert set(WRITTEN) == set(SPECS)


@pytest.mark.parametrize("tag", sorted(set(WRITTEN) - set(LACKING)))
def test_a_tag_becomes_the_stock_class_with_the_arguments_written(tag):
    body, cls, wanted = WRITTEN[tag]
    tree = compiled(body)
    assert type(tree.root) is cls
    for name, value in wanted.items():
        # Each tree of a process has another prefix on its keys.
        mine = value.replace("/Main", tree.board.prefix) if isinstance(value, str) else value
        assert operator.attrgetter(name)(tree.root) == mine


@pytest.mark.parametrize("tag", sorted(WRITTEN))
def test_a_node_says_what_it_does_what_it_takes_and_how_it_can_end(tag):
    spec = SPECS[tag]
    assert spec.doc.endswith(".")
    assert all(parameter.doc for parameter in spec.attributes)
    assert spec.statuses


@pytest.mark.parametrize(
    ("body", "statuses"),
    [
        (queue("RUNNING;FAILURE"), [R, F, R, F]),
        ('<StatusQueue queue="RUNNING" eventually="SUCCESS"/>', [R, S, S]),
        ('<StatusQueue queue="" eventually="SUCCESS"/>', [S, S]),
        ('<Periodic n="1"/>', [R, S, S, F, F, R]),
        ('<SuccessEveryN n="2"/>', [F, S, F, S]),
        ('<SuccessEveryN n="-2"/>', [F, S, F, S]),
        ('<TickCounter duration="2" completion_status="FAILURE"/>', [R, R, F, R]),
        ('<TickCounter duration="-1" completion_status="SUCCESS"/>', [S, S]),
        ('<ProbabilisticBehaviour weights="0;1;0"/>', [F, F]),
        ("<Dummy/>", [R, R]),
        (f'<Condition status="FAILURE">{queue("SUCCESS;RUNNING;FAILURE")}</Condition>', [R, R, S]),
        (f"<Count>{queue('RUNNING;FAILURE')}</Count>", [R, F]),
        (f"<PassThrough>{queue('RUNNING;SUCCESS;FAILURE')}</PassThrough>", [R, S, F]),
        (f"<RunningIsFailure>{queue('RUNNING;SUCCESS;FAILURE')}</RunningIsFailure>", [F, S, F]),
        (f"<RunningIsSuccess>{queue('RUNNING;SUCCESS;FAILURE')}</RunningIsSuccess>", [S, S, F]),
        (f"<SuccessIsFailure>{queue('RUNNING;SUCCESS;FAILURE')}</SuccessIsFailure>", [R, F, F]),
        (f"<SuccessIsRunning>{queue('RUNNING;SUCCESS;FAILURE')}</SuccessIsRunning>", [R, R, F]),
        (f"<FailureIsSuccess>{queue('RUNNING;SUCCESS;FAILURE')}</FailureIsSuccess>", [R, S, S]),
        (f"<FailureIsRunning>{queue('RUNNING;SUCCESS;FAILURE')}</FailureIsRunning>", [R, S, R]),
        ('<Repeat num_success="2"><Success/></Repeat>', [R, S, R, S]),
        ('<Repeat num_success="0"><Success/></Repeat>', [R, R, R, R]),
        ('<Retry num_failures="2"><Failure/></Retry>', [R, F, R, F]),
        ('<Retry num_failures="0"><Failure/></Retry>', [F, F]),
        (f'<OneShot policy="ON_COMPLETION">{queue("RUNNING;FAILURE;SUCCESS")}</OneShot>', [R, F, F, F]),
    ],
)
def test_a_node_behaves_as_py_trees_has_it(body, statuses):
    assert ticks(body, len(statuses)) == statuses


# --- time ---


def test_a_timer_runs_on_the_clock_of_the_mission():
    clock = ManualClock(100.0)
    tree = compiled('<Timer duration="2"/>', clock)
    assert ticked(tree, 2) == [R, R]
    clock.advance(1.9)
    assert ticked(tree, 1) == [R]
    clock.advance(0.2)
    assert ticked(tree, 2) == [S, R], "it begins again when it is started again"


@pytest.mark.parametrize("duration", ["0", "-1"])
def test_a_timer_without_time_succeeds_at_once(duration):
    assert ticks(f'<Timer duration="{duration}"/>', 2) == [S, S]


def test_a_timer_waits_five_seconds_where_nothing_is_written():
    assert compiled("<Timer/>").root.duration == 5.0


# --- keys ---

SET_X = '<SetBlackboardVariable variable_name="x" variable_value="{value}"/>'


@pytest.mark.parametrize(
    ("text", "value"),
    [("7", 7), ("2.5", 2.5), ("true", True), ("red", "red"), ("json:[1, null]", [1, None]), ("", "")],
)
def test_a_written_value_is_a_number_a_truth_value_a_text_or_json(text, value):
    tree = compiled(f"<SetBlackboardVariable variable_name='x' variable_value='{text}'/>")
    assert ticked(tree, 1) == [S]
    assert key(tree, "x").read() == value
    assert type(key(tree, "x").read()) is type(value)


def test_the_value_of_another_key_is_read_when_the_node_is_ticked():
    tree = compiled('<SetBlackboardVariable variable_name="x" variable_value="{y}"/>')
    for value in (1, "two"):
        key(tree, "y").write(value)
        ticked(tree, 1)
        assert key(tree, "x").read() == value


def test_a_key_that_is_not_to_be_overwritten_stays_as_it_is():
    tree = compiled('<SetBlackboardVariable variable_name="x" variable_value="1" overwrite="false"/>')
    assert ticked(tree, 2) == [S, F]
    assert key(tree, "x").stamp == 1


def test_two_trees_in_a_process_do_not_see_each_others_keys():
    first, second = compiled(SET_X.format(value=1)), compiled(SET_X.format(value=2))
    ticked(first, 1)
    assert not key(second, "x").exists
    ticked(second, 1)
    assert (key(first, "x").read(), key(second, "x").read()) == (1, 2)


def test_a_tree_leaves_nothing_on_the_blackboard_that_others_would_see():
    ticked(compiled(SET_X.format(value=1)), 1)
    assert "/x" not in Blackboard.storage
    assert "/x" not in Blackboard.metadata


def test_a_key_goes_from_a_stock_node_to_a_script_and_back():
    body = (
        '<Sequence><SetBlackboardVariable variable_name="x" variable_value="2"/><Script code="x *= 3"/>'
        '<CheckBlackboardVariableValue variable="x" operator="eq" value="6"/></Sequence>'
    )
    assert ticks(body, 1) == [S]


@pytest.mark.parametrize("name", ["name", "read", "id", "set", "x"])
def test_a_key_may_have_the_name_of_something_that_a_client_has(name):
    body = (
        f'<Sequence><SetBlackboardVariable variable_name="{name}" variable_value="2"/>'
        f'<CheckBlackboardVariableValue variable="{name}" operator="eq" value="2"/></Sequence>'
    )
    assert ticks(body, 1) == [S]


SUBTREE = (
    '<BehaviorTree ID="Inner"><Sequence>'
    '<SetBlackboardVariable variable_name="{goal}" variable_value="5"/>'
    '<SetBlackboardVariable variable_name="own" variable_value="6"/>'
    '<CheckBlackboardVariableExists variable_name="own"/>'
    "</Sequence></BehaviorTree>"
)


def test_keys_in_a_subtree_are_its_own_unless_it_is_given_another_one():
    tree = compiled('<SubTree ID="Inner" name="Inner.v2" goal="{target}"/>', trees=SUBTREE)
    assert ticked(tree, 1) == [S]
    assert key(tree, "target").read() == 5
    assert not key(tree, "own").exists


def test_a_dot_in_the_name_of_a_tree_is_no_attribute_of_an_object():
    text = document(SET_X.format(value=3)).replace('"Main"', '"Main.v2"')
    tree = compile_tree(bind_main(forest_of(text), default_registry()), {}, {})
    assert ticked(tree, 1) == [S]
    assert key(tree, "x").read() == 3


def test_a_dot_in_a_key_is_an_attribute_of_the_object_in_it():
    tree = compiled(
        '<Sequence><SetBlackboardVariable variable_name="battery.percentage" variable_value="20"/>'
        '<CheckBlackboardVariableValue variable="{battery.percentage}" operator="le" value="20"/></Sequence>'
    )
    battery = SimpleNamespace(percentage=80)
    key(tree, "battery").write(battery)
    assert ticked(tree, 1) == [S]
    assert battery.percentage == 20
    assert key(tree, "battery").stamp == 2


def test_a_parameter_of_the_mission_is_a_key_of_the_root():
    body = '<CheckBlackboardVariableValue variable="{@speed}" operator="gt" value="1"/>'
    assert ticks(body, 1, parameters={"speed": 1.5}) == [S]


def test_removing_a_key_takes_it_off_the_blackboard():
    tree = compiled('<UnsetBlackboardVariable key="x"/>')
    key(tree, "x").write(1)
    assert ticked(tree, 2) == [S, S]
    assert not key(tree, "x").exists
    assert key(tree, "x").stamp == 0


def test_a_write_of_a_stock_node_counts_as_an_update():
    tree = compiled(
        '<Sequence><SetBlackboardVariable variable_name="x" variable_value="1"/>'
        '<WasEntryUpdated entry="{x}"/></Sequence>'
    )
    assert ticked(tree, 3) == [S, S, S]


@given(st.lists(st.sampled_from(["write", "remove", "keep"]), max_size=8))
def test_writes_are_counted_and_removals_end_the_count(steps):
    tree = compiled(
        '<Sequence><SetBlackboardVariable variable_name="x" variable_value="1"/>'
        '<SetBlackboardVariable name="keep" variable_name="x" variable_value="2" overwrite="false"/>'
        '<UnsetBlackboardVariable key="x"/></Sequence>'
    )
    write, keep, remove = tree.root.children
    count = 0
    for step in steps:
        {"write": write, "keep": keep, "remove": remove}[step].tick_once()
        count = {"write": count + 1, "keep": count or 1, "remove": 0}[step]
        assert key(tree, "x").stamp == count
        assert key(tree, "x").exists is (count > 0)


def test_the_entries_of_a_tree_that_nobody_has_any_more_leave_the_blackboard():
    tree = compiled(SET_X.format(value=1))
    ticked(tree, 1)
    name = key(tree, "x").name
    assert name in Blackboard.storage
    del tree
    gc.collect()
    assert name not in Blackboard.storage


# --- waiting and comparing ---


@pytest.mark.parametrize(
    ("tag", "missing"), [("CheckBlackboardVariableExists", F), ("WaitForBlackboardVariable", R)]
)
def test_a_key_is_asked_for_or_waited_for(tag, missing):
    tree = compiled(f'<{tag} variable_name="{{goal}}"/>')
    assert ticked(tree, 1) == [missing]
    key(tree, "goal").write(None)
    assert ticked(tree, 1) == [S]


@pytest.mark.parametrize(
    ("tag", "not_yet"), [("CheckBlackboardVariableValue", F), ("WaitForBlackboardVariableValue", R)]
)
def test_a_value_is_compared_in_every_tick(tag, not_yet):
    tree = compiled(f'<{tag} variable="x" operator="ge" value="2"/>')
    assert ticked(tree, 1) == [not_yet]
    for value, status in ((1, not_yet), (2, S), (2.5, S)):
        key(tree, "x").write(value)
        assert ticked(tree, 1) == [status]


@pytest.mark.parametrize("name", ["eq", "ne", "lt", "le", "gt", "ge"])
@given(left=st.integers(-3, 3), right=st.integers(-3, 3))
def test_comparisons_mean_what_they_do_in_python(name, left, right):
    tree = compiled(f'<CheckBlackboardVariableValue variable="x" operator="{name}" value="{right}"/>')
    key(tree, "x").write(left)
    assert ticked(tree, 1) == [S if getattr(operator, name)(left, right) else F]


def test_a_value_is_compared_with_what_another_key_holds_now_and_says_so():
    tree = compiled('<CheckBlackboardVariableValue variable="x" operator="lt" value="{limit}"/>')
    key(tree, "x").write(4)
    for limit, status in ((3, F), (5, S)):
        key(tree, "limit").write(limit)
        assert ticked(tree, 1) == [status]
        assert f"[e: {limit}]" in tree.root.feedback_message


@pytest.mark.parametrize(
    ("junction", "x", "y", "status"),
    [
        ("and", 21, 1, S),
        ("and", 21, 2, F),
        ("or", 21, 2, S),
        ("or", 20, 2, F),
        ("xor", 21, 1, F),
        ("xor", 20, 1, S),
        ("or", 21, None, F),
    ],
)
def test_several_comparisons_are_joined(junction, x, y, status):
    checks = "battery gt 20; speed lt 1.5"
    tree = compiled(f'<CheckBlackboardVariableValues checks="{checks}" operator="{junction}"/>')
    key(tree, "battery").write(x)
    if y is not None:
        key(tree, "speed").write(y)
    assert ticked(tree, 1) == [status]


def test_the_results_of_several_comparisons_can_be_had_one_by_one():
    body = '<CheckBlackboardVariableValues checks="x gt 1;y gt 1" operator="or" namespace="{results}"/>'
    tree = compiled(body)
    key(tree, "x").write(1)
    key(tree, "y").write(2)
    assert ticked(tree, 1) == [S]
    assert [key(tree, f"results/{number}").read() for number in (1, 2)] == [False, True]
    assert key(tree, "results/1").stamp == 1


@since_2_4
def test_two_keys_are_compared():
    tree = compiled('<CompareBlackboardVariables var1_key="x" var2_key="y" operator="lt"/>')
    key(tree, "x").write(1)
    assert ticked(tree, 1) == [F]
    for value, status in ((1, F), (2, S)):
        key(tree, "y").write(value)
        assert ticked(tree, 1) == [status]


# --- statuses on the blackboard, guards, loops ---


def test_a_status_goes_over_the_blackboard_from_one_node_to_another():
    body = (
        f'<Parallel policy="SuccessOnAll"><StatusToBlackboard variable_name="how">{queue("RUNNING;FAILURE")}'
        '</StatusToBlackboard><BlackboardToStatus variable_name="how"/></Parallel>'
    )
    tree = compiled(body)
    assert ticked(tree, 2) == [R, F]
    assert [child.status for child in tree.root.children] == [F, F]
    assert key(tree, "how").read() is F
    assert key(tree, "how").stamp == 2


def test_a_guard_asks_before_every_tick_and_interrupts_its_child():
    tree = compiled('<EternalGuard condition="battery &gt; 20"><Running/></EternalGuard>')
    key(tree, "battery").write(50)
    assert ticked(tree, 2) == [R, R]
    key(tree, "battery").write(20)
    assert ticked(tree, 1) == [F]
    assert tree.root.decorated.status is Status.INVALID


@since_2_4
@given(st.lists(st.integers(), min_size=1, max_size=4))
def test_a_loop_hands_one_item_after_the_other_to_its_child(items):
    tree = compiled('<ForEach source_key="zones" target_key="{zone}"><Success/></ForEach>')
    key(tree, "zones").write(items)
    seen = []
    while tree.root.status is not S:
        tree.root.tick_once()
        seen.append(key(tree, "zone").stamp)
    assert key(tree, "zone").read() == items[-1]
    assert seen[-1] == len(items)


def test_a_parallel_succeeds_with_the_children_that_are_selected():
    tree = compiled(
        '<Parallel policy="SuccessOnSelected" selected="c; a">'
        '<Success name="a"/><Running name="b"/><Success name="c"/></Parallel>'
    )
    assert isinstance(tree.root, composites.Parallel)
    assert isinstance(tree.root.policy, ParallelPolicy.SuccessOnSelected)
    assert [child.name for child in tree.root.policy.children] == ["c", "a"]
    assert ticked(tree, 1) == [S]


def test_a_selected_child_is_called_as_it_is_written_whatever_is_wrapped_around_it():
    tree = compiled(
        '<Parallel policy="SuccessOnSelected" selected="a;b;c">'
        '<Success name="a" oneshot="ON_COMPLETION"/><Success name="b" _failureIf="false"/>'
        '<Success name="c" _onSuccess="n := 1" oneshot="ON_COMPLETION"/></Parallel>'
    )
    assert tree.root.policy.children == tree.root.children
    assert ticked(tree, 1) == [S]


@pytest.mark.parametrize(
    ("attributes", "cls", "synchronise"),
    [
        ('policy="SuccessOnAll"', "SuccessOnAll", True),
        ('policy="SuccessOnAll" synchronise="false"', "SuccessOnAll", False),
        ('policy="SuccessOnOne"', "SuccessOnOne", False),
        ('policy="SuccessOnSelected" selected="Success"', "SuccessOnSelected", True),
        ('policy="SuccessOnSelected" selected="Success" synchronise="false"', "SuccessOnSelected", False),
    ],
)
def test_a_parallel_has_the_policy_written(attributes, cls, synchronise):
    policy = compiled(f"<Parallel {attributes}><Success/></Parallel>").root.policy
    assert type(policy) is getattr(ParallelPolicy, cls)
    assert policy.synchronise is synchronise


# --- mistakes ---


@pytest.mark.parametrize(
    ("body", "code", "column", "said"),
    [
        ('<SuccessEveryN n="0"/>', "wrong-value", 19, "the number must not be 0"),
        ('<UnsetBlackboardVariable key="{a b}"/>', "wrong-value", 32, "'a b' is not a key"),
        ('<StatusQueue queue="RUNNING; SUCESS"/>', "wrong-value", 30, "'SUCESS' is not one of"),
        (
            '<CheckBlackboardVariableValues checks="x gt 1;y" operator="or"/>',
            "wrong-value",
            47,
            "'y' is not a comparison",
        ),
        (
            '<Parallel policy="SuccessOnSelected" selected=""><Success/></Parallel>',
            "wrong-value",
            48,
            "no child is named",
        ),
        (
            '<Parallel policy="SuccessOnSelected" selected="Success;x"><Success/></Parallel>',
            "wrong-value",
            56,
            "named 'x'",
        ),
        ('<SuccessEveryN n="two"/>', "wrong-value", 19, "'two' is not an integer"),
        ('<StatusQueue queue=""/>', "wrong-value", 21, "RUNNING;SUCCESS"),
        ('<StatusQueue queue="SUCESS"/>', "wrong-value", 21, "'SUCESS' is not one of"),
        ('<StatusQueue queue="INVALID"/>', "wrong-value", 21, "'INVALID' is not one of"),
        (
            '<TickCounter duration="1" completion_status="DONE"/>',
            "wrong-value",
            46,
            "'DONE' is not one of SUCCESS, FAILURE, RUNNING",
        ),
        ('<Condition status="INVALID"><Success/></Condition>', "wrong-value", 20, "'INVALID' is not one of"),
        (
            '<ProbabilisticBehaviour weights="1;2"/>',
            "wrong-value",
            34,
            "expected 3 weights (SUCCESS, FAILURE, RUNNING), got 2",
        ),
        (
            '<ProbabilisticBehaviour weights="0;0;0"/>',
            "wrong-value",
            34,
            "at least one of the three weights must be more than 0",
        ),
        ('<ProbabilisticBehaviour weights="2;-1;1"/>', "wrong-value", 36, "'-1' is negative"),
        ('<WaitForBlackboardVariable variable_name=""/>', "wrong-value", 43, "is not a key"),
        ('<WaitForBlackboardVariable variable_name="/x"/>', "wrong-value", 43, "'/x' is not a key"),
        ('<WaitForBlackboardVariable variable_name="a b"/>', "wrong-value", 43, "'a b' is not a key"),
        ('<WaitForBlackboardVariable variable_name=".x"/>', "wrong-value", 43, "begins with a dot"),
        ('<WaitForBlackboardVariable variable_name="json:3"/>', "wrong-value", 43, "'json:3' is not a key"),
        ('<UnsetBlackboardVariable key="a.b"/>', "wrong-value", 31, "contains a dot"),
        (
            '<CheckBlackboardVariableValue variable="x" operator="==" value="1"/>',
            "wrong-value",
            54,
            "'==' is not one of eq, ne",
        ),
        (
            '<CheckBlackboardVariableValues checks="x gt 1" operator="and"/>',
            "wrong-value",
            40,
            "at least two",
        ),
        (
            '<CheckBlackboardVariableValues checks="x;y" operator="and"/>',
            "wrong-value",
            40,
            "'x' is not a comparison",
        ),
        (
            '<CheckBlackboardVariableValues checks="x is 1;y eq 2" operator="and"/>',
            "wrong-value",
            40,
            "'is' is not one of eq",
        ),
        (
            '<EternalGuard condition="a &gt;"><Success/></EternalGuard>',
            "script-error",
            None,
            "condition",
        ),
        (
            '<Parallel policy="SuccessOnSelected" selected="lift"><Success name="left"/></Parallel>',
            "wrong-value",
            48,
            "no child is named 'lift'",
        ),
        (
            '<Parallel policy="SuccessOnSelected" selected="x"><Success name="left"/></Parallel>',
            "wrong-value",
            48,
            "(known: left",
        ),
        (
            '<Parallel policy="SuccessOnSelected" selected="Success"><Success/><Success/></Parallel>',
            "wrong-value",
            48,
            "2 children are named 'Success'",
        ),
        (
            '<Parallel policy="SuccessOnSelected"><Success/></Parallel>',
            "missing-attribute",
            1,
            "needs the attribute 'selected'",
        ),
        (
            '<Parallel policy="SuccessOnAll" selected="Success"><Success/></Parallel>',
            "conflicting-attributes",
            33,
            "requires the policy SuccessOnSelected",
        ),
        (
            '<Parallel policy="SuccessOnOne" synchronise="true"><Success/></Parallel>',
            "conflicting-attributes",
            33,
            "remove it",
        ),
        (
            '<Repeat num_success="1" num_cycles="1"><Success/></Repeat>',
            "conflicting-attributes",
            None,
            "conflicts with",
        ),
    ],
)
def test_a_mistake_is_a_finding_where_it_stands(body, code, column, said):
    ((found, line, at, message),) = findings(f"<Sequence>\n{body}\n</Sequence>")
    assert (found, line) == (code, 4)
    assert column in (at, None)
    assert said in message


def test_the_decorator_and_the_explicit_form_of_a_leaf_share_the_tag_condition():
    body = '<Condition status="SUCCESS"><Condition ID="ScriptCondition" code="true"/></Condition>'
    tree = compile_tree(bind_main(forest_of(document(body)), default_registry()), {}, {})
    assert ticked(tree, 1) == [S]
    assert type(tree.root) is decorators.Condition


SKIPPABLE = '<Success _skipIf="true"/>'


@pytest.mark.parametrize(
    ("tag", "advice"),
    [
        ('Retry num_failures="2"', "write RetryUntilSuccessful"),
        ('Repeat num_success="2"', 'write num_cycles="..."'),
        ('Timeout duration="2"', 'write msec="..."'),
        ('OneShot policy="ON_COMPLETION"', "write RunOnce"),
        ("SuccessIsRunning", "write KeepRunningUntilFailure"),
        ("SuccessIsFailure", "write ForceFailure"),
        ("FailureIsSuccess", "write ForceSuccess"),
        ('Parallel policy="SuccessOnAll"', 'write success_count="..."'),
        ("PassThrough", "let the child succeed or fail"),
        ("Count", "let the child succeed or fail"),
        ('Condition status="SUCCESS"', "let the child succeed or fail"),
        ('EternalGuard condition="true"', "let the child succeed or fail"),
        ('StatusToBlackboard variable_name="how"', "let the child succeed or fail"),
    ],
)
def test_a_child_that_can_be_skipped_is_refused_with_what_to_write(tag, advice):
    name = tag.split()[0]
    (finding,) = errors(forest_of(document(f"<{tag}>{SKIPPABLE}</{name}>")), default_registry())
    assert (finding.code, finding.span.line, finding.span.column) == ("skip-misread", 3, len(tag) + 3)
    assert f"can be skipped, which <{name}> treats as an interruption" in finding.message
    assert finding.hint.startswith(f"{advice} instead")


# --- versions of py_trees ---


@before_2_4
@pytest.mark.parametrize("tag", LACKING)
def test_what_this_py_trees_does_not_have_yet_is_a_finding_when_the_tree_is_made(tag):
    ((code, line, column, message),) = findings(WRITTEN[tag][0])
    assert (code, line, column) == ("constructor-failed", 3, 1)
    assert f"does not have {tag}" in message
    assert "2.4 or later" in message


def test_the_schema_has_what_this_py_trees_does_not_have_yet():
    schema = xml_schema(default_registry())
    assert all(f'<xs:element name="{tag}"' in schema for tag in WRITTEN)
