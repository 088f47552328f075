"""What changes around a mission while it runs is said, and acted on."""

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


def test_a_clock_that_stops_ends_the_waits_and_is_told(fly, serve):
    clock = serve("clock")
    navigation = serve("navigation", goals=[{"drive": 2.0, "end": "abort", "code": 105}, {}])
    run = fly(RESILIENT, use_sim_time="true")
    navigation.wait_for("accepted")
    clock.order(stop=True)
    run.wait_for("The clock has stood still for 10 s (is the simulator running?)")
    assert run.end() == 0, run.output
    assert "Timeout" not in run.output


def test_a_clock_that_stops_is_told_alone_although_the_transforms_stop_with_it(fly, serve):
    clock = serve("clock")
    navigation = serve("navigation", goals=[{"drive": 18.0}, {}], states={"amcl": None}, pose=[0.0, 0.0])
    localiser = serve("localiser")
    # Its localiser does not follow the robot.
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


def test_a_clock_that_jumps_is_told_once_and_changes_no_duration(fly, serve, tmp_path):
    clock = serve("clock")
    navigation = serve("navigation", goals=[{"drive": 3.0}, {}])
    # With all that looks at the time: the run, its journal and its page.
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


def test_a_second_server_is_told_and_one_of_the_navigation_ends_the_run(fly, serve):
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


def test_a_second_mission_on_the_same_robot_is_refused_before_it_sends_anything(fly, serve):
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


def test_a_mission_begun_anew_away_from_the_base_tells_a_localised_robot_no_pose_and_asks(fly, serve):
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


def test_a_mission_that_was_killed_does_not_keep_the_next_one_from_its_robot(fly, serve):
    navigation = serve("navigation", goals=[{"drive": 2.0}, {}])
    first = fly(RESILIENT)
    navigation.wait_for("accepted")
    first.kill()
    assert fly(RESILIENT).end() == 0


def test_a_mission_is_flown_among_thirty_other_participants(fly, serve, make_ros):
    for number in range(30):
        make_ros().node(f"other_{number}")
    serve("navigation")
    run = fly(RESILIENT)
    assert run.end() == 0, run.output


def test_a_localisation_that_is_gone_is_told_and_waited_for(fly, serve):
    navigation = serve("navigation", goals=[{"drive": 1.0}, {"drive": 1.0, "end": "abort"}, {}])
    run = fly(RESILIENT, zones=("zone_a", "zone_b"))
    navigation.wait_for("accepted")
    navigation.order(state={"amcl": "unconfigured"})
    run.wait_for("Nav2 is no longer active: node amcl: state 'unconfigured', must be 'active'.")
    run.wait_for("waits to send its goal again: node amcl: state 'unconfigured', must be 'active'.")
    navigation.order(state={"amcl": "active"})
    assert run.end() == 0, run.output
    assert "postponed" not in run.output


def test_a_simulator_that_was_killed_and_started_again_is_given_the_last_pose_and_the_mission_completes(
    start, serve, tmp_path
):
    # A simulation does not start beside the shadow of another one.
    env = {"FASTRTPS_DEFAULT_PROFILES_FILE": "config/fastdds_profile.xml"}
    places = tmp_path / "places.json"
    serve("survivors", env)
    # Slow: the robot is killed near the last place that its localisation has said, as one is that stands.
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
    """Wait until a localisation has said that the robot is elsewhere than at the start, and the simulator has gone on after that."""
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from nav_msgs.msg import Odometry

    from tests.e2e.witness import Watcher

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


def test_parameters_that_cannot_change_in_flight_are_refused(fly, serve):
    navigation = serve("navigation", goals=ENDLESS)
    run = fly(RESILIENT)
    navigation.wait_for("accepted")
    from tests.ros.conftest import Ros

    ros = Ros()
    try:
        reasons = _set(ros, tick_rate_hz=5.0, **{"zones.zone_a.x": 99.0}, use_sim_time=True)
    finally:
        ros.close()
    assert [reason.partition(":")[0] for reason in reasons] == [
        "tick_rate_hz",
        "zones.zone_a.x",
        "use_sim_time",
    ]
    assert all("Stop the run, and start it with the new value" in reason for reason in reasons)
    assert run.stop(within_sec=5.0) == 130


def _set(ros, **values):
    """Return why each parameter cannot be set."""
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


def test_a_run_that_was_stopped_names_that_and_blames_no_server(fly, serve):
    serve("clock")
    navigation = serve("navigation", goals=[{"drive": 16.0}, {}], states={"amcl": None}, pose=[0.0, 0.0])
    serve("localiser")
    # Its localiser does not follow the robot, and its guardian is patient.
    patient = {"arrival_tolerance_m": 100.0, "blocked_tick_timeout_sec": 60.0}
    run = fly(RESILIENT, use_sim_time="true", **patient)
    navigation.wait_for("feedback")
    run.send(signal.SIGSTOP)
    # Ten a second: longer than anybody's patience for feedback, answers, transforms and the clock.
    navigation.wait_for("feedback", times=120)
    run.send(signal.SIGCONT)
    run.wait_for("This process was suspended for ")
    assert run.end() == 0, run.output
    assert run.output.count("This process was suspended for 1") == 1
    assert not any(blame in run.output for blame in BLAMES), run.output


def test_a_run_that_hears_nobody_after_it_stood_still_is_resumed_by_another_process(fly, serve, tmp_path):
    navigation = serve("navigation", goals=[{"drive": 30.0}, {}])
    run = fly(RESILIENT, "--supervise", "--journal", tmp_path / "run.journal")
    navigation.wait_for("feedback")
    (process,) = children_of(run.pid)
    os.kill(process, signal.SIGSTOP)
    # Ten a second; a supervisor kills what is silent for 10 s.
    navigation.wait_for("feedback", times=len(navigation.of("feedback")) + 40)
    # In the graph, and not heard: as for who was forgotten, which is a matter of luck.
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


def test_a_supervisor_that_stood_still_itself_blames_no_run_for_its_silence(fly, serve, tmp_path):
    navigation = serve("navigation", goals=[{"drive": 18.0}, {}])
    run = fly(RESILIENT, "--supervise", "--journal", tmp_path / "run.journal")
    navigation.wait_for("feedback")
    (child,) = children_of(run.pid)
    (guardian,) = children_of(child)
    for process in (guardian, child, run.pid):
        os.kill(process, signal.SIGSTOP)
    # As on a machine that sleeps; ten a second, and 10 s are silence.
    navigation.wait_for("feedback", times=len(navigation.of("feedback")) + 120)
    for process in (run.pid, child, guardian):
        os.kill(process, signal.SIGCONT)
    assert run.end() == 0, run.output
    assert "has died" not in run.output
