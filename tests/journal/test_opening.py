"""Which journal a run writes to, and what it does to one that is there."""

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
def place(tmp_path):
    return tmp_path / "mission.journal"


def leave(place, ending=None, **options):
    """Run a mission with one fact; without an ending it breaks off."""
    journal = open_journal(place, **options)
    journal.begin({"mission": "patrol"}, {})
    journal.record_event("zone_visited", zone="zone_a")
    if ending is not None:
        journal.end_run(ending, 1, "It was enough.")
    journal.close()


def kinds(journal):
    return [fact.kind for fact in journal.earlier_events()]


def test_a_new_mission_begins_without_facts(place):
    journal = open_journal(place)
    assert not journal.is_resumed
    assert journal.earlier_events() == []
    assert journal.active_goals() == []
    journal.close()


def test_a_run_that_does_not_begin_leaves_nothing(place):
    open_journal(place).close()
    assert list(place.parent.iterdir()) == []


@pytest.mark.parametrize("ending", [None, Ending.STOPPED, Ending.FAILED])
def test_a_mission_that_is_not_over_is_not_begun_anew_unasked(place, ending):
    leave(place, ending)
    with pytest.raises(JournalError, match=r"is not over: .* --resume, .* --new"):
        open_journal(place)


@pytest.mark.parametrize("ending", [None, Ending.STOPPED, Ending.FAILED])
def test_a_mission_that_is_not_over_goes_on_with_its_facts(place, ending):
    leave(place, ending)
    journal = open_journal(place, resume=True)
    assert journal.is_resumed
    assert kinds(journal) == ["zone_visited"]
    journal.begin({"mission": "another"}, {})
    assert journal.description == {"mission": "patrol"}
    journal.record_event("base_reached")
    journal.close()
    again = open_journal(place, resume=True)
    assert [(fact.run, fact.kind) for fact in again.earlier_events()] == [
        (1, "zone_visited"),
        (2, "base_reached"),
    ]
    again.close()


def test_new_keeps_the_former_journal_under_another_name_once_it_begins(place):
    leave(place)
    journal = open_journal(place, start_over=True)
    assert list(place.parent.glob("*.journal")) == [place]
    assert journal.earlier_events() == []
    journal.begin({"mission": "patrol"}, {})
    journal.close()
    (aside,) = set(place.parent.glob("*.journal")) - {place}
    assert re.fullmatch(r"mission\.\d{8}-\d{6}\.journal", aside.name)
    former = open_journal(aside, resume=True)
    assert kinds(former) == ["zone_visited"]
    former.close()


def test_two_journals_of_one_second_get_two_names(place):
    for _ in range(3):
        leave(place, start_over=True)
    assert len(list(place.parent.glob("*.journal"))) == 3


def test_a_new_mission_that_does_not_begin_leaves_the_former_one_as_it_was(place):
    leave(place)
    open_journal(place, start_over=True).close()
    journal = open_journal(place, resume=True)
    assert kinds(journal) == ["zone_visited"]
    journal.close()


def test_a_mission_that_is_over_makes_room_for_the_next(place):
    leave(place, Ending.OVER)
    leave(place, Ending.OVER)
    assert len(list(place.parent.glob("*.journal"))) == 2


def test_a_mission_that_is_over_is_not_resumed(place):
    leave(place, Ending.OVER)
    with pytest.raises(JournalError, match=r"is over \(It was enough\.\)"):
        open_journal(place, resume=True)


def test_where_no_file_was_named_a_mission_that_was_stopped_makes_room_for_the_next(place):
    leave(place, Ending.STOPPED)
    journal = open_journal(place, is_named=False)
    assert not journal.is_resumed
    journal.close()


def test_where_no_file_was_named_a_mission_that_broke_off_is_refused_all_the_same(place):
    leave(place)
    with pytest.raises(JournalError, match="crashed"):
        open_journal(place, is_named=False)


def test_without_a_journal_there_is_nothing_to_resume(place):
    with pytest.raises(JournalError, match=r"to resume\. Omit --resume"):
        open_journal(place, resume=True)
    assert not place.exists()


@pytest.mark.parametrize(
    "leave_empty", [lambda path: path.touch(), lambda path: JournalFile.create(path).close()]
)
def test_a_journal_in_which_nothing_has_begun_is_no_obstacle(place, leave_empty):
    leave_empty(place)
    with pytest.raises(JournalError, match="to resume"):
        open_journal(place, resume=True)
    leave(place, Ending.OVER)


def test_two_runs_at_a_time_are_one_too_many(place):
    journal = open_journal(place)
    for options in ({}, {"resume": True}, {"start_over": True}):
        with pytest.raises(JournalError, match="in another process"):
            open_journal(place, **options)
    journal.close()


def test_goals_whose_end_was_not_seen_are_left(place):
    journal = open_journal(place)
    journal.begin({}, {})
    for number in (1, 2, 3):
        journal.record_event(GOAL_SENT, action="/navigate_to_pose", goal=f"{number:032x}")
    journal.record_observation(GOAL_ENDED, goal=f"{2:032x}", status=4)
    journal.close()
    again = open_journal(place, resume=True)
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
def test_a_goal_that_could_not_be_sent_is_refused_with_its_number(place, data):
    journal = open_journal(place)
    journal.begin({}, {})
    journal.record_event(GOAL_SENT, **data)
    journal.close()
    again = open_journal(place, resume=True)
    with pytest.raises(
        JournalError, match=r"event 1 of the journal, goal_sent .* does not describe an action goal"
    ):
        again.active_goals()
    again.close()


@pytest.mark.parametrize("began", [1e300, -1e300])
def test_a_time_that_is_none_is_told_as_it_is(place, began):
    file = JournalFile.create(place)
    file.begin_run({}, {}, began)
    file.close()
    with pytest.raises(JournalError, match=f"started on {began:g}, and crashed".replace("+", r"\+")):
        open_journal(place)
    open_journal(place, start_over=True).close()


def test_entries_have_the_time_of_the_missions_clock(place):
    journal = open_journal(place)
    journal.clock = clock = ManualClock(5.0)
    journal.begin({}, {})
    clock.advance(2.5)
    journal.record_event("base_reached")
    journal.close()
    again = open_journal(place, resume=True)
    assert [fact.time for fact in again.earlier_events()] == [7.5]
    again.close()


def test_a_value_that_is_no_json_is_the_callers_mistake(place):
    journal = open_journal(place)
    journal.begin({}, {})
    with pytest.raises(TypeError, match="not JSON serializable"):
        journal.record_event("photo", image=object())
    journal.close()


def test_after_a_full_disk_what_is_told_is_of_the_same_run_still(place):
    leave(place, Ending.STOPPED)
    journal = open_journal(place, resume=True)
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
def test_the_default_place_has_the_name_of_the_node(tmp_path, node, environment, expected):
    found = default_place(node, {"XDG_STATE_HOME": str(tmp_path), **environment})
    assert found == tmp_path / "sar_compiler" / expected


def test_the_default_place_is_in_the_home_of_the_user(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    for environment in ({}, {"XDG_STATE_HOME": "relative"}):
        found = default_place("/patrol", environment)
        assert found == tmp_path / ".local/state/sar_compiler/patrol.journal"


@pytest.fixture
def simulated(tmp_path):
    """Say where the journal of a simulated run of a node is kept."""

    def place(node="/search_and_rescue", *, resume=False, domain="0"):
        environment = {"XDG_STATE_HOME": str(tmp_path), "ROS_DOMAIN_ID": domain}
        return simulated_place(node, resume=resume, environment=environment)

    return place


def test_simulated_runs_have_a_folder_of_their_own_and_a_file_each(simulated, tmp_path):
    folder = tmp_path / "sar_compiler" / "simulated"
    first = simulated()
    leave(first)
    assert first.parent == simulated().parent == folder
    assert re.fullmatch(r"search_and_rescue\.\d{8}-\d{6}\.journal", first.name)
    assert simulated() != first


def test_a_simulated_run_is_resumed_in_the_last_journal_of_its_node_and_domain(simulated):
    leave(last := simulated())
    for other in (simulated("/robot1"), simulated("/search_and_rescue/more"), simulated(domain="7")):
        leave(other)
    assert simulated(resume=True) == last
    with pytest.raises(JournalError, match="to resume"):
        open_journal(simulated("/robot2", resume=True), resume=True)


def test_the_last_ten_simulated_runs_are_kept_with_the_one_that_begins(simulated):
    places = [simulated(f"/robot{number}") for number in range(12)]
    for number, place in enumerate(places):
        leave(place)
        place.with_name(f"{place.name}-reserve").touch()
        os.utime(place, (number, number))
    delete_old_simulated(simulated())
    left = sorted(path.name for path in places[0].parent.iterdir())
    assert left == sorted(name for place in places[3:] for name in (place.name, f"{place.name}-reserve"))


def test_a_simulated_run_that_still_writes_keeps_its_journal(simulated):
    writing = open_journal(oldest := simulated("/robot0"))
    writing.begin({}, {})
    for number in range(1, 12):
        leave(simulated(f"/robot{number}"))
    os.utime(oldest, (0, 0))
    delete_old_simulated(simulated())
    assert oldest.exists()
    writing.close()
