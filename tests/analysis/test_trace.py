"""Tests of the reports of a scripted run: trace, verdict, coverage, JUnit and JSON."""

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


def test_only_ticks_with_new_events_are_shown():
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


def test_repeated_events_are_summarized_in_one_line():
    text = "until: tick == 4\nleaves: {NavigateToZone: aborted}"
    body = '<Sequence memory="false"><ZonesRemaining/><NavigateToZone/></Sequence>'
    assert trace(played(text, body)).splitlines()[3:5] == [
        "ticks 2 to 4, until 1.5 s: again NavigateToZone aborted",
        "ended after tick 4 (1.5 s): root FAILURE",
    ]


def test_facts_and_keys_are_written_as_in_scripts():
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


def test_run_without_end_is_shown_as_aborted():
    text = trace(played("ticks: 2\nleaves: {NavigateToBase: RUNNING}", "<NavigateToBase/>"))
    assert "aborted without an end after tick 2 (0.5 s): root RUNNING" in text


def test_run_with_error_shows_reason():
    text = trace(played("name: x", '<Script code="a = 1"/>'))
    assert text.startswith("tick 1, 0 s: not finished\n")
    assert "aborted in tick 1 (0 s): 'Script'" in text


def test_leaves_of_same_name_are_distinguished_by_parent():
    body = """<Sequence name="Main"><Sequence name="Out"><NavigateToZone/></Sequence>
    <Sequence name="Home"><NavigateToZone/><NavigateToBase/></Sequence></Sequence>"""
    run = played("name: x", body)
    assert list(leaf_labels(run.simulated.leaves).values()) == [
        "Out/NavigateToZone",
        "Home/NavigateToZone",
        "NavigateToBase",
    ]


def test_sibling_leaves_of_same_name_are_numbered():
    run = played("name: x", "<Sequence><NavigateToBase/><NavigateToBase/></Sequence>")
    assert list(leaf_labels(run.simulated.leaves).values()) == ["NavigateToBase (1)", "NavigateToBase (2)"]


def test_verdict_names_line_of_every_failed_expectation():
    run = played("expect:\n  root: FAILURE\n  never: AdvanceZone advanced", "<AdvanceZone/>")
    assert verdict(run, failures(run)).splitlines() == [
        "scenario.yaml: 'scenario' does not hold:",
        "  scenario.yaml:2: root: the status of the root is SUCCESS in the last tick, but FAILURE was expected",
        "  scenario.yaml:3: never: 'AdvanceZone advanced' happens in tick 1 (0 s)",
    ]
    assert verdict(run, []) == "scenario.yaml: 'scenario' holds."


def test_coverage_is_counted_and_missing_parts_have_locations():
    collected = OutcomeCoverage()
    collected.add(played("name: x", "<Selector><AdvanceZone/><Success/></Selector>"))
    assert coverage_text(collected).splitlines() == [
        "coverage: 2 of 3 nodes ticked, 1 of 3 leaf outcomes seen",
        "  test.xml:3: 'Success' is never ticked",
        "  test.xml:3: 'AdvanceZone' never returned no zone",
    ]


def played_scenarios():
    good = played("name: good", "<AdvanceZone/>")
    bad = played("name: <bad> &\nexpect: {root: FAILURE}", "<AdvanceZone/>")
    return [
        PlayedScenario("good", good),
        PlayedScenario("<bad> &", bad, tuple(failures(bad))),
        PlayedScenario("worse.yaml", problem="no\x00 scenario"),
    ]


def test_junit_has_test_case_for_each_scenario():
    suites = ET.fromstring(junit("tree.xml", played_scenarios()))  # noqa: S314 - it is ours
    (suite,) = suites
    assert suite.attrib == {"name": "tree.xml", "tests": "3", "failures": "1", "errors": "1", "time": "0.000"}
    assert [case.attrib["name"] for case in suite] == ["good", "<bad> &", "worse.yaml"]
    assert [case[0].tag for case in suite] == ["system-out", "failure", "error"]


def test_junit_failure_has_failed_expectations_and_trace():
    (failure,) = ET.fromstring(junit("tree.xml", played_scenarios())).iter("failure")  # noqa: S314 - it is ours
    said = (
        "scenario.yaml:2: root: the status of the root is SUCCESS in the last tick, but FAILURE was expected"
    )
    assert failure.attrib == {"message": said, "type": "root"}
    assert failure.text is not None
    assert failure.text.startswith(f"{said}\n\ntick 1, 0 s: root SUCCESS\n")


def test_characters_invalid_in_xml_are_replaced():
    (error,) = ET.fromstring(junit("tree.xml", played_scenarios())).iter("error")  # noqa: S314 - it is ours
    assert error.text == "no\N{REPLACEMENT CHARACTER} scenario"


def test_json_has_every_tick_and_missing_coverage():
    collected = OutcomeCoverage()
    scenarios = played_scenarios()
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
