"""Tests of the mission state that results from journal entries."""

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


def state_after(*told, began=BEGAN):
    """Return the state after entries that are 1 s apart, starting at 100 s of the mission's clock."""
    entries = [
        JournalEntry(number, 1, 1000.0 + number, 100.0 + number, kind, data)
        for number, (kind, data) in enumerate([began, *told])
    ]
    return MissionState.from_stream(entries)


POINT = {"kind": "point", "name": "a", "x": 1.0, "y": 2.0, "state": "open"}
SEEN = {**POINT, "state": "seen", "level": 2}


def status(node, status, message="", tick=1):
    return "status", {"node": node, "tick": tick, "status": status, "message": message}


def test_started_mission_has_parameters_and_tree():
    state = state_after()
    assert (state.title, state.parameters) == ("patrol", {"speed": 1.0})
    assert [(node.name, node.depth, node.parent, node.line) for node in state.nodes] == [
        ("Main", 0, None, 2),
        ("Drive", 1, 0, 3),
        ("Look", 1, 0, 4),
    ]
    assert state.nodes[0].children == [1, 2]


def test_time_is_measured_from_start_of_run():
    state = state_after(status(1, "RUNNING"))
    assert (state.now.time, state.now.wall) == (1.0, 1001.0)


def test_status_time_is_that_of_last_status_change():
    state = state_after(status(1, "RUNNING", "3 m left"), status(1, "RUNNING", "2 m left"))
    assert (state.nodes[1].status_time.time, state.nodes[1].message) == (1.0, "2 m left")


@pytest.mark.parametrize("end", ["IDLE", "HALTED"])
def test_idle_or_halted_node_has_no_message(end):
    state = state_after(status(1, "RUNNING", "navigating to zone_a"), status(1, end, "navigating to zone_a"))
    assert (state.nodes[1].has_part, state.nodes[1].message) == (False, "")


def changed(**data):
    return "changed", data


def test_display_has_latest_landmark_state():
    state = state_after(
        changed(kinds=[{"name": "point", "plural": "points"}], landmarks=[POINT]), changed(landmarks=[SEEN])
    )
    (landmark,) = state.situation.of_kind("point")
    assert (landmark.state, landmark.level, state.is_told) == ("seen", Level.DONE, True)


def test_new_run_replaces_display():
    state = state_after(
        changed(kinds=[], landmarks=[POINT]), BEGAN, changed(kinds=[], landmarks=[{**POINT, "name": "b"}])
    )
    assert [each.name for each in state.situation.landmarks.values()] == ["b"]


def test_alarm_keeps_time_of_first_report():
    low = {"text": "low"}
    state = state_after(changed(alarms=[low]), changed(alarms=[{**low, "is_over": True}]))
    assert (state.since["low"].time, state.situation.alarms["low"].is_over) == (1.0, True)
    assert state_after(changed(alarms=[low]), changed(kinds=[])).since == {}


def test_event_has_sentence_of_mission_or_default_text():
    photo = ("photo_taken", {"photo": "photo_1"})
    assert [fact.text for fact in state_after(photo).facts] == ["photo taken: photo: photo_1"]
    assert [fact.text for fact in state_after(photo, photo, changed(said="saw 1")).facts] == [
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
def test_phase_is_one_word_with_reason(told, name, reason):
    assert state_after(*told).phase[:2] == (name, reason)


def test_location_of_phase_is_known_while_waiting():
    assert state_after(HELD, LOST).phase.place == "a"


def test_drive_has_remaining_distance_until_its_goal_ends():
    progress = ("progress", {"target": "zone_a", "distance": 3.2, "time_left": 8.0})
    goal = ("goal_sent", {"action": "/navigate_to_pose", "goal": "ab"})
    assert state_after(goal, progress).drive == ("zone_a", 3.2, 8.0)
    assert state_after(goal, progress).goals == {"ab": "/navigate_to_pose"}
    state = state_after(goal, progress, ("goal_ended", {"goal": "ab", "status": 4}))
    assert (state.drive, state.goals) == (None, {})


def test_missing_requirement_is_known_until_robot_can_drive():
    lost = ("lacks", {"text": "Nav2 is not active: node amcl: missing"})
    assert state_after(lost).lacks == "Nav2 is not active: node amcl: missing"
    assert state_after(lost, ("lacks", {"text": ""})).lacks == ""


def test_battery_gauge_of_mission_replaces_that_of_robot():
    low = ("battery", {"share": 0.186})
    assert state_after(low).gauges == [Gauge("battery", 19, "%")]
    own = Gauge("battery", 18.6, "%", 20.0)
    assert state_after(low, changed(gauges=[own._asdict()])).gauges == [own]
    assert state_after(("battery", {"share": None})).gauges == []


def test_battery_limit_is_kept_from_earlier_entry():
    told = (("battery", {"share": 0.5, "at_least": 0.2}), ("battery", {"share": 0.186}))
    assert state_after(*told).gauges == [Gauge("battery", 19, "%", 20)]


def test_trail_has_every_pose():
    state = state_after(
        ("pose", {"x": 1.0, "y": 2.0, "yaw": 0.5}), ("pose", {"x": 2.0, "y": 2.0, "yaw": 0.5})
    )
    assert [(pose.at.time, pose.x) for pose in state.trail] == [(1.0, 1.0), (2.0, 2.0)]
    assert state.pose == state.trail[-1]


def test_plan_in_other_frame_is_ignored():
    assert state_after(("plan", {"frame": "map", "points": [[1, 2]]})).plan == [(1.0, 2.0)]
    assert state_after(("plan", {"frame": "odom", "points": [[1, 2]]})).plan == []


def test_second_run_resets_tree_and_keeps_display():
    state = state_after(status(0, "RUNNING"), changed(landmarks=[SEEN]), BEGAN)
    assert len(state.runs) == 2
    assert state.nodes[0].status == ""
    assert state.situation.landmarks


def test_ended_run_has_ending_status_and_reason():
    run = state_after(("run_ended", {"ending": "over", "status": 1, "reason": "no"})).runs[-1]
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
def test_malformed_entry_is_kept_as_event_and_changes_nothing(entry):
    state, before = state_after(entry), state_after()
    assert [(each.kind, each.data) for each in state.facts] == [entry]
    assert (state.pose, state.trail, state.situation.landmarks) == (None, [], {})
    assert [node.status for node in state.nodes] == ["", "", ""]
    assert state.runs[-1].ending == before.runs[-1].ending


def test_events_of_mission_are_kept_in_order():
    photo = ("photo_taken", {"photo": "photo_1"})
    state = state_after(
        photo, status(1, "RUNNING"), ("pose", {"x": 1.0, "y": 2.0, "yaw": 0.5}), ("point_left", {})
    )
    assert [(each.at.time, each.kind, each.data) for each in state.facts] == [
        (1.0, *photo),
        (4.0, "point_left", {}),
    ]


def test_journal_without_mission_has_tree():
    state = state_after(began=("run_began", {"mission": None, "identity": {}, "tree": TREE, "run": {}}))
    assert (len(state.nodes), state.title, state.is_told) == (3, "Main", False)


WATCHED = (
    "properties_watched",
    {"properties": [{"name": "a", "if_broken": "tell"}, {"name": "b", "if_broken": "hold"}]},
)
BROKEN = ("property_broken", {"property": "a", "event": "Drive aborted", "tick": 3, "owed": False})


def property_words(state):
    return {name: state.word_of(each) for name, each in state.properties.items()}


def test_unmonitored_run_has_no_properties():
    assert state_after().properties == {}


def test_monitored_property_has_response_to_violation():
    assert [each.if_broken for each in state_after(WATCHED).properties.values()] == ["tell", "hold"]


def test_property_is_watched_until_violation_or_kept_at_end():
    end = ("run_ended", {"ending": "over", "status": 0, "reason": ""})
    assert property_words(state_after(WATCHED)) == {"a": "watched", "b": "watched"}
    assert property_words(state_after(WATCHED, BROKEN)) == {"a": "broken", "b": "watched"}
    assert property_words(state_after(WATCHED, BROKEN, end)) == {"a": "broken", "b": "kept"}


def test_property_is_owed_until_required_event_or_violation():
    owed = ("properties_owed", {"owed": ["a", "b"]})
    assert property_words(state_after(WATCHED, owed)) == {"a": "owed", "b": "owed"}
    assert property_words(state_after(WATCHED, owed, BROKEN)) == {"a": "broken", "b": "owed"}
    assert property_words(state_after(WATCHED, owed, ("properties_owed", {"owed": []}))) == {
        "a": "watched",
        "b": "watched",
    }


def test_property_keeps_time_and_event_of_first_violation():
    later = ("property_broken", {**BROKEN[1], "event": "Look failed"})
    broken = state_after(WATCHED, BROKEN, later).properties["a"]
    assert broken.broken is not None
    assert (broken.broken.time, broken.event, broken.if_broken) == (2.0, "Drive aborted", "tell")


def test_violation_and_failed_assumption_are_events():
    state = state_after(
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


def test_violation_of_unannounced_property_is_known():
    assert property_words(state_after(BROKEN)) == {"a": "broken"}


def test_next_run_resets_properties():
    state = state_after(WATCHED, BROKEN, ("assumption_failed", {}), BEGAN)
    assert (state.properties, state.assumption_failed_at) == ({}, None)


@pytest.mark.parametrize(
    "entry",
    [("properties_watched", {"properties": [3]}), ("properties_owed", {"owed": 3}), ("property_broken", {})],
)
def test_malformed_property_entry_is_kept_as_event(entry):
    state = state_after(WATCHED, entry)
    assert property_words(state) == {"a": "watched", "b": "watched"}
    assert [each.kind for each in state.facts] == [entry[0]]


def test_exception_of_leaf_has_its_text():
    state = state_after(("leaf_raised", {"node": 0, "text": "'Look' (Look) failed: no lens"}))
    assert [fact.text for fact in state.facts] == [
        "an exception has ended the run: 'Look' (Look) failed: no lens"
    ]


@pytest.mark.parametrize("earlier", [[], [BEGAN]])
def test_log_line_before_start_of_run_has_time_zero(earlier):
    state = MissionState.from_stream(
        [JournalEntry(1, 1, 1000.0, 100.0, kind, data) for kind, data in earlier]
    )
    state.apply(JournalEntry(9, 2, 2000.0, 7000.0, "log", {"level": 20, "text": "waiting"}))
    assert (state.now.run, state.now.time) == (2, 0.0)
