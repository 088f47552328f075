"""The trace of a scripted run, as an operator reads it."""

import json
from xml.etree import ElementTree as ET

from sar_compiler.analysis.simulate.scenario_run import OutcomeCoverage, failures
from sar_compiler.analysis.trace_view import (
    PlayedScenario,
    coverage_text,
    junit,
    leaf_labels,
    runs_as_json,
    trace,
    verdict,
)
from tests.analysis.simulate.stage import played

WAITS = """
name: a scenario
until: "at == 'base'"
leaves:
  NavigateToZone: [{outcome: aborted, after: 1.5s}, RUNNING]
  NavigateToBase: [RUNNING]
expect: {root: FAILURE}
"""


def test_only_ticks_in_which_something_new_happens_are_shown():
    run = played(f"{WAITS}ticks: 7")
    assert trace(run).splitlines()[:11] == [
        "tick 1, 0 s: root RUNNING",
        "  ZonesRemaining?  some left (SUCCESS)",
        "  NavigateToZone   driving (RUNNING)",
        "ticks 2 to 3, until 1 s: nothing new",
        "tick 4, 1.5 s: root RUNNING",
        "  NavigateToZone   aborted (FAILURE)",
        "  NavigateToBase   driving (RUNNING)",
        "tick 5, 2 s: root RUNNING",
        "  ZonesRemaining?  some left (SUCCESS)",
        "  NavigateToZone   driving (RUNNING)",
        "  NavigateToBase   halted",
    ]


def test_what_is_done_again_in_ticks_without_news_is_said_in_their_line():
    text = "until: tick == 4\nleaves: {NavigateToZone: aborted}"
    body = '<Sequence memory="false"><ZonesRemaining/><NavigateToZone/></Sequence>'
    assert trace(played(text, body)).splitlines()[3:5] == [
        "ticks 2 to 4, until 1.5 s: again NavigateToZone aborted",
        "ended after tick 4 (1.5 s): root FAILURE",
    ]


def test_facts_and_keys_are_written_as_a_script_would():
    body = (
        "<Sequence><Script code=\"goal := 2.5; place := 'here'\"/><NavigateToBase/><AdvanceZone/></Sequence>"
    )
    assert trace(played("name: x", body)).splitlines() == [
        "tick 1, 0 s: root SUCCESS",
        "  NavigateToBase  arrived (SUCCESS)",
        "  AdvanceZone     advanced (SUCCESS)",
        "  facts: at = 'base', zones_left = 2",
        "  keys: goal = 2.5, place = 'here'",
        "ended after tick 1 (0 s): root SUCCESS",
        "facts at the end: at = 'base', navigation_lost = false, zones_left = 2",
    ]


def test_a_run_that_does_not_end_says_so():
    text = trace(played("ticks: 2\nleaves: {NavigateToBase: RUNNING}", "<NavigateToBase/>"))
    assert "aborted without an end after tick 2 (0.5 s): root RUNNING" in text


def test_a_run_that_cannot_go_on_says_why():
    text = trace(played("name: x", '<Script code="a = 1"/>'))
    assert text.startswith("tick 1, 0 s: not finished\n")
    assert "aborted in tick 1 (0 s): 'Script'" in text


def test_namesakes_are_told_apart_by_what_is_around_them():
    body = """<Sequence name="Main"><Sequence name="Out"><NavigateToZone/></Sequence>
    <Sequence name="Home"><NavigateToZone/><NavigateToBase/></Sequence></Sequence>"""
    run = played("name: x", body)
    assert list(leaf_labels(run.simulated.leaves).values()) == [
        "Out/NavigateToZone",
        "Home/NavigateToZone",
        "NavigateToBase",
    ]


def test_namesakes_side_by_side_are_numbered():
    run = played("name: x", "<Sequence><NavigateToBase/><NavigateToBase/></Sequence>")
    assert list(leaf_labels(run.simulated.leaves).values()) == ["NavigateToBase (1)", "NavigateToBase (2)"]


def test_the_verdict_names_the_line_of_every_expectation_that_does_not_hold():
    run = played("expect:\n  root: FAILURE\n  never: AdvanceZone advanced", "<AdvanceZone/>")
    assert verdict(run, failures(run)).splitlines() == [
        "scenario.yaml: 'scenario' does not hold:",
        "  scenario.yaml:2: root: the status of the root is SUCCESS in the last tick, but FAILURE was expected",
        "  scenario.yaml:3: never: 'AdvanceZone advanced' happens in tick 1 (0 s)",
    ]
    assert verdict(run, []) == "scenario.yaml: 'scenario' holds."


def test_coverage_is_counted_and_what_is_missing_has_its_line():
    collected = OutcomeCoverage()
    collected.add(played("name: x", "<Selector><AdvanceZone/><Success/></Selector>"))
    assert coverage_text(collected).splitlines() == [
        "coverage: 2 of 3 nodes ticked, 1 of 3 leaf outcomes seen",
        "  test.xml:3: 'Success' is never ticked",
        "  test.xml:3: 'AdvanceZone' never returned no zone",
    ]


def parts():
    good = played("name: good", "<AdvanceZone/>")
    bad = played("name: <bad> &\nexpect: {root: FAILURE}", "<AdvanceZone/>")
    return [
        PlayedScenario("good", good),
        PlayedScenario("<bad> &", bad, tuple(failures(bad))),
        PlayedScenario("worse.yaml", problem="no\x00 scenario"),
    ]


def test_junit_has_a_test_case_for_each_scenario():
    suites = ET.fromstring(junit("tree.xml", parts()))  # noqa: S314 - it is ours
    (suite,) = suites
    assert suite.attrib == {"name": "tree.xml", "tests": "3", "failures": "1", "errors": "1", "time": "0.000"}
    assert [case.attrib["name"] for case in suite] == ["good", "<bad> &", "worse.yaml"]
    assert [case[0].tag for case in suite] == ["system-out", "failure", "error"]


def test_a_failure_in_junit_has_what_does_not_hold_and_the_trace():
    (failure,) = ET.fromstring(junit("tree.xml", parts())).iter("failure")  # noqa: S314 - it is ours
    said = (
        "scenario.yaml:2: root: the status of the root is SUCCESS in the last tick, but FAILURE was expected"
    )
    assert failure.attrib == {"message": said, "type": "root"}
    assert failure.text is not None
    assert failure.text.startswith(f"{said}\n\ntick 1, 0 s: root SUCCESS\n")


def test_what_xml_cannot_have_is_replaced():
    (error,) = ET.fromstring(junit("tree.xml", parts())).iter("error")  # noqa: S314 - it is ours
    assert error.text == "no\N{REPLACEMENT CHARACTER} scenario"


def test_json_has_every_tick_and_what_was_not_covered():
    collected = OutcomeCoverage()
    scenarios = parts()
    collected.add(scenarios[0].run)
    data = json.loads(runs_as_json("tree.xml", scenarios, collected))
    good, bad, worse = data["scenarios"]
    assert (good["holds"], bad["holds"], worse["holds"]) == (True, False, None)
    assert good["ticks"][0] == {
        "tick": 1,
        "time": 0.0,
        "root": "SUCCESS",
        "events": [
            {"leaf": "AdvanceZone", "what": "started", "outcome": None, "status": None},
            {"leaf": "AdvanceZone", "what": "returned", "outcome": "advanced", "status": "SUCCESS"},
        ],
        "facts": {"zones_left": 2},
        "keys": {},
        "statuses": [{"node": "AdvanceZone", "status": "SUCCESS"}],
    }
    assert bad["failures"][0]["line"] == 2
    assert data["coverage"] == {
        "never_ticked": [],
        "unseen": [{"name": "AdvanceZone", "file": "test.xml", "line": 3, "outcomes": ["no zone"]}],
    }
