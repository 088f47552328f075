"""`sar-run` as its users see it: what it refuses, what it waits for, how runs go wrong."""

import re

import pytest

from sar_compiler.cli.journal_command import main as journal_command
from tests.processes import Command
from tests.trees import document

pytestmark = pytest.mark.ros


def refused(start, *arguments):
    """Run a command that must end with status 2, and return what it printed."""
    run = start("sar-run", *arguments)
    assert run.end() == 2, run.output
    assert "Navigating" not in run.output
    return run.output


def why(journal, capsys):
    """Return what `sar-journal why` says of a journal, and check that there is none."""
    assert not journal.exists()
    capsys.readouterr()
    assert journal_command(["why", str(journal)]) == 0
    return capsys.readouterr().out


def ended(*arguments, speed=20):
    """Fly in the simulator to the end; return the run and its exit status."""
    run = Command("sar-run", "--sim", "--speed", speed, *arguments)
    try:
        return run, run.end()
    finally:
        run.kill()


def test_an_invalid_tree_is_refused_with_its_findings_before_anything_starts(start, tmp_path):
    tree = tmp_path / "broken.xml"
    tree.write_text(document('<Sequence memory="ture"><NavigateToZne/></Sequence>'), encoding="utf-8")
    output = refused(start, tree, "--sim")
    assert f"{tree}:3:19: error[wrong-value]: memory: 'ture' is neither true nor false" in output
    assert "did you mean 'NavigateToZone'?" in output
    assert "service ready" not in output


def test_a_name_that_ros_does_not_allow_is_refused_before_anything_moves(start, tmp_path):
    tree = tmp_path / "name.xml"
    tree.write_text(document('<NavigateToBase action="a b"/>'), encoding="utf-8")
    assert "failed to resolve name" in refused(start, tree)


def test_a_run_that_begins_forgets_the_refusal_of_the_one_before(start, tmp_path, capsys):
    journal, tree = tmp_path / "m.journal", tmp_path / "tree.xml"
    tree.write_text(document("<Nothing/>"), encoding="utf-8")
    refused(start, tree, "--journal", journal)
    assert "error[unknown-node]" in why(journal, capsys)
    tree.write_text(document("<AlwaysFailure/>"), encoding="utf-8")
    assert start("sar-run", tree, "--journal", journal).end() == 1
    assert journal_command(["why", str(journal)]) == 0
    assert "did not begin" not in capsys.readouterr().out


def test_a_tree_file_that_is_not_there_is_named(start):
    assert "cannot read nowhere.xml: No such file or directory" in refused(start, "nowhere.xml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--no-such-option"], "unrecognized arguments: --no-such-option"),
        (["--engine", "theirs"], "invalid choice: 'theirs'"),
        (["--view", "wbe"], "invalid choice: 'wbe' (choose from 'text', 'web', 'none'); did you mean 'web'?"),
        (["--web-port", "0"], "--web-port requires --view web"),
        (["--view", "web", "--web-port", "65536"], "'65536' is not a port, 0 to 65535"),
        (["--view", "web", "--check"], "--check does not run the mission"),
        (["--record", "r.mcap", "--check"], "--check does not run the mission"),
        (["--publish", "--check"], "--check does not run the mission"),
        (["--groot2", "1667", "--check"], "--check does not run the mission"),
        (["--groot2", "65535"], "'65535' is not a port from 1 to 65534"),
        (["--groot2", "0"], "'0' is not a port from 1 to 65534"),
        (["--speed", "2"], "--speed requires --sim"),
        (["--seed", "0"], "--seed requires --sim"),
        (["--fault", "report_survivor:drop=1"], "--fault requires --sim"),
        (["--sim", "--speed", "0"], "'0' is not a number from 0.001 to 10000"),
        (["--sim", "--speed", "1e300"], "'1e300' is not a number from 0.001 to 10000"),
        (["--supervise", "1000000"], "'1000000' is not an integer from 1 to 1000"),
        (["--sim", "--fault", "report_survivor:drp=1"], "drop"),
        (["--sim", "moon"], "there is no world file 'moon'"),
        (["--sim", "my_tree.xml"], "Write the tree before --sim"),
        (
            ["--sim", "search_and_rescue"],
            "'search_and_rescue' looks like a tree. Write the tree before --sim",
        ),
        (["nosuchtree"], "there is no tree file 'nosuchtree', nor a shipped tree of that name"),
        (["--nodes", "no.such.module"], "'no.such.module' (--nodes) cannot be imported"),
        (["--ros-args", "-p"], "-p must be followed by a value"),
        (["--ros-args", "--nonsense"], "unknown ROS argument: --nonsense"),
    ],
)
def test_wrong_usage_is_refused_with_what_is_wrong(start, arguments, words):
    assert words in refused(start, *arguments)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("zone_order: [zone_x]\n    zones: {zone_a: {x: 0.0, y: 0.0, yaw: 0.0}}", "zone_x"),
        ("zone_order: []", "zone_order"),
        ("zone_order: [zone_a, zone_a]\n    zones: {zone_a: {x: 0.0, y: 0.0, yaw: 0.0}}", "zone_order"),
        ("zone_order: [zone_a]\n    zones: {zone_a: {x: .nan, y: 0.0, yaw: 0.0}}", "zones.zone_a.x"),
        (
            "zone_order: [zone_a]\n    zones: {zone_a: {x: 1, y: 0, yaw: 0}}\n    tick_rate_hz: 0",
            "tick_rate_hz",
        ),
        ("zone_order: [zone_a, 3]", "zone_order"),
        ("zone_order: [zone_a", "params.yaml"),
        ("tick_rate_hz: 2.0", "zone_order"),
    ],
)
def test_a_mistake_in_the_parameters_is_one_error_that_names_the_key(start, tmp_path, lines, words):
    params = tmp_path / "params.yaml"
    params.write_text(f"/**:\n  ros__parameters:\n    {lines}\n", encoding="utf-8")
    output = refused(start, "--sim", "--params", params)
    assert len(re.findall("^sar-run: ", output, re.MULTILINE)) == 1
    assert (
        re.search(rf"{re.escape(str(params))}:\d+:\d+: .*{re.escape(words)}", output) or words == params.name
    )


def test_a_world_that_is_not_there_is_said_before_the_look_around(start):
    assert "Looking whether" not in refused(start, "--sim", "moon")


def test_a_file_for_another_node_says_whose_its_sections_are(start, tmp_path):
    params = tmp_path / "params.yaml"
    params.write_text("/robot1/search_and_rescue:\n  ros__parameters: {zone_order: [a]}\n", encoding="utf-8")
    for arguments in (["--params", params], ["--ros-args", "--params-file", params]):
        assert (
            "(the file's sections are for /robot1/search_and_rescue, but this node is /search_and_rescue)"
        ) in refused(start, *arguments)


@pytest.mark.parametrize("use", ['Use.action("navigate_to_pose")', "Use.nav2()"])
def test_a_world_in_which_nothing_navigates_is_named_at_once(start, tmp_path, capsys, use):
    (tmp_path / "drives.py").write_text(
        "from py_trees.behaviours import Dummy\nfrom sar_compiler.leaves import Kind, Use, register\n"
        f"@register('Drive', kind=Kind.ACTION, uses=[{use}])\n"
        "class Drive(Dummy):\n    def __init__(self, name: str) -> None:\n        super().__init__(name)\n",
        encoding="utf-8",
    )
    tree = tmp_path / "tree.xml"
    tree.write_text(document("<Drive/>"), encoding="utf-8")
    path = {"PYTHONPATH": str(tmp_path)}
    journal = tmp_path / "m.journal"
    run = start("sar-run", tree, "--nodes", "drives", "--sim", "empty", "--journal", journal, env=path)
    assert run.end() == 3
    assert "did not start (exit status 3): the mission cannot start:\n  Nav2: the world" in why(
        journal, capsys
    )
    assert (
        "sar-run: the mission cannot start:\n  Nav2: the world 'empty' has no map for navigation"
        in run.output
    )
    assert "Waiting for" not in run.output


def test_what_does_not_appear_in_time_is_named_and_has_a_status_of_its_own(start, tmp_path, capsys):
    state = {"XDG_STATE_HOME": str(tmp_path)}
    run = start("sar-run", "--ros-args", "-p", "startup_timeout_sec:=1.0", env=state)
    assert run.end() == 3
    (refusal,) = tmp_path.rglob("*-refused")
    assert "did not start (exit status 3): not ready after" in why(refusal.with_suffix(".journal"), capsys)
    for missing in ("amcl_pose", "bt_navigator", "navigate_to_pose", "detect_survivor", "report_survivor"):
        assert missing in run.output


@pytest.mark.costly
def test_only_what_is_missing_is_waited_for_and_the_mission_starts_when_it_comes(start):
    start("sar-detect-survivor-server")
    start("sar-sim", "run", "--speed", 20)
    run = start(
        "sar-run",
        "--until",
        "complete",
        "--ros-args",
        "-p",
        "use_sim_time:=true",
        "-p",
        "zone_order:=[zone_b]",
    )
    run.wait_for("Waiting for: service report_survivor: no server")
    start("sar-report-survivor-server")
    assert run.end() == 0, run.output


def test_a_check_sees_that_everything_is_there_and_ends(start):
    run = start("sar-run", "--sim", "--speed", 20, "--check")
    assert run.end() == 0
    assert run.output.endswith("All requirements are present.")
    assert "Navigating" not in run.output
    way = [line.split() for line in run.output.splitlines() if re.fullmatch(r"  \w.* m +\d+ s", line)]
    assert [words[0] for words in way] == ["zone_a", "zone_b", "zone_c", "zone_d", "base", "total"]
    assert 25.0 < float(way[-1][1]) < 50.0


def test_a_check_names_the_places_that_cannot_be_reached(start):
    run = start(
        "sar-run", "--sim", "--speed", 20, "--check", "--ros-args", "-p", "zones.zone_b.x:=99.0", "-p", "zones.zone_c.y:=0.0",
        "-p", "geofence:=[-3.2, -9.0, 9.0, -9.0, 9.0, 9.0, -3.2, 9.0]",
    )  # fmt: skip
    assert run.end() == 1
    for problem in (
        "zone_b (99.00, 3.00): the position is outside the map.",
        "zone_c (4.00, 0.00): there is not enough free ground for the robot at this position.",
        "zone_d (-3.50, -3.00): the position is outside the geofence.",
        "all requirements are present, but the route has 3 problems (see above)",
    ):
        assert f"sar-run: {problem}" in run.output, run.output


def test_a_check_looks_at_the_map_that_a_robot_publishes(start, ros):
    from nav_msgs.msg import OccupancyGrid
    from rclpy.qos import DurabilityPolicy, QoSProfile

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    grid = OccupancyGrid()
    grid.info.resolution, grid.info.width, grid.info.height = 0.5, 40, 40
    grid.info.origin.position.x = grid.info.origin.position.y = -10.0
    grid.data = [0] * 1600
    ros.node("map_server").create_publisher(OccupancyGrid, "map", latched).publish(grid)
    # So long the map may take to be found; of the robot there is nothing else, and the check waits for it to the end.
    run = start(
        "sar-run", "--check", "--ros-args", "-p", "startup_timeout_sec:=10.0", "-p", "zones.zone_b.x:=99.0"
    )
    assert run.end() == 3
    assert "zone_b (99.00, 3.00): the position is outside the map." in run.output, run.output
    assert re.search(r"  zone_a +4\.\d m", run.output), run.output


@pytest.mark.costly
def test_a_check_does_not_tell_a_robot_where_it_is(start):
    start("sar-sim", "run")
    start("sar-detect-survivor-server")
    start("sar-report-survivor-server")
    run = start("sar-run", "--check", "--ros-args", "-p", "use_sim_time:=true")
    run.wait_for("Waiting for: node bt_navigator: state 'inactive', must be 'active'")
    status = run.stop()
    assert status == 130


@pytest.fixture(scope="module")
def one_zone():
    """A flight to one zone, with the file of all of them and the tree shown; return the run, ended, and its status."""
    return ended(
        "--params", "config/mission_params.yaml", "--view", "text", "--ros-args", "-p", "zone_order:=[zone_b]"
    )


def test_a_later_parameter_on_the_command_line_wins_over_the_file(one_zone):
    run, status = one_zone
    assert status == 0, run.output
    assert "zones visited:   1 of 1 (zone_b)" in run.output


def test_each_change_is_shown_once_in_a_line_with_the_time(one_zone):
    run, status = one_zone
    assert status == 0
    lines = run.output.splitlines()
    shown = [found[1] for line in lines if (found := re.match(r" +\d+:\d\d  (.*)", line))]
    expected = [
        "set out for zone_b",
        "ZonesRemaining? SUCCESS (some left), 0 of 1 zones visited",
        "NavigateToZone RUNNING (driving), navigating to zone_b",
        "NavigateToZone SUCCESS (arrived), reached zone_b",
        "zone_b was visited",
        "NavigateToBase SUCCESS (arrived), reached base station",
    ]
    assert [line for line in shown if line in expected] == expected, run.output


@pytest.mark.parametrize("other", ["sar-sim", "sar-run"])
def test_a_simulation_does_not_start_beside_another_one(start, other):
    first = start("sar-sim", "run").wait_for("runs")
    second = start(other, *(["run"] if other == "sar-sim" else ["--sim"]))
    assert second.end() == 2, second.output
    # Whichever of the two it has heard of first.
    refusal = r"already provides (/clock|the action /navigate_to_pose) in this ROS domain"
    assert re.search(refusal, second.output), second.output
    assert first.stop() == 0, first.output


@pytest.fixture(scope="module")
def unacknowledged():
    """A flight whose first report is never answered, and whose second one is refused."""
    return ended("--fault", "report_survivor:drop=1", "--fault", "report_survivor:refuse=1")


@pytest.mark.costly
def test_a_report_without_an_answer_leaves_the_mission_incomplete(unacknowledged):
    run, status = unacknowledged
    assert status == 1
    assert "The base station did not acknowledge survivor_1 in zone_a" in run.output


def test_a_refused_report_leaves_the_mission_incomplete(unacknowledged):
    run, status = unacknowledged
    assert status == 1
    assert "The base station did not acknowledge survivor_2 in zone_c" in run.output
    assert "back at base:    yes" in run.output


@pytest.fixture(scope="module")
def delayed():
    """A flight with all that makes a mission late, and no more."""
    faults = ("navigate_to_pose:reject=1", "detect_survivor:delay=3", "navigate_to_pose:die@zone_c,back=5")
    return ended(*(word for fault in faults for word in ("--fault", fault)))


def test_a_rejected_goal_is_tried_again(delayed):
    run, status = delayed
    assert status == 0, run.output
    assert "rejected" in run.output


def test_a_slow_answer_is_waited_for(delayed):
    run, status = delayed
    assert status == 0, run.output


@pytest.mark.costly
def test_time_waits_for_a_mission_that_cannot_go_as_fast_as_asked_for():
    run, status = ended(speed=1000)
    assert status == 0, run.output
    # What Fast DDS prints is none of the mission's failures.
    assert not any("failed" in line for line in run.log), run.output


def test_a_server_that_disappears_and_comes_back_delays_the_mission(delayed):
    run, status = delayed
    assert status == 0, run.output
    assert "bt_navigator disappears" in run.output


@pytest.mark.costly
def test_a_zone_out_of_reach_is_tried_ever_more_rarely(start, witness):
    watching = witness()
    limit = 60.0
    start("sar-sim", "run", "--speed", 10, "--fault", "navigate_to_pose:abort=zone_b")
    start("sar-detect-survivor-server")
    start("sar-report-survivor-server")
    watching.wait_until_seen()
    run = start(
        "sar-run", "--until", "complete",
        "--ros-args", "-p", "use_sim_time:=true", "-p", f"time_limit_sec:={limit}",
    )  # fmt: skip
    assert run.end() == 1
    assert "The time limit of 1:00 has expired." in run.output
    assert "zone_b, zone_c and zone_d were not visited." in run.output
    # To zone_a, and then to zone_b and back home in turns, each after pauses of 0, 1, 2, 4 and from then on 8 s.
    assert 8 < len(watching.goals()) <= 30


def test_a_root_that_succeeds_does_not_make_an_incomplete_mission_a_success(start):
    run = start("sar-run", "--sim", "--speed", 20, "--until", "success")
    assert run.end() == 1
    assert "the run has ended as requested, but the mission is incomplete" in run.output
