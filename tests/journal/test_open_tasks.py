"""Tests of the open tasks of a mission for a person, which page, terminal and reports share."""

import pytest

from sar_compiler.journal.display import (
    Alarm,
    AwaitedItem,
    Figure,
    Gauge,
    Landmark,
    LandmarkKind,
    Level,
    MissionPhase,
)
from sar_compiler.journal.journal_entries import (
    GOAL_SENT,
    LACKS,
    PROGRESS,
    RUN_BEGAN,
    RUN_ENDED,
    JournalEntry,
)
from sar_compiler.journal.mission_state import MissionState, RunProcess
from sar_compiler.journal.open_tasks import find_open_tasks, severity
from sar_compiler.journal.status_line import condition

KINDS = (
    LandmarkKind("zone", "zones", remedy="Send people to search"),
    LandmarkKind("survivor", "survivors", is_found=True, review="judge_survivor"),
    LandmarkKind("base", "base", is_end=True),
    LandmarkKind("gap", "gaps", remedy="Send people to search"),
    LandmarkKind("area", "areas"),
)
AT_HOME = Landmark("base", "base", 0.0, 0.0, "home", Level.DONE)
AWAY = Landmark("base", "base", 0.0, 0.0)
DETECTION = Landmark("survivor", "survivor_1", 1.0, 2.0, "candidate", Level.IN_HAND)
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))


def mission(*landmarks, phase=None, alarms=(), gauges=(), end=None, goal=False):
    """Return the state of a mission with these display items. If `end` is given, it has ended with this status."""
    state = MissionState()
    state.apply(JournalEntry(1, 1, 0.0, 0.0, RUN_BEGAN, {"run": {"node": "/search"}}))
    if goal:
        state.apply(JournalEntry(2, 1, 1.0, 1.0, GOAL_SENT, {"action": "navigate_to_pose", "goal": "a"}))
    state.situation.kinds.update({kind.name: kind for kind in KINDS})
    state.situation.landmarks.update({(each.kind, each.name): each for each in landmarks})
    state.situation.alarms.update({alarm.text: alarm for alarm in alarms})
    state.situation.gauges.update({gauge.name: gauge for gauge in gauges})
    state.situation.phase = phase or MissionPhase()
    if end is not None:
        state.apply(
            JournalEntry(3, 1, 2.0, 2.0, RUN_ENDED, {"ending": "over", "status": end, "reason": "so"})
        )
    return state


def task_texts(state):
    return [task.text for task in find_open_tasks(state)]


def test_undisturbed_drive_without_detections_has_no_task_and_is_good():
    state = mission(AWAY, Landmark("zone", "zone_a", 0.0, 0.0, "under way", Level.IN_HAND))
    assert (task_texts(state), severity(state)) == ([], "good")


def test_mission_that_has_not_begun_has_no_task():
    assert find_open_tasks(MissionState()) == ()


def test_run_awaiting_its_start_names_missing_items_and_is_warning():
    state = MissionState()
    state.awaited = [AwaitedItem("navigation", "it is inactive"), AwaitedItem("clock")]
    assert task_texts(state) == ["Wait for navigation, or ask an engineer to start it on the robot"]
    assert (severity(state), condition(state).reason) == ("warning", "waiting for navigation")
    state.awaited = [AwaitedItem("navigation", "it is inactive"), AwaitedItem("clock", "it is silent")]
    assert task_texts(state) == ["Wait for navigation, clock, or ask an engineer to start them on the robot"]
    state.awaited = [AwaitedItem("navigation"), AwaitedItem("clock")]
    assert (task_texts(state), severity(state)) == ([], "quiet")
    state.apply(JournalEntry(1, 1, 0.0, 0.0, RUN_BEGAN, {"run": {"node": "/search"}}))
    assert not state.awaited


@pytest.mark.parametrize(("ending", "words"), [("stopped", "was stopped"), ("failed", "has failed")])
def test_interrupted_mission_asks_to_resume_it_or_fetch_robot(ending, words):
    state = mission(AWAY)
    state.apply(JournalEntry(3, 1, 2.0, 2.0, RUN_ENDED, {"ending": ending, "status": 1, "reason": ""}))
    assert (
        task_texts(state)[0]
        == f"Ask an engineer to resume the mission, or fetch the robot: its program {words}"
    )


def test_imported_journal_has_no_task_to_resume():
    state = MissionState()
    about = {"imported": {"file": "run.btlog", "format": "btlog"}}
    state.apply(JournalEntry(1, 1, 0.0, 0.0, RUN_BEGAN, {"run": about}))
    state.apply(JournalEntry(2, 1, 2.0, 2.0, RUN_ENDED, {"ending": "stopped", "status": 1, "reason": ""}))
    assert task_texts(state) == []


def test_goal_of_crashed_run_ends_when_next_run_sends_goal_to_same_action():
    state = mission(AT_HOME, goal=True)
    state.apply(JournalEntry(3, 2, 5.0, 0.0, RUN_BEGAN, {"run": {"node": "/search"}}))
    assert state.goals == {"a": "navigate_to_pose"}
    state.apply(JournalEntry(4, 2, 6.0, 1.0, GOAL_SENT, {"action": "navigate_to_pose", "goal": "b"}))
    assert state.goals == {"b": "navigate_to_pose"}


def test_detection_is_reviewed_by_command_of_its_kind():
    (task,) = find_open_tasks(mission(DETECTION))
    assert task == (
        "warning",
        "Review survivor_1: is it a survivor?",
        "survivor",
        "survivor_1",
        "judge_survivor",
        False,
    )
    assert severity(mission(DETECTION)) == "warning"


@pytest.mark.parametrize("changes", [{"is_certain": True}, {"level": Level.GIVEN_UP}])
def test_confirmed_or_rejected_detection_has_no_task(changes):
    assert task_texts(mission(DETECTION._replace(**changes))) == []


def test_detection_with_unfinished_report_must_be_reported_by_person_after_end():
    assert task_texts(mission(AT_HOME, DETECTION, end=1)) == [
        "Report survivor_1 yourself: the mission did not finish reporting it"
    ]


def test_unconfirmed_reported_detection_must_be_visited_after_end():
    reported = DETECTION._replace(level=Level.DONE)
    assert (task_texts(mission(AT_HOME, reported, end=0)), severity(mission(AT_HOME, reported, end=0))) == (
        ["Go to survivor_1: no person has confirmed it"],
        "warning",
    )
    assert task_texts(mission(AT_HOME, reported._replace(is_certain=True), end=0)) == []
    second = reported._replace(name="survivor_2")
    assert task_texts(mission(AT_HOME, reported, second, end=0)) == [
        "Go to survivor_1, survivor_2: no person has confirmed them"
    ]


def test_detection_without_review_command_must_be_visited_after_end():
    state = mission(AT_HOME, DETECTION._replace(level=Level.DONE), end=0)
    state.situation.kinds["survivor"] = LandmarkKind("survivor", "survivors", is_found=True)
    assert task_texts(state) == ["Go to survivor_1: no person has confirmed it"]


def test_task_of_landmark_is_listed_once_during_and_after_run():
    refused = DETECTION._replace(is_certain=True, task="Report survivor_1 yourself: no answer")
    assert [(task.level, task.text) for task in find_open_tasks(mission(AT_HOME, refused))] == [
        ("error", refused.task)
    ]
    assert task_texts(mission(AT_HOME, refused, end=1)) == [refused.task]


def test_abandoned_zone_must_be_searched_at_once_and_open_zone_after_end():
    given_up = Landmark("zone", "zone_b", 0.0, 0.0, "abandoned", Level.GIVEN_UP, "after attempt 2")
    still_open = Landmark("zone", "zone_c", 0.0, 0.0, "open")
    assert task_texts(mission(AT_HOME, given_up, still_open)) == ["Send people to search zone_b: abandoned"]
    assert "Send people to search zone_c: not reached" in task_texts(
        mission(AT_HOME, given_up, still_open, end=0)
    )


@pytest.mark.parametrize(
    ("reason", "end"),
    [("the battery is low", " because the battery is low"), ("skipped by Ann", ", skipped by Ann")],
)
def test_zones_abandoned_for_same_reason_are_one_task(reason, end):
    zones = [
        Landmark("zone", name, 0.0, 0.0, "abandoned", Level.GIVEN_UP, reason) for name in ("zone_b", "zone_c")
    ]
    assert task_texts(mission(*zones)) == [f"Send people to search zone_b, zone_c: abandoned{end}"]


def test_task_names_at_most_five_locations():
    gaps = [
        Landmark("gap", f"gap {number}", 0.0, 0.0, level=Level.GIVEN_UP, corners=SQUARE)
        for number in range(6)
    ]
    (task,) = find_open_tasks(mission(*gaps))
    assert task.text == "Send people to search gap 0, gap 1, gap 2, gap 3, gap 4 and 1 more: not done"
    assert (task.kind, task.name) == ("", "")


def test_outline_of_abandoned_zone_is_no_second_task():
    outline = Landmark("area", "zone_b", 0.0, 0.0, "2 of 5 pieces", Level.GIVEN_UP, corners=SQUARE)
    assert task_texts(mission(outline)) == []


def test_complete_mission_with_gap_is_warning():
    gap = Landmark("gap", "gap 1", 0.0, 0.0, level=Level.GIVEN_UP, corners=SQUARE)
    assert severity(mission(AT_HOME, gap, end=0)) == "warning"
    assert severity(mission(AT_HOME, end=0)) == "good"


def test_alarm_is_task_with_its_level_until_it_is_over():
    low, broken = Alarm("low", level=30), Alarm("broken")
    assert [
        (task.level, task.text, task.is_alarm) for task in find_open_tasks(mission(alarms=(low, broken)))
    ] == [
        ("error", "broken", True),
        ("warning", "low", True),
    ]
    assert task_texts(mission(alarms=(low._replace(is_over=True),))) == []


def test_low_battery_asks_to_call_robot_back_during_run():
    gauge = Gauge("battery", 19.0, "%", least=20.0)
    assert task_texts(mission(gauges=(gauge,))) == [
        "Call the robot back: battery 19 %, below the limit of 20 %"
    ]
    assert task_texts(mission(gauges=(gauge._replace(value=20.0),))) == []
    assert task_texts(mission(AT_HOME, gauges=(gauge,), end=0)) == []
    at_home = task_texts(mission(AT_HOME, gauges=(gauge,)))
    assert at_home == ["Charge the robot: battery 19 %, below the limit of 20 %"]


def test_low_battery_of_returning_robot_asks_to_expect_it():
    state = mission(AWAY, gauges=(Gauge("battery", 19.0, "%", 20.0),))
    progress = {"target": "base", "distance": 4.0, "time_left": None}
    state.apply(JournalEntry(4, 1, 3.0, 3.0, PROGRESS, progress))
    assert task_texts(state) == ["Expect the robot at base: battery 19 %, below the limit of 20 %"]


def test_pause_asks_for_command_of_resume_role():
    (task,) = find_open_tasks(mission(phase=MissionPhase("held", "by the operator")))
    assert (task.level, task.text, task.command) == (
        "warning",
        "Resume the mission, or call the robot back",
        "release",
    )


@pytest.mark.parametrize(
    ("reason", "told"),
    [
        ("Nav2 is not active: bt_navigator is inactive", "Nav2 is not active"),
        ("for another battery", "the robot waits for another battery"),
        ("", "the robot waits"),
    ],
)
def test_task_names_reason_for_waiting(reason, told):
    state = mission(phase=MissionPhase("waiting", reason))
    assert task_texts(state) == [f"Ask an engineer for help: {told}"]


@pytest.mark.parametrize(
    ("reason", "told"),
    [("Mission complete.", ""), ("Mission complete. b was visited.", "Mission complete. b was visited.")],
)
def test_reason_of_complete_mission_does_not_repeat_its_state(reason, told):
    state = mission()
    state.apply(JournalEntry(4, 1, 3.0, 3.0, RUN_ENDED, {"ending": "over", "status": 0, "reason": reason}))
    assert condition(state)[::3] == ("complete", told)


def test_failed_mission_asks_to_fetch_robot_away_from_base():
    assert task_texts(mission(AWAY, end=1)) == ["Fetch the robot: it has not reached base"]
    assert task_texts(mission(AT_HOME, end=1)) == []
    assert task_texts(mission(end=1)) == []


@pytest.mark.parametrize("process", [RunProcess(is_gone=True), RunProcess(is_gone=False, silent_sec=60.0)])
def test_robot_driving_without_contact_asks_for_emergency_stop(process):
    state = mission(goal=True)
    state.apply(JournalEntry(4, 1, 3.0, 3.0, "progress", {"target": "a", "distance": 1.0, "time_left": 2.0}))
    state.process = process
    first = find_open_tasks(state)[0]
    assert (first.level, first.text) == (
        "error",
        "Press the emergency stop on the robot: STOP on the page may not reach it",
    )
    assert "may still be driving" in condition(state).reason


def test_crash_without_goal_asks_for_engineer_not_emergency_stop():
    state = mission()
    state.process = RunProcess(is_gone=True)
    assert task_texts(state) == [
        "Ask an engineer to resume the mission, or fetch the robot: its program has crashed"
    ]


def test_errors_come_before_warnings():
    given_up = Landmark("zone", "zone_b", 0.0, 0.0, "abandoned", Level.GIVEN_UP)
    assert [task.level for task in find_open_tasks(mission(given_up, alarms=(Alarm("broken"),)))] == [
        "error",
        "warning",
    ]


def test_lost_position_is_error_and_asks_to_correct_position():
    state = mission(AWAY)
    state.apply(JournalEntry(3, 1, 2.0, 2.0, LACKS, {"text": "no transform", "is_position_lost": True}))
    assert condition(state)[:2] == ("position lost", "error")
    assert task_texts(state) == [
        "Press the robot's emergency stop if it moves, then ask an engineer to correct its position"
    ]
    state.apply(JournalEntry(4, 1, 3.0, 3.0, LACKS, {"text": ""}))
    assert severity(state) == "good"


@pytest.mark.parametrize(("least", "level"), [(None, "good"), (50.0, "good"), (80.0, "warning")])
def test_search_below_wanted_probability_of_success_is_warning(least, level):
    state = mission(AT_HOME, end=0)
    state.situation.figures["success"] = Figure("success", 57.0, unit="%", least=least)
    assert severity(state) == level


def test_mission_called_home_is_ended_early_and_warning():
    state = mission(AT_HOME)
    changed = {"phase": {"reason": "called home by Ann"}, "by": "Ann"}
    state.apply(JournalEntry(3, 1, 2.0, 2.0, "changed", changed))
    state.apply(
        JournalEntry(4, 1, 3.0, 3.0, RUN_ENDED, {"ending": "over", "status": 1, "reason": "b is left."})
    )
    assert condition(state)[:2] == ("ended early", "warning")
    assert condition(state).reason == "Called home by Ann. b is left."
