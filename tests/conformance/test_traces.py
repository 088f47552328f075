"""Trees behave as they do in BehaviorTree.CPP."""

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


def each(cases):
    """Return the cases as parameters; replayed with another node in the kernel's place only where that can be."""
    return [
        pytest.param(case, id=case["name"], marks=[python_only] if "<Precondition" in case["xml"] else [])
        for case in cases
    ]


@pytest.mark.parametrize("case", each(cases_of(TRACES)))
def test_a_tree_shows_the_trace_of_behaviortree_cpp_or_differs_on_purpose(case):
    differences = list(replay(case))
    assert [str(difference) for difference in differences if reason_for(case, difference) is None] == []
    assert bool(differences) == (case["name"] in INTENDED)


@pytest.mark.parametrize("case", cases_of(RANDOM_TRACES), ids=lambda case: case["name"])
def test_a_random_tree_shows_the_trace_of_behaviortree_cpp_but_for_skipped_conditions(case):
    for difference in replay(case):
        assert "over a condition that is skipped" in (reason_for(case, difference) or str(difference))


@pytest.mark.parametrize("case", cases_of(NAV2_TRACES), ids=lambda case: case["name"])
def test_a_control_of_nav2_below_and_above_every_other_one_shows_the_trace_of_nav2(case):
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
def test_values_are_what_they_are_in_behaviortree_cpp_or_differ_on_purpose(case):
    differences = list(replay(case))
    assert bool(differences) == (case["name"] in DEVIATING)
    for difference in differences:
        assert DEVIATING[case["name"]] in (reason_for(case, difference) or str(difference))


@pytest.mark.parametrize("mistake", ["root", "events", "blackboards"])
def test_a_mistake_is_not_taken_for_a_habit_that_shows_in_the_same_tree(mistake):
    tree = '<Sequence><Scripted id="a" outcomes="S" _post="n+=1"/><SetBlackboard value="7" output_key="k"/></Sequence>'
    case = case_of(tree, ("SUCCESS", [["tick", "a", "SUCCESS"]]), bb={"n": 0})
    (tick,) = case["runs"][0]["ticks"]
    tick["blackboards"] = {"Main": {"n": 1, "k": "7"}}
    assert list(replay(case)) == []
    tick[mistake] = {"root": "FAILURE", "events": [], "blackboards": {"Main": {"n": 2, "k": "7"}}}[mistake]
    (difference,) = replay(case)
    assert reason_for(case, difference) is None


def written(tmp_path, *cases):
    path = tmp_path / "cases.json"
    path.write_text(json.dumps({"cases": cases}), encoding="utf-8")
    return str(path)


def case_of(tree, *ticks, mode="once", **more):
    run = {"mode": mode, "ticks": [{"root": root, "events": events} for root, events in ticks]}
    xml = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{tree}</BehaviorTree></root>'
    return {"name": "a_case", "xml": xml, "ticks": len(ticks), "runs": [run], **more}


@python_only
def test_the_command_counts_what_is_the_same_and_explains_what_differs(capsys):
    assert main([str(TRACES)]) == 0
    *lines, total = capsys.readouterr().out.splitlines()
    assert total == "95 same, 3 differ"
    assert {line.split(":")[0] for line in lines} == INTENDED


def test_a_difference_that_nobody_intended_is_named_and_ends_with_status_1(tmp_path, capsys):
    wrong = case_of('<Scripted id="a" outcomes="S"/>', ("SUCCESS", [["tick", "a", "FAILURE"]]))
    assert main([written(tmp_path, wrong)]) == 1
    line, total = capsys.readouterr().out.splitlines()
    assert "once, tick 0, events: tick a FAILURE there, tick a SUCCESS here" in line
    assert "not on the list of deviations" in line
    assert total == "0 same, 1 differ"


def test_a_file_that_is_no_list_of_cases_ends_with_status_2(tmp_path, capsys):
    path = tmp_path / "cases.json"
    path.write_text("[", encoding="utf-8")
    assert main([str(path)]) == 2
    assert "cases.json" in capsys.readouterr().err


def test_no_file_at_all_ends_with_status_2(capsys):
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
def test_mistakes_of_behaviortree_cpp_are_recognised_by_what_happens(case, reason):
    exception = {
        "<IfThenElse": "Something unexpected happened in IfThenElseNode",
        "<WhileDoElse": "not allowed to set manually the status to IDLE",
    }
    for tick in case["runs"][0]["ticks"]:
        tick["exception"] = next((text for tag, text in exception.items() if tag in case["xml"]), "")
    (difference,) = replay(case)
    assert reason in (reason_for(case, difference) or "")


def raised(tree, exception, **more):
    """Return why a tree is refused here over which something is raised in BehaviorTree.CPP; None if that is not known."""
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
def test_a_refusal_is_explained_by_what_the_same_node_raised_there(tree, exception):
    if "nobody" in tree:
        tree = tree.replace("nobody", "nobody +")
    assert "refused before" in (raised(tree, exception) or "")


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
def test_a_refusal_is_not_explained_by_what_another_node_raised(tree, exception):
    assert raised(tree, exception) is None


def test_two_refusals_are_explained_each_by_its_own_reason():
    exception = f"Exception in node 'IfThenElse::3' [IfThenElse]: {WHY}"
    reason = raised(ONE_CHILD.format("", TWO_TYPES), exception, bb={"k": "a text"})
    assert reason is not None
    assert "refused before" in reason
    assert "ports of two types" in reason


@pytest.mark.parametrize(
    ("ticks", "explained"),
    [
        # Over at once; not over in the second tick.
        ([("RUNNING", "RUNNING", "RUNNING")], True),
        ([("RUNNING", "RUNNING", "IDLE"), ("RUNNING", "RUNNING", "IDLE")], True),
        # Over as here, and something else differs.
        ([("RUNNING", "RUNNING", "IDLE"), ("FAILURE", "RUNNING", "RUNNING")], False),
        ([("FAILURE", "RUNNING", "IDLE")], False),
    ],
)
def test_a_delay_of_nothing_explains_only_that_its_child_is_ticked_sooner_or_later_there(ticks, explained):
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
def test_types_that_clash_there_by_a_key_of_the_main_tree_are_recognised(first, explained):
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


def test_halting_the_tree_runs_no_script_of_a_node_that_does_not_run():
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


def test_halting_the_tree_leaves_to_a_node_at_rest_what_outlasts_its_end():
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
def test_a_condition_that_fails_without_an_else_goes_on_after_it_below_any_parent(around):
    loop = '<LoopInt queue="1;2;3" value="{x}"><Scripted id="a" outcomes="F"/></LoopInt>'
    case = case_of(
        f'<{around}><IfThenElse>{loop}<Scripted id="b"/></IfThenElse></{around}>',
        *[("FAILURE", events("a FAILURE"))] * 3,
        ("SUCCESS", events("b SUCCESS")),
        ("FAILURE", events("a FAILURE")),
    )
    assert list(replay(case)) == []


def test_a_count_out_of_reach_of_a_node_that_is_never_ticked_is_refused_here_alone():
    case = case_of(
        '<Fallback><Scripted id="a"/><ParallelAll max_failures="3"><Scripted id="b"/></ParallelAll></Fallback>',
        ("SUCCESS", events("a SUCCESS")),
    )
    (difference,) = replay(case)
    assert "only met where the node is ticked" in (reason_for(case, difference) or "")
    # Something else may raise there meanwhile.
    case["runs"][0]["ticks"][0]["exception"] = "Exception in node 'a' [Scripted]: no such file"
    assert "only met where the node is ticked" in (reason_for(case, difference) or "")
    case["runs"][0]["ticks"][0]["events"].append(["tick", "b", "SUCCESS"])
    assert reason_for(case, next(iter(replay(case)))) is None


@python_only
def test_only_children_that_are_skipped_in_one_run_of_a_fallback_are_counted():
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
def test_a_precondition_is_asked_again_after_its_child_was_skipped(around):
    case = case_of(
        f'<{around}><Precondition if="n==0" else="RUNNING"><Scripted id="a" outcomes="K"/></Precondition><Script code="n:=1"/></{around}>',
        ("SUCCESS", events("a SKIPPED")),
        ("SUCCESS", events("a SKIPPED")),
        bb={"n": 0},
    )
    (difference,) = replay(case)
    assert (difference.tick, difference.seen) == (1, "nothing")
    assert "Precondition does not check" in (reason_for(case, difference) or "")


def test_what_a_timer_did_there_between_two_ticks_may_come_after_other_leaves_here():
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
