"""Tests of `sar-run`: rejected arguments, the wait for requirements, and runs with faults."""

import re

import pytest

from sar_compiler.cli.journal_command import main as journal_command
from tests.processes import Command
from tests.trees import document

pytestmark = pytest.mark.ros


def output_of_rejected_run(start, *arguments):
    """Run a command that must end with status 2, and return its output."""
    run = start("sar-run", *arguments)
    assert run.end() == 2, run.output
    assert "Navigating" not in run.output
    return run.output


def explain_missing_journal(journal, capsys):
    """Return the output of `sar-journal why` for a journal that does not exist."""
    assert not journal.exists()
    capsys.readouterr()
    assert journal_command(["why", str(journal)]) == 0
    return capsys.readouterr().out


def run_to_end(*arguments, speed=20):
    """Run in the simulator to the end; return the run and its exit status."""
    run = Command("sar-run", "--sim", "--speed", speed, *arguments)
    try:
        return run, run.end()
    finally:
        run.kill()


def test_invalid_tree_is_rejected_with_findings_before_start(start, tmp_path):
    tree = tmp_path / "broken.xml"
    tree.write_text(document('<Sequence memory="ture"><NavigateToZne/></Sequence>'), encoding="utf-8")
    output = output_of_rejected_run(start, tree, "--sim")
    assert f"{tree}:3:19: error[wrong-value]: memory: 'ture' is neither true nor false" in output
    assert "did you mean 'NavigateToZone'?" in output
    assert "service ready" not in output


def test_invalid_ros_name_is_rejected_before_start(start, tmp_path):
    tree = tmp_path / "name.xml"
    tree.write_text(document('<NavigateToBase action="a b"/>'), encoding="utf-8")
    assert "failed to resolve name" in output_of_rejected_run(start, tree)


def test_started_run_replaces_record_of_rejected_run(start, tmp_path, capsys):
    journal, tree = tmp_path / "m.journal", tmp_path / "tree.xml"
    tree.write_text(document("<Nothing/>"), encoding="utf-8")
    output_of_rejected_run(start, tree, "--journal", journal)
    assert "error[unknown-node]" in explain_missing_journal(journal, capsys)
    tree.write_text(document("<AlwaysFailure/>"), encoding="utf-8")
    assert start("sar-run", tree, "--journal", journal).end() == 1
    assert journal_command(["why", str(journal)]) == 0
    assert "did not begin" not in capsys.readouterr().out


def test_missing_tree_file_is_named(start):
    assert "cannot read nowhere.xml: No such file or directory" in output_of_rejected_run(
        start, "nowhere.xml"
    )


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
def test_wrong_usage_is_rejected_with_reason(start, arguments, words):
    assert words in output_of_rejected_run(start, *arguments)


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
def test_parameter_error_is_reported_once_with_key(start, tmp_path, lines, words):
    params = tmp_path / "params.yaml"
    params.write_text(f"/**:\n  ros__parameters:\n    {lines}\n", encoding="utf-8")
    output = output_of_rejected_run(start, "--sim", "--params", params)
    assert len(re.findall("^sar-run: ", output, re.MULTILINE)) == 1
    assert (
        re.search(rf"{re.escape(str(params))}:\d+:\d+: .*{re.escape(words)}", output) or words == params.name
    )


def test_missing_world_is_reported_before_check_for_other_simulations(start):
    assert "Checking for other simulations" not in output_of_rejected_run(start, "--sim", "moon")


def test_parameter_file_for_another_node_is_rejected_with_its_sections(start, tmp_path):
    params = tmp_path / "params.yaml"
    params.write_text("/robot1/search_and_rescue:\n  ros__parameters: {zone_order: [a]}\n", encoding="utf-8")
    for arguments in (["--params", params], ["--ros-args", "--params-file", params]):
        assert (
            "(the file's sections are for /robot1/search_and_rescue, but this node is /search_and_rescue)"
        ) in output_of_rejected_run(start, *arguments)


@pytest.mark.parametrize("use", ['Use.action("navigate_to_pose")', "Use.nav2()"])
def test_world_without_navigation_is_reported_at_once(start, tmp_path, capsys, use):
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
    assert (
        "did not start (exit status 3): the mission cannot start:\n  Nav2: the world"
        in explain_missing_journal(journal, capsys)
    )
    assert (
        "sar-run: the mission cannot start:\n  Nav2: the world 'empty' has no map for navigation"
        in run.output
    )
    assert "Waiting for" not in run.output


def test_missing_requirements_are_named_at_startup_timeout_with_status_3(start, tmp_path, capsys):
    state = {"XDG_STATE_HOME": str(tmp_path)}
    run = start("sar-run", "--ros-args", "-p", "startup_timeout_sec:=1.0", env=state)
    assert run.end() == 3
    (refusal,) = tmp_path.rglob("*-refused")
    assert "did not start (exit status 3): not ready after" in explain_missing_journal(
        refusal.with_suffix(".journal"), capsys
    )
    for missing in ("amcl_pose", "bt_navigator", "navigate_to_pose", "detect_survivor", "report_survivor"):
        assert missing in run.output


@pytest.mark.costly
def test_mission_starts_when_missing_service_appears(start):
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


def test_check_of_complete_setup_succeeds_and_shows_route(start):
    run = start("sar-run", "--sim", "--speed", 20, "--check")
    assert run.end() == 0
    assert run.output.endswith("All requirements are present.")
    assert "Navigating" not in run.output
    way = [line.split() for line in run.output.splitlines() if re.fullmatch(r"  \w.* m +\d+ s", line)]
    assert [words[0] for words in way] == ["zone_a", "zone_b", "zone_c", "zone_d", "base", "total"]
    assert 25.0 < float(way[-1][1]) < 50.0


def test_check_reports_unreachable_positions(start):
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


def test_check_uses_published_map(start, ros):
    from nav_msgs.msg import OccupancyGrid
    from rclpy.qos import DurabilityPolicy, QoSProfile

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    grid = OccupancyGrid()
    grid.info.resolution, grid.info.width, grid.info.height = 0.5, 40, 40
    grid.info.origin.position.x = grid.info.origin.position.y = -10.0
    grid.data = [0] * 1600
    ros.node("map_server").create_publisher(OccupancyGrid, "map", latched).publish(grid)
    # The map must be discovered within the timeout. The rest of the robot is missing, so the check waits for all this time.
    run = start(
        "sar-run", "--check", "--ros-args", "-p", "startup_timeout_sec:=10.0", "-p", "zones.zone_b.x:=99.0"
    )
    assert run.end() == 3
    assert "zone_b (99.00, 3.00): the position is outside the map." in run.output, run.output
    assert re.search(r"  zone_a +4\.\d m", run.output), run.output


@pytest.mark.costly
def test_check_does_not_send_initial_pose(start):
    start("sar-sim", "run")
    start("sar-detect-survivor-server")
    start("sar-report-survivor-server")
    run = start("sar-run", "--check", "--ros-args", "-p", "use_sim_time:=true")
    run.wait_for("Waiting for: node bt_navigator: state 'inactive', must be 'active'")
    status = run.stop()
    assert status == 130


@pytest.fixture(scope="module")
def one_zone():
    """Run to one zone, with the parameter file of all zones and the text view; return the completed run and its status."""
    return run_to_end(
        "--params", "config/mission_params.yaml", "--view", "text", "--ros-args", "-p", "zone_order:=[zone_b]"
    )


def test_command_line_parameter_overrides_file(one_zone):
    run, status = one_zone
    assert status == 0, run.output
    assert "zones visited:   1 of 1 (zone_b)" in run.output


def test_text_view_shows_each_change_once_with_time(one_zone):
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
def test_second_simulation_does_not_start(start, other):
    first = start("sar-sim", "run").wait_for("runs")
    second = start(other, *(["run"] if other == "sar-sim" else ["--sim"]))
    assert second.end() == 2, second.output
    # The message depends on which of the two is discovered first.
    refusal = r"already provides (/clock|the action /navigate_to_pose) in this ROS domain"
    assert re.search(refusal, second.output), second.output
    assert first.stop() == 0, first.output


@pytest.fixture(scope="module")
def unacknowledged_run():
    """Run with a first report that is never answered, and a second one that is rejected."""
    return run_to_end("--fault", "report_survivor:drop=1", "--fault", "report_survivor:refuse=1")


@pytest.mark.costly
def test_unanswered_report_leaves_mission_incomplete(unacknowledged_run):
    run, status = unacknowledged_run
    assert status == 1
    assert "The base station did not acknowledge survivor_1 in zone_a" in run.output


def test_rejected_report_leaves_mission_incomplete(unacknowledged_run):
    run, status = unacknowledged_run
    assert status == 1
    assert "The base station did not acknowledge survivor_2 in zone_c" in run.output
    assert "back at base:    yes" in run.output


@pytest.fixture(scope="module")
def delayed_run():
    """Run with faults that only delay the mission."""
    faults = ("navigate_to_pose:reject=1", "detect_survivor:delay=3", "navigate_to_pose:die@zone_c,back=5")
    return run_to_end(*(word for fault in faults for word in ("--fault", fault)))


def test_rejected_goal_is_retried(delayed_run):
    run, status = delayed_run
    assert status == 0, run.output
    assert "rejected" in run.output


def test_slow_response_is_awaited(delayed_run):
    run, status = delayed_run
    assert status == 0, run.output


@pytest.mark.costly
def test_simulated_time_waits_for_slow_mission():
    run, status = run_to_end(speed=1000)
    assert status == 0, run.output
    # The output of Fast DDS is not part of the log.
    assert not any("failed" in line for line in run.log), run.output


def test_mission_succeeds_after_server_disappears_and_returns(delayed_run):
    run, status = delayed_run
    assert status == 0, run.output
    assert "bt_navigator disappears" in run.output


@pytest.mark.costly
def test_pauses_between_attempts_at_unreachable_zone_increase(start, witness):
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
    # One goal for zone_a, then alternating goals for zone_b and home, after pauses of 0, 1, 2, 4 and then always 8 s.
    assert 8 < len(watching.goals()) <= 30


def test_incomplete_mission_fails_even_if_root_succeeds(start):
    run = start("sar-run", "--sim", "--speed", 20, "--until", "success")
    assert run.end() == 1
    assert "the run has ended as requested, but the mission is incomplete" in run.output
