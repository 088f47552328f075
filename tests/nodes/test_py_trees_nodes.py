"""Tests of py_trees' decorators and leaves in tree files, which use the keys and the clock of the tree."""

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


def compile_body(body, clock=None, parameters=None, trees=""):
    text = document(body).replace("</root>", f"{trees}</root>")
    forest = forest_of(text.replace("<root ", '<root main_tree_to_execute="Main" ') if trees else text)
    assert [finding.render() for finding in errors(forest, default_registry())] == []
    return compile_tree(
        bind_main(forest, default_registry()), {Clock: clock or ManualClock()}, parameters or {}
    )


def tick_statuses(tree, times):
    statuses = []
    for _ in range(times):
        tree.root.tick_once()
        statuses.append(tree.root.status)
    return statuses


def ticks(body, times, **options):
    return tick_statuses(compile_body(body, **options), times)


def findings(body):
    """Return the findings of the checks, or else of the compiler."""
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


# By tag: the XML, the class of the node, and some of its attributes.
EXAMPLES: dict[str, tuple[str, Any, dict[str, Any]]] = {
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


def test_every_py_trees_node_is_in_table():
    assert set(EXAMPLES) == set(SPECS)


@pytest.mark.parametrize("tag", sorted(set(EXAMPLES) - set(LACKING)))
def test_tag_becomes_py_trees_class_with_given_arguments(tag):
    body, cls, wanted = EXAMPLES[tag]
    tree = compile_body(body)
    assert type(tree.root) is cls
    for name, value in wanted.items():
        # Each tree of a process has its own prefix for keys.
        mine = value.replace("/Main", tree.board.prefix) if isinstance(value, str) else value
        assert operator.attrgetter(name)(tree.root) == mine


@pytest.mark.parametrize("tag", sorted(EXAMPLES))
def test_spec_describes_node_attributes_and_statuses(tag):
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
def test_node_behaves_as_in_py_trees(body, statuses):
    assert ticks(body, len(statuses)) == statuses


# --- time ---


def test_timer_uses_clock_of_mission():
    clock = ManualClock(100.0)
    tree = compile_body('<Timer duration="2"/>', clock)
    assert tick_statuses(tree, 2) == [R, R]
    clock.advance(1.9)
    assert tick_statuses(tree, 1) == [R]
    clock.advance(0.2)
    assert tick_statuses(tree, 2) == [S, R], "it begins again when it is started again"


@pytest.mark.parametrize("duration", ["0", "-1"])
def test_timer_with_zero_or_negative_duration_succeeds_immediately(duration):
    assert ticks(f'<Timer duration="{duration}"/>', 2) == [S, S]


def test_default_duration_of_timer_is_five_seconds():
    assert compile_body("<Timer/>").root.duration == 5.0


# --- keys ---

SET_X = '<SetBlackboardVariable variable_name="x" variable_value="{value}"/>'


@pytest.mark.parametrize(
    ("text", "value"),
    [("7", 7), ("2.5", 2.5), ("true", True), ("red", "red"), ("json:[1, null]", [1, None]), ("", "")],
)
def test_literal_value_is_number_bool_string_or_json(text, value):
    tree = compile_body(f"<SetBlackboardVariable variable_name='x' variable_value='{text}'/>")
    assert tick_statuses(tree, 1) == [S]
    assert key(tree, "x").read() == value
    assert type(key(tree, "x").read()) is type(value)


def test_value_of_other_key_is_read_when_node_is_ticked():
    tree = compile_body('<SetBlackboardVariable variable_name="x" variable_value="{y}"/>')
    for value in (1, "two"):
        key(tree, "y").write(value)
        tick_statuses(tree, 1)
        assert key(tree, "x").read() == value


def test_existing_key_is_kept_if_overwrite_is_false():
    tree = compile_body('<SetBlackboardVariable variable_name="x" variable_value="1" overwrite="false"/>')
    assert tick_statuses(tree, 2) == [S, F]
    assert key(tree, "x").stamp == 1


def test_two_trees_in_one_process_share_no_keys():
    first, second = compile_body(SET_X.format(value=1)), compile_body(SET_X.format(value=2))
    tick_statuses(first, 1)
    assert not key(second, "x").exists
    tick_statuses(second, 1)
    assert (key(first, "x").read(), key(second, "x").read()) == (1, 2)


def test_tree_writes_no_keys_without_its_prefix():
    tick_statuses(compile_body(SET_X.format(value=1)), 1)
    assert "/x" not in Blackboard.storage
    assert "/x" not in Blackboard.metadata


def test_py_trees_nodes_and_scripts_share_keys():
    body = (
        '<Sequence><SetBlackboardVariable variable_name="x" variable_value="2"/><Script code="x *= 3"/>'
        '<CheckBlackboardVariableValue variable="x" operator="eq" value="6"/></Sequence>'
    )
    assert ticks(body, 1) == [S]


@pytest.mark.parametrize("name", ["name", "read", "id", "set", "x"])
def test_key_may_be_named_like_attribute_of_client(name):
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


def test_keys_of_subtree_are_separate_unless_remapped():
    tree = compile_body('<SubTree ID="Inner" name="Inner.v2" goal="{target}"/>', trees=SUBTREE)
    assert tick_statuses(tree, 1) == [S]
    assert key(tree, "target").read() == 5
    assert not key(tree, "own").exists


def test_dot_in_tree_name_does_not_access_attribute():
    text = document(SET_X.format(value=3)).replace('"Main"', '"Main.v2"')
    tree = compile_tree(bind_main(forest_of(text), default_registry()), {}, {})
    assert tick_statuses(tree, 1) == [S]
    assert key(tree, "x").read() == 3


def test_dot_in_key_accesses_attribute_of_object():
    tree = compile_body(
        '<Sequence><SetBlackboardVariable variable_name="battery.percentage" variable_value="20"/>'
        '<CheckBlackboardVariableValue variable="{battery.percentage}" operator="le" value="20"/></Sequence>'
    )
    battery = SimpleNamespace(percentage=80)
    key(tree, "battery").write(battery)
    assert tick_statuses(tree, 1) == [S]
    assert battery.percentage == 20
    assert key(tree, "battery").stamp == 2


def test_mission_parameter_is_key_of_root():
    body = '<CheckBlackboardVariableValue variable="{@speed}" operator="gt" value="1"/>'
    assert ticks(body, 1, parameters={"speed": 1.5}) == [S]


def test_unset_key_is_removed_from_blackboard():
    tree = compile_body('<UnsetBlackboardVariable key="x"/>')
    key(tree, "x").write(1)
    assert tick_statuses(tree, 2) == [S, S]
    assert not key(tree, "x").exists
    assert key(tree, "x").stamp == 0


def test_write_of_py_trees_node_counts_as_update():
    tree = compile_body(
        '<Sequence><SetBlackboardVariable variable_name="x" variable_value="1"/>'
        '<WasEntryUpdated entry="{x}"/></Sequence>'
    )
    assert tick_statuses(tree, 3) == [S, S, S]


@given(st.lists(st.sampled_from(["write", "remove", "keep"]), max_size=8))
def test_stamp_counts_writes_since_last_removal(steps):
    tree = compile_body(
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


def test_garbage_collected_tree_removes_its_entries():
    tree = compile_body(SET_X.format(value=1))
    tick_statuses(tree, 1)
    name = key(tree, "x").name
    assert name in Blackboard.storage
    del tree
    gc.collect()
    assert name not in Blackboard.storage


# --- waiting and comparing ---


@pytest.mark.parametrize(
    ("tag", "missing"), [("CheckBlackboardVariableExists", F), ("WaitForBlackboardVariable", R)]
)
def test_missing_key_fails_check_or_is_waited_for(tag, missing):
    tree = compile_body(f'<{tag} variable_name="{{goal}}"/>')
    assert tick_statuses(tree, 1) == [missing]
    key(tree, "goal").write(None)
    assert tick_statuses(tree, 1) == [S]


@pytest.mark.parametrize(
    ("tag", "not_yet"), [("CheckBlackboardVariableValue", F), ("WaitForBlackboardVariableValue", R)]
)
def test_value_is_compared_in_every_tick(tag, not_yet):
    tree = compile_body(f'<{tag} variable="x" operator="ge" value="2"/>')
    assert tick_statuses(tree, 1) == [not_yet]
    for value, status in ((1, not_yet), (2, S), (2.5, S)):
        key(tree, "x").write(value)
        assert tick_statuses(tree, 1) == [status]


@pytest.mark.parametrize("name", ["eq", "ne", "lt", "le", "gt", "ge"])
@given(left=st.integers(-3, 3), right=st.integers(-3, 3))
def test_comparison_operators_match_python(name, left, right):
    tree = compile_body(f'<CheckBlackboardVariableValue variable="x" operator="{name}" value="{right}"/>')
    key(tree, "x").write(left)
    assert tick_statuses(tree, 1) == [S if getattr(operator, name)(left, right) else F]


def test_value_is_compared_with_current_value_of_other_key():
    tree = compile_body('<CheckBlackboardVariableValue variable="x" operator="lt" value="{limit}"/>')
    key(tree, "x").write(4)
    for limit, status in ((3, F), (5, S)):
        key(tree, "limit").write(limit)
        assert tick_statuses(tree, 1) == [status]
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
def test_several_comparisons_are_combined(junction, x, y, status):
    checks = "battery gt 20; speed lt 1.5"
    tree = compile_body(f'<CheckBlackboardVariableValues checks="{checks}" operator="{junction}"/>')
    key(tree, "battery").write(x)
    if y is not None:
        key(tree, "speed").write(y)
    assert tick_statuses(tree, 1) == [status]


def test_results_of_comparisons_are_written_to_namespace():
    body = '<CheckBlackboardVariableValues checks="x gt 1;y gt 1" operator="or" namespace="{results}"/>'
    tree = compile_body(body)
    key(tree, "x").write(1)
    key(tree, "y").write(2)
    assert tick_statuses(tree, 1) == [S]
    assert [key(tree, f"results/{number}").read() for number in (1, 2)] == [False, True]
    assert key(tree, "results/1").stamp == 1


@since_2_4
def test_two_keys_are_compared():
    tree = compile_body('<CompareBlackboardVariables var1_key="x" var2_key="y" operator="lt"/>')
    key(tree, "x").write(1)
    assert tick_statuses(tree, 1) == [F]
    for value, status in ((1, F), (2, S)):
        key(tree, "y").write(value)
        assert tick_statuses(tree, 1) == [status]


# --- statuses on the blackboard, guards, loops ---


def test_status_is_passed_between_nodes_by_blackboard():
    body = (
        f'<Parallel policy="SuccessOnAll"><StatusToBlackboard variable_name="how">{queue("RUNNING;FAILURE")}'
        '</StatusToBlackboard><BlackboardToStatus variable_name="how"/></Parallel>'
    )
    tree = compile_body(body)
    assert tick_statuses(tree, 2) == [R, F]
    assert [child.status for child in tree.root.children] == [F, F]
    assert key(tree, "how").read() is F
    assert key(tree, "how").stamp == 2


def test_guard_checks_condition_in_every_tick_and_interrupts_child():
    tree = compile_body('<EternalGuard condition="battery &gt; 20"><Running/></EternalGuard>')
    key(tree, "battery").write(50)
    assert tick_statuses(tree, 2) == [R, R]
    key(tree, "battery").write(20)
    assert tick_statuses(tree, 1) == [F]
    assert tree.root.decorated.status is Status.INVALID


@since_2_4
@given(st.lists(st.integers(), min_size=1, max_size=4))
def test_for_each_passes_items_to_child_one_by_one(items):
    tree = compile_body('<ForEach source_key="zones" target_key="{zone}"><Success/></ForEach>')
    key(tree, "zones").write(items)
    seen = []
    while tree.root.status is not S:
        tree.root.tick_once()
        seen.append(key(tree, "zone").stamp)
    assert key(tree, "zone").read() == items[-1]
    assert seen[-1] == len(items)


def test_parallel_succeeds_with_selected_children():
    tree = compile_body(
        '<Parallel policy="SuccessOnSelected" selected="c; a">'
        '<Success name="a"/><Running name="b"/><Success name="c"/></Parallel>'
    )
    assert isinstance(tree.root, composites.Parallel)
    assert isinstance(tree.root.policy, ParallelPolicy.SuccessOnSelected)
    assert [child.name for child in tree.root.policy.children] == ["c", "a"]
    assert tick_statuses(tree, 1) == [S]


def test_selected_child_is_found_by_name_despite_wrappers():
    tree = compile_body(
        '<Parallel policy="SuccessOnSelected" selected="a;b;c">'
        '<Success name="a" oneshot="ON_COMPLETION"/><Success name="b" _failureIf="false"/>'
        '<Success name="c" _onSuccess="n := 1" oneshot="ON_COMPLETION"/></Parallel>'
    )
    assert tree.root.policy.children == tree.root.children
    assert tick_statuses(tree, 1) == [S]


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
def test_parallel_has_given_policy(attributes, cls, synchronise):
    policy = compile_body(f"<Parallel {attributes}><Success/></Parallel>").root.policy
    assert type(policy) is getattr(ParallelPolicy, cls)
    assert policy.synchronise is synchronise


# --- errors ---


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
def test_error_is_located(body, code, column, said):
    ((found, line, at, message),) = findings(f"<Sequence>\n{body}\n</Sequence>")
    assert (found, line) == (code, 4)
    assert column in (at, None)
    assert said in message


def test_decorator_and_explicit_form_of_leaf_share_tag_condition():
    body = '<Condition status="SUCCESS"><Condition ID="ScriptCondition" code="true"/></Condition>'
    tree = compile_tree(bind_main(forest_of(document(body)), default_registry()), {}, {})
    assert tick_statuses(tree, 1) == [S]
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
def test_skippable_child_is_rejected_with_alternative(tag, advice):
    name = tag.split()[0]
    (finding,) = errors(forest_of(document(f"<{tag}>{SKIPPABLE}</{name}>")), default_registry())
    assert (finding.code, finding.span.line, finding.span.column) == ("skip-misread", 3, len(tag) + 3)
    assert f"can be skipped, which <{name}> treats as an interruption" in finding.message
    assert finding.hint.startswith(f"{advice} instead")


# --- versions of py_trees ---


@before_2_4
@pytest.mark.parametrize("tag", LACKING)
def test_node_missing_in_old_py_trees_is_reported_at_compilation(tag):
    ((code, line, column, message),) = findings(EXAMPLES[tag][0])
    assert (code, line, column) == ("constructor-failed", 3, 1)
    assert f"does not have {tag}" in message
    assert "2.4 or later" in message


def test_schema_contains_nodes_missing_in_old_py_trees():
    schema = xml_schema(default_registry())
    assert all(f'<xs:element name="{tag}"' in schema for tag in EXAMPLES)
