"""Questions to an action's server that moves nothing, over real DDS."""

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


class Asked:
    """Questions to the stage's server, and its answers; the action stands for one that moves nothing."""

    def __init__(self, stage: "Stage") -> None:
        self.questions = ActionQueries(stage.node, TYPE, "navigate_to_pose")
        self.answers: list[tuple[int, Any]] = []

    def ask(self, x: float) -> None:
        goal = self.questions.interface.Goal()
        goal.pose.pose.position.x = x
        self.questions.send_goal(goal, lambda *answer: self.answers.append(answer))


def asked(stage: "Stage", *script: str) -> "tuple[Asked, NavServer]":
    """Return who asks, and the server, which is found."""
    server = stage.nav_server()
    server.script = list(script)
    asked = Asked(stage)
    stage.until(lambda: asked.questions.is_ready, "the server")
    return asked, server


def test_the_result_is_what_is_answered(stage: "Stage") -> None:
    who, server = asked(stage, "succeed")
    who.ask(1.5)
    stage.until(lambda: who.answers, "the answer")
    assert who.answers == [(SUCCEEDED, who.questions.interface.Result())]
    assert [goal.pose[1] for goal in server.goals] == [1.5]


def test_a_server_that_aborts_says_why(stage: "Stage") -> None:
    who, server = asked(stage, "abort")
    server.error_code = 208
    who.ask(1.5)
    stage.until(lambda: who.answers, "the end")
    assert who.answers == [(ABORTED, who.questions.interface.Result(error_code=208))]


def test_a_server_that_rejects_has_no_answer(stage: "Stage") -> None:
    who, server = asked(stage)
    server.accept = False
    who.ask(1.5)
    stage.until(lambda: who.answers, "the rejection")
    assert who.answers == [(UNKNOWN, who.questions.interface.Result())]
    assert server.goals == []


def test_what_is_answered_to_a_question_that_was_given_up_is_ignored(stage: "Stage") -> None:
    who, server = asked(stage)
    who.ask(1.5)
    stage.until(lambda: server.goals, "the goal")
    who.questions.give_up()
    assert not who.questions._results._pending_requests
    server.order("succeed")
    server.wait_for_end()
    server.script = ["abort"]
    who.ask(2.5)
    stage.until(lambda: who.answers, "the answer to the next one")
    assert [status for status, _ in who.answers] == [ABORTED]


def test_the_next_question_gives_up_the_one_before(stage: "Stage") -> None:
    who, server = asked(stage)
    held = server.hold()
    who.ask(1.5)
    server.script = ["succeed"]
    who.ask(2.5)
    stage.until(lambda: who.answers, "the answer")
    held.set()
    stage.until(lambda: len(server.goals) == 2, "the goal that was given up")
    assert len(who.answers) == 1


def test_a_question_is_no_goal_under_way(stage: "Stage") -> None:
    who, server = asked(stage)
    goals, news = active_goals_of(stage.node), list[Any]()
    goals.add_listener(news.append)
    who.ask(1.5)
    stage.until(lambda: server.goals, "the goal")
    assert (len(goals), goals.may_be_active, news) == (0, False, [])
    server.order("succeed")
    stage.until(lambda: who.answers, "the answer")
    assert news == []


def test_the_graph_says_whether_there_is_a_server(stage: "Stage") -> None:
    who = Asked(stage)
    assert not who.questions.has_server
    host = stage.host()
    stage.nav_server_on(host)
    stage.until(lambda: who.questions.has_server, "the server")
    host.close()
    stage.until(lambda: not who.questions.has_server, "the end of the server")
    assert not who.questions.is_ready


def test_its_clients_are_gone_when_it_is_released(stage: "Stage") -> None:
    before = len(list(stage.node.clients))
    who, server = asked(stage)
    who.ask(1.5)
    stage.until(lambda: server.goals, "the goal")
    who.questions.release()
    assert len(list(stage.node.clients)) == before


def test_it_can_be_released_after_the_end_of_its_node(stage: "Stage") -> None:
    who, server = asked(stage)
    who.ask(1.5)
    stage.until(lambda: server.goals, "the goal")
    stage.renew_node()
    assert (who.questions.has_server, who.questions.is_ready) == (False, False)
    who.questions.release()
    assert who.answers == []


def test_a_type_that_is_not_installed_is_named(stage: "Stage") -> None:
    with pytest.raises(LeafDefinitionError, match="there is no nav2_msgs/action/NavigateToPost"):
        ActionQueries(stage.node, "nav2_msgs/action/NavigateToPost", "navigate_to_pose")
