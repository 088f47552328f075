"""Tests of leaves with random server responses: a leaf ends, prints clean lines, and accepts the next valid response."""

import math
import unicodedata
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.waiting import SILENCE_SEC

pytestmark = pytest.mark.ros

# A response about the goal that was sent, or about another one.
OWN, FOREIGN = "own", "foreign"
SUCCEEDED, UNKNOWN_GOAL = 4, 2
FINAL = {SUCCEEDED, 5, 6}

whose = st.sampled_from([OWN, FOREIGN])
bytes_ = st.integers(-128, 127)
statuses = st.one_of(st.sampled_from([0, 2, *FINAL]), bytes_)
results = st.fixed_dictionaries(
    {
        "status": statuses,
        "error_code": st.one_of(st.sampled_from([0, 102, 204, 206]), st.integers(0, 2**16 - 1)),
        "error_msg": st.text(max_size=60),
    }
)
answers = st.fixed_dictionaries(
    {
        "accepts": st.sampled_from([True, True, True, False, None]),
        "feedback": st.lists(st.tuples(whose, st.floats(width=32)), max_size=2),
        "statuses": st.lists(st.lists(st.tuples(whose, statuses), max_size=3), max_size=2),
        "result": st.one_of(results, results, st.none()),
        "pulse": st.one_of(results, st.none()),
        "cancel": st.one_of(st.tuples(bytes_, st.lists(whose, max_size=2)), st.none()),
        "states": st.lists(st.one_of(st.just("active"), st.text(max_size=20)), min_size=2, max_size=2),
    }
)
TRUE: dict[str, Any] = {
    "accepts": True,
    "feedback": [(OWN, 1.0)],
    "statuses": [],
    "result": {"status": SUCCEEDED, "error_code": 0, "error_msg": ""},
    "pulse": {"status": 0, "error_code": 0, "error_msg": ""},
    "cancel": (UNKNOWN_GOAL, []),
    "states": ["active", "active"],
}


class ScriptedServer:
    """A `navigate_to_pose` server and Nav2's lifecycle nodes that send scripted responses to any request.

    It consists of plain services and topics, because an action server sends only consistent responses.

    Attributes:
        says: The responses.
        has_asked: Whether a client has requested the result of a goal since it was sent.
    """

    def __init__(self, host):
        from action_msgs.msg import GoalStatusArray
        from action_msgs.srv import CancelGoal
        from lifecycle_msgs.srv import GetState
        from nav2_msgs.action import NavigateToPose
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self.says = TRUE
        self.has_asked = False
        self._types, self._goal = NavigateToPose, b""
        parts = NavigateToPose.Impl
        self._serve(host, parts.SendGoalService, "navigate_to_pose/_action/send_goal", self._accept)
        self._serve(host, parts.GetResultService, "navigate_to_pose/_action/get_result", self._tell_result)
        self._serve(host, CancelGoal, "navigate_to_pose/_action/cancel_goal", self._cancel)
        for number, name in enumerate(("amcl", "bt_navigator")):
            self._serve(
                host, GetState, f"{name}/get_state", lambda _, response, n=number: self._state(n, response)
            )
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._feedback = host.node.create_publisher(
            parts.FeedbackMessage, "navigate_to_pose/_action/feedback", 10
        )
        self._statuses = host.node.create_publisher(
            GoalStatusArray, "navigate_to_pose/_action/status", latched
        )

    def _serve(self, host, kind, name, answer):
        service = host.node.create_service(kind, name, answer, callback_group=host.group)
        send = service.send_response
        service.send_response = lambda response, header: None if response is None else send(response, header)

    def _id(self, owner):
        from unique_identifier_msgs.msg import UUID

        return UUID(uuid=list(self._goal if owner == OWN else bytes(range(16))))

    def _accept(self, request, response):
        self._goal, self.has_asked = bytes(request.goal_id.uuid), False
        for owner, distance in self.says["feedback"]:
            message = self._types.Impl.FeedbackMessage(goal_id=self._id(owner))
            message.feedback.distance_remaining = distance
            self._feedback.publish(message)
        for listed in self.says["statuses"]:
            self._publish_statuses(listed)
        if self.says["accepts"] is None:
            return None
        response.accepted = self.says["accepts"]
        return response

    def _publish_statuses(self, listed):
        from action_msgs.msg import GoalStatus, GoalStatusArray

        message = GoalStatusArray()
        for owner, status in listed:
            each = GoalStatus(status=status)
            each.goal_info.goal_id = self._id(owner)
            message.status_list.append(each)
        self._statuses.publish(message)

    def _tell_result(self, request, response):
        self.has_asked = True
        said = self.says["result" if bytes(request.goal_id.uuid) == self._goal else "pulse"]
        if said is None:
            return None
        response.status = said["status"]
        response.result.error_code, response.result.error_msg = said["error_code"], said["error_msg"]
        return response

    def _cancel(self, _, response):
        from action_msgs.msg import GoalInfo

        if self.says["cancel"] is None:
            return None
        response.return_code, owners = self.says["cancel"]
        response.goals_canceling = [GoalInfo(goal_id=self._id(owner)) for owner in owners]
        return response

    def _state(self, number, response):
        response.current_state.label = self.says["states"][number]
        return response


def require_clean(lines):
    """Assert that lines contain no control characters."""
    for line in lines:
        assert "Cc" not in map(unicodedata.category, line.replace("\t", "")), repr(line)


@pytest.fixture
def stage(ros):
    from tests.missions.mission_stage import Stage

    stage = Stage(ros.context)
    yield stage
    stage.close()


def examples(rounds):
    """Return the settings for some rounds; failures are not shrunk, because DDS is not deterministic."""
    return settings(
        max_examples=rounds, deadline=None, database=None, phases=[Phase.explicit, Phase.generate]
    )


@pytest.mark.parametrize("rounds", [15, pytest.param(1500, marks=pytest.mark.slow)], ids=["short", "long"])
def test_drive_ends_or_can_be_stopped_for_any_server_responses(stage, rounds, monkeypatch):
    from py_trees.common import Status

    from search_and_rescue.actions.navigation import NavigateToZone

    monkeypatch.setattr("sar_compiler.ros.leaves.goals._RESULT_SEC", 0.2)
    monkeypatch.setattr("sar_compiler.ros.leaves.goals._CHASE_SEC", 0.1)
    server = ScriptedServer(stage.host())

    @examples(rounds)
    @given(answers)
    def hold(says):
        server.says = says
        limits: dict[str, Any] = {
            "acceptance_timeout_sec": 0.2,
            "feedback_timeout_sec": 0.3,
            "hold_timeout_sec": 0.1,
        }
        leaf = NavigateToZone("Drive", stage.zones, record=stage.record, **limits)
        leaf.pause_sec = 0.0
        leaf.setup(node=stage.node)
        try:
            # The last status of a goal in a message applies, and only the last of two messages is sure to arrive.
            told = [dict(listed).get(OWN) for listed in says["statuses"]]
            if says["accepts"] and says["result"] is None and not FINAL.intersection(told[-1:]):
                # A server that reports an active goal without a result may be right.
                stage.tick_until(leaf, lambda: server.has_asked, "the goal")
                leaf.stop(Status.INVALID)
            else:
                succeeded = stage.run(leaf) is Status.SUCCESS
                assert not succeeded or SUCCEEDED in {(says["result"] or {}).get("status"), *told}
            # The server was wrong; the goal can be reached.
            server.says = TRUE
            leaf._hopeless.clear()
            leaf.acceptance_timeout_sec = leaf.feedback_timeout_sec = SILENCE_SEC
            assert stage.run(leaf) is Status.SUCCESS, (stage.lines, stage.warnings)
            leaf.stop(Status.INVALID)
            stage.until(leaf.is_settled, "the end of all its goals")
            require_clean([*stage.lines, *stage.warnings])
        finally:
            leaf.stop(Status.INVALID)
            leaf.shutdown()
            stage.lines.clear()
            stage.warnings.clear()

    hold()


@pytest.mark.parametrize("rounds", [60, pytest.param(3000, marks=pytest.mark.slow)], ids=["short", "long"])
def test_search_rejects_impossible_survivor_positions(stage, rounds):
    from py_trees.common import Status

    from search_and_rescue.actions.survivors import DetectSurvivor

    said: dict[str, Any] = {}

    def answer(_, response):
        response.found, response.survivor_x, response.survivor_y = said["found"], said["x"], said["y"]

    service = stage.detect_service({})
    service.answer = answer
    leaf = stage.take(DetectSurvivor("Search", stage.zones, record=stage.record))

    @examples(rounds)
    @given(st.booleans(), st.floats(), st.floats())
    def hold(found, x, y):
        said.update(found=found, x=x, y=y)
        status = stage.run(leaf)
        possible = math.isfinite(x) and math.isfinite(y) and max(abs(x), abs(y)) <= 100_000.0
        assert status is (Status.SUCCESS if possible or not found else Status.FAILURE)
        assert leaf.survivor_pose() == ((x, y) if found and possible else None)
        require_clean([*stage.lines, *stage.warnings])
        leaf.stop(Status.INVALID)
        stage.lines.clear()
        stage.warnings.clear()

    hold()
    assert all(math.isfinite(each.x) and math.isfinite(each.y) for each in stage.record.survivors)
