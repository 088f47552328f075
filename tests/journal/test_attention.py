"""The open tasks of a mission: what a person has to do, computed once for page, terminal and reports."""

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
FOUND = Landmark("survivor", "survivor_1", 1.0, 2.0, "candidate", Level.IN_HAND)
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))


def mission(*landmarks, phase=None, alarms=(), gauges=(), end=None, goal=False):
    """Return the state of a mission whose display has these, and that ended with a status if one is given."""
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


def texts(state):
    return [task.text for task in find_open_tasks(state)]


def test_a_robot_that_drives_and_has_found_nobody_leaves_nothing_to_do_and_is_green():
    state = mission(AWAY, Landmark("zone", "zone_a", 0.0, 0.0, "under way", Level.IN_HAND))
    assert (texts(state), severity(state)) == ([], "good")


def test_a_mission_that_has_not_begun_asks_for_nothing():
    assert find_open_tasks(MissionState()) == ()


def test_a_run_that_waits_for_its_start_asks_for_what_is_missing_and_is_not_green():
    state = MissionState()
    state.awaited = [AwaitedItem("navigation", "it is inactive"), AwaitedItem("clock")]
    assert texts(state) == ["Wait for navigation, or ask an engineer to start it on the robot"]
    assert (severity(state), condition(state).reason) == ("warning", "waiting for navigation")
    state.awaited = [AwaitedItem("navigation", "it is inactive"), AwaitedItem("clock", "it is silent")]
    assert texts(state) == ["Wait for navigation, clock, or ask an engineer to start them on the robot"]
    state.awaited = [AwaitedItem("navigation"), AwaitedItem("clock")]
    assert (texts(state), severity(state)) == ([], "quiet")
    state.apply(JournalEntry(1, 1, 0.0, 0.0, RUN_BEGAN, {"run": {"node": "/search"}}))
    assert not state.awaited


@pytest.mark.parametrize(("ending", "words"), [("stopped", "was stopped"), ("failed", "has failed")])
def test_an_interrupted_mission_is_resumed_or_its_robot_fetched(ending, words):
    state = mission(AWAY)
    state.apply(JournalEntry(3, 1, 2.0, 2.0, RUN_ENDED, {"ending": ending, "status": 1, "reason": ""}))
    assert (
        texts(state)[0] == f"Ask an engineer to resume the mission, or fetch the robot: its program {words}"
    )


def test_the_record_of_another_program_asks_for_nothing_that_only_its_mission_can_do():
    state = MissionState()
    about = {"imported": {"file": "run.btlog", "format": "btlog"}}
    state.apply(JournalEntry(1, 1, 0.0, 0.0, RUN_BEGAN, {"run": about}))
    state.apply(JournalEntry(2, 1, 2.0, 2.0, RUN_ENDED, {"ending": "stopped", "status": 1, "reason": ""}))
    assert texts(state) == []


def test_a_goal_of_a_crashed_run_is_over_once_the_next_run_has_sent_one_to_the_same_action():
    state = mission(AT_HOME, goal=True)
    state.apply(JournalEntry(3, 2, 5.0, 0.0, RUN_BEGAN, {"run": {"node": "/search"}}))
    assert state.goals == {"a": "navigate_to_pose"}
    state.apply(JournalEntry(4, 2, 6.0, 1.0, GOAL_SENT, {"action": "navigate_to_pose", "goal": "b"}))
    assert state.goals == {"b": "navigate_to_pose"}


def test_a_detection_is_reviewed_by_the_command_of_its_kind():
    (task,) = find_open_tasks(mission(FOUND))
    assert task == (
        "warning",
        "Review survivor_1: is it a survivor?",
        "survivor",
        "survivor_1",
        "judge_survivor",
        False,
    )
    assert severity(mission(FOUND)) == "warning"


@pytest.mark.parametrize("changes", [{"is_certain": True}, {"level": Level.GIVEN_UP}])
def test_a_detection_that_was_confirmed_or_rejected_asks_for_nothing(changes):
    assert texts(mission(FOUND._replace(**changes))) == []


def test_a_detection_whose_report_is_not_finished_at_the_end_is_passed_on_by_a_person():
    assert texts(mission(AT_HOME, FOUND, end=1)) == [
        "Report survivor_1 yourself: the mission did not finish reporting it"
    ]


def test_a_reported_detection_that_nobody_has_confirmed_is_visited_after_the_end_and_the_page_is_not_green():
    reported = FOUND._replace(level=Level.DONE)
    assert (texts(mission(AT_HOME, reported, end=0)), severity(mission(AT_HOME, reported, end=0))) == (
        ["Go to survivor_1: no person has confirmed it"],
        "warning",
    )
    assert texts(mission(AT_HOME, reported._replace(is_certain=True), end=0)) == []
    second = reported._replace(name="survivor_2")
    assert texts(mission(AT_HOME, reported, second, end=0)) == [
        "Go to survivor_1, survivor_2: no person has confirmed them"
    ]


def test_a_detection_whose_kind_has_no_command_for_a_review_is_visited_after_the_end_too():
    state = mission(AT_HOME, FOUND._replace(level=Level.DONE), end=0)
    state.situation.kinds["survivor"] = LandmarkKind("survivor", "survivors", is_found=True)
    assert texts(state) == ["Go to survivor_1: no person has confirmed it"]


def test_a_task_of_the_mission_about_a_landmark_is_told_once_also_after_the_end():
    refused = FOUND._replace(is_certain=True, task="Report survivor_1 yourself: no answer")
    assert [(task.level, task.text) for task in find_open_tasks(mission(AT_HOME, refused))] == [
        ("error", refused.task)
    ]
    assert texts(mission(AT_HOME, refused, end=1)) == [refused.task]


def test_a_zone_that_was_given_up_is_searched_by_people_at_once_and_one_that_is_open_after_the_end():
    given_up = Landmark("zone", "zone_b", 0.0, 0.0, "abandoned", Level.GIVEN_UP, "after attempt 2")
    still_open = Landmark("zone", "zone_c", 0.0, 0.0, "open")
    assert texts(mission(AT_HOME, given_up, still_open)) == ["Send people to search zone_b: abandoned"]
    assert "Send people to search zone_c: not reached" in texts(mission(AT_HOME, given_up, still_open, end=0))


@pytest.mark.parametrize(
    ("reason", "end"),
    [("the battery is low", " because the battery is low"), ("skipped by Ann", ", skipped by Ann")],
)
def test_places_that_were_given_up_for_one_reason_are_one_task_that_states_it_once(reason, end):
    zones = [
        Landmark("zone", name, 0.0, 0.0, "abandoned", Level.GIVEN_UP, reason) for name in ("zone_b", "zone_c")
    ]
    assert texts(mission(*zones)) == [f"Send people to search zone_b, zone_c: abandoned{end}"]


def test_places_of_one_state_are_one_task_with_at_most_five_names():
    gaps = [
        Landmark("gap", f"gap {number}", 0.0, 0.0, level=Level.GIVEN_UP, corners=SQUARE)
        for number in range(6)
    ]
    (task,) = find_open_tasks(mission(*gaps))
    assert task.text == "Send people to search gap 0, gap 1, gap 2, gap 3, gap 4 and 1 more: not done"
    assert (task.kind, task.name) == ("", "")


def test_the_outline_of_a_zone_that_was_given_up_is_no_second_task():
    outline = Landmark("area", "zone_b", 0.0, 0.0, "2 of 5 pieces", Level.GIVEN_UP, corners=SQUARE)
    assert texts(mission(outline)) == []


def test_a_complete_mission_with_a_gap_is_not_green():
    gap = Landmark("gap", "gap 1", 0.0, 0.0, level=Level.GIVEN_UP, corners=SQUARE)
    assert severity(mission(AT_HOME, gap, end=0)) == "warning"
    assert severity(mission(AT_HOME, end=0)) == "good"


def test_an_alarm_counts_with_its_level_until_it_is_over():
    low, broken = Alarm("low", level=30), Alarm("broken")
    assert [
        (task.level, task.text, task.is_alarm) for task in find_open_tasks(mission(alarms=(low, broken)))
    ] == [
        ("error", "broken", True),
        ("warning", "low", True),
    ]
    assert texts(mission(alarms=(low._replace(is_over=True),))) == []


def test_a_battery_below_its_limit_calls_the_robot_home_while_the_run_lasts():
    gauge = Gauge("battery", 19.0, "%", least=20.0)
    assert texts(mission(gauges=(gauge,))) == ["Call the robot back: battery 19 %, below the limit of 20 %"]
    assert texts(mission(gauges=(gauge._replace(value=20.0),))) == []
    assert texts(mission(AT_HOME, gauges=(gauge,), end=0)) == []
    at_home = texts(mission(AT_HOME, gauges=(gauge,)))
    assert at_home == ["Charge the robot: battery 19 %, below the limit of 20 %"]


def test_of_a_robot_that_comes_home_it_is_said_that_it_comes():
    state = mission(AWAY, gauges=(Gauge("battery", 19.0, "%", 20.0),))
    progress = {"target": "base", "distance": 4.0, "time_left": None}
    state.apply(JournalEntry(4, 1, 3.0, 3.0, PROGRESS, progress))
    assert texts(state) == ["Expect the robot at base: battery 19 %, below the limit of 20 %"]


def test_a_pause_is_ended_by_the_command_of_that_role():
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
def test_what_a_mission_waits_for_is_named(reason, told):
    state = mission(phase=MissionPhase("waiting", reason))
    assert texts(state) == [f"Ask an engineer for help: {told}"]


@pytest.mark.parametrize(
    ("reason", "told"),
    [("Mission complete.", ""), ("Mission complete. b was visited.", "Mission complete. b was visited.")],
)
def test_a_complete_mission_does_not_repeat_its_word_as_a_reason(reason, told):
    state = mission()
    state.apply(JournalEntry(4, 1, 3.0, 3.0, RUN_ENDED, {"ending": "over", "status": 0, "reason": reason}))
    assert condition(state)[::3] == ("complete", told)


def test_a_robot_that_failed_away_from_home_is_fetched():
    assert texts(mission(AWAY, end=1)) == ["Fetch the robot: it has not reached base"]
    assert texts(mission(AT_HOME, end=1)) == []
    assert texts(mission(end=1)) == []


@pytest.mark.parametrize("process", [RunProcess(is_gone=True), RunProcess(is_gone=False, silent_sec=60.0)])
def test_a_robot_that_may_be_driving_alone_is_stopped_at_its_button(process):
    state = mission(goal=True)
    state.apply(JournalEntry(4, 1, 3.0, 3.0, "progress", {"target": "a", "distance": 1.0, "time_left": 2.0}))
    state.process = process
    first = find_open_tasks(state)[0]
    assert (first.level, first.text) == (
        "error",
        "Press the emergency stop on the robot: STOP on the page may not reach it",
    )
    assert "may still be driving" in condition(state).reason


def test_a_crash_without_a_goal_asks_for_a_person_and_not_for_the_button():
    state = mission()
    state.process = RunProcess(is_gone=True)
    assert texts(state) == [
        "Ask an engineer to resume the mission, or fetch the robot: its program has crashed"
    ]


def test_errors_come_before_warnings():
    given_up = Landmark("zone", "zone_b", 0.0, 0.0, "abandoned", Level.GIVEN_UP)
    assert [task.level for task in find_open_tasks(mission(given_up, alarms=(Alarm("broken"),)))] == [
        "error",
        "warning",
    ]


def test_a_lost_position_is_an_error_of_its_own_and_asks_for_the_robot_to_be_found():
    state = mission(AWAY)
    state.apply(JournalEntry(3, 1, 2.0, 2.0, LACKS, {"text": "no transform", "is_position_lost": True}))
    assert condition(state)[:2] == ("position lost", "error")
    assert texts(state) == [
        "Press the robot's emergency stop if it moves, then ask an engineer to correct its position"
    ]
    state.apply(JournalEntry(4, 1, 3.0, 3.0, LACKS, {"text": ""}))
    assert severity(state) == "good"


@pytest.mark.parametrize(("least", "level"), [(None, "good"), (50.0, "good"), (80.0, "warning")])
def test_an_ended_search_with_less_than_the_wanted_probability_of_success_is_not_green(least, level):
    state = mission(AT_HOME, end=0)
    state.situation.figures["success"] = Figure("success", 57.0, unit="%", least=least)
    assert severity(state) == level


def test_a_mission_that_an_operator_has_called_home_is_ended_early_and_no_error():
    state = mission(AT_HOME)
    changed = {"phase": {"reason": "called home by Ann"}, "by": "Ann"}
    state.apply(JournalEntry(3, 1, 2.0, 2.0, "changed", changed))
    state.apply(
        JournalEntry(4, 1, 3.0, 3.0, RUN_ENDED, {"ending": "over", "status": 1, "reason": "b is left."})
    )
    assert condition(state)[:2] == ("ended early", "warning")
    assert condition(state).reason == "Called home by Ann. b is left."
