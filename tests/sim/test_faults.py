"""Tests of the faults of `--fault`."""

import re

import pytest

from sar_compiler.missions.faults import (
    NAVIGATION_FAULTS,
    CallFaults,
    Fault,
    FaultError,
    FaultPlan,
    ServiceFaults,
    parse_fault,
)
from search_and_rescue.plugin import MISSION

TARGETS = {**MISSION.faults, **NAVIGATION_FAULTS}


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("report_survivor:drop=2", Fault("report_survivor", "drop", count=2)),
        ("detect_survivor:delay=3", Fault("detect_survivor", "delay", seconds=3.0)),
        ("report_survivor:refuse=1", Fault("report_survivor", "refuse", count=1)),
        ("navigate_to_pose:abort=zone_b", Fault("navigate_to_pose", "abort", place="zone_b")),
        ("navigate_to_pose:reject=1", Fault("navigate_to_pose", "reject", count=1)),
        ("navigate_to_pose:die@zone_c", Fault("navigate_to_pose", "die", place="zone_c")),
        ("navigate_to_pose:die@zone_c,back=5", Fault("navigate_to_pose", "die", place="zone_c", back=5.0)),
        ("navigate_to_pose:delay=2s", Fault("navigate_to_pose", "delay", seconds=2.0)),
        ("navigate_to_pose:late=50ms", Fault("navigate_to_pose", "late", seconds=0.05)),
        ("navigate_to_pose:starved@zone_b", Fault("navigate_to_pose", "starved", place="zone_b")),
        ("navigate_to_pose:succeed@zone_b", Fault("navigate_to_pose", "succeed", place="zone_b")),
        ("navigate_to_pose:code=208,after=14s", Fault("navigate_to_pose", "code", code=208, seconds=14.0)),
        ("navigate_to_pose:code=107@zone_c", Fault("navigate_to_pose", "code", code=107, place="zone_c")),
        (
            "navigate_to_pose:late=1s@zone_b,drives=3s",
            Fault("navigate_to_pose", "late", place="zone_b", seconds=1.0, drives=3.0),
        ),
        ("amcl:die", Fault("amcl", "die")),
        ("amcl:die@zone_b,back=5", Fault("amcl", "die", place="zone_b", back=5.0)),
    ],
)
def test_fault_is_parsed_and_formatted_alike(text: str, fault: Fault) -> None:
    assert parse_fault(text, TARGETS) == fault
    assert str(parse_fault(text, TARGETS)) == text


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "unknown target '' (known: detect_survivor, report_survivor, navigate_to_pose, amcl)"),
        ("report_survivr:drop=2", "did you mean 'report_survivor'?"),
        ("report_survivor", "the kind of fault is missing. Write one of report_survivor:drop=COUNT"),
        ("report_survivor:", "the kind of fault is missing"),
        ("report_survivor:dorp=2", "did you mean 'drop'?"),
        ("report_survivor:DROP=2", "did you mean 'drop'?"),
        ("detect_survivor:refuse=1", "unknown fault of detect_survivor 'refuse' (known: drop, delay)"),
        ("report_survivor:drop", "expected report_survivor:drop=COUNT"),
        ("report_survivor:drop@2", "expected report_survivor:drop=COUNT"),
        ("report_survivor:drop=0", "'0' is not an integer above 0"),
        ("report_survivor:drop=-1", "'-1' is not an integer above 0"),
        ("report_survivor:drop=two", "'two' is not an integer above 0"),
        ("detect_survivor:delay=nan", "'nan' is not a number of seconds above 0"),
        ("detect_survivor:delay=soon", "'soon' is not a number of seconds above 0"),
        ("navigate_to_pose:die=zone_c", "expected navigate_to_pose:die[@PLACE][,back=SECONDS]"),
        (
            "navigate_to_pose:die@zone_c,bak=5",
            "unknown option 'bak=5'. Expected navigate_to_pose:die[@PLACE]",
        ),
        ("navigate_to_pose:die@", "expected navigate_to_pose:die[@PLACE]"),
        (
            "navigate_to_pose:reject=1,back=5",
            "unknown option 'back=5'. Expected navigate_to_pose:reject=COUNT",
        ),
        ("navigate_to_pose:code=many", "'many' is not an integer above 0"),
        ("navigate_to_pose:code=208,after=14m", "'14m' is not a number of seconds above 0"),
        ("navigate_to_pose:late@zone_b", "expected navigate_to_pose:late=SECONDS"),
        ("navigate_to_pose:late=ms", "'ms' is not a number of seconds above 0"),
        ("amcl:abort=zone_b", "unknown fault of amcl 'abort' (known: die)"),
        ("navigate_to_pose:die@zone_c,back=", "'' is not a number of seconds above 0"),
        ("navigate_to_pose:abort=zone b", "'zone b' is not the name of a location"),
    ],
)
def test_invalid_fault_is_explained(text: str, problem: str) -> None:
    with pytest.raises(FaultError, match=re.escape(f"fault '{text}': ") + ".*" + re.escape(problem)):
        parse_fault(text, TARGETS)


def plan(*texts: str) -> FaultPlan:
    return FaultPlan([parse_fault(text, TARGETS) for text in texts])


def test_calls_are_dropped_then_refused_and_responses_are_delayed() -> None:
    faults = plan("report_survivor:refuse=1", "report_survivor:drop=2", "report_survivor:delay=3")
    service = faults.for_service("report_survivor")
    assert [service.next_call() for _ in range(4)] == [
        CallFaults(drop=True),
        CallFaults(drop=True),
        CallFaults(delay_sec=3.0, refuse=True),
        CallFaults(delay_sec=3.0),
    ]


def test_faults_of_service_do_not_affect_other_services() -> None:
    assert plan("report_survivor:drop=2").for_service("detect_survivor").next_call() == CallFaults()
    assert ServiceFaults().next_call() == CallFaults()


def test_goals_are_rejected_given_number_of_times() -> None:
    navigation = plan("navigate_to_pose:reject=2").for_navigation()
    assert [navigation.should_reject() for _ in range(3)] == [True, True, False]


def test_goals_for_aborted_zone_are_aborted_every_time() -> None:
    faults = plan("navigate_to_pose:abort=zone_b")
    navigation, [aborts] = faults.for_navigation(), faults.faults
    assert [navigation.fault_for_goal(zone) for zone in ("zone_b", "zone_a", None, "zone_b")] == [
        aborts,
        None,
        None,
        aborts,
    ]


def test_code_without_zone_applies_to_every_goal() -> None:
    faults = plan("navigate_to_pose:code=208,after=14s")
    navigation = faults.for_navigation()
    assert [navigation.fault_for_goal(zone) for zone in ("zone_a", None)] == [*faults.faults] * 2
    faults = plan("navigate_to_pose:code=107@zone_c")
    navigation = faults.for_navigation()
    assert [navigation.fault_for_goal(zone) for zone in ("zone_c", "zone_a")] == [*faults.faults, None]


@pytest.mark.parametrize("kind", ["late=50ms", "starved", "succeed"])
def test_late_starved_and_succeed_apply_to_every_goal_or_once_at_zone(kind: str) -> None:
    faults = plan(f"navigate_to_pose:{kind}")
    navigation = faults.for_navigation()
    assert [navigation.fault_for_goal(zone) for zone in ("zone_a", None)] == [*faults.faults] * 2
    faults = plan(f"navigate_to_pose:{kind}@zone_b")
    navigation = faults.for_navigation()
    assert [navigation.fault_for_goal(zone) for zone in ("zone_a", "zone_b", "zone_b")] == [
        None,
        *faults.faults,
        None,
    ]


def test_localisation_fault_without_zone_applies_to_any_goal() -> None:
    faults = plan("amcl:die")
    assert faults.for_navigation().fault_for_goal(None) == faults.faults[0]


def test_server_crashes_once_per_fault() -> None:
    faults = plan("navigate_to_pose:die@zone_c,back=5")
    navigation = faults.for_navigation()
    assert [navigation.fault_for_goal("zone_c") for _ in range(2)] == [*faults.faults, None]


def test_unknown_location_is_named() -> None:
    with pytest.raises(FaultError, match=r"unknown place 'zone-a'.*did you mean 'zone_a'"):
        plan("navigate_to_pose:abort=zone-a").for_navigation().check_places(["zone_a"])
    plan("navigate_to_pose:abort=zone_a").for_navigation().check_places(["zone_a"])
