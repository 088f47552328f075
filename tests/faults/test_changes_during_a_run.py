"""Tests of changes around a running mission, which are reported and handled."""

import math
import os
import signal

import pytest

from tests.processes import children_of

pytestmark = [pytest.mark.ros, pytest.mark.slow]

RESILIENT = "search_and_rescue_resilient"
ENDLESS = [{"drive": None}]
BLAMES = (
    "The clock has",
    "Nav2 is no longer active",
    "No transform from 'map'",
    "failed:",
    "waits to send",
    "the server has",
)


def test_stopped_clock_ends_waits_and_is_reported(fly, serve):
    clock = serve("clock")
    navigation = serve("navigation", goals=[{"drive": 2.0, "end": "abort", "code": 105}, {}])
    run = fly(RESILIENT, use_sim_time="true")
    navigation.wait_for("accepted")
    clock.order(stop=True)
    run.wait_for("The clock has stood still for 10 s (is the simulator running?)")
    assert run.end() == 0, run.output
    assert "Timeout" not in run.output


def test_stopped_clock_is_reported_without_missing_transforms(fly, serve):
    clock = serve("clock")
    navigation = serve("navigation", goals=[{"drive": 18.0}, {}], states={"amcl": None}, pose=[0.0, 0.0])
    localiser = serve("localiser")
    # The tolerance is large, because the scripted localiser does not follow the robot.
    run = fly(RESILIENT, use_sim_time="true", arrival_tolerance_m=100.0)
    navigation.wait_for("feedback")
    clock.order(stop=True)
    localiser.order(transforms=False)
    run.wait_for("The clock has stood still for 10 s")
    localiser.order(transforms=True)
    clock.order(stop=False)
    run.wait_for("The clock advances again.")
    assert run.end() == 0, run.output
    assert "No transform from 'map'" not in run.output
    assert "Transforms from 'map'" not in run.output


def test_clock_jump_is_reported_once_and_changes_no_duration(fly, serve, tmp_path):
    clock = serve("clock")
    navigation = serve("navigation", goals=[{"drive": 3.0}, {}])
    # All users of the time are active: the run, its journal and its page.
    watched = ("--journal", tmp_path / "run.journal", "--view", "web", "--web-port", 0)
    run = fly(RESILIENT, *watched, use_sim_time="true", time_limit_sec=1000.0)
    navigation.wait_for("accepted")
    clock.order(jump=5000.0)
    run.wait_for("The clock has jumped forward by 5000.")
    clock.order(jump=-5090.0)
    run.wait_for("The clock has jumped back by 50")
    assert run.end() == 0, run.output
    assert run.output.count("The clock has jumped") == 2
    assert "time limit" not in run.output


def test_second_server_is_reported_and_second_navigation_server_ends_run(fly, serve):
    navigation = serve("navigation", goals=ENDLESS)
    run = fly(RESILIENT)
    navigation.wait_for("accepted")
    serve("survivors")
    run.wait_for("service detect_survivor: two servers provide /detect_survivor. Stop one.")
    serve("navigation", goals=ENDLESS)
    run.wait_for("action navigate_to_pose: two servers provide /navigate_to_pose. Stop one.")
    assert run.end() == 1, run.output
    assert "sar-run: action navigate_to_pose: two servers provide /navigate_to_pose. Stop one" in run.output
    navigation.wait_for("ended", how="cancel")


def test_second_mission_on_same_robot_is_refused_before_sending_anything(fly, serve):
    navigation = serve("navigation", goals=ENDLESS)
    first = fly(RESILIENT)
    navigation.wait_for("accepted")
    second = fly(RESILIENT, set_initial_pose="true")
    assert second.end() == 2, second.output
    assert "another mission already uses this robot: node /search_and_rescue (process " in second.output
    assert "uses the action '/navigate_to_pose'. Stop that mission first" in second.output
    assert navigation.of("initialpose") == []
    assert len(navigation.of("goal")) == 1
    first.wait_for("Another mission claims this robot: node /search_and_rescue")
    assert first.stop(within_sec=5.0) == 130


def test_mission_starting_away_from_base_sends_no_pose_to_localised_robot(fly, serve):
    navigation = serve("navigation", pose=[-0.44, 0.6])
    run = fly(RESILIENT, set_initial_pose="true")
    assert run.end() == 3, run.output
    assert (
        "the localisation locates the robot at (-0.44, 0.60), 0.74 m from initial_pose (0.00, 0.00)"
        in run.output
    )
    assert navigation.of("initialpose") == navigation.of("goal") == []
    said = {"initial_pose.x": "-0.44", "initial_pose.y": "0.6"}
    assert fly(RESILIENT, set_initial_pose="true", **said).end() == 0


def test_killed_mission_does_not_block_robot_for_next_mission(fly, serve):
    navigation = serve("navigation", goals=[{"drive": 2.0}, {}])
    first = fly(RESILIENT)
    navigation.wait_for("accepted")
    first.kill()
    assert fly(RESILIENT).end() == 0


def test_mission_completes_among_thirty_other_participants(fly, serve, make_ros):
    for number in range(30):
        make_ros().node(f"other_{number}")
    serve("navigation")
    run = fly(RESILIENT)
    assert run.end() == 0, run.output


def test_inactive_localisation_is_reported_and_awaited(fly, serve):
    navigation = serve("navigation", goals=[{"drive": 1.0}, {"drive": 1.0, "end": "abort"}, {}])
    run = fly(RESILIENT, zones=("zone_a", "zone_b"))
    navigation.wait_for("accepted")
    navigation.order(state={"amcl": "unconfigured"})
    run.wait_for("Nav2 is no longer active: node amcl: state 'unconfigured', must be 'active'.")
    run.wait_for("waits to send its goal again: node amcl: state 'unconfigured', must be 'active'.")
    navigation.order(state={"amcl": "active"})
    assert run.end() == 0, run.output
    assert "postponed" not in run.output


def test_restarted_simulator_gets_last_pose_and_mission_completes(start, serve, tmp_path):
    # A simulation does not start while a killed one is still in the graph; this profile removes it early.
    env = {"FASTRTPS_DEFAULT_PROFILES_FILE": "config/fastdds_profile.xml"}
    places = tmp_path / "places.json"
    serve("survivors", env)
    # The simulation is slow, so that it is killed near the last position that its localisation has published.
    world = start("sar-sim", "run", "--keep", places, "--speed", 0.25, env=env)
    ros = ("--ros-args", "-p", "use_sim_time:=true", "-p", "zone_order:=[zone_a]")
    mission = start("sar-run", RESILIENT, "--until", "complete", *ros, env=env)
    mission.wait_for("Navigating to zone_a...")
    _wait_for_pose_away_from_the_start()
    world.kill()
    mission.wait_for("waits to send its goal again")
    again = start("sar-sim", "run", "--keep", places, env=env).wait_for("runs")
    mission.wait_for("The localisation is back. Its last pose")
    assert mission.end() == 0, mission.output
    assert "far from the robot's" not in again.output


def _wait_for_pose_away_from_the_start() -> None:
    """Wait until the localisation reports a robot away from the start, and the simulator has continued after that."""
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from nav_msgs.msg import Odometry

    from tests.e2e.observers import Watcher

    heard: list[str] = []

    def take_pose(message: PoseWithCovarianceStamped) -> None:
        place = message.pose.pose.position
        if math.hypot(place.x, place.y) > 0.3:
            heard.append("pose")

    def take_odometry(_: Odometry) -> None:
        if heard:
            heard.append("odometry")

    watcher = Watcher("watcher")
    watcher.node.create_subscription(PoseWithCovarianceStamped, "amcl_pose", take_pose, 10)
    watcher.node.create_subscription(Odometry, "odometry/filtered", take_odometry, 10)
    watcher.watch()
    try:
        watcher.wait_until(lambda: "odometry" in heard, "the place of a robot that drives")
    finally:
        watcher.close()


def test_parameters_fixed_during_run_are_refused(fly, serve):
    navigation = serve("navigation", goals=ENDLESS)
    run = fly(RESILIENT)
    navigation.wait_for("accepted")
    from tests.ros.conftest import Ros

    ros = Ros()
    try:
        reasons = _set_parameters(ros, tick_rate_hz=5.0, **{"zones.zone_a.x": 99.0}, use_sim_time=True)
    finally:
        ros.close()
    assert [reason.partition(":")[0] for reason in reasons] == [
        "tick_rate_hz",
        "zones.zone_a.x",
        "use_sim_time",
    ]
    assert all("Stop the run, and start it with the new value" in reason for reason in reasons)
    assert run.stop(within_sec=5.0) == 130


def _set_parameters(ros, **values):
    """Try to set parameters; return the reason of each refusal."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    client = ros.node("setter").create_client(SetParameters, "/search_and_rescue/set_parameters")
    ros.spin_until(client.service_is_ready, "the mission's parameters")
    asked = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    answer = client.call_async(SetParameters.Request(parameters=asked))
    ros.spin_until(answer.done, "the answer")
    results = answer.result().results
    assert not any(result.successful for result in results)
    return [result.reason for result in results]


def test_suspended_run_reports_suspension_and_blames_no_server(fly, serve):
    serve("clock")
    navigation = serve("navigation", goals=[{"drive": 16.0}, {}], states={"amcl": None}, pose=[0.0, 0.0])
    serve("localiser")
    # The scripted localiser does not follow the robot, and the suspension must not count as a blocked tick.
    patient = {"arrival_tolerance_m": 100.0, "blocked_tick_timeout_sec": 60.0}
    run = fly(RESILIENT, use_sim_time="true", **patient)
    navigation.wait_for("feedback")
    run.send(signal.SIGSTOP)
    # At 10 per second, this is longer than the timeouts for feedback, responses, transforms and the clock.
    navigation.wait_for("feedback", times=120)
    run.send(signal.SIGCONT)
    run.wait_for("This process was suspended for ")
    assert run.end() == 0, run.output
    assert run.output.count("This process was suspended for 1") == 1
    assert not any(blame in run.output for blame in BLAMES), run.output


def test_suspended_run_that_receives_nothing_is_resumed_by_new_process(fly, serve, tmp_path):
    navigation = serve("navigation", goals=[{"drive": 30.0}, {}])
    run = fly(RESILIENT, "--supervise", "--journal", tmp_path / "run.journal")
    navigation.wait_for("feedback")
    (process,) = children_of(run.pid)
    os.kill(process, signal.SIGSTOP)
    # At 10 per second, this is shorter than the 10 s of silence after which a supervisor kills the run.
    navigation.wait_for("feedback", times=len(navigation.of("feedback")) + 40)
    # A frozen server is in the graph but silent, which a suspension causes only by chance.
    navigation.freeze()
    os.kill(process, signal.SIGCONT)
    run.wait_for("Since this process was suspended, it has received nothing from amcl and bt_navigator")
    navigation.thaw()
    assert run.end() == 0, run.output
    assert (
        "crashed (the process no longer received messages from Nav2, although the ROS graph shows Nav2) and is resumed (1 of 3)"
        in run.output
    )
    assert not any(blame in run.output for blame in BLAMES), run.output


def test_suspended_supervisor_blames_no_run(fly, serve, tmp_path):
    navigation = serve("navigation", goals=[{"drive": 18.0}, {}])
    run = fly(RESILIENT, "--supervise", "--journal", tmp_path / "run.journal")
    navigation.wait_for("feedback")
    (child,) = children_of(run.pid)
    (guardian,) = children_of(child)
    for process in (guardian, child, run.pid):
        os.kill(process, signal.SIGSTOP)
    # As on a sleeping machine: at 10 per second, this is longer than the 10 s that count as silence.
    navigation.wait_for("feedback", times=len(navigation.of("feedback")) + 120)
    for process in (run.pid, child, guardian):
        os.kill(process, signal.SIGCONT)
    assert run.end() == 0, run.output
    assert "has crashed" not in run.output
