"""Tests of the end of goals: it is observed or reported as unknown, and faults of the navigation cost a zone no attempt."""

import signal
from html import unescape
from pathlib import Path

import pytest

from tests.processes import Command

pytestmark = [pytest.mark.ros, pytest.mark.slow]

RESILIENT = "search_and_rescue_resilient"
STILL_MOVING = "a goal may still be active, and the robot may still be moving: NavigateToZone"
ENDLESS = [{"drive": None}]
LOST = "The robot may still be moving"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("cancel", ["ignore", "refuse", "mute"])
def test_run_stopped_with_unending_goal_reports_it_and_exits_with_4(fly, serve, cancel, number):
    navigation = serve("navigation", goals=[{"drive": None, "cancel": cancel}])
    run = fly(settle_timeout_sec=1.0)
    navigation.wait_for("accepted")
    run.send(number)
    assert run.end() == 4, run.output
    assert STILL_MOVING in run.output
    assert navigation.active == 1


def test_goal_accepted_after_signal_is_canceled(fly, serve):
    navigation = serve("navigation", goals=[{"drive": None, "accept_after": 2.0}])
    run = fly()
    navigation.wait_for("goal")
    run.send(signal.SIGINT)
    assert run.end() == 130, run.output
    assert navigation.wait_for("ended")["how"] == "cancel"


def test_goal_still_awaiting_acceptance_at_end_is_reported(fly, serve):
    navigation = serve("navigation", goals=[{"drive": None, "accept_after": 4.0}])
    run = fly(settle_timeout_sec=1.0)
    navigation.wait_for("goal")
    run.send(signal.SIGINT)
    assert run.end() == 4, run.output
    assert STILL_MOVING in run.output


def test_run_with_frozen_server_exits_with_4(fly, serve):
    navigation = serve("navigation", goals=[{"drive": None}])
    run = fly(settle_timeout_sec=1.0)
    navigation.wait_for("accepted")
    navigation.freeze()
    run.send(signal.SIGINT)
    assert run.end() == 4, run.output


@pytest.mark.parametrize("tree", ["search_and_rescue", RESILIENT])
def test_lost_result_is_read_from_status_topic(fly, serve, tree):
    navigation = serve("navigation", goals=[{"result": "lose", "feedback": False}, {}])
    run = fly(tree)
    assert run.end() == 0, run.output
    assert (
        "The result of the goal sent to 'navigate_to_pose' has not arrived. According to the status topic, the goal has ended with status 4."
        in run.output
    )
    assert len(navigation.of("goal")) == 2, "the zone, and home"


def wait_until_heard(navigation, how):
    """Wait until the mission has received a message of the server after the goal was accepted."""
    navigation.wait_for("accepted")
    # When the second further event occurs, the mission has received the first one.
    navigation.wait_for(how, times=len(navigation.of(how)) + 2)


@pytest.mark.parametrize("feedback", [True, False])
def test_killed_server_is_detected_with_and_without_feedback(fly, serve, feedback):
    navigation = serve("navigation", goals=[{"drive": None, "feedback": feedback}])
    run = fly(RESILIENT)
    wait_until_heard(navigation, "feedback" if feedback else "asked")
    navigation.kill()
    quiet = "sent no feedback for 2 s, and node bt_navigator does not respond"
    run.wait_for(f"the server has {quiet if feedback else 'not responded for 10 s'}. {LOST}")


def test_killed_server_leaves_graph_early_with_shipped_profile(fly, serve):
    env = {"FASTRTPS_DEFAULT_PROFILES_FILE": "config/fastdds_profile.xml"}
    navigation = serve("navigation", env, goals=[{"drive": None, "feedback": False}])
    run = fly(RESILIENT, env=env)
    wait_until_heard(navigation, "asked")
    navigation.kill()
    run.wait_for("'NavigateToZone' waits to send its goal again: node amcl: missing")
    assert "no response to the goal" not in run.output


def test_goal_rejected_by_inactive_server_is_sent_again_once_active(fly, serve):
    navigation = serve("navigation")
    run = fly(RESILIENT, zones=("zone_a", "zone_b"))
    navigation.wait_for("accepted")
    navigation.order(state={"bt_navigator": "inactive"})
    run.wait_for("waits to send its goal again: node bt_navigator: state 'inactive', must be 'active'.")
    navigation.order(state={"bt_navigator": "active"})
    assert run.end() == 0, run.output
    assert "postponed" not in run.output
    assert len(navigation.of("rejected")) == 1


def test_goal_preempted_by_other_client_is_sent_again_after_its_end(fly, serve):
    """Like Nav2, the server aborts the first goal without an error code when it accepts the second one."""
    from tests.faults.other_client import OtherClient

    navigation = serve("navigation", goals=[{"drive": None}, {"drive": 1.0}, {}], preempts=True)
    run = fly(RESILIENT)
    navigation.wait_for("accepted")
    with OtherClient() as other:
        other.send()
        run.wait_for("waits to send its goal again: another client's goal is active on 'navigate_to_pose'.")
        assert run.end() == 0, run.output
    assert len(navigation.of("goal")) == 4, "the zone twice, the other's, and home"
    hows = {end["number"]: end["how"] for end in navigation.of("ended")}
    assert hows == {1: "abort", 2: "succeed", 3: "succeed", 4: "succeed"}


def test_goal_outside_map_is_not_sent_twice(fly, serve):
    navigation = serve("navigation", goals=[{"drive": 0.0, "end": "abort", "code": 204}])
    run = fly(RESILIENT)
    run.wait_for("zone_a is postponed after attempt 1 of 3.")
    zones = [goal for goal in navigation.of("goal") if goal["x"] == -3.0]
    assert len(zones) == 1
    run.stop(within_sec=5.0)


def test_simulated_server_that_stays_dead_abandons_zone(start):
    ros = ("--ros-args", "-p", "zone_order:=[zone_b]")
    run = start("sar-run", RESILIENT, "--sim", "--speed", 20, "--fault", "navigate_to_pose:die@zone_b", *ros)
    assert run.end() == 1, run.output
    assert "zone_b was abandoned: navigation is unavailable (node bt_navigator: missing" in run.output
    assert "after attempt" not in run.output
    assert "time limit" not in run.output


def test_robot_driving_after_aborted_goal_is_stopped_before_next_attempt(fly, serve):
    drives_on = {"drive": 0.5, "end": "abort", "code": 105, "drives_on": 60.0}
    navigation = serve("navigation", odometry=True, goals=[drives_on, {}])
    run = fly(RESILIENT, settle_timeout_sec=30.0)
    run.wait_for(
        "The robot moves (0.30 m/s, 0.00 rad/s) although its goal has ended and no other goal is active"
    )
    assert navigation.wait_for("follow_path cancelled")["all"]
    run.wait_for("The robot has stopped.")
    assert run.end() == 0, run.output
    assert "postponed" not in run.output


@pytest.mark.parametrize(("runs_away", "status"), [(False, 130), (True, 4)])
def test_stopped_run_waits_for_standstill_and_exits_with_4_otherwise(fly, serve, runs_away, status):
    goals = [{"drive": None, "drives_on": 60.0}]
    navigation = serve("navigation", odometry=True, runs_away=runs_away, goals=goals)
    run = fly(settle_timeout_sec=8.0 if runs_away else 30.0)
    navigation.wait_for("accepted")
    run.send(signal.SIGINT)
    assert run.end() == status, run.output
    navigation.wait_for("ended", how="cancel")
    navigation.wait_for("follow_path cancelled")
    still = "no goal of this mission is active, but the robot still moves (0.30 m/s, 0.00 rad/s)"
    assert (still in run.output) is runs_away


def test_restarted_navigation_server_costs_no_attempt(fly, serve):
    dies = serve("navigation", goals=ENDLESS)
    run = fly(RESILIENT, zones=("zone_a", "zone_b"))
    dies.wait_for("feedback")
    dies.kill()
    run.wait_for("waits to send its goal again:")
    serve("navigation")
    assert run.end() == 0, run.output
    assert "postponed" not in run.output


def test_dead_navigation_server_ends_mission_without_postponing_zones(fly, serve, tmp_path):
    impatient = 'feedback_timeout_sec="2" acceptance_timeout_sec="1" hold_timeout_sec="3"'
    text = Path("trees/search_and_rescue_resilient.xml").read_text()
    text = text.replace("<NavigateToZone/>", f"<NavigateToZone {impatient}/>").replace(
        "<NavigateToBase/>", f"<NavigateToBase {impatient}/>"
    )
    tree = tmp_path / "impatient.xml"
    tree.write_text(text.replace('num_attempts="5"', 'num_attempts="1"').replace("10000", "100"))
    navigation = serve("navigation", goals=ENDLESS)
    run = fly(tree, zones=("zone_a", "zone_b"))
    navigation.wait_for("feedback")
    navigation.kill()
    run.wait_for("Navigation to zone_a is unavailable:")
    assert run.end() in (1, 4), run.output
    assert "postponed" not in run.output
    assert "zone_a and zone_b were abandoned: navigation is unavailable (" in run.output


def test_goal_of_dead_server_is_over_if_new_server_does_not_know_it(fly, serve):
    dead = serve("navigation", goals=[{}])
    run = fly(RESILIENT, zones=("zone_a", "zone_b"), survivors={"detect": [{"outcome": False}, {}]})
    dead.wait_for("ended")
    dead.kill()
    run.wait_for("waits to send its goal again: ")
    serve("navigation")
    assert run.end() == 0, run.output
    assert "the robot may still be moving: " not in run.output


def test_goal_aborted_without_error_code_costs_no_attempt(fly, serve):
    late = {"drive": 0.0, "end": "abort", "says": "Timed out while waiting for action server"}
    serve("navigation", goals=[late, late, {}])
    run = fly(RESILIENT)
    run.wait_for("Nav2 has aborted 2 goals in a row without an error code (controller_server: ")
    assert run.end() == 0, run.output
    assert "failed:" not in run.output


def test_unresponsive_server_is_contacted_by_new_client(fly, serve):
    navigation = serve("navigation", deaf=True)
    run = fly(RESILIENT)
    run.wait_for(
        "The server of 'navigate_to_pose' is present, but has not responded to 2 goals in a row with nothing"
    )
    assert run.end() == 0, run.output
    assert len(navigation.of("unanswered")) == 2


def test_nav2_message_about_abort_is_the_reason_everywhere(fly, serve, tmp_path):
    serve("navigation", goals=[{"end": "abort", "code": 105, "says": "Failed to make progress"}, {}])
    journal, reports = tmp_path / "run.journal", [tmp_path / f"run.{form}" for form in ("json", "html")]
    asked = [word for report in reports for word in ("--report", report)]
    run = fly(RESILIENT, "--journal", journal, *asked)
    assert run.end() == 0, run.output
    why = Command("sar-journal", "why", journal)
    assert why.end() == 0
    said = [run.output, why.output, *(report.read_text(encoding="utf-8") for report in reports)]
    quote = 'controller_server: "Failed to make progress"'
    assert [quote in unescape(text).replace('\\"', '"') for text in said] == [True] * 4, said[:2]
