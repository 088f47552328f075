"""What is known of a mission after the entries of its journal."""

import math

import pytest

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.mission_state import MissionState, Position

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
ZONES = [{"id": "zone_a", "x": 1.0, "y": 2.0, "yaw": 0.0}, {"id": "zone_b", "x": 3.0, "y": 4.0, "yaw": 0.0}]
BEGAN = (
    "run_began",
    {
        "mission": "search_and_rescue",
        "identity": {"zones": ZONES, "base_station": {"x": 0.0, "y": 0.5, "yaw": 0.0}},
        "tree": TREE,
        "run": {"time": 100.0, "parameters": {"geofence": [0, 0, 4, 0, 4, 4]}},
    },
)


def after(*told, began=BEGAN):
    """Return the state after entries, which come a second apart, from 100 s of the clock on."""
    entries = [
        JournalEntry(number, 1, 1000.0 + number, 100.0 + number, kind, data)
        for number, (kind, data) in enumerate([began, *told])
    ]
    return MissionState.of(entries)


def status(node, status, message="", tick=1):
    return "status", {"node": node, "tick": tick, "status": status, "message": message}


def test_a_mission_that_has_begun_has_its_plan_and_its_tree():
    state = after()
    assert {name: zone.place for name, zone in state.zones.items()} == {
        "zone_a": (1.0, 2.0),
        "zone_b": (3.0, 4.0),
    }
    assert state.base == (0.0, 0.5)
    assert state.fence == [(0, 0), (4, 0), (4, 4)]
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
    assert (state.nodes[1].since.time, state.nodes[1].message) == (1.0, "2 m left")


@pytest.mark.parametrize("end", ["IDLE", "HALTED"])
def test_a_node_that_has_no_part_any_more_says_nothing(end):
    state = after(status(1, "RUNNING", "navigating to zone_a"), status(1, end, "navigating to zone_a"))
    assert (state.nodes[1].has_part, state.nodes[1].message) == (False, "")


def test_a_zone_goes_from_open_to_visited():
    told = [("zone_started", {"zone": "zone_a"}), ("zone_searched", {"zone": "zone_a", "survivor": None})]
    assert after(told[0]).zones["zone_a"].state == "under way"
    assert after(told[0]).zone == "zone_a"
    state = after(*told, ("zone_visited", {"zone": "zone_a"}))
    zone = state.zones["zone_a"]
    assert (state.zone, zone.state, zone.started.time, zone.left.time) == ("", "visited", 1.0, 3.0)


STARTED = ("zone_started", {"zone": "zone_a"})
SEARCHED = ("zone_searched", {"zone": "zone_a", "survivor": None})
ABANDONED = ("zone_abandoned", {"zone": "zone_a", "attempts": 3, "reason": ""})
STOPPED = ("run_ended", {"ending": "stopped", "status": 130, "reason": ""})


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ([], "not searched"),
        ([STARTED], "not searched"),
        ([STARTED, SEARCHED], "searched"),
        ([STARTED, SEARCHED, ("zone_visited", {"zone": "zone_a"})], "searched"),
        ([STARTED, ("zone_visited", {"zone": "zone_a"})], "visited, not searched"),
        ([STARTED, SEARCHED, ("zone_postponed", {"zone": "zone_a"})], "searched"),
        ([STARTED, ABANDONED], "not searched, given up"),
        ([STARTED, SEARCHED, ABANDONED], "searched, given up"),
    ],
)
def test_of_a_zone_it_is_said_whether_it_was_searched_wherever_the_robot_was(told, words):
    assert after(*told).zones["zone_a"].said == words


@pytest.mark.parametrize("end", [STOPPED, BEGAN, ("zone_started", {"zone": "zone_b"})])
@pytest.mark.parametrize("told", [[STARTED], [STARTED, SEARCHED]])
def test_a_zone_is_under_way_no_longer_than_the_run_or_until_another_one_is(told, end):
    state = after(*told, end)
    assert state.zones["zone_a"].state == "open"
    assert state.zone == ("zone_b" if end[0] == "zone_started" else "")


def test_a_zone_that_is_postponed_comes_last():
    state = after(("zone_started", {"zone": "zone_a"}), ("zone_postponed", {"zone": "zone_a"}))
    assert list(state.zones) == ["zone_b", "zone_a"]
    assert state.zones["zone_a"].state == "open"


def test_a_zone_that_is_given_up_has_the_reason():
    state = after(("zone_abandoned", {"zone": "zone_a", "attempts": 3, "reason": ""}))
    assert state.zones["zone_a"].reason == "it was not reached in 3 attempts"


def test_a_zone_that_the_operator_adds_is_in_the_plan():
    state = after(("zone_added", {"id": "zone_x", "x": 5.0, "y": 6.0, "yaw": 0.0}))
    assert state.zones["zone_x"].place == (5.0, 6.0)


FOUND = ("zone_searched", {"zone": "zone_a", "survivor": [1.5, 2.5]})
NAMED = ("survivor_named", {"survivor": "survivor_1", "x": 1.5, "y": 2.5, "possibly": None})


def test_a_survivor_is_found_named_reported_and_acknowledged():
    sent, done = (
        ("report_sent", {"survivor": "survivor_1"}),
        ("report_acknowledged", {"survivor": "survivor_1"}),
    )
    (survivor,) = after(FOUND, NAMED, sent, done).survivors
    assert (survivor.name, survivor.zone, survivor.place) == ("survivor_1", "zone_a", (1.5, 2.5))
    assert (survivor.found.time, survivor.sent.time, survivor.acknowledged.time) == (1.0, 3.0, 4.0)
    assert (survivor.report, survivor.standing) == ("acknowledged", "candidate")


def test_somebody_found_again_at_the_same_place_is_no_other():
    assert len(after(FOUND, FOUND).survivors) == 1


def test_the_operator_s_word_counts():
    judged = ("survivor_judged", {"survivor": "survivor_1", "standing": "merged", "same_as": "survivor_0"})
    state = after(FOUND, NAMED, judged)
    assert (state.survivors[0].standing, state.survivors[0].possibly) == ("merged", "survivor_0")
    assert [order.text for order in state.orders] == ["survivor_1 is merged with survivor_0"]


def test_a_drive_has_what_is_left_until_its_goal_ends():
    progress = ("progress", {"target": "zone_a", "distance": 3.2, "time_left": 8.0})
    goal = ("goal_sent", {"action": "/navigate_to_pose", "goal": "ab"})
    assert after(goal, progress).drive == ("zone_a", 3.2, 8.0)
    assert after(goal, progress).goals == {"ab": "/navigate_to_pose"}
    state = after(goal, progress, ("goal_ended", {"goal": "ab", "status": 4}))
    assert (state.drive, state.goals) == (None, {})


def test_the_trail_has_every_pose():
    state = after(("pose", {"x": 1.0, "y": 2.0, "yaw": 0.5}), ("pose", {"x": 2.0, "y": 2.0, "yaw": 0.5}))
    assert [(pose.at.time, pose.x) for pose in state.trail] == [(1.0, 1.0), (2.0, 2.0)]
    assert state.pose == state.trail[-1]


def test_a_plan_in_another_frame_is_not_shown_on_the_map():
    assert after(("plan", {"frame": "map", "points": [[1, 2]]})).plan == [Position(1.0, 2.0)]
    assert after(("plan", {"frame": "odom", "points": [[1, 2]]})).plan == []


def test_a_second_run_begins_with_the_tree_anew_and_with_what_the_first_has_done():
    state = after(status(0, "RUNNING"), ("zone_visited", {"zone": "zone_a"}), BEGAN)
    assert len(state.runs) == 2
    assert state.nodes[0].status == ""
    assert state.zones["zone_a"].state == "visited"


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
        ("zone_started", {"place": "elsewhere"}),
        ("zone_searched", {"zone": "zone_a", "survivor": "nobody"}),
        ("written", {"by": "me"}),
        ("run_ended", {"ending": "over", "status": 0, "reason": "", "more": 1}),
    ],
)
def test_what_is_not_of_this_form_is_kept_as_it_is_and_changes_nothing(entry):
    state, before = after(entry), after()
    assert [(each.kind, each.data) for each in state.noted] == [entry]
    assert (state.pose, state.trail, state.survivors) == (None, [], [])
    assert [node.status for node in state.nodes] == ["", "", ""]
    assert state.runs[-1].ending == before.runs[-1].ending


def test_what_a_mission_has_written_of_its_own_is_kept_in_its_order():
    photo = ("photo_taken", {"photo": "photo_1"})
    state = after(photo, status(1, "RUNNING"), ("pose", {"x": 1.0, "y": 2.0, "yaw": 0.5}), ("point_left", {}))
    assert [(each.at.time, each.kind, each.data) for each in state.noted] == [
        (1.0, *photo),
        (4.0, "point_left", {}),
    ]


def test_a_journal_without_a_mission_has_a_tree_and_no_zones():
    state = after(began=("run_began", {"mission": None, "identity": {}, "tree": TREE, "run": {}}))
    assert (len(state.nodes), state.zones, state.base) == (3, {}, None)
