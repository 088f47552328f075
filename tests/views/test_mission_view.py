"""Tests of the terminal view of a mission: the part that is shown if the screen is too small, and the log lines."""

import pytest

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.status_line import condition
from sar_compiler.runtime.clock import clock_text
from sar_compiler.views.mission_view import change_text, condition_change, screen


def node(name, *children):
    return {
        "class": "x",
        "name": name,
        "attributes": {},
        "children": list(children),
        "file": "m.xml",
        "line": 1,
    }


def mission(tree, *statuses, more=()):
    """Return the state of a mission after node statuses, given by node number, one per second."""
    about = {"mission": "patrol", "tree": tree, "run": {}}
    told = [("run_began", about)]
    told += [
        ("status", {"node": number, "tick": 1, "status": status, "message": message})
        for number, status, message in statuses
    ]
    entries = enumerate([*told, *more])
    return MissionState.from_stream(
        JournalEntry(at, 1, at, float(at), kind, data) for at, (kind, data) in entries
    )


def lines(state, height=24, now=10.0):
    return ["".join(piece.text for piece in line) for line in screen(state, now, height)]


@pytest.mark.parametrize(("seconds", "text"), [(0, "0:00"), (65.9, "1:05"), (3600, "1:00:00"), (-1, "0:00")])
def test_durations_are_formatted_as_on_a_clock(seconds, text):
    assert clock_text(seconds) == text


def test_small_tree_is_shown_completely():
    state = mission(node("Main", node("Drive"), node("Look")), (1, "RUNNING", "3 m left"), (0, "RUNNING", ""))
    assert lines(state) == [
        "patrol  0:10  working",
        "[*] Main  0:08",
        "  [*] Drive  0:09  3 m left",
        "  [-] Look",
    ]


def test_message_of_earlier_activation_is_not_shown():
    state = mission(node("Main", node("Drive")), (1, "RUNNING", "driving to a"), (1, "HALTED", ""))
    assert lines(state)[2] == "  [-] Drive"


KINDS = [
    {"name": "zone", "plural": "zones"},
    {"name": "survivor", "plural": "survivors", "is_found": True},
]


def changed(**data):
    return "changed", data


def detection(number, **more):
    return {
        "kind": "survivor",
        "name": f"survivor_{number}",
        "x": number,
        "y": 0,
        "state": "candidate",
        **more,
    }


def test_first_lines_show_target_remaining_drive_and_figures():
    drive = ("progress", {"target": "zone_b", "distance": 3.21, "time_left": 8.0})
    told = [
        changed(phase={"place": "zone_b"}, figures=[{"name": "zones visited", "value": 1, "of": 2}]),
        drive,
    ]
    assert lines(mission(node("Main"), more=told))[:2] == [
        "patrol  0:10  driving: to zone_b  3.2 m, 0:08 left",
        "zones visited 1 of 2",
    ]


def test_headline_of_robot_that_cannot_drive_shows_reason_not_remaining_drive():
    drive = ("progress", {"target": "zone_b", "distance": 5.6, "time_left": 8.0})
    lost = ("lacks", {"text": "Nav2 is not active: node amcl: missing"})
    head = lines(mission(node("Main"), more=[drive, lost]))[0]
    assert head == "patrol  0:10  WAITING (0:08): Nav2 is not active: node amcl: missing"


@pytest.mark.parametrize(
    "last",
    [
        ("lacks", {"text": "Nav2 is not active"}),
        ("progress", {"target": "a", "distance": 5.6, "time_left": 8.0}),
    ],
)
def test_headline_of_ended_run_shows_neither_waiting_nor_driving(last):
    ended = ("run_ended", {"ending": "failed", "status": 1, "reason": ""})
    head = lines(mission(node("Main"), more=[last, ended]))[0]
    assert head == "patrol  0:10  FAILED"


def test_headline_shows_reason_for_pause():
    held = changed(phase={"name": "held", "reason": "by the operator", "place": "zone_b"})
    assert lines(mission(node("Main"), more=[held]))[0] == "patrol  0:10  PAUSED (0:09): by the operator"


def test_latest_detection_comes_first():
    told = changed(
        kinds=KINDS,
        landmarks=[
            detection(1, details={"report": "acknowledged", "found": {"run": 1, "time": 1, "wall": 1}}),
            detection(2),
        ],
    )
    assert lines(mission(node("Main"), more=[told]))[1] == (
        "survivors: 2; survivor_2 (2.0, 0.0) candidate; survivor_1 (1.0, 0.0) candidate, acknowledged"
    )


def test_searched_kind_without_detections_is_shown_as_none():
    assert lines(mission(node("Main"), more=[changed(kinds=KINDS)]))[1] == "survivors: none"


def test_mission_without_display_shows_its_latest_events():
    told = [("photo_taken", {"photo": f"photo_{each}"}) for each in range(20)]
    shown = lines(mission(node("Main"), more=[*told, ("point_left", {}), ("\x1b[2J", {"a\n": 1.5})]))
    assert len(shown) == 3
    assert shown[1].startswith("events: 22; \\x1b[2J: a\\n: 1.5; point left; photo taken: photo: photo_19; ")
    assert shown[1].endswith("photo: photo_12")


def test_alarm_has_its_own_line_until_it_is_over():
    low = {"text": "battery low"}
    second = lines(mission(node("Main"), more=[changed(alarms=[low])]))[1]
    assert second == "ALARM (0:09): battery low"
    over = changed(alarms=[{**low, "is_over": True}])
    assert lines(mission(node("Main"), more=[changed(alarms=[low]), over]))[1] == "[-] Main"


def test_gauges_come_before_alarms():
    told = changed(gauges=[{"name": "battery", "value": 15, "unit": "%"}], alarms=[{"text": "low"}])
    assert lines(mission(node("Main"), more=[told]))[1] == "battery 15 %  ALARM (0:09): low"


def wide_tree(count=100):
    return node("Main", *(node(f"child {number}", node("below")) for number in range(count)))


def test_large_tree_shows_path_to_running_node_and_its_siblings():
    # The root, then each child with one below it.
    shown = lines(
        mission(wide_tree(), (0, "RUNNING", ""), (101, "RUNNING", ""), (102, "RUNNING", "here")), height=10
    )
    assert len(shown) == 10
    assert "  [*] child 50 > below  0:07  here" in shown
    assert "  [-] child 49 > below" in shown
    assert "  [-] child 51 > below" in shown
    assert [line for line in shown if "more" in line] == ["  … 46 more", "  … 48 more"]


def test_tree_deeper_than_screen_shows_deepest_running_nodes():
    tree = node("leaf")
    for depth in reversed(range(60)):
        tree = node(f"level {depth}", tree, node(f"beside {depth}"))
    shown = lines(mission(tree, *((number, "RUNNING", "") for number in range(61))), height=12)
    assert len(shown) == 12
    assert any("[*] leaf" in line for line in shown)


def test_long_chain_names_first_and_last_nodes():
    tree = node("leaf")
    for depth in reversed(range(60)):
        tree = node(f"level {depth}", tree)
    shown = lines(mission(tree, *((number, "RUNNING", "") for number in range(61))), height=12)
    assert shown[1:] == ["[*] level 0 > … > level 58 > level 59 > leaf  0:00"]


def chains(count):
    """Return a tree with chains of only children: a root, and below it inverted checks."""
    return node("Main", *(node(f"Not {each}", node(f"Check {each}")) for each in range(count)))


def test_only_children_share_line_with_parent_if_screen_is_too_short():
    state = mission(
        chains(4), (2, "FAILURE", "no"), (1, "SUCCESS", ""), (4, "SUCCESS", ""), (3, "SUCCESS", "")
    )
    assert lines(state, height=10)[1:4] == ["[-] Main", "  [✓] Not 0  0:08", "    [✕] Check 0  0:09  no"]
    assert lines(state, height=9)[1:4] == [
        "[-] Main",
        "  [✓] Not 0 > [✕] Check 0  0:09  no",
        "  [✓] Not 1 > Check 1  0:07",
    ]


def test_chain_shows_time_and_message_of_its_last_active_node():
    state = mission(chains(4), (1, "RUNNING", "here"), (0, "RUNNING", ""))
    assert "  [*] Not 0 > [-] Check 0  0:09  here" in lines(state, height=9)


def test_subtree_and_root_of_same_name_are_shown_once():
    tree = node(
        "Main", node("Part", node("Part", node("a"), node("b"))), *(node(f"c{each}") for each in range(4))
    )
    assert lines(mission(tree), height=9)[2:5] == ["  [-] Part", "    [-] a", "    [-] b"]


@pytest.mark.parametrize("height", range(3, 40))
def test_screen_never_exceeds_its_height(height):
    running = [(0, "RUNNING", ""), *((number, "RUNNING", "") for number in range(1, 200, 14))]
    assert len(lines(mission(wide_tree(), *running), height=height)) <= height


def test_failed_tree_shows_path_to_failed_leaf():
    tree = node("Main", node("A", node("a")), node("B", node("b")), *(node(f"C{each}") for each in range(30)))
    shown = lines(
        mission(tree, (1, "SUCCESS", ""), (4, "FAILURE", "no way"), (3, "FAILURE", ""), (0, "FAILURE", "")),
        10,
    )
    assert "  [✕] B > b  0:08  no way" in shown


def test_control_characters_in_names_and_messages_are_escaped():
    state = mission(node("Main\x1b[2J"), (0, "RUNNING", "a\nb\x1b]0;title\x07"))
    assert lines(state)[1] == r"[*] Main\x1b[2J  0:09  a\nb\x1b]0;title\x07"


def change_line(kind, data, before="", more=()):
    state = mission(node("Main", node("Drive")), more=more)
    entry = JournalEntry(9, 1, 9.0, 2.5, kind, data)
    state.apply(entry)
    return change_text(state, entry, before)


def test_change_is_one_line_with_its_time():
    told = {"node": 1, "tick": 2, "status": "FAILURE", "message": "no way"}
    assert change_line("status", told) == "     0:02  Drive FAILURE, no way"
    assert change_line("zone_visited", {"zone": "zone_a"}) == "     0:02  zone visited: zone: zone_a"


def test_leaf_of_an_event_has_no_line():
    assert change_line("changed", {"leaf": 1, "tick": 2}) == ""


def test_sentence_of_mission_replaces_line_of_event():
    fact, said, told = {"zone": "zone_a"}, {"said": "zone_a was visited"}, [changed(kinds=[])]
    assert change_line("zone_visited", fact, more=told) == ""
    assert (
        change_line("changed", said, more=[*told, ("zone_visited", fact)]) == "     0:02  zone_a was visited"
    )
    assert change_line("changed", {"figures": []}, more=told) == ""


def test_executed_command_is_printed_once_with_its_operator():
    fact, told = ("command_given", {"command": "pause", "by": "Ann"}), [changed(kinds=[])]
    ordered = {"said": "the operator: pause", "by": "Ada"}
    assert change_line("changed", ordered, more=[*told, fact]) == "     0:02  Ada: pause"
    order = {"verb": "pause", "label": "Pause", "by": "Ada", "is_told": True}
    assert change_line("ordered", order, more=[*told, fact, ("changed", ordered)]) == ""


@pytest.mark.parametrize(
    ("by", "said"), [("Ada (page, 127.0.0.1)", "Ada (page, 127.0.0.1)"), ("", "an operator")]
)
@pytest.mark.parametrize("told", [(), [changed(kinds=[])]])
def test_received_command_is_printed_with_its_operator(by, said, told):
    order = {"verb": "pause", "label": "Pause", "by": by}
    assert change_line("ordered", order, more=told) == f"     0:02  {said}: Pause"


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("status", {"node": 1, "tick": 2, "status": "RUNNING", "message": "2 m left"}),
        ("status", {"node": 1, "tick": 2, "status": "IDLE", "message": ""}),
        ("pose", {"x": 1.0, "y": 1.0, "yaw": 0.0}),
        ("goal_sent", {"action": "/a", "goal": "ab"}),
    ],
)
def test_unimportant_entries_have_no_line(kind, data):
    assert change_line(kind, data, before="RUNNING") == ""


def condition_lines(*told):
    """Return the log lines about a mission's status line, entry by entry."""
    state, said = mission(node("Main", node("Drive"))), []
    for number, (kind, data) in enumerate(told, 9):
        before = condition(state)
        state.apply(JournalEntry(number, 1, float(number), float(number), kind, data))
        said.append(condition_change(state, before))
    return said


DRIVES = ("progress", {"target": "a", "distance": 5.6, "time_left": 8.0})
LOST = ("lacks", {"text": "Nav2 is not active"})


def test_start_and_end_of_waiting_are_printed_once():
    assert condition_lines(DRIVES, LOST, LOST, ("lacks", {"text": ""}), DRIVES) == [
        "",
        "     0:10  WAITING: Nav2 is not active",
        "",
        "     0:12  driving: to a",
        "",
    ]


def test_new_reason_for_waiting_is_printed():
    other = ("lacks", {"text": "no localisation"})
    assert condition_lines(LOST, other)[1] == "     0:10  WAITING: no localisation"
