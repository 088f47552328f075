"""Tests of `ros2 mission`: the project's commands as verbs, and commands to running missions."""

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
    """Return a function that runs `ros2 mission` as ros2cli does, and returns its exit status and output."""
    monkeypatch.syspath_prepend(str(STAND_INS))
    modules = ("ros2cli", "ros2cli.command", "sar_compiler.cli.ros2_command")
    for name in modules:
        monkeypatch.delitem(sys.modules, name, raising=False)
    (entry,) = entry_points(group="ros2cli.command", name="mission")
    command = entry.load()()
    parser = argparse.ArgumentParser("ros2 mission")
    command.add_arguments(parser, "ros2")

    def run_mission_command(*words):
        capsys.readouterr()
        status = command.main(parser=parser, args=parser.parse_args(words))
        printed = capsys.readouterr()
        return status, printed.out + printed.err

    yield run_mission_command
    for name in modules:
        sys.modules.pop(name, None)


@pytest.fixture
def authors():
    return queue.Queue()


@pytest.fixture
def robots(ros, authors):
    """Return a function that starts a mission with an action and with command services."""
    from rcl_interfaces.msg import SetParametersResult
    from std_srvs.srv import Trigger

    from sar_compiler.ros.discovery_wait import DiscoveryWait
    from sar_compiler.ros.robot_lease import RobotLease

    given = []
    nodes = []
    threads: list[Thread] = []

    def record_author(parameters):
        authors.put(parameters[0].value)
        return SetParametersResult(successful=True)

    def start_mission(name, responses):
        node = ros.node(name, allow_undeclared_parameters=True)
        nodes.append(node)
        node.add_on_set_parameters_callback(record_author)

        def callback_for(command_name):
            def respond(_request, response):
                given.append((name, command_name))
                response.success, response.message = responses[command_name]
                return response

            return respond

        for command_name in responses:
            node.create_service(Trigger, f"~/{command_name}", callback_for(command_name))
        RobotLease(node, [f"{name}/drive"], DiscoveryWait(node)).run()
        if not threads:
            threads.append(Thread(target=ros.executor.spin))
            threads[0].start()
        return given

    yield start_mission
    ros.executor.shutdown()
    for thread in threads:
        thread.join()
    for node in nodes:
        node.destroy_node()


RESPONSES = {"pause": (True, "held"), "skip_it": (False, "nothing is left"), "abort": (True, "")}


def test_validate_has_options_and_status_of_sar_compile(mission, tmp_path):
    (tmp_path / "wrong.xml").write_text(document("<Sleep/>"), encoding="utf-8")
    status, said = mission("validate", "--format", "json", str(tmp_path / "wrong.xml"))
    assert status == 1
    assert '"code": "missing-attribute"' in said


def test_run_has_options_and_status_of_sar_run(mission):
    status, said = mission("run", "no_such_tree", "--sim")
    assert status == 2
    assert "no_such_tree" in said


def test_missing_verb_prints_verbs(mission):
    status, said = mission()
    assert status == 0
    assert "commands" in said


def test_list_reports_that_no_mission_was_found(mission):
    assert mission("list") == (0, "No mission that drives a robot was found.\n")


def test_list_shows_missions_with_actions_and_commands(mission, robots):
    robots("digger", RESPONSES)
    robots("flyer", {})
    status, said = mission("list")
    first, commands, second = said.splitlines()
    assert status == 0
    assert first.startswith("node /digger (process ")
    assert first.endswith(", drives /digger/drive")
    assert commands == "  commands: abort, pause, skip_it"
    assert second.startswith("node /flyer ")


def test_command_is_sent_and_its_response_printed(mission, robots):
    given = robots("digger", RESPONSES)
    assert mission("pause") == (0, "held\n")
    assert given == [("digger", "pause")]
    assert mission("order", "abort") == (0, "abort: done\n")


def test_author_and_reason_are_sent_with_command(mission, robots, authors):
    robots("digger", RESPONSES)
    assert mission("pause", "--reason", "smoke") == (0, "held\n")
    by, reason = authors.get(timeout=SILENCE_SEC)
    assert by.startswith("ros2 mission of ")
    assert reason == "smoke"


def test_rejected_command_fails_with_reason(mission, robots):
    robots("digger", RESPONSES)
    assert mission("skip") == (2, "ros2 mission skip: not executed: nothing is left\n")


def test_unknown_command_is_rejected_with_list_of_known_commands(mission, robots):
    given = robots("digger", RESPONSES)
    said = "ros2 mission resume: /digger has no command 'resume' (known commands: abort, pause, skip_it)\n"
    assert mission("resume") == (2, said)
    assert given == []


def test_node_must_be_chosen_among_several_missions(mission, robots):
    given = robots("digger", RESPONSES)
    robots("flyer", RESPONSES)
    said = "ros2 mission pause: several missions are running (/digger, /flyer): choose one with --node\n"
    assert mission("pause") == (2, said)
    assert mission("pause", "--node", "flyer") == (0, "held\n")
    assert given == [("flyer", "pause")]


def test_command_fails_without_mission(mission):
    assert mission("abort") == (2, "ros2 mission abort: no mission was found\n")
