"""A goal is over when its end was seen, or said not to be; and what is not its fault costs no attempt."""

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
def test_a_run_that_is_stopped_while_its_goal_goes_on_says_so_and_ends_with_4(fly, serve, cancel, number):
    navigation = serve("navigation", goals=[{"drive": None, "cancel": cancel}])
    run = fly(settle_timeout_sec=1.0)
    navigation.wait_for("accepted")
    run.send(number)
    assert run.end() == 4, run.output
    assert STILL_MOVING in run.output
    assert navigation.active == 1


def test_a_goal_that_was_accepted_after_the_signal_is_canceled_while_its_end_is_awaited(fly, serve):
    navigation = serve("navigation", goals=[{"drive": None, "accept_after": 2.0}])
    run = fly()
    navigation.wait_for("goal")
    run.send(signal.SIGINT)
    assert run.end() == 130, run.output
    assert navigation.wait_for("ended")["how"] == "cancel"


def test_a_goal_that_may_still_be_accepted_when_the_run_ends_is_told(fly, serve):
    navigation = serve("navigation", goals=[{"drive": None, "accept_after": 4.0}])
    run = fly(settle_timeout_sec=1.0)
    navigation.wait_for("goal")
    run.send(signal.SIGINT)
    assert run.end() == 4, run.output
    assert STILL_MOVING in run.output


def test_a_frozen_server_may_still_hold_its_goal(fly, serve):
    navigation = serve("navigation", goals=[{"drive": None}])
    run = fly(settle_timeout_sec=1.0)
    navigation.wait_for("accepted")
    navigation.freeze()
    run.send(signal.SIGINT)
    assert run.end() == 4, run.output


@pytest.mark.parametrize("tree", ["search_and_rescue", RESILIENT])
def test_a_result_that_is_lost_is_known_by_the_status_topic(fly, serve, tree):
    navigation = serve("navigation", goals=[{"result": "lose", "feedback": False}, {}])
    run = fly(tree)
    assert run.end() == 0, run.output
    assert (
        "The result of the goal sent to 'navigate_to_pose' has not arrived. According to the status topic, the goal has ended with status 4."
        in run.output
    )
    assert len(navigation.of("goal")) == 2, "the zone, and home"


def wait_until_heard(navigation, how):
    """Wait until a server has sent or answered something since it accepted the goal; it may have been asked before."""
    navigation.wait_for("accepted")
    # It has done so by the time that the next comes.
    navigation.wait_for(how, times=len(navigation.of(how)) + 2)


@pytest.mark.parametrize("feedback", [True, False])
def test_a_killed_server_is_noticed_by_its_silence_whether_it_sent_feedback_or_not(fly, serve, feedback):
    navigation = serve("navigation", goals=[{"drive": None, "feedback": feedback}])
    run = fly(RESILIENT)
    wait_until_heard(navigation, "feedback" if feedback else "asked")
    navigation.kill()
    quiet = "sent no feedback for 2 s, and node bt_navigator does not respond"
    run.wait_for(f"the server has {quiet if feedback else 'not responded for 10 s'}. {LOST}")


def test_with_the_shipped_profile_a_killed_server_is_out_of_the_graph_before_its_silence_is_noticed(
    fly, serve
):
    env = {"FASTRTPS_DEFAULT_PROFILES_FILE": "config/fastdds_profile.xml"}
    navigation = serve("navigation", env, goals=[{"drive": None, "feedback": False}])
    run = fly(RESILIENT, env=env)
    wait_until_heard(navigation, "asked")
    navigation.kill()
    run.wait_for("'NavigateToZone' waits to send its goal again: node amcl: missing")
    assert "answered nothing" not in run.output


def test_a_goal_that_an_inactive_server_rejected_is_sent_again_once_it_is_active(fly, serve):
    navigation = serve("navigation")
    run = fly(RESILIENT, zones=("zone_a", "zone_b"))
    navigation.wait_for("accepted")
    navigation.order(state={"bt_navigator": "inactive"})
    run.wait_for("waits to send its goal again: node bt_navigator: state 'inactive', must be 'active'.")
    navigation.order(state={"bt_navigator": "active"})
    assert run.end() == 0, run.output
    assert "postponed" not in run.output
    assert len(navigation.of("rejected")) == 1


def test_a_goal_that_another_client_took_over_is_sent_again_when_that_one_has_arrived(fly, serve):
    """As Nav2 has it: the first goal is aborted, without a code, when the second is accepted."""
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


def test_a_goal_outside_the_map_is_not_sent_twice(fly, serve):
    navigation = serve("navigation", goals=[{"drive": 0.0, "end": "abort", "code": 204}])
    run = fly(RESILIENT)
    run.wait_for("zone_a is postponed after attempt 1 of 3.")
    zones = [goal for goal in navigation.of("goal") if goal["x"] == -3.0]
    assert len(zones) == 1
    run.stop(within_sec=5.0)


def test_a_rehearsed_server_that_stays_dead_ends_the_mission_as_the_tree_says(start):
    ros = ("--ros-args", "-p", "zone_order:=[zone_b]")
    run = start("sar-run", RESILIENT, "--sim", "--speed", 20, "--fault", "navigate_to_pose:die@zone_b", *ros)
    assert run.end() == 1, run.output
    assert "zone_b was abandoned: navigation is unavailable (node bt_navigator: missing" in run.output
    assert "after attempt" not in run.output
    assert "time limit" not in run.output


def test_a_robot_that_drives_on_after_an_abort_is_stopped_before_the_next_attempt(fly, serve):
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
def test_a_run_ends_when_the_robot_stands_and_with_4_if_it_does_not(fly, serve, runs_away, status):
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


def test_a_navigation_server_that_dies_and_comes_back_costs_no_attempt(fly, serve):
    dies = serve("navigation", goals=ENDLESS)
    run = fly(RESILIENT, zones=("zone_a", "zone_b"))
    dies.wait_for("feedback")
    dies.kill()
    run.wait_for("waits to send its goal again:")
    serve("navigation")
    assert run.end() == 0, run.output
    assert "postponed" not in run.output


def test_a_navigation_server_that_stays_dead_ends_the_mission_and_no_zone_is_given_up_for_itself(
    fly, serve, tmp_path
):
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


def test_a_goal_that_was_sent_to_a_dead_server_is_over_when_another_server_does_not_know_it(fly, serve):
    dead = serve("navigation", goals=[{}])
    run = fly(RESILIENT, zones=("zone_a", "zone_b"), survivors={"detect": [{"outcome": False}, {}]})
    dead.wait_for("ended")
    dead.kill()
    run.wait_for("waits to send its goal again: ")
    serve("navigation")
    assert run.end() == 0, run.output
    assert "the robot may still be moving: " not in run.output


def test_a_goal_without_an_error_code_costs_its_zone_no_attempt(fly, serve):
    late = {"drive": 0.0, "end": "abort", "says": "Timed out while waiting for action server"}
    serve("navigation", goals=[late, late, {}])
    run = fly(RESILIENT)
    run.wait_for("Nav2 has aborted 2 goals in a row without an error code (controller_server: ")
    assert run.end() == 0, run.output
    assert "failed:" not in run.output


def test_a_server_that_hears_nothing_of_the_client_is_asked_with_another_one(fly, serve):
    navigation = serve("navigation", deaf=True)
    run = fly(RESILIENT)
    run.wait_for(
        "The server of 'navigate_to_pose' is present, but has not responded to 2 goals in a row with nothing"
    )
    assert run.end() == 0, run.output
    assert len(navigation.of("unanswered")) == 2


def test_what_nav2_says_itself_of_an_abort_is_the_reason_everywhere(fly, serve, tmp_path):
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
