"""What changes around a mission while it runs is said, and acted on."""

from pathlib import Path

import pytest

pytestmark = [pytest.mark.ros, pytest.mark.slow]

RESILIENT = "search_and_rescue_resilient"
ENDLESS = [{"drive": None}]


def test_a_clock_that_stops_ends_the_waits_and_is_told(fly, serve):
    clock = serve("clock")
    navigation = serve("navigation", goals=[{"drive": 2.0, "end": "abort", "code": 105}, {}])
    run = fly(RESILIENT, use_sim_time="true")
    navigation.wait_for("accepted")
    clock.order(stop=True)
    run.wait_for("The clock has stood still for 10 s (is the simulator running?)")
    assert run.end() == 0, run.output
    assert "Timeout" not in run.output


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
    run.wait_for("service detect_survivor: two servers answer to /detect_survivor: stop one.")
    serve("navigation")
    run.wait_for("action navigate_to_pose: two servers answer to /navigate_to_pose: stop one.")
    assert run.end() == 1, run.output
    assert "sar-run: action navigate_to_pose: two servers answer to /navigate_to_pose: stop one" in run.output
    navigation.wait_for("ended", how="cancel")


def test_a_second_mission_on_the_same_robot_is_refused_before_it_sends_anything(fly, serve):
    navigation = serve("navigation", goals=ENDLESS)
    first = fly(RESILIENT)
    navigation.wait_for("accepted")
    second = fly(RESILIENT, set_initial_pose="true")
    assert second.end() == 2, second.output
    assert "another mission drives this robot already: node /search_and_rescue (process " in second.output
    assert "uses the action '/navigate_to_pose'. Stop it first" in second.output
    assert navigation.of("initialpose") == []
    assert len(navigation.of("goal")) == 1
    first.wait_for("Another mission wants this robot: node /search_and_rescue")
    assert first.stop(within_sec=5.0) == 130


def test_a_mission_begun_anew_away_from_the_base_tells_a_localised_robot_no_pose_and_asks(fly, serve):
    navigation = serve("navigation", pose=[-0.44, 0.6])
    run = fly(RESILIENT, set_initial_pose="true")
    assert run.end() == 3, run.output
    assert (
        "the localisation has the robot at (-0.44, 0.60), 0.74 m from initial_pose (0.00, 0.00)" in run.output
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
    world = start("sar-sim", "run", "--keep", places, env=env)
    ros = ("--ros-args", "-p", "use_sim_time:=true", "-p", "zone_order:=[zone_a]")
    mission = start("sar-run", RESILIENT, "--until", "complete", *ros, env=env)
    mission.wait_for("Navigating to zone_a...")
    _wait_for_places(places)
    world.kill()
    mission.wait_for("failed:")
    again = start("sar-sim", "run", "--keep", places, env=env).wait_for("runs")
    mission.wait_for("The localisation is back, and is given its last pose again")
    assert mission.end() == 0, mission.output
    assert "far from the robot's" not in again.output


def _wait_for_places(path: Path) -> None:
    """Wait until the robot has moved from the world's start."""
    import json

    from tests.waiting import News

    def moved() -> bool:
        return path.is_file() and json.loads(path.read_text())["robots"][""][0][0] < -0.3

    news = News()
    with news:
        news.wait_until(moved, lambda: "the robot does not move")


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
    assert all("stop the run, and start it with the new value" in reason for reason in reasons)
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
