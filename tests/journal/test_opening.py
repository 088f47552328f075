"""Tests of choosing and opening the journal of a run, and of handling an existing one."""

import os
import re

import pytest

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT, Ending, JournalEntry
from sar_compiler.journal.journal_opening import (
    default_place,
    delete_old_simulated,
    open_journal,
    simulated_place,
)
from sar_compiler.runtime.clock import ManualClock


@pytest.fixture
def journal_path(tmp_path):
    return tmp_path / "mission.journal"


def run_mission(journal_path, ending=None, **options):
    """Write the journal of a run with one event; without `ending`, the run has crashed."""
    journal = open_journal(journal_path, **options)
    journal.begin({"mission": "patrol"}, {})
    journal.record_event("zone_visited", zone="zone_a")
    if ending is not None:
        journal.end_run(ending, 1, "It was enough.")
    journal.close()


def kinds(journal):
    return [fact.kind for fact in journal.earlier_events()]


def test_new_mission_begins_without_events(journal_path):
    journal = open_journal(journal_path)
    assert not journal.is_resumed
    assert journal.earlier_events() == []
    assert journal.active_goals() == []
    journal.close()


def test_run_that_does_not_begin_leaves_no_file(journal_path):
    open_journal(journal_path).close()
    assert list(journal_path.parent.iterdir()) == []


@pytest.mark.parametrize("ending", [None, Ending.STOPPED, Ending.FAILED])
def test_unfinished_mission_is_not_restarted_without_option(journal_path, ending):
    run_mission(journal_path, ending)
    with pytest.raises(JournalError, match=r"is not over: .* --resume, .* --new"):
        open_journal(journal_path)


@pytest.mark.parametrize("ending", [None, Ending.STOPPED, Ending.FAILED])
def test_unfinished_mission_resumes_with_its_events(journal_path, ending):
    run_mission(journal_path, ending)
    journal = open_journal(journal_path, resume=True)
    assert journal.is_resumed
    assert kinds(journal) == ["zone_visited"]
    journal.begin({"mission": "another"}, {})
    assert journal.description == {"mission": "patrol"}
    journal.record_event("base_reached")
    journal.close()
    again = open_journal(journal_path, resume=True)
    assert [(fact.run, fact.kind) for fact in again.earlier_events()] == [
        (1, "zone_visited"),
        (2, "base_reached"),
    ]
    again.close()


def test_start_over_renames_previous_journal_when_run_begins(journal_path):
    run_mission(journal_path)
    journal = open_journal(journal_path, start_over=True)
    assert list(journal_path.parent.glob("*.journal")) == [journal_path]
    assert journal.earlier_events() == []
    journal.begin({"mission": "patrol"}, {})
    journal.close()
    (aside,) = set(journal_path.parent.glob("*.journal")) - {journal_path}
    assert re.fullmatch(r"mission\.\d{8}-\d{6}\.journal", aside.name)
    former = open_journal(aside, resume=True)
    assert kinds(former) == ["zone_visited"]
    former.close()


def test_journals_renamed_in_same_second_get_different_names(journal_path):
    for _ in range(3):
        run_mission(journal_path, start_over=True)
    assert len(list(journal_path.parent.glob("*.journal"))) == 3


def test_start_over_that_does_not_begin_keeps_previous_journal(journal_path):
    run_mission(journal_path)
    open_journal(journal_path, start_over=True).close()
    journal = open_journal(journal_path, resume=True)
    assert kinds(journal) == ["zone_visited"]
    journal.close()


def test_next_mission_renames_journal_of_finished_one(journal_path):
    run_mission(journal_path, Ending.OVER)
    run_mission(journal_path, Ending.OVER)
    assert len(list(journal_path.parent.glob("*.journal"))) == 2


def test_finished_mission_is_not_resumed(journal_path):
    run_mission(journal_path, Ending.OVER)
    with pytest.raises(JournalError, match=r"is over \(It was enough\.\)"):
        open_journal(journal_path, resume=True)


def test_stopped_mission_in_default_journal_is_replaced(journal_path):
    run_mission(journal_path, Ending.STOPPED)
    journal = open_journal(journal_path, is_named=False)
    assert not journal.is_resumed
    journal.close()


def test_crashed_mission_in_default_journal_is_not_replaced(journal_path):
    run_mission(journal_path)
    with pytest.raises(JournalError, match="crashed"):
        open_journal(journal_path, is_named=False)


def test_missing_journal_cannot_be_resumed(journal_path):
    with pytest.raises(JournalError, match=r"to resume\. Omit --resume"):
        open_journal(journal_path, resume=True)
    assert not journal_path.exists()


@pytest.mark.parametrize(
    "leave_empty", [lambda path: path.touch(), lambda path: JournalFile.create(path).close()]
)
def test_empty_journal_cannot_be_resumed_but_is_replaced(journal_path, leave_empty):
    leave_empty(journal_path)
    with pytest.raises(JournalError, match="to resume"):
        open_journal(journal_path, resume=True)
    run_mission(journal_path, Ending.OVER)


def test_second_simultaneous_run_is_refused(journal_path):
    journal = open_journal(journal_path)
    for options in ({}, {"resume": True}, {"start_over": True}):
        with pytest.raises(JournalError, match="in another process"):
            open_journal(journal_path, **options)
    journal.close()


def test_goals_without_recorded_end_are_active(journal_path):
    journal = open_journal(journal_path)
    journal.begin({}, {})
    for number in (1, 2, 3):
        journal.record_event(GOAL_SENT, action="/navigate_to_pose", goal=f"{number:032x}")
    journal.record_observation(GOAL_ENDED, goal=f"{2:032x}", status=4)
    journal.close()
    again = open_journal(journal_path, resume=True)
    assert [(goal.action, int(goal.goal_id, 16)) for goal in again.active_goals()] == [
        ("/navigate_to_pose", 1),
        ("/navigate_to_pose", 3),
    ]
    again.close()


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"action": "/navigate_to_pose", "goal": "7"},
        {"action": "/navigate_to_pose", "goal": ["7"]},
        {"action": "/a b", "goal": "0" * 32},
        {"action": "navigate", "goal": "0" * 32},
    ],
)
def test_invalid_goal_event_is_rejected_with_its_number(journal_path, data):
    journal = open_journal(journal_path)
    journal.begin({}, {})
    journal.record_event(GOAL_SENT, **data)
    journal.close()
    again = open_journal(journal_path, resume=True)
    with pytest.raises(
        JournalError, match=r"event 1 of the journal, goal_sent .* does not describe an action goal"
    ):
        again.active_goals()
    again.close()


@pytest.mark.parametrize("began", [1e300, -1e300])
def test_start_time_out_of_range_is_printed_as_number(journal_path, began):
    file = JournalFile.create(journal_path)
    file.begin_run({}, {}, began)
    file.close()
    with pytest.raises(JournalError, match=f"started on {began:g}, and crashed".replace("+", r"\+")):
        open_journal(journal_path)
    open_journal(journal_path, start_over=True).close()


def test_entries_have_time_of_mission_clock(journal_path):
    journal = open_journal(journal_path)
    journal.clock = clock = ManualClock(5.0)
    journal.begin({}, {})
    clock.advance(2.5)
    journal.record_event("base_reached")
    journal.close()
    again = open_journal(journal_path, resume=True)
    assert [fact.time for fact in again.earlier_events()] == [7.5]
    again.close()


def test_value_that_is_not_json_raises_type_error(journal_path):
    journal = open_journal(journal_path)
    journal.begin({}, {})
    with pytest.raises(TypeError, match="not JSON serializable"):
        journal.record_event("photo", image=object())
    journal.close()


def test_entries_keep_run_number_if_writing_fails(journal_path):
    run_mission(journal_path, Ending.STOPPED)
    journal = open_journal(journal_path, resume=True)
    told: list[JournalEntry] = []
    journal.add_listener(told.append)
    journal.begin({}, {})
    assert journal._file is not None
    journal._file._connection.execute("PRAGMA query_only = 1")
    journal.record_event("base_reached")
    journal.end_run(Ending.OVER, 0)
    journal.close()
    assert [(entry.run, entry.kind) for entry in told] == [
        (2, "run_began"),
        (2, "base_reached"),
        (2, "run_ended"),
    ]


@pytest.mark.parametrize(
    ("node", "environment", "expected"),
    [
        ("/search_and_rescue", {}, "search_and_rescue.journal"),
        ("/robot1/search_and_rescue", {"ROS_DOMAIN_ID": "0"}, "robot1.search_and_rescue.journal"),
        ("/patrol", {"ROS_DOMAIN_ID": "42"}, "patrol.domain_42.journal"),
    ],
)
def test_default_path_contains_node_name(tmp_path, node, environment, expected):
    found = default_place(node, {"XDG_STATE_HOME": str(tmp_path), **environment})
    assert found == tmp_path / "sar_compiler" / expected


def test_default_path_is_in_home_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    for environment in ({}, {"XDG_STATE_HOME": "relative"}):
        found = default_place("/patrol", environment)
        assert found == tmp_path / ".local/state/sar_compiler/patrol.journal"


@pytest.fixture
def simulated(tmp_path):
    """Return a function that returns the journal path of a simulated run."""

    def journal_path(node="/search_and_rescue", *, resume=False, domain="0"):
        environment = {"XDG_STATE_HOME": str(tmp_path), "ROS_DOMAIN_ID": domain}
        return simulated_place(node, resume=resume, environment=environment)

    return journal_path


def test_simulated_runs_have_separate_files_in_own_folder(simulated, tmp_path):
    folder = tmp_path / "sar_compiler" / "simulated"
    first = simulated()
    run_mission(first)
    assert first.parent == simulated().parent == folder
    assert re.fullmatch(r"search_and_rescue\.\d{8}-\d{6}\.journal", first.name)
    assert simulated() != first


def test_simulated_run_resumes_last_journal_of_its_node_and_domain(simulated):
    run_mission(last := simulated())
    for other in (simulated("/robot1"), simulated("/search_and_rescue/more"), simulated(domain="7")):
        run_mission(other)
    assert simulated(resume=True) == last
    with pytest.raises(JournalError, match="to resume"):
        open_journal(simulated("/robot2", resume=True), resume=True)


def test_ten_simulated_runs_are_kept_including_new_one(simulated):
    places = [simulated(f"/robot{number}") for number in range(12)]
    for number, journal_path in enumerate(places):
        run_mission(journal_path)
        journal_path.with_name(f"{journal_path.name}-reserve").touch()
        os.utime(journal_path, (number, number))
    delete_old_simulated(simulated())
    left = sorted(path.name for path in places[0].parent.iterdir())
    assert left == sorted(
        name for journal_path in places[3:] for name in (journal_path.name, f"{journal_path.name}-reserve")
    )


def test_journal_of_active_simulated_run_is_not_deleted(simulated):
    writing = open_journal(oldest := simulated("/robot0"))
    writing.begin({}, {})
    for number in range(1, 12):
        run_mission(simulated(f"/robot{number}"))
    os.utime(oldest, (0, 0))
    delete_old_simulated(simulated())
    assert oldest.exists()
    writing.close()
