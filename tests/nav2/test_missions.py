"""Tests of missions on an installed Nav2 against the promises of the pages, with its own nodes, codes, times and recoveries (`make nav2-test`)."""

import json
import signal
import time

import pytest
from lifecycle_msgs.msg import Transition

from tests.docs.test_sweeping_page import passing_tree
from tests.nav2.parameter_files import nav2_with_its_own_time_outs, one_zone_in_a_wall, one_zone_to_sweep
from tests.nav2.stack import GRACE_SEC, NAVIGATION, NAVIGATION_MANAGER, busy_processes
from tests.processes import in_order

pytestmark = [pytest.mark.nav2, pytest.mark.ros]

TREES = ("search_and_rescue", "search_and_rescue_resilient", "search_and_rescue_guarded")
RESILIENT, GUARDED = TREES[1:]
ZONES = ("zone_a", "zone_b", "zone_c", "zone_d")
CANCELING, CANCELED, ABORTED = 3, 5, 6
MISSIONS_IN_A_ROW = 10
# How long a killed server of Nav2 stays away, seconds.
MISSING_SEC = 45.0
# How soon the crash of a server is reported, seconds: 10 s of silence, and a check each second.
REPORTED_WITHIN_SEC = 12.0
# The delay before a killed server is restarted, and the time that Nav2 then has to become active, seconds.
RESTARTED_AFTER_SEC, RETURN_WITHIN_SEC = 5.0, 120.0


def wait_for_end(run, nav2):
    """Wait for a mission's end while its robot sends messages: a drive in real time prints nothing for a minute."""
    nav2.robot.wait_until(lambda: run.is_over, "the mission's end")
    return run.end()


def wait_for_line(run, nav2, text):
    """Wait in the same way for a line."""
    nav2.robot.wait_until(lambda: text in run.output or run.is_over, f"'{text}'")
    assert text in run.output, run.output


def given_up_lines(run):
    """Return the lines that give a zone up or postpone it."""
    return [line for line in run.log if "postponed" in line.lower() or "abandon" in line.lower()]


def summary(run):
    """Return the summary that `--format json` has printed."""
    lines = [line for line in run.output.splitlines() if line.startswith('{"status"')]
    assert lines, f"no summary:\n{run.output}"
    return json.loads(lines[-1])


@pytest.mark.parametrize("tree", TREES)
def test_tree_completes_and_robot_moves_only_with_goal(tree, nav2, start_mission, record_result):
    began = time.time()
    run = start_mission(tree, "--format", "json")
    status, ended = wait_for_end(run, nav2), time.time()
    figures, loose = summary(run), nav2.robot.drives_without_goal(began)
    still = nav2.robot.still_after(ended)
    aborted = nav2.robot.ends_since(began).count(ABORTED)
    record_result(
        "status 0, 4 zones, 2 survivors; nothing moves 1 s after a goal or the process",
        f"status {status}, {figures['figures']}, {figures['duration']:.1f} s simulated, {figures['ticks']} ticks, "
        f"{aborted} goals aborted, moved without a goal for {loose:.1f} s, after the end for {still:.1f} s",
    )
    assert status == 0, run.output
    expected = [word for zone in ZONES for word in (f"Navigating to {zone}...", f"Reached {zone}.")]
    assert in_order([*expected, "Reached base station."], run.log) is None, run.output
    assert figures["figures"]["survivors reported"] == 2
    assert max(loose, still) <= GRACE_SEC


def test_sweep_pieces_are_driven_through_as_one_goal(nav2, start_mission, record_result, tmp_path):
    file = one_zone_to_sweep(tmp_path)
    began = time.time()
    run = start_mission(passing_tree(tmp_path), "--format", "json", "--params", file)
    status = wait_for_end(run, nav2)
    ends, loose = nav2.robot.ends_since(began), nav2.robot.drives_without_goal(began)
    swept = [line for line in run.log if "Reached pieces" in line or "% seen" in line]
    record_result(
        "status 0, no piece driven to alone, no goal aborted; nothing moves 1 s after a goal",
        f"status {status}, {summary(run)['duration']:.1f} s simulated, {swept}, {ends.count(ABORTED)} goals aborted, "
        f"moved without a goal for {loose:.1f} s",
    )
    assert status == 0, run.output
    assert swept
    assert not any("Navigating to piece " in line for line in run.log), run.output
    assert ABORTED not in ends
    assert loose <= GRACE_SEC


def test_zone_in_wall_is_given_up_and_robot_returns_home(nav2, start_mission, record_result, tmp_path):
    file = one_zone_in_a_wall(tmp_path)
    began = time.time()
    run = start_mission(RESILIENT, "--format", "json", "--params", file)
    status = wait_for_end(run, nav2)
    aborted = nav2.robot.ends_since(began).count(ABORTED)
    record_result(
        "status 1, the zone named, home",
        f"status {status}, {aborted} goals aborted, {summary(run)['duration']:.1f} s",
    )
    assert status == 1, run.output
    assert any("zone_b" in line for line in given_up_lines(run)), run.output
    assert "Reached base station." in run.log


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGHUP, 129)])
def test_signal_during_drive_cancels_goal_and_robot_stops(nav2, start_mission, record_result, number, status):
    began, run = time.time(), start_mission(RESILIENT)
    nav2.robot.wait_until_moving(run)
    sent = time.time()
    run.send(number)
    came, ended = wait_for_end(run, nav2), time.time()
    still = nav2.robot.still_after(ended)
    record_result(
        f"status {status}, the goal cancelled, still within 1 s of the end",
        f"status {came} after {ended - sent:.1f} s, moved for {still:.1f} s after it",
    )
    assert came == status, run.output
    assert CANCELED in nav2.robot.ends_since(began)
    assert still <= GRACE_SEC


def test_second_ctrl_c_ends_run_at_once_and_robot_stops(nav2, start_mission, record_result):
    began, run = time.time(), start_mission(RESILIENT)
    nav2.robot.wait_until_moving(run)
    run.send(signal.SIGINT)
    nav2.robot.let_pass(0.05)
    sent = time.time()
    run.send(signal.SIGINT)
    status, ended = wait_for_end(run, nav2), time.time()
    still = nav2.robot.still_after(ended)
    record_result(
        "the cancel is sent; status 130, or 4 where the goal was still under way",
        f"status {status} after {ended - sent:.1f} s, moved for {still:.1f} s after it",
    )
    assert status in (130, 4), run.output
    assert CANCELED in nav2.robot.ends_since(began)
    assert still <= GRACE_SEC


def test_killed_mission_leaves_no_goal_and_can_be_resumed(nav2, start_mission, record_result, tmp_path):
    journal = tmp_path / "m.journal"
    run = start_mission(RESILIENT, "--journal", journal)
    wait_for_line(run, nav2, "Reached zone_a.")
    wait_for_line(run, nav2, "Navigating to zone_b...")
    nav2.robot.wait_until_moving(run)
    killed = time.time()
    run.kill()
    nav2.robot.wait_until(lambda: nav2.robot.first([CANCELED], killed), "the goal's end")
    asked, ended = (nav2.robot.first(each, killed) for each in ([CANCELING, CANCELED], [CANCELED]))
    still = nav2.robot.still_after(ended)
    resumed = start_mission(RESILIENT, "--journal", journal, "--resume", "--format", "json")
    status = wait_for_end(resumed, nav2)
    record_result(
        "the guardian cancels at once; --resume completes",
        f"cancelled after {asked - killed:.1f} s, ended after {ended - killed:.1f} s, moved for {still:.1f} s after it, "
        f"resumed with status {status}",
    )
    assert asked - killed <= GRACE_SEC
    assert still <= GRACE_SEC
    assert status == 0, resumed.output
    assert "Navigating to zone_a..." not in resumed.log


def test_goal_of_other_client_is_awaited(nav2, start_mission, record_result):
    began, run = time.time(), start_mission(RESILIENT)
    nav2.robot.wait_until_moving(run)
    nav2.robot.send(0.8, 0.8)
    status = wait_for_end(run, nav2)
    record_result(
        "waited for, the mission's goal sent again", f"status {status}, {nav2.robot.ends_since(began)}"
    )
    assert status == 0, run.output
    assert not given_up_lines(run)


def test_second_mission_is_refused(nav2, start_mission, record_result):
    first = start_mission(RESILIENT)
    nav2.robot.wait_until_moving(first)
    asked = time.time()
    status = wait_for_end(start_mission(RESILIENT, "--journal", "none"), nav2)
    record_result("refused, status 2", f"status {status} after {time.time() - asked:.1f} s")
    assert status == 2
    first.send(signal.SIGINT)
    assert wait_for_end(first, nav2) == 130


def test_restart_away_from_base_sends_no_pose(nav2, start_mission, record_result):
    run = start_mission(RESILIENT, "--journal", "none")
    wait_for_line(run, nav2, "Reached zone_a.")
    run.send(signal.SIGINT)
    assert wait_for_end(run, nav2) == 130
    told = nav2.log("amcl").count("Setting pose")
    status = wait_for_end(start_mission(RESILIENT, "--journal", "none"), nav2)
    again = nav2.log("amcl").count("Setting pose") - told
    record_result("status 3, the robot is told nothing", f"status {status}, told {again} times")
    assert (status, again) == (3, 0)


def test_late_initial_pose_is_awaited(running, start_mission, record_result):
    running.stop()
    running.start()
    run = start_mission(RESILIENT, set_initial_pose="false", zone_order="[zone_a]")
    running.robot.let_pass(15.0)
    told = time.time()
    running.robot.tell_pose(0.0, 0.0)
    running.robot.wait_until_moving(run)
    drove = time.time() - told
    status = wait_for_end(run, running)
    record_result("waited for", f"drives {drove:.1f} s after the pose; status {status}")
    assert status == 0, run.output


def test_stopped_clock_is_reported_and_mission_continues(nav2, start_mission, record_result):
    run = start_mission(RESILIENT)
    nav2.robot.wait_until_moving(run)
    stopped = time.time()
    nav2.simulator.send(signal.SIGSTOP)
    wait_for_line(run, nav2, "clock")
    told = time.time() - stopped
    nav2.simulator.send(signal.SIGCONT)
    status = wait_for_end(run, nav2)
    record_result("told after 10 s, the goal not harmed", f"told after {told:.1f} s, status {status}")
    assert status == 0, run.output


def test_low_battery_during_drive_sends_robot_home(nav2, start_mission, record_result):
    run = start_drive_to_second_zone(nav2, start_mission, GUARDED)
    told = time.time()
    deadline = told + 10.0
    while "the battery is at 10%" not in run.output and time.time() < deadline:
        nav2.robot.say_battery(0.1)
        nav2.robot.let_pass(0.1)
    noticed = time.time() - told
    status = wait_for_end(run, nav2)
    record_result(
        "home with the next tick, the zones named, status 1",
        f"noticed after {noticed:.1f} s, home {time.time() - told:.1f} s after; status {status}",
    )
    assert status == 1, run.output
    assert "Reached base station." in run.log
    assert all(any(zone in line for line in given_up_lines(run)) for zone in ZONES[1:]), run.output


def test_deactivation_of_nav2_during_drive_costs_no_zone(nav2, start_mission, record_result):
    """The lifecycle manager misses the node, stops the others, and starts all of them again."""
    began, run = time.time(), start_drive_to_second_zone(nav2, start_mission)
    assert nav2.robot.change_state("bt_navigator", Transition.TRANSITION_DEACTIVATE)
    inactive = time.time()
    still = nav2.robot.still_after(inactive)
    status = wait_for_end(run, nav2)
    ends = nav2.robot.ends_since(began)
    record_result(
        "waited for; no zone is postponed or given up; the mission completes",
        f"moved for {still:.1f} s, {ends.count(CANCELED)} goals canceled, {ends.count(ABORTED)} aborted; "
        f"{given_up_lines(run) or 'none given up'}; status {status}",
    )
    assert status == 0, run.output
    assert not given_up_lines(run)


def start_drive_to_second_zone(nav2, start_mission, tree=RESILIENT):
    """Start a run, and return it while its robot drives from the first zone to the second."""
    run = start_mission(tree, "--journal", "none")
    wait_for_line(run, nav2, "Reached zone_a.")
    wait_for_line(run, nav2, "Navigating to zone_b...")
    nav2.robot.wait_until_moving(run)
    return run


def kill_during_drive(nav2, start_mission, name):
    """Kill one of Nav2's processes during a drive; return the run and the time of the kill."""
    run = start_drive_to_second_zone(nav2, start_mission)
    return run, nav2.kill(name)


def test_restart_of_killed_navigator_costs_no_zone(nav2, start_mission, record_result):
    run, killed = kill_during_drive(nav2, start_mission, "bt_navigator")
    nav2.robot.let_pass(RESTARTED_AFTER_SEC)
    nav2.run("bt_navigator")
    came_back = nav2.robot.comes_within(
        RETURN_WITHIN_SEC, lambda: "Managed nodes are active" in nav2.news(NAVIGATION_MANAGER)
    )
    if not came_back:
        run.send(signal.SIGINT)
    status = wait_for_end(run, nav2)
    record_result(
        "no zone is postponed or given up, whether Nav2 comes back or not; if it does, the mission completes",
        f"Nav2 {'came back' if came_back else 'did not come back'}; {given_up_lines(run) or 'none given up'}; status {status}, {time.time() - killed:.0f} s after the kill",
    )
    assert not given_up_lines(run)
    assert status == (0 if came_back else 130), run.output


@pytest.mark.parametrize("how", ["end", "kill"])
def test_mission_continues_after_navigation_is_restarted(how, nav2, start_mission, record_result):
    run = start_drive_to_second_zone(nav2, start_mission)
    ended = getattr(nav2, how)(NAVIGATION_MANAGER, *NAVIGATION)
    nav2.robot.let_pass(RESTARTED_AFTER_SEC)
    for name in (*NAVIGATION, NAVIGATION_MANAGER):
        nav2.run(name)
    status = wait_for_end(run, nav2)
    record_result(
        "no zone is postponed or given up; the mission completes",
        f"{given_up_lines(run) or 'none given up'}; status {status}, {time.time() - ended:.0f} s after the end",
    )
    assert status == 0, run.output
    assert not given_up_lines(run)


@pytest.mark.parametrize("name", ["bt_navigator", "controller_server", "planner_server", "behavior_server"])
def test_no_zone_is_given_up_while_nav2_server_is_missing(name, nav2, start_mission, record_result):
    run, killed = kill_during_drive(nav2, start_mission, name)
    moved = nav2.robot.still_after(killed)
    nav2.robot.let_pass(MISSING_SEC)
    told = [(at - killed, text) for at, _, text in run.stamped_log() if at > killed]
    assert told, run.output
    lost = given_up_lines(run)
    run.send(signal.SIGINT)
    status, ended = wait_for_end(run, nav2), time.time()
    after = nav2.robot.still_after(ended)
    record_result(
        f"told within {REPORTED_WITHIN_SEC:.0f} s, no zone is postponed or given up; nothing moves after the end",
        f"told after {told[0][0]:.1f} s: {told[0][1]}; moved for {moved:.1f} s after the kill; "
        f"{lost or 'none given up'} in {MISSING_SEC:.0f} s; status {status}, moved for {after:.1f} s",
    )
    assert told[0][0] <= REPORTED_WITHIN_SEC
    assert not lost
    assert after <= GRACE_SEC


def test_crashed_localisation_is_reported_within_four_seconds(nav2, start_mission, record_result):
    run, killed = kill_during_drive(nav2, start_mission, "amcl")
    before = len(run.log)
    nav2.robot.wait_until(lambda: localisation_line(run, before), "a word of the localisation")
    told = time.time() - killed
    lost = given_up_lines(run)
    run.send(signal.SIGINT)
    wait_for_end(run, nav2)
    line = localisation_line(run, before)
    record_result(
        "told within 4 s, no zone given up", f"after {told:.1f} s: {line}; {lost or 'none given up'}"
    )
    assert told <= 4.0
    assert not lost


def localisation_line(run, since):
    """Return the first line about a missing localisation."""
    words = ("localisation", "amcl", "No transform from 'map'")
    return next((line for line in run.log[since:] if any(word in line for word in words)), "")


def test_ten_missions_in_a_row_complete(nav2, start_mission, record_result):
    """A drive that Nav2 aborts is repeated; none is aborted while the controller keeps its rate."""
    ends = []
    for _ in range(MISSIONS_IN_A_ROW):
        began = time.time()
        nav2.forget_logs()
        run = start_mission(RESILIENT, "--journal", "none", "--format", "json")
        status = wait_for_end(run, nav2)
        aborted, loose = nav2.robot.ends_since(began).count(ABORTED), nav2.robot.drives_without_goal(began)
        ends.append((status, summary(run)["duration"], aborted, round(loose, 1), nav2.missed_rates()))
        nav2.be_home()
    record_result(
        "status 0; no drive aborted and nothing moves without a goal, where the controller keeps its rate",
        f"(status, s, aborted, s without goal, control loops missed): {ends}",
    )
    assert [status for status, *_ in ends] == [0] * MISSIONS_IN_A_ROW
    in_time = [each for each in ends if not each[-1]]
    assert [aborted for _, _, aborted, *_ in in_time] == [0] * len(in_time)
    assert max((loose for _, _, _, loose, _ in in_time), default=0.0) <= GRACE_SEC


def test_default_timeout_of_nav2_on_busy_computer_gives_up_no_zone(
    running, start_mission, record_result, tmp_path
):
    """With 20 ms Nav2 aborts most goals without a code, which is no failure of their zones."""
    running.stop()
    running.parameters = nav2_with_its_own_time_outs(tmp_path)
    try:
        running.start()
        began = time.time()
        with busy_processes(2):
            run = start_mission(RESILIENT, "--journal", "none", "--format", "json")
            status = wait_for_end(run, running)
        aborted, place = running.robot.ends_since(began).count(ABORTED), running.robot.place
        unsearched = [line for line in given_up_lines(run) if "navigation is unavailable" not in line]
        record_result(
            "the parameter is named; each zone is searched, or reported as not searched because Nav2 did not answer; home",
            f"status {status}, {aborted} goals aborted, {given_up_lines(run) or 'no zone given up'}, ended at "
            f"({place[0]:.2f}, {place[1]:.2f}), moved without a goal for {running.robot.drives_without_goal(began):.1f} s",
        )
        assert "write `default_server_timeout: 1000` under `bt_navigator" in run.output
        assert status in (0, 1), run.output
        assert not unsearched, run.output
        assert "Reached base station." in run.log, run.output
    finally:
        running.parameters = None
        running.is_whole = False
