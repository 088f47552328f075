"""Tests of equivalence with BehaviorTree.CPP and Nav2, by recorded traces."""

import json
from pathlib import Path

import pytest

from tests.conformance.replay import cases_of, main, reason_for, replay
from tests.kernels import python_only

TRACES = Path(__file__).parent / "btcpp_traces.json"
VALUE_TRACES = Path(__file__).parent / "btcpp_value_traces.json"
RANDOM_TRACES = Path(__file__).parent / "btcpp_random_traces.json"
NAV2_TRACES = Path(__file__).parent / "nav2_traces.json"


INTENDED = {"precondition_after_halt", "post_on_halt", "reactive_seq_explicit_child"}


def case_params(cases):
    """Return the cases as parameters; a habit of Precondition needs the Python kernel."""
    return [
        pytest.param(case, id=case["name"], marks=[python_only] if "<Precondition" in case["xml"] else [])
        for case in cases
    ]


@pytest.mark.parametrize("case", case_params(cases_of(TRACES)))
def test_tree_matches_btcpp_trace_except_intended_deviations(case):
    differences = list(replay(case))
    assert [str(difference) for difference in differences if reason_for(case, difference) is None] == []
    assert bool(differences) == (case["name"] in INTENDED)


@pytest.mark.parametrize("case", cases_of(RANDOM_TRACES), ids=lambda case: case["name"])
def test_random_tree_matches_btcpp_trace_except_skipped_conditions(case):
    for difference in replay(case):
        assert "over a condition that is skipped" in (reason_for(case, difference) or str(difference))


@pytest.mark.parametrize("case", cases_of(NAV2_TRACES), ids=lambda case: case["name"])
def test_nested_nav2_controls_match_nav2_trace(case):
    assert [str(difference) for difference in replay(case)] == []


DEVIATING = {
    "front_of_a_loops_literal": "the rest is dropped",
    "front_of_a_loops_text": "the rest is dropped",
    "front_of_a_text": "the rest is dropped",
    "name_alone": "name of an empty entry",
    "number_for_an_unsigned_port": "may not share a key",
    "number_too_large": "too large",
    "own_key_of_a_port": "its own port's name",
    "plus_sign": "plus sign",
    "port_missing": "without a port that it needs",
    "root_key_made_in_a_subtree": "cannot make an entry",
    "root_key_twice": "listed a second time",
    "script_written_later": "must be there before",
    "sign_of_no_number": "has a sign",
    "subtree_number_for_a_text_port": "may not share a key",
    "switch_over_a_subtrees_number": "may not share a key",
    "text_for_an_awaited_entry": "takes no text",
    "text_lost": "loses a text",
    "text_over_a_copy": "takes no text",
    "text_port_then_loop": "first named by a port of another type",
}


@pytest.mark.parametrize("case", cases_of(VALUE_TRACES), ids=lambda case: case["name"])
def test_values_match_btcpp_except_intended_deviations(case):
    differences = list(replay(case))
    assert bool(differences) == (case["name"] in DEVIATING)
    for difference in differences:
        assert DEVIATING[case["name"]] in (reason_for(case, difference) or str(difference))


@pytest.mark.parametrize("mistake", ["root", "events", "blackboards"])
def test_real_error_is_not_explained_by_habit(mistake):
    tree = '<Sequence><Scripted id="a" outcomes="S" _post="n+=1"/><SetBlackboard value="7" output_key="k"/></Sequence>'
    case = case_of(tree, ("SUCCESS", [["tick", "a", "SUCCESS"]]), bb={"n": 0})
    (tick,) = case["runs"][0]["ticks"]
    tick["blackboards"] = {"Main": {"n": 1, "k": "7"}}
    assert list(replay(case)) == []
    tick[mistake] = {"root": "FAILURE", "events": [], "blackboards": {"Main": {"n": 2, "k": "7"}}}[mistake]
    (difference,) = replay(case)
    assert reason_for(case, difference) is None


def write_cases(tmp_path, *cases):
    path = tmp_path / "cases.json"
    path.write_text(json.dumps({"cases": cases}), encoding="utf-8")
    return str(path)


def case_of(tree, *ticks, mode="once", **more):
    run = {"mode": mode, "ticks": [{"root": root, "events": events} for root, events in ticks]}
    xml = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{tree}</BehaviorTree></root>'
    return {"name": "a_case", "xml": xml, "ticks": len(ticks), "runs": [run], **more}


@python_only
def test_command_counts_equal_cases_and_explains_differences(capsys):
    assert main([str(TRACES)]) == 0
    *lines, total = capsys.readouterr().out.splitlines()
    assert total == "95 same, 3 differ"
    assert {line.split(":")[0] for line in lines} == INTENDED


def test_unintended_difference_is_reported_with_status_1(tmp_path, capsys):
    wrong = case_of('<Scripted id="a" outcomes="S"/>', ("SUCCESS", [["tick", "a", "FAILURE"]]))
    assert main([write_cases(tmp_path, wrong)]) == 1
    line, total = capsys.readouterr().out.splitlines()
    assert "once, tick 0, events: tick a FAILURE there, tick a SUCCESS here" in line
    assert "not on the list of deviations" in line
    assert total == "0 same, 1 differ"


def test_malformed_case_file_exits_with_status_2(tmp_path, capsys):
    path = tmp_path / "cases.json"
    path.write_text("[", encoding="utf-8")
    assert main([str(path)]) == 2
    assert "cases.json" in capsys.readouterr().err


def test_missing_argument_exits_with_status_2(capsys):
    assert main([]) == 2
    assert "usage" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        (
            case_of(
                '<IfThenElse><Scripted id="c" outcomes="K"/><Scripted id="a"/></IfThenElse>',
                ("EXCEPTION", [["tick", "c", "SKIPPED"]]),
            ),
            "skipped",
        ),
        (
            case_of(
                '<WhileDoElse><Scripted id="c" outcomes="K"/><Scripted id="a"/></WhileDoElse>',
                ("EXCEPTION", [["tick", "c", "SKIPPED"]]),
            ),
            "skipped",
        ),
        (
            case_of(
                '<Sequence><SetBlackboard value="7" output_key="k"/><Show id="k" value="{k}"/></Sequence>',
                ("FAILURE", [["show", "k", "<error: the entry is empty>"]]),
            ),
            "loses a text",
        ),
        (
            case_of(
                '<Timeout msec="60"><Scripted id="a" outcomes="K,K,R"/></Timeout>',
                ("SKIPPED", [["tick", "a", "SKIPPED"]]),
                ("SKIPPED", [["tick", "a", "SKIPPED"]]),
                ("RUNNING", [["tick", "a", "RUNNING"]]),
                ("RUNNING", [["tick", "a", "RUNNING"]]),
                ("RUNNING", [["tick", "a", "RUNNING"]]),
                mode="exactly_once",
                period_ms=40,
            ),
            "Timeout",
        ),
    ],
)
def test_btcpp_bugs_are_recognised_by_symptoms(case, reason):
    exception = {
        "<IfThenElse": "Something unexpected happened in IfThenElseNode",
        "<WhileDoElse": "not allowed to set manually the status to IDLE",
    }
    for tick in case["runs"][0]["ticks"]:
        tick["exception"] = next((text for tag, text in exception.items() if tag in case["xml"]), "")
    (difference,) = replay(case)
    assert reason in (reason_for(case, difference) or "")


def reason_for_rejection(tree, exception, **more):
    """Return why a tree is rejected here that raises an exception in BehaviorTree.CPP; None if unknown."""
    case = case_of(tree, ("EXCEPTION", []), **more)
    case["runs"][0]["ticks"][0]["events"] = [["tick", "a", "SUCCESS"]]
    case["runs"][0]["ticks"][0]["exception"] = exception
    (difference,) = replay(case)
    assert difference.what == "refused"
    return reason_for(case, difference)


ONE_CHILD = '<Sequence><Scripted id="a"/><IfThenElse{}><Scripted id="c"/></IfThenElse>{}</Sequence>'
WHY = "IfThenElseNode must have either 2 or 3 children"
TWO_TYPES = '<LoopInt queue="1" value="{k}"><Show id="k" value="{k}"/></LoopInt><LoopBool queue="1" value="{k}"><Scripted id="b"/></LoopBool>'


@pytest.mark.parametrize(
    ("tree", "exception"),
    [
        (ONE_CHILD.format("", ""), f"Exception in node 'IfThenElse::3' [IfThenElse]: {WHY}"),
        (ONE_CHILD.format(' name="if"', ""), f"Exception in node 'if' [IfThenElse]: {WHY}"),
        (
            '<Sequence><Scripted id="a"/><Scripted id="b" _skipIf="nobody"/></Sequence>',
            "Exception in node 'Sequence::1' [Sequence]: Error in script [nobody]\nVariable not found: nobody",
        ),
    ],
)
def test_rejection_is_explained_by_exception_of_same_node(tree, exception):
    if "nobody" in tree:
        tree = tree.replace("nobody", "nobody +")
    assert "refused before" in (reason_for_rejection(tree, exception) or "")


@pytest.mark.parametrize(
    ("tree", "exception"),
    [
        (ONE_CHILD.format("", ""), "Exception in node 'Script::4' [Script]: Variable not found: b"),
        (ONE_CHILD.format(' name="if"', ""), f"Exception in node 'other' [IfThenElse]: {WHY}"),
        (ONE_CHILD.format("", "<"), f"Exception in node 'IfThenElse::3' [IfThenElse]: {WHY}"),
        (
            ONE_CHILD.format("", '<Scripted id="d" restart="maybe"/>'),
            f"Exception in node 'IfThenElse::3' [IfThenElse]: {WHY}",
        ),
    ],
)
def test_rejection_is_not_explained_by_exception_of_other_node(tree, exception):
    assert reason_for_rejection(tree, exception) is None


def test_each_rejection_is_explained_by_its_own_reason():
    exception = f"Exception in node 'IfThenElse::3' [IfThenElse]: {WHY}"
    reason = reason_for_rejection(ONE_CHILD.format("", TWO_TYPES), exception, bb={"k": "a text"})
    assert reason is not None
    assert "refused before" in reason
    assert "ports of two types" in reason


@pytest.mark.parametrize(
    ("ticks", "explained"),
    [
        # Expired at once; not expired in the second tick.
        ([("RUNNING", "RUNNING", "RUNNING")], True),
        ([("RUNNING", "RUNNING", "IDLE"), ("RUNNING", "RUNNING", "IDLE")], True),
        # Expired as here, and something else differs.
        ([("RUNNING", "RUNNING", "IDLE"), ("FAILURE", "RUNNING", "RUNNING")], False),
        ([("FAILURE", "RUNNING", "IDLE")], False),
    ],
)
def test_zero_delay_explains_only_different_tick_of_its_child(ticks, explained):
    events = [[["tick", "a", "RUNNING"]] if child == "RUNNING" else [] for _, _, child in ticks]
    case = case_of(
        '<Delay delay_msec="0"><Scripted id="a" outcomes="R"/></Delay>',
        *((root, happened) for (root, _, _), happened in zip(ticks, events, strict=True)),
        mode="exactly_once",
        period_ms=10,
    )
    for tick, (_, delay, child) in zip(case["runs"][0]["ticks"], ticks, strict=True):
        tick["status"] = {"Delay::1": delay, "Scripted::2": child}
    (difference,) = replay(case)
    assert ("had a turn" in (reason_for(case, difference) or "")) == explained


@pytest.mark.parametrize(("first", "explained"), [("std::string", True), ("MyType", False)])
def test_type_conflict_through_main_tree_key_is_recognised(first, explained):
    a, b = (
        '<Fallback><AlwaysSuccess/><ShowS id="s" value="{x}"/></Fallback>',
        '<LoopInt queue="1" value="{x}">',
    )
    case = case_of(
        '<Sequence><SubTree ID="A" x="{@c}"/><SubTree ID="B" x="{@c}"/></Sequence></BehaviorTree>'
        f'<BehaviorTree ID="A">{a}</BehaviorTree><BehaviorTree ID="B">{b}<Scripted id="a"/></LoopInt>'
    )
    case["xml"] = case["xml"].replace("<root", '<root main_tree_to_execute="Main"')
    case["ticks"] = 1
    (run,) = case["runs"]
    run["create_exception"] = (
        "Blackboard entry [@c]: once declared, the type of a port shall not change. "
        f"Previously declared type [{first}], current type [int]"
    )
    (difference,) = replay(case)
    assert ("goes with no other type" in (reason_for(case, difference) or "")) == explained


def test_halting_tree_does_not_run_script_of_idle_node():
    tree = '<Sequence><Scripted id="a" outcomes="R"/><Scripted id="b" _onHalted="n+=1"/></Sequence>'
    case = case_of(
        tree,
        ("RUNNING", [["tick", "a", "RUNNING"]]),
        ("RUNNING", [["haltTree"], ["halt", "a"], ["tick", "a", "RUNNING"]]),
        bb={"n": 0},
        halt_before=[1],
    )
    case["runs"][0]["ticks"][1]["blackboards"] = {"Main": {"n": 1}}
    (difference,) = replay(case)
    assert "_onHalted" in (reason_for(case, difference) or "")


def events(text):
    """Return the events of a tick: `a SUCCESS, halt a`."""
    return [
        [*event] if event[0] in ("halt", "haltTree") else ["tick", *event]
        for event in map(str.split, text.split(", "))
    ]


def test_halting_tree_keeps_memory_of_idle_node():
    case = case_of(
        '<Sequence><RoundRobin wrap_around="true"><Scripted id="a"/><Scripted id="b"/></RoundRobin><Scripted id="c" outcomes="R"/></Sequence>',
        ("RUNNING", events("a SUCCESS, c RUNNING")),
        ("RUNNING", events("haltTree, halt c, a SUCCESS, c RUNNING")),
        halt_before=[1],
    )
    (difference,) = replay(case)
    assert difference.seen.endswith("tick b SUCCESS, tick c RUNNING")
    assert "halts nodes at rest" in (reason_for(case, difference) or "")


@pytest.mark.parametrize("around", ["Fallback", "Sequence"])
def test_failed_if_condition_without_else_is_followed_by_second_child(around):
    loop = '<LoopInt queue="1;2;3" value="{x}"><Scripted id="a" outcomes="F"/></LoopInt>'
    case = case_of(
        f'<{around}><IfThenElse>{loop}<Scripted id="b"/></IfThenElse></{around}>',
        *[("FAILURE", events("a FAILURE"))] * 3,
        ("SUCCESS", events("b SUCCESS")),
        ("FAILURE", events("a FAILURE")),
    )
    assert list(replay(case)) == []


def test_unreachable_count_of_unticked_node_is_rejected_only_here():
    case = case_of(
        '<Fallback><Scripted id="a"/><ParallelAll max_failures="3"><Scripted id="b"/></ParallelAll></Fallback>',
        ("SUCCESS", events("a SUCCESS")),
    )
    (difference,) = replay(case)
    assert "only met where the node is ticked" in (reason_for(case, difference) or "")
    # Another node may raise an exception there meanwhile.
    case["runs"][0]["ticks"][0]["exception"] = "Exception in node 'a' [Scripted]: no such file"
    assert "only met where the node is ticked" in (reason_for(case, difference) or "")
    case["runs"][0]["ticks"][0]["events"].append(["tick", "b", "SUCCESS"])
    assert reason_for(case, next(iter(replay(case)))) is None


@python_only
def test_fallback_counts_only_children_skipped_in_same_run():
    case = case_of(
        '<NonblockingSequence><Scripted id="a" outcomes="R"/>'
        '<Fallback><Scripted id="b" outcomes="K"/><Scripted id="c" outcomes="S,K"/></Fallback></NonblockingSequence>',
        ("RUNNING", events("a RUNNING, b SKIPPED, c SUCCESS")),
        ("FAILURE", events("a RUNNING, b SKIPPED, c SKIPPED, halt a")),
    )
    (difference,) = replay(case)
    assert "'Fallback' was skipped" in difference.error
    assert "counts children there that were skipped before" in (reason_for(case, difference) or "")


@python_only
@pytest.mark.parametrize("around", ["Sequence", "Fallback"])
def test_precondition_is_checked_again_after_child_was_skipped(around):
    case = case_of(
        f'<{around}><Precondition if="n==0" else="RUNNING"><Scripted id="a" outcomes="K"/></Precondition><Script code="n:=1"/></{around}>',
        ("SUCCESS", events("a SKIPPED")),
        ("SUCCESS", events("a SKIPPED")),
        bb={"n": 0},
    )
    (difference,) = replay(case)
    assert (difference.tick, difference.seen) == (1, "nothing")
    assert "Precondition does not check" in (reason_for(case, difference) or "")


def test_timer_event_between_ticks_can_follow_other_leaves_here():
    case = case_of(
        '<ReactiveSequence><Scripted id="g"/><Timeout msec="50"><Scripted id="a" outcomes="R"/></Timeout></ReactiveSequence>',
        ("RUNNING", [["tick", "g", "SUCCESS"], ["tick", "a", "RUNNING"]]),
        ("FAILURE", [["halt", "a", "async"], ["tick", "g", "SUCCESS"]]),
        mode="exactly_once",
        period_ms=60,
    )
    assert list(replay(case)) == []
    case["runs"][0]["ticks"][1]["events"][0][1] = "b"
    assert len(list(replay(case))) == 1
