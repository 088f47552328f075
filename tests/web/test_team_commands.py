"""Tests of commands to missions in other processes, by the services of their nodes."""

import json
import socket

import pytest

from sar_compiler.execution.command_authors import CommandAuthors
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.missions.mission import CommandError
from sar_compiler.missions.parameter_reader import ParameterReader
from sar_compiler.web.page_server import CommandSender
from sar_compiler.web.team_commands import TeamCommands, open_team_commands, run_of
from search_and_rescue.operator_commands import VERBS
from search_and_rescue.plugin import SearchAndRescue
from search_and_rescue.search import Search
from tests.ros.conftest import make_ros, ros

__all__ = ["make_ros", "ros"]

pytestmark = pytest.mark.ros


def run_began(node="/robot2/mission", mission="search_and_rescue"):
    """Return the entry of the start of a run."""
    parameters = {"zone_order": ["a"], "zones": {"a": {"x": 1.0, "y": 1.0, "yaw": 0.0}}}
    base = {"base_station": {"x": 0.0, "y": 0.0, "yaw": 0.0}}
    run = {"node": node, "parameters": {**parameters, **base}}
    return JournalEntry(1, 1, 0.0, 0.0, "run_began", {"mission": mission, "run": run})


@pytest.fixture
def team(ros, monkeypatch):
    """Return the team commands, the journal entries of robot2, and the commands that robot2 received."""
    from std_srvs.srv import Trigger

    monkeypatch.setattr("getpass.getuser", lambda: "ops")
    told: list[JournalEntry] = []
    asked: list[str] = []
    journal = Journal()
    journal.add_listener(told.append)

    def pause(_, response):
        asked.append("pause")
        response.success, response.message = True, "it stands"
        return response

    robot = ros.node("mission", namespace="/robot2", allow_undeclared_parameters=True)
    record = CommandAuthors(robot, VERBS, journal)
    robot.create_service(Trigger, "~/pause", pause)
    record.begin()
    return TeamCommands(ros.node("watch")), told, asked


def test_command_reaches_its_robot_and_is_recorded_with_author(ros, team):
    orders, told, asked = team
    assert [verb.name for verb in orders.add_run(1, run_began())][:2] == ["pause", "resume"]
    orders.add_run(0, run_began("/robot1/mission"))
    ros.spin_until(lambda: orders.available(1) == ["pause"], "the service of robot2")
    assert orders.available(0) == []
    answer = orders.send("pause", {}, CommandSender("Ada", 1, reason="smoke"))
    ros.spin_until(answer.done, "the answer")
    assert (answer.result(), asked) == ((True, "it stands"), ["pause"])
    by = f"Ada (team page of ops@{socket.gethostname()})"
    (order,) = told
    assert order.kind == "ordered"
    said = {"by": by, "reason": "smoke", "refusal": ""}
    assert order.data == {"verb": "pause", "label": "Pause", **said, "is_told": False}


def test_robot_without_parameter_services_accepts_commands(ros):
    from std_srvs.srv import Trigger

    robot = ros.node("mission", namespace="/robot3", start_parameter_services=False)
    robot.create_service(Trigger, "~/pause", lambda _, response: response)
    orders = TeamCommands(ros.node("watch"))
    orders.add_run(0, run_began("/robot3/mission"))
    ros.spin_until(lambda: orders.available(0) == ["pause"], "the service of robot3")
    answer = orders.send("pause", {}, CommandSender("Ada", 0))
    ros.spin_until(answer.done, "the answer")
    assert answer.result() == (False, "")


@pytest.mark.parametrize("beginning", [run_began(mission="of somebody else"), run_began(node="")])
def test_unknown_mission_accepts_no_commands(team, beginning):
    orders, _, _ = team
    assert orders.add_run(0, beginning) == []
    assert orders.available(0) == []
    with pytest.raises(CommandError, match="its mission is not installed"):
        orders.send("pause", {}, CommandSender("", 0))


def test_broken_middleware_is_reported_and_disables_commands(monkeypatch):
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_of_nobody")
    said: list[str] = []
    with open_team_commands(said.append) as orders:
        assert orders is None
    assert "rmw_of_nobody" in said[0]


def test_commands_are_disabled_without_ros(monkeypatch):
    monkeypatch.setattr("sar_compiler.web.team_commands.find_spec", lambda _: None)
    with open_team_commands(pytest.fail) as orders:
        assert orders is None


def test_team_commands_are_available_with_ros():
    with open_team_commands(pytest.fail) as orders:
        assert orders is not None
        assert [verb.name for verb in orders.add_run(0, run_began())][:1] == ["pause"]


def test_file_named_by_journal_is_not_read(tmp_path):
    """A journal is untrusted; the run has recorded the content of its files in its parameters."""
    areas = tmp_path / "areas.geojson"
    square = [[0.001, 0.001], [0.002, 0.001], [0.002, 0.002], [0.001, 0.001]]
    area = {"properties": {"name": "secret"}, "geometry": {"type": "Polygon", "coordinates": [square]}}
    areas.write_text(json.dumps({"features": [area]}), encoding="utf-8")
    georeference = {f"georeference.{name}": 0.0 for name in ("lat", "lon", "heading")}
    base = {f"base_station.{name}": 0.0 for name in ("x", "y", "yaw")}
    parameters = {**base, **georeference, "areas_file": str(areas)}
    assert [*SearchAndRescue().begin(ParameterReader(parameters)).zones.remaining_zones()]
    entry = run_began()
    run = run_of(entry._replace(data={**entry.data, "run": {"parameters": parameters}}))
    assert isinstance(run, Search)
    assert [*run.zones.remaining_zones()] == []
