"""`ros2 mission`: the commands beside ROS's own, and orders to missions that run somewhere in the graph."""

import argparse
import queue
import sys
from importlib.metadata import entry_points
from pathlib import Path
from threading import Thread

import pytest

from tests.ros.conftest import make_ros, ros
from tests.trees import document
from tests.waiting import SILENCE_SEC

__all__ = ["make_ros", "ros"]

STAND_INS = Path(__file__).parents[1] / "stand_ins"

pytestmark = pytest.mark.ros


@pytest.fixture
def mission(monkeypatch, capsys):
    """What is typed behind `ros2 mission`, as ros2cli has it done: its exit status, and what was printed."""
    monkeypatch.syspath_prepend(str(STAND_INS))
    modules = ("ros2cli", "ros2cli.command", "sar_compiler.cli.ros2_command")
    for name in modules:
        monkeypatch.delitem(sys.modules, name, raising=False)
    (entry,) = entry_points(group="ros2cli.command", name="mission")
    command = entry.load()()
    parser = argparse.ArgumentParser("ros2 mission")
    command.add_arguments(parser, "ros2")

    def typed(*words):
        capsys.readouterr()
        status = command.main(parser=parser, args=parser.parse_args(words))
        printed = capsys.readouterr()
        return status, printed.out + printed.err

    yield typed
    for name in modules:
        sys.modules.pop(name, None)


@pytest.fixture
def authors():
    return queue.Queue()


@pytest.fixture
def robots(ros, authors):
    """Missions that run: each drives an action, and heeds orders."""
    from rcl_interfaces.msg import SetParametersResult
    from std_srvs.srv import Trigger

    from sar_compiler.ros.discovery_wait import DiscoveryWait
    from sar_compiler.ros.robot_lease import RobotLease

    given = []
    nodes = []
    threads: list[Thread] = []

    def take_author(parameters):
        authors.put(parameters[0].value)
        return SetParametersResult(successful=True)

    def fly(name, heeds):
        node = ros.node(name, allow_undeclared_parameters=True)
        nodes.append(node)
        node.add_on_set_parameters_callback(take_author)

        def carry_out(order):
            def answer(_request, response):
                given.append((name, order))
                response.success, response.message = heeds[order]
                return response

            return answer

        for order in heeds:
            node.create_service(Trigger, f"~/{order}", carry_out(order))
        RobotLease(node, [f"{name}/drive"], DiscoveryWait(node)).run()
        if not threads:
            threads.append(Thread(target=ros.executor.spin))
            threads[0].start()
        return given

    yield fly
    ros.executor.shutdown()
    for thread in threads:
        thread.join()
    for node in nodes:
        node.destroy_node()


HEEDS = {"pause": (True, "held"), "skip_it": (False, "nothing is left"), "abort": (True, "")}


def test_validate_has_the_options_and_the_status_of_the_command(mission, tmp_path):
    (tmp_path / "wrong.xml").write_text(document("<Sleep/>"), encoding="utf-8")
    status, said = mission("validate", "--format", "json", str(tmp_path / "wrong.xml"))
    assert status == 1
    assert '"code": "missing-attribute"' in said


def test_run_has_the_options_and_the_status_of_the_command(mission):
    status, said = mission("run", "no_such_tree", "--sim")
    assert status == 2
    assert "no_such_tree" in said


def test_without_a_verb_the_verbs_are_told(mission):
    status, said = mission()
    assert status == 0
    assert "commands" in said


def test_where_no_mission_drives_a_robot_the_list_says_so(mission):
    assert mission("list") == (0, "No mission that drives a robot was found.\n")


def test_the_list_has_the_missions_with_what_they_drive_and_heed(mission, robots):
    robots("digger", HEEDS)
    robots("flyer", {})
    status, said = mission("list")
    first, orders, second = said.splitlines()
    assert status == 0
    assert first.startswith("node /digger (process ")
    assert first.endswith(", drives /digger/drive")
    assert orders == "  commands: abort, pause, skip_it"
    assert second.startswith("node /flyer ")


def test_an_order_is_given_and_its_answer_is_told(mission, robots):
    given = robots("digger", HEEDS)
    assert mission("pause") == (0, "held\n")
    assert given == [("digger", "pause")]
    assert mission("order", "abort") == (0, "abort: done\n")


def test_an_order_says_who_gives_it_and_why_before_it_is_given(mission, robots, authors):
    robots("digger", HEEDS)
    assert mission("pause", "--reason", "smoke") == (0, "held\n")
    by, reason = authors.get(timeout=SILENCE_SEC)
    assert by.startswith("ros2 mission of ")
    assert reason == "smoke"


def test_an_order_that_is_not_carried_out_fails_and_says_why(mission, robots):
    robots("digger", HEEDS)
    assert mission("skip") == (2, "ros2 mission skip: not executed: nothing is left\n")


def test_an_order_that_a_mission_does_not_heed_is_told_beside_those_that_it_does(mission, robots):
    given = robots("digger", HEEDS)
    said = "ros2 mission resume: /digger has no command 'resume' (known commands: abort, pause, skip_it)\n"
    assert mission("resume") == (2, said)
    assert given == []


def test_of_several_missions_one_has_to_be_named(mission, robots):
    given = robots("digger", HEEDS)
    robots("flyer", HEEDS)
    said = "ros2 mission pause: several missions are running (/digger, /flyer): choose one with --node\n"
    assert mission("pause") == (2, said)
    assert mission("pause", "--node", "flyer") == (0, "held\n")
    assert given == [("flyer", "pause")]


def test_without_a_mission_nothing_is_ordered(mission):
    assert mission("abort") == (2, "ros2 mission abort: no mission was found\n")
