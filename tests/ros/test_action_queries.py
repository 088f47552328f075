"""Tests of queries to an action server that moves nothing, over real DDS."""

from typing import TYPE_CHECKING, Any

import pytest

from sar_compiler.leaves import ActionQueries, LeafDefinitionError
from sar_compiler.ros.leaves.goals import ABORTED, SUCCEEDED, UNKNOWN, active_goals_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.missions.mission_stage import NavServer, Stage
    from tests.ros.conftest import Ros

pytestmark = pytest.mark.ros

TYPE = "nav2_msgs/action/NavigateToPose"


@pytest.fixture
def stage(ros: "Ros") -> "Iterator[Stage]":
    from tests.missions.mission_stage import Stage

    stage = Stage(ros.context)
    yield stage
    stage.close()


class QueryProbe:
    """Queries to the stage's server and their results; the action stands for one that moves nothing."""

    def __init__(self, stage: "Stage") -> None:
        self.questions = ActionQueries(stage.node, TYPE, "navigate_to_pose")
        self.answers: list[tuple[int, Any]] = []

    def ask(self, x: float) -> None:
        goal = self.questions.interface.Goal()
        goal.pose.pose.position.x = x
        self.questions.send_goal(goal, lambda *answer: self.answers.append(answer))


def connect_probe(stage: "Stage", *script: str) -> "tuple[QueryProbe, NavServer]":
    """Return a probe that is connected to a server, and the server."""
    server = stage.nav_server()
    server.script = list(script)
    probe = QueryProbe(stage)
    stage.until(lambda: probe.questions.is_ready, "the server")
    return probe, server


def test_query_returns_status_and_result(stage: "Stage") -> None:
    probe, server = connect_probe(stage, "succeed")
    probe.ask(1.5)
    stage.until(lambda: probe.answers, "the answer")
    assert probe.answers == [(SUCCEEDED, probe.questions.interface.Result())]
    assert [goal.pose[1] for goal in server.goals] == [1.5]


def test_aborted_query_returns_error_code(stage: "Stage") -> None:
    probe, server = connect_probe(stage, "abort")
    server.error_code = 208
    probe.ask(1.5)
    stage.until(lambda: probe.answers, "the end")
    assert probe.answers == [(ABORTED, probe.questions.interface.Result(error_code=208))]


def test_rejected_query_returns_unknown_status_and_empty_result(stage: "Stage") -> None:
    probe, server = connect_probe(stage)
    server.accept = False
    probe.ask(1.5)
    stage.until(lambda: probe.answers, "the rejection")
    assert probe.answers == [(UNKNOWN, probe.questions.interface.Result())]
    assert server.goals == []


def test_result_of_abandoned_query_is_ignored(stage: "Stage") -> None:
    probe, server = connect_probe(stage)
    probe.ask(1.5)
    stage.until(lambda: server.goals, "the goal")
    probe.questions.give_up()
    assert not probe.questions._results._pending_requests
    server.order("succeed")
    server.wait_for_end()
    server.script = ["abort"]
    probe.ask(2.5)
    stage.until(lambda: probe.answers, "the answer to the next one")
    assert [status for status, _ in probe.answers] == [ABORTED]


def test_next_query_abandons_previous_one(stage: "Stage") -> None:
    probe, server = connect_probe(stage)
    held = server.hold()
    probe.ask(1.5)
    server.script = ["succeed"]
    probe.ask(2.5)
    stage.until(lambda: probe.answers, "the answer")
    held.set()
    stage.until(lambda: len(server.goals) == 2, "the goal that was given up")
    assert len(probe.answers) == 1


def test_query_is_not_an_active_goal(stage: "Stage") -> None:
    probe, server = connect_probe(stage)
    goals, news = active_goals_of(stage.node), list[Any]()
    goals.add_listener(news.append)
    probe.ask(1.5)
    stage.until(lambda: server.goals, "the goal")
    assert (len(goals), goals.may_be_active, news) == (0, False, [])
    server.order("succeed")
    stage.until(lambda: probe.answers, "the answer")
    assert news == []


def test_graph_shows_whether_server_exists(stage: "Stage") -> None:
    probe = QueryProbe(stage)
    assert not probe.questions.has_server
    host = stage.host()
    stage.nav_server_on(host)
    stage.until(lambda: probe.questions.has_server, "the server")
    host.close()
    stage.until(lambda: not probe.questions.has_server, "the end of the server")
    assert not probe.questions.is_ready


def test_release_destroys_clients(stage: "Stage") -> None:
    before = len(list(stage.node.clients))
    probe, server = connect_probe(stage)
    probe.ask(1.5)
    stage.until(lambda: server.goals, "the goal")
    probe.questions.release()
    assert len(list(stage.node.clients)) == before


def test_release_works_after_node_is_destroyed(stage: "Stage") -> None:
    probe, server = connect_probe(stage)
    probe.ask(1.5)
    stage.until(lambda: server.goals, "the goal")
    stage.renew_node()
    assert (probe.questions.has_server, probe.questions.is_ready) == (False, False)
    probe.questions.release()
    assert probe.answers == []


def test_missing_action_type_is_named(stage: "Stage") -> None:
    with pytest.raises(LeafDefinitionError, match="there is no nav2_msgs/action/NavigateToPost"):
        ActionQueries(stage.node, "nav2_msgs/action/NavigateToPost", "navigate_to_pose")
