"""What is known of a mission after the entries of its journal."""

import math

import pytest

from sar_compiler.journal.display import Gauge, Level
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.mission_state import MissionState

TREE = {
    "class": "Sequence",
    "name": "Main",
    "attributes": {},
    "file": "m.xml",
    "line": 2,
    "children": [
        {
            "class": "Drive",
            "name": "Drive",
            "attributes": {"to": "a"},
            "children": [],
            "file": "m.xml",
            "line": 3,
        },
        {"class": "Look", "name": "Look", "attributes": {}, "children": [], "file": "m.xml", "line": 4},
    ],
}
BEGAN = (
    "run_began",
    {
        "mission": "patrol",
        "tree": TREE,
        "run": {"time": 100.0, "parameters": {"speed": 1.0}},
    },
)


def after(*told, began=BEGAN):
    """Return the state after entries, which come a second apart, from 100 s of the clock on."""
    entries = [
        JournalEntry(number, 1, 1000.0 + number, 100.0 + number, kind, data)
        for number, (kind, data) in enumerate([began, *told])
    ]
    return MissionState.from_stream(entries)


POINT = {"kind": "point", "name": "a", "x": 1.0, "y": 2.0, "state": "open"}
SEEN = {**POINT, "state": "seen", "level": 2}


def status(node, status, message="", tick=1):
    return "status", {"node": node, "tick": tick, "status": status, "message": message}


def test_a_mission_that_has_begun_has_its_parameters_and_its_tree():
    state = after()
    assert (state.title, state.parameters) == ("patrol", {"speed": 1.0})
    assert [(node.name, node.depth, node.parent, node.line) for node in state.nodes] == [
        ("Main", 0, None, 2),
        ("Drive", 1, 0, 3),
        ("Look", 1, 0, 4),
    ]
    assert state.nodes[0].children == [1, 2]


def test_time_is_told_from_the_beginning_of_the_run():
    state = after(status(1, "RUNNING"))
    assert (state.now.time, state.now.wall) == (1.0, 1001.0)


def test_a_status_lasts_since_it_was_another_one_whatever_the_node_says_meanwhile():
    state = after(status(1, "RUNNING", "3 m left"), status(1, "RUNNING", "2 m left"))
    assert (state.nodes[1].status_time.time, state.nodes[1].message) == (1.0, "2 m left")


@pytest.mark.parametrize("end", ["IDLE", "HALTED"])
def test_a_node_that_has_no_part_any_more_says_nothing(end):
    state = after(status(1, "RUNNING", "navigating to zone_a"), status(1, end, "navigating to zone_a"))
    assert (state.nodes[1].has_part, state.nodes[1].message) == (False, "")


def changed(**data):
    return "changed", data


def test_what_a_mission_shows_is_what_it_has_said_last():
    state = after(
        changed(kinds=[{"name": "point", "plural": "points"}], landmarks=[POINT]), changed(landmarks=[SEEN])
    )
    (landmark,) = state.situation.of_kind("point")
    assert (landmark.state, landmark.level, state.is_told) == ("seen", Level.DONE, True)


def test_a_run_that_says_what_it_shows_begins_anew():
    state = after(
        changed(kinds=[], landmarks=[POINT]), BEGAN, changed(kinds=[], landmarks=[{**POINT, "name": "b"}])
    )
    assert [each.name for each in state.situation.landmarks.values()] == ["b"]


def test_an_alarm_is_there_since_it_was_raised_first():
    low = {"text": "low"}
    state = after(changed(alarms=[low]), changed(alarms=[{**low, "is_over": True}]))
    assert (state.since["low"].time, state.situation.alarms["low"].is_over) == (1.0, True)
    assert after(changed(alarms=[low]), changed(kinds=[])).since == {}


def test_a_fact_is_told_in_the_words_of_its_mission():
    photo = ("photo_taken", {"photo": "photo_1"})
    assert [fact.text for fact in after(photo).facts] == ["photo taken: photo: photo_1"]
    assert [fact.text for fact in after(photo, photo, changed(said="saw 1")).facts] == [
        "photo taken: photo: photo_1",
        "saw 1",
    ]


DRIVES = ("progress", {"target": "a", "distance": 3.2, "time_left": 8.0})
STUCK = ("breakpoint", {"text": "held before a"})
LOST = ("lacks", {"text": "no localisation"})
HELD = changed(phase={"name": "held", "reason": "by the operator", "place": "a"})


@pytest.mark.parametrize(
    ("told", "name", "reason"),
    [
        ([], "working", ""),
        ([DRIVES], "driving", ""),
        ([DRIVES, LOST], "waiting", "no localisation"),
        ([DRIVES, LOST, HELD], "held", "by the operator"),
        ([HELD, STUCK], "waiting", "held before a"),
        ([STUCK, ("breakpoint", {"text": ""})], "working", ""),
        ([("run_ended", {"ending": "failed", "status": 1, "reason": "no"}), BEGAN], "working", ""),
    ],
)
def test_what_a_mission_is_at_is_one_word_with_its_reason(told, name, reason):
    assert after(*told).phase[:2] == (name, reason)


def test_where_a_mission_is_at_work_is_known_whatever_keeps_it():
    assert after(HELD, LOST).phase.place == "a"


def test_a_drive_has_what_is_left_until_its_goal_ends():
    progress = ("progress", {"target": "zone_a", "distance": 3.2, "time_left": 8.0})
    goal = ("goal_sent", {"action": "/navigate_to_pose", "goal": "ab"})
    assert after(goal, progress).drive == ("zone_a", 3.2, 8.0)
    assert after(goal, progress).goals == {"ab": "/navigate_to_pose"}
    state = after(goal, progress, ("goal_ended", {"goal": "ab", "status": 4}))
    assert (state.drive, state.goals) == (None, {})


def test_what_the_robot_lacks_is_known_until_it_can_drive_again():
    lost = ("lacks", {"text": "Nav2 is not active: node amcl: missing"})
    assert after(lost).lacks == "Nav2 is not active: node amcl: missing"
    assert after(lost, ("lacks", {"text": ""})).lacks == ""


def test_the_battery_is_what_the_robot_says_unless_the_mission_says_it():
    low = ("battery", {"share": 0.186})
    assert after(low).gauges == [Gauge("battery", 19, "%")]
    own = Gauge("battery", 18.6, "%", 20.0)
    assert after(low, changed(gauges=[own._asdict()])).gauges == [own]
    assert after(("battery", {"share": None})).gauges == []


def test_the_limit_of_the_battery_is_said_once():
    told = (("battery", {"share": 0.5, "at_least": 0.2}), ("battery", {"share": 0.186}))
    assert after(*told).gauges == [Gauge("battery", 19, "%", 20)]


def test_the_trail_has_every_pose():
    state = after(("pose", {"x": 1.0, "y": 2.0, "yaw": 0.5}), ("pose", {"x": 2.0, "y": 2.0, "yaw": 0.5}))
    assert [(pose.at.time, pose.x) for pose in state.trail] == [(1.0, 1.0), (2.0, 2.0)]
    assert state.pose == state.trail[-1]


def test_a_plan_in_another_frame_is_not_shown_on_the_map():
    assert after(("plan", {"frame": "map", "points": [[1, 2]]})).plan == [(1.0, 2.0)]
    assert after(("plan", {"frame": "odom", "points": [[1, 2]]})).plan == []


def test_a_second_run_begins_with_the_tree_anew_and_with_what_the_first_has_done():
    state = after(status(0, "RUNNING"), changed(landmarks=[SEEN]), BEGAN)
    assert len(state.runs) == 2
    assert state.nodes[0].status == ""
    assert state.situation.landmarks


def test_a_run_that_has_ended_says_how():
    run = after(("run_ended", {"ending": "over", "status": 1, "reason": "no"})).runs[-1]
    assert (run.ending, run.status, run.reason, run.ended.time) == ("over", 1, "no", 1.0)


@pytest.mark.parametrize(
    "entry",
    [
        ("status", {"node": 99, "tick": 1, "status": "RUNNING", "message": ""}),
        ("status", {"node": "Drive"}),
        ("pose", {"x": math.nan, "y": 0.0, "yaw": 0.0}),
        ("pose", {}),
        ("changed", {"landmarks": [{"kind": "point"}]}),
        ("changed", {"landmarks": [{**POINT, "x": math.nan}]}),
        ("changed", {"alarms": "all"}),
        ("written", {"by": "me"}),
        ("run_ended", {"ending": "over", "status": 0, "reason": "", "more": 1}),
    ],
)
def test_what_is_not_of_this_form_is_kept_as_it_is_and_changes_nothing(entry):
    state, before = after(entry), after()
    assert [(each.kind, each.data) for each in state.facts] == [entry]
    assert (state.pose, state.trail, state.situation.landmarks) == (None, [], {})
    assert [node.status for node in state.nodes] == ["", "", ""]
    assert state.runs[-1].ending == before.runs[-1].ending


def test_what_a_mission_has_written_of_its_own_is_kept_in_its_order():
    photo = ("photo_taken", {"photo": "photo_1"})
    state = after(photo, status(1, "RUNNING"), ("pose", {"x": 1.0, "y": 2.0, "yaw": 0.5}), ("point_left", {}))
    assert [(each.at.time, each.kind, each.data) for each in state.facts] == [
        (1.0, *photo),
        (4.0, "point_left", {}),
    ]


def test_a_journal_without_a_mission_has_a_tree():
    state = after(began=("run_began", {"mission": None, "identity": {}, "tree": TREE, "run": {}}))
    assert (len(state.nodes), state.title, state.is_told) == (3, "Main", False)


WATCHED = (
    "properties_watched",
    {"properties": [{"name": "a", "if_broken": "tell"}, {"name": "b", "if_broken": "hold"}]},
)
BROKEN = ("property_broken", {"property": "a", "event": "Drive aborted", "tick": 3, "owed": False})


def words(state):
    return {name: state.word_of(each) for name, each in state.properties.items()}


def test_a_run_that_is_not_watched_has_no_properties():
    assert after().properties == {}


def test_a_watched_property_says_what_is_done_where_it_is_broken():
    assert [each.if_broken for each in after(WATCHED).properties.values()] == ["tell", "hold"]


def test_a_property_is_watched_until_it_is_broken_and_kept_at_the_end_of_the_run():
    end = ("run_ended", {"ending": "over", "status": 0, "reason": ""})
    assert words(after(WATCHED)) == {"a": "watched", "b": "watched"}
    assert words(after(WATCHED, BROKEN)) == {"a": "broken", "b": "watched"}
    assert words(after(WATCHED, BROKEN, end)) == {"a": "broken", "b": "kept"}


def test_something_is_owed_until_it_comes_or_the_property_is_broken():
    owed = ("properties_owed", {"owed": ["a", "b"]})
    assert words(after(WATCHED, owed)) == {"a": "owed", "b": "owed"}
    assert words(after(WATCHED, owed, BROKEN)) == {"a": "broken", "b": "owed"}
    assert words(after(WATCHED, owed, ("properties_owed", {"owed": []}))) == {"a": "watched", "b": "watched"}


def test_a_property_is_broken_since_its_first_breach_and_by_that():
    later = ("property_broken", {**BROKEN[1], "event": "Look failed"})
    broken = after(WATCHED, BROKEN, later).properties["a"]
    assert broken.broken is not None
    assert (broken.broken.time, broken.event, broken.if_broken) == (2.0, "Drive aborted", "tell")


def test_a_breach_and_a_failed_assumption_are_facts():
    state = after(
        WATCHED, BROKEN, ("assumption_failed", {"assumption": "no loss"}), ("assumption_failed", {})
    )
    assert [each.kind for each in state.facts] == [
        "property_broken",
        "assumption_failed",
        "assumption_failed",
    ]
    assert state.facts[0].text == "property broken: property: a, event: Drive aborted, tick: 3, owed: false"
    assert state.assumption_failed_at is not None
    assert state.assumption_failed_at.time == 3.0


def test_a_breach_of_what_nobody_has_said_is_watched_is_known_all_the_same():
    assert words(after(BROKEN)) == {"a": "broken"}


def test_the_next_run_is_watched_anew():
    state = after(WATCHED, BROKEN, ("assumption_failed", {}), BEGAN)
    assert (state.properties, state.assumption_failed_at) == ({}, None)


@pytest.mark.parametrize(
    "entry",
    [("properties_watched", {"properties": [3]}), ("properties_owed", {"owed": 3}), ("property_broken", {})],
)
def test_an_entry_of_the_same_name_from_somebody_else_is_a_fact(entry):
    state = after(WATCHED, entry)
    assert words(state) == {"a": "watched", "b": "watched"}
    assert [each.kind for each in state.facts] == [entry[0]]


def test_an_exception_of_a_leaf_is_told_in_its_own_words():
    state = after(("leaf_raised", {"node": 0, "text": "'Look' (Look) failed: no lens"}))
    assert [fact.text for fact in state.facts] == [
        "an exception has ended the run: 'Look' (Look) failed: no lens"
    ]


@pytest.mark.parametrize("earlier", [[], [BEGAN]])
def test_a_log_line_before_a_run_begins_has_the_time_zero(earlier):
    state = MissionState.from_stream(
        [JournalEntry(1, 1, 1000.0, 100.0, kind, data) for kind, data in earlier]
    )
    state.apply(JournalEntry(9, 2, 2000.0, 7000.0, "log", {"level": 20, "text": "waiting"}))
    assert (state.now.run, state.now.time) == (2, 0.0)
