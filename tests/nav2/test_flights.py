"""Missions on an installed Nav2: what the pages promise, with its own nodes, codes, times and recoveries (`make nav2-test`)."""

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
# How long Nav2 is away in the tests of a server that is killed, seconds.
AWAY_SEC = 45.0
# How soon it is told that a server has died, seconds: 10 s of silence, and a look each second.
TOLD_SEC = 12.0
# After how long somebody starts a killed server again, and how long Nav2 has to come back then, seconds.
RESTARTED_AFTER_SEC, BACK_WITHIN_SEC = 5.0, 120.0


def end(run, nav2):
    """Wait for a mission's end as long as its robot is heard of: a drive in real time prints nothing for a minute."""
    nav2.robot.wait_until(lambda: run.is_over, "the mission's end")
    return run.end()


def until(run, nav2, text):
    """Wait likewise for a line."""
    nav2.robot.wait_until(lambda: text in run.output or run.is_over, f"'{text}'")
    assert text in run.output, run.output


def given_up(run):
    """The lines that give a zone an end without a visit, or put it off."""
    return [line for line in run.log if "postponed" in line.lower() or "abandon" in line.lower()]


def summary(run):
    """What `--format json` has printed."""
    lines = [line for line in run.output.splitlines() if line.startswith('{"status"')]
    assert lines, f"no summary:\n{run.output}"
    return json.loads(lines[-1])


@pytest.mark.parametrize("tree", TREES)
def test_a_tree_is_flown_and_nothing_moves_without_a_goal(tree, nav2, fly, seen):
    began = time.time()
    run = fly(tree, "--format", "json")
    status, ended = end(run, nav2), time.time()
    figures, loose = summary(run), nav2.robot.drives_without_goal(began)
    still = nav2.robot.still_after(ended)
    aborted = nav2.robot.ends_since(began).count(ABORTED)
    seen(
        "status 0, 4 zones, 2 survivors; nothing moves 1 s after a goal or the process",
        f"status {status}, {figures['figures']}, {figures['duration']:.1f} s simulated, {figures['ticks']} ticks, "
        f"{aborted} goals aborted, moved without a goal for {loose:.1f} s, after the end for {still:.1f} s",
    )
    assert status == 0, run.output
    expected = [word for zone in ZONES for word in (f"Navigating to {zone}...", f"Reached {zone}.")]
    assert in_order([*expected, "Reached base station."], run.log) is None, run.output
    assert figures["figures"]["survivors reported"] == 2
    assert max(loose, still) <= GRACE_SEC


def test_pieces_of_a_sweep_are_driven_through_as_one_goal(nav2, fly, seen, tmp_path):
    file = one_zone_to_sweep(tmp_path)
    began = time.time()
    run = fly(passing_tree(tmp_path), "--format", "json", "--params", file)
    status = end(run, nav2)
    ends, loose = nav2.robot.ends_since(began), nav2.robot.drives_without_goal(began)
    swept = [line for line in run.log if "Reached pieces" in line or "% seen" in line]
    seen(
        "status 0, no piece driven to alone, no goal aborted; nothing moves 1 s after a goal",
        f"status {status}, {summary(run)['duration']:.1f} s simulated, {swept}, {ends.count(ABORTED)} goals aborted, "
        f"moved without a goal for {loose:.1f} s",
    )
    assert status == 0, run.output
    assert swept
    assert not any("Navigating to piece " in line for line in run.log), run.output
    assert ABORTED not in ends
    assert loose <= GRACE_SEC


def test_a_zone_in_a_wall_is_given_up_and_the_robot_comes_home(nav2, fly, seen, tmp_path):
    file = one_zone_in_a_wall(tmp_path)
    began = time.time()
    run = fly(RESILIENT, "--format", "json", "--params", file)
    status = end(run, nav2)
    aborted = nav2.robot.ends_since(began).count(ABORTED)
    seen(
        "status 1, the zone named, home",
        f"status {status}, {aborted} goals aborted, {summary(run)['duration']:.1f} s",
    )
    assert status == 1, run.output
    assert any("zone_b" in line for line in given_up(run)), run.output
    assert "Reached base station." in run.log


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGHUP, 129)])
def test_a_signal_on_the_way_cancels_the_goal_and_the_robot_stands(nav2, fly, seen, number, status):
    began, run = time.time(), fly(RESILIENT)
    nav2.robot.wait_until_moving(run)
    sent = time.time()
    run.send(number)
    came, ended = end(run, nav2), time.time()
    still = nav2.robot.still_after(ended)
    seen(
        f"status {status}, the goal cancelled, still within 1 s of the end",
        f"status {came} after {ended - sent:.1f} s, moved for {still:.1f} s after it",
    )
    assert came == status, run.output
    assert CANCELED in nav2.robot.ends_since(began)
    assert still <= GRACE_SEC


def test_a_second_ctrl_c_ends_it_at_once_and_the_robot_stands(nav2, fly, seen):
    began, run = time.time(), fly(RESILIENT)
    nav2.robot.wait_until_moving(run)
    run.send(signal.SIGINT)
    nav2.robot.let_pass(0.05)
    sent = time.time()
    run.send(signal.SIGINT)
    status, ended = end(run, nav2), time.time()
    still = nav2.robot.still_after(ended)
    seen(
        "the cancel is sent; status 130, or 4 where the goal was still under way",
        f"status {status} after {ended - sent:.1f} s, moved for {still:.1f} s after it",
    )
    assert status in (130, 4), run.output
    assert CANCELED in nav2.robot.ends_since(began)
    assert still <= GRACE_SEC


def test_a_mission_that_is_killed_leaves_no_goal_and_is_resumed(nav2, fly, seen, tmp_path):
    journal = tmp_path / "m.journal"
    run = fly(RESILIENT, "--journal", journal)
    until(run, nav2, "Reached zone_a.")
    until(run, nav2, "Navigating to zone_b...")
    nav2.robot.wait_until_moving(run)
    killed = time.time()
    run.kill()
    nav2.robot.wait_until(lambda: nav2.robot.first([CANCELED], killed), "the goal's end")
    asked, ended = (nav2.robot.first(each, killed) for each in ([CANCELING, CANCELED], [CANCELED]))
    still = nav2.robot.still_after(ended)
    resumed = fly(RESILIENT, "--journal", journal, "--resume", "--format", "json")
    status = end(resumed, nav2)
    seen(
        "the guardian cancels at once; --resume completes",
        f"cancelled after {asked - killed:.1f} s, ended after {ended - killed:.1f} s, moved for {still:.1f} s after it, "
        f"resumed with status {status}",
    )
    assert asked - killed <= GRACE_SEC
    assert still <= GRACE_SEC
    assert status == 0, resumed.output
    assert "Navigating to zone_a..." not in resumed.log


def test_another_clients_goal_is_waited_for(nav2, fly, seen):
    began, run = time.time(), fly(RESILIENT)
    nav2.robot.wait_until_moving(run)
    nav2.robot.send(0.8, 0.8)
    status = end(run, nav2)
    seen("waited for, the mission's goal sent again", f"status {status}, {nav2.robot.ends_since(began)}")
    assert status == 0, run.output
    assert not given_up(run)


def test_a_second_mission_is_refused(nav2, fly, seen):
    first = fly(RESILIENT)
    nav2.robot.wait_until_moving(first)
    asked = time.time()
    status = end(fly(RESILIENT, "--journal", "none"), nav2)
    seen("refused, status 2", f"status {status} after {time.time() - asked:.1f} s")
    assert status == 2
    first.send(signal.SIGINT)
    assert end(first, nav2) == 130


def test_a_mission_begun_anew_away_from_the_base_tells_the_robot_no_pose(nav2, fly, seen):
    run = fly(RESILIENT, "--journal", "none")
    until(run, nav2, "Reached zone_a.")
    run.send(signal.SIGINT)
    assert end(run, nav2) == 130
    told = nav2.log("amcl").count("Setting pose")
    status = end(fly(RESILIENT, "--journal", "none"), nav2)
    again = nav2.log("amcl").count("Setting pose") - told
    seen("status 3, the robot is told nothing", f"status {status}, told {again} times")
    assert (status, again) == (3, 0)


def test_a_pose_that_is_given_late_is_waited_for(running, fly, seen):
    running.stop()
    running.start()
    run = fly(RESILIENT, set_initial_pose="false", zone_order="[zone_a]")
    running.robot.let_pass(15.0)
    told = time.time()
    running.robot.tell_pose(0.0, 0.0)
    running.robot.wait_until_moving(run)
    drove = time.time() - told
    status = end(run, running)
    seen("waited for", f"drives {drove:.1f} s after the pose; status {status}")
    assert status == 0, run.output


def test_a_clock_that_stops_is_told_and_the_mission_goes_on(nav2, fly, seen):
    run = fly(RESILIENT)
    nav2.robot.wait_until_moving(run)
    stopped = time.time()
    nav2.simulator.send(signal.SIGSTOP)
    until(run, nav2, "clock")
    told = time.time() - stopped
    nav2.simulator.send(signal.SIGCONT)
    status = end(run, nav2)
    seen("told after 10 s, the goal not harmed", f"told after {told:.1f} s, status {status}")
    assert status == 0, run.output


def test_a_low_battery_on_the_way_brings_the_robot_home(nav2, fly, seen):
    run = on_the_way(nav2, fly, GUARDED)
    told = time.time()
    deadline = told + 10.0
    while "the battery is at 10%" not in run.output and time.time() < deadline:
        nav2.robot.say_battery(0.1)
        nav2.robot.let_pass(0.1)
    noticed = time.time() - told
    status = end(run, nav2)
    seen(
        "home with the next tick, the zones named, status 1",
        f"noticed after {noticed:.1f} s, home {time.time() - told:.1f} s after; status {status}",
    )
    assert status == 1, run.output
    assert "Reached base station." in run.log
    assert all(any(zone in line for line in given_up(run)) for zone in ZONES[1:]), run.output


def test_nav2_that_is_deactivated_on_the_way_costs_no_attempt(nav2, fly, seen):
    """Its lifecycle manager misses the node, takes down the others, and brings all of them up again."""
    began, run = time.time(), on_the_way(nav2, fly)
    assert nav2.robot.change_state("bt_navigator", Transition.TRANSITION_DEACTIVATE)
    inactive = time.time()
    still = nav2.robot.still_after(inactive)
    status = end(run, nav2)
    ends = nav2.robot.ends_since(began)
    seen(
        "waited for; no zone is postponed or given up; the mission completes",
        f"moved for {still:.1f} s, {ends.count(CANCELED)} goals canceled, {ends.count(ABORTED)} aborted; "
        f"{given_up(run) or 'none given up'}; status {status}",
    )
    assert status == 0, run.output
    assert not given_up(run)


def on_the_way(nav2, fly, tree=RESILIENT):
    """A run whose robot drives from its first zone to the second."""
    run = fly(tree, "--journal", "none")
    until(run, nav2, "Reached zone_a.")
    until(run, nav2, "Navigating to zone_b...")
    nav2.robot.wait_until_moving(run)
    return run


def killed_on_the_way(nav2, fly, name):
    """Kill one of Nav2's processes on the way to a zone; the run, and when that was."""
    run = on_the_way(nav2, fly)
    return run, nav2.kill(name)


def test_a_navigator_that_is_killed_and_started_again_costs_no_zone(nav2, fly, seen):
    run, killed = killed_on_the_way(nav2, fly, "bt_navigator")
    nav2.robot.let_pass(RESTARTED_AFTER_SEC)
    nav2.run("bt_navigator")
    came_back = nav2.robot.comes_within(
        BACK_WITHIN_SEC, lambda: "Managed nodes are active" in nav2.news(NAVIGATION_MANAGER)
    )
    if not came_back:
        run.send(signal.SIGINT)
    status = end(run, nav2)
    seen(
        "no zone is postponed or given up, whether Nav2 comes back or not; if it does, the mission completes",
        f"Nav2 {'came back' if came_back else 'did not come back'}; {given_up(run) or 'none given up'}; status {status}, {time.time() - killed:.0f} s after the kill",
    )
    assert not given_up(run)
    assert status == (0 if came_back else 130), run.output


@pytest.mark.parametrize("how", ["end", "kill"])
def test_a_navigation_that_goes_and_is_started_again_goes_on_with_the_mission(how, nav2, fly, seen):
    run = on_the_way(nav2, fly)
    ended = getattr(nav2, how)(NAVIGATION_MANAGER, *NAVIGATION)
    nav2.robot.let_pass(RESTARTED_AFTER_SEC)
    for name in (*NAVIGATION, NAVIGATION_MANAGER):
        nav2.run(name)
    status = end(run, nav2)
    seen(
        "no zone is postponed or given up; the mission completes",
        f"{given_up(run) or 'none given up'}; status {status}, {time.time() - ended:.0f} s after the end",
    )
    assert status == 0, run.output
    assert not given_up(run)


@pytest.mark.parametrize("name", ["bt_navigator", "controller_server", "planner_server", "behavior_server"])
def test_no_zone_is_given_up_while_a_server_of_nav2_is_away(name, nav2, fly, seen):
    run, killed = killed_on_the_way(nav2, fly, name)
    moved = nav2.robot.still_after(killed)
    nav2.robot.let_pass(AWAY_SEC)
    told = [(at - killed, text) for at, _, text in run.stamped_log() if at > killed]
    assert told, run.output
    lost = given_up(run)
    run.send(signal.SIGINT)
    status, ended = end(run, nav2), time.time()
    after = nav2.robot.still_after(ended)
    seen(
        f"told within {TOLD_SEC:.0f} s, no zone is postponed or given up; nothing moves after the end",
        f"told after {told[0][0]:.1f} s: {told[0][1]}; moved for {moved:.1f} s after the kill; "
        f"{lost or 'none given up'} in {AWAY_SEC:.0f} s; status {status}, moved for {after:.1f} s",
    )
    assert told[0][0] <= TOLD_SEC
    assert not lost
    assert after <= GRACE_SEC


def test_a_localisation_that_dies_is_told_within_four_seconds(nav2, fly, seen):
    run, killed = killed_on_the_way(nav2, fly, "amcl")
    before = len(run.log)
    nav2.robot.wait_until(lambda: tells_of_localisation(run, before), "a word of the localisation")
    told = time.time() - killed
    lost = given_up(run)
    run.send(signal.SIGINT)
    end(run, nav2)
    line = tells_of_localisation(run, before)
    seen("told within 4 s, no zone given up", f"after {told:.1f} s: {line}; {lost or 'none given up'}")
    assert told <= 4.0
    assert not lost


def tells_of_localisation(run, since):
    """The first line about a localisation that is gone."""
    words = ("localisation", "amcl", "No transform from 'map'")
    return next((line for line in run.log[since:] if any(word in line for word in words)), "")


def test_ten_missions_in_a_row_are_complete(nav2, fly, seen):
    """A drive that Nav2 aborts is driven again; none is aborted while the controller keeps its rate."""
    ends = []
    for _ in range(MISSIONS_IN_A_ROW):
        began = time.time()
        nav2.forget_logs()
        run = fly(RESILIENT, "--journal", "none", "--format", "json")
        status = end(run, nav2)
        aborted, loose = nav2.robot.ends_since(began).count(ABORTED), nav2.robot.drives_without_goal(began)
        ends.append((status, summary(run)["duration"], aborted, round(loose, 1), nav2.missed_rates()))
        nav2.be_home()
    seen(
        "status 0; no drive aborted and nothing moves without a goal, where the controller keeps its rate",
        f"(status, s, aborted, s without goal, control loops missed): {ends}",
    )
    assert [status for status, *_ in ends] == [0] * MISSIONS_IN_A_ROW
    in_time = [each for each in ends if not each[-1]]
    assert [aborted for _, _, aborted, *_ in in_time] == [0] * len(in_time)
    assert max((loose for _, _, _, loose, _ in in_time), default=0.0) <= GRACE_SEC


def test_nav2s_own_time_out_on_a_busy_computer_gives_no_zone_up(running, fly, seen, tmp_path):
    """With 20 ms Nav2 aborts most goals without a code: nothing against their zones."""
    running.stop()
    running.parameters = nav2_with_its_own_time_outs(tmp_path)
    try:
        running.start()
        began = time.time()
        with busy_processes(2):
            run = fly(RESILIENT, "--journal", "none", "--format", "json")
            status = end(run, running)
        aborted, place = running.robot.ends_since(began).count(ABORTED), running.robot.place
        unsearched = [line for line in given_up(run) if "navigation is unavailable" not in line]
        seen(
            "the parameter is named; each zone is searched, or reported as not searched because Nav2 did not answer; home",
            f"status {status}, {aborted} goals aborted, {given_up(run) or 'no zone given up'}, ended at "
            f"({place[0]:.2f}, {place[1]:.2f}), moved without a goal for {running.robot.drives_without_goal(began):.1f} s",
        )
        assert "write `default_server_timeout: 1000` under `bt_navigator" in run.output
        assert status in (0, 1), run.output
        assert not unsearched, run.output
        assert "Reached base station." in run.log, run.output
    finally:
        running.parameters = None
        running.is_whole = False
