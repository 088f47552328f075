"""Trees behave as they do in BehaviorTree.CPP."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.conformance.deviations import deviation
from tests.conformance.replay import main, replay

TRACES = Path(__file__).parent / "btcpp_traces.json"
RANDOM_TRACES = Path(__file__).parent / "btcpp_random_traces.json"


def cases_of(path: Path) -> list[dict[str, Any]]:
    cases: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["cases"]
    return cases


INTENDED = {"precondition_after_halt", "post_on_halt", "reactive_seq_explicit_child"}


@pytest.mark.parametrize("case", cases_of(TRACES), ids=lambda case: case["name"])
def test_a_tree_shows_the_trace_of_behaviortree_cpp_or_differs_on_purpose(case):
    differences = list(replay(case))
    assert [str(difference) for difference in differences if deviation(case, difference) is None] == []
    assert bool(differences) == (case["name"] in INTENDED)


@pytest.mark.parametrize("case", cases_of(RANDOM_TRACES), ids=lambda case: case["name"])
def test_a_random_tree_shows_the_trace_of_behaviortree_cpp_but_for_skipped_conditions(case):
    for difference in replay(case):
        assert "over a condition that is skipped" in (deviation(case, difference) or str(difference))


def written(tmp_path, *cases):
    path = tmp_path / "cases.json"
    path.write_text(json.dumps({"cases": cases}), encoding="utf-8")
    return str(path)


def case_of(tree, *ticks, mode="once", **more):
    run = {"mode": mode, "ticks": [{"root": root, "events": events} for root, events in ticks]}
    xml = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{tree}</BehaviorTree></root>'
    return {"name": "a_case", "xml": xml, "ticks": len(ticks), "runs": [run], **more}


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
                '<Sequence><Scripted id="a"/><IfThenElse><Scripted id="c"/></IfThenElse></Sequence>',
                ("EXCEPTION", [["tick", "a", "SUCCESS"]]),
            ),
            "refused before",
        ),
        (
            case_of(
                '<Sequence><SetBlackboard value="7" output_key="k"/><Show id="k" value="{k}"/></Sequence>',
                ("FAILURE", [["show", "k", "<error: the entry is empty>"]]),
            ),
            "literal",
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
    assert reason in (deviation(case, difference) or "")


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
    assert "_onHalted" in (deviation(case, difference) or "")


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
