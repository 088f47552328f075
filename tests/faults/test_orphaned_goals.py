"""Tests of orphaned goals: their end is known from any of three sources, and late responses are accepted."""

import threading
import time

import pytest

pytestmark = pytest.mark.ros

GOAL = "0123456789abcdef" * 2
UNKNOWN_GOAL, CANCELED = 2, 5
# Longer than the period of repeated cancel requests.
SLOW_SEC = 1.6


@pytest.fixture
def make_goal(ros):
    """Return a function that makes an orphaned goal and scripted action services without a status topic.

    It returns their host, the goal and the list of its ends.
    """
    from action_msgs.srv import CancelGoal
    from nav2_msgs.action import NavigateToPose

    from sar_compiler.ros.leaves.goals import GoalEvent
    from sar_compiler.ros.orphaned_goals import OrphanedGoal
    from tests.missions.mission_stage import Host

    hosts = []

    def make(cancel, result=None):
        host = Host("navigator", "/left", ros.context)
        hosts.append(host)
        names = {"cancel_goal": (CancelGoal, cancel)}
        if result is not None:
            names["get_result"] = (NavigateToPose.Impl.GetResultService, result)
        for name, (kind, answer) in names.items():
            full = f"navigate_to_pose/_action/{name}"
            host.node.create_service(kind, full, answer, callback_group=host.group)
        node = ros.node("mission", namespace="/left")
        ends: list[int] = []
        goal = OrphanedGoal(node, GoalEvent(GOAL, "/left/navigate_to_pose"), on_end=ends.append)
        return host, goal, ends

    yield make
    for host in hosts:
        host.close()


async def never_respond(_request, _response):
    """Never respond."""
    from rclpy.task import Future

    await Future()


def test_response_after_next_request_is_accepted(ros, make_goal):
    asked, answered = [], []

    def slow(request, response):
        asked.append(request)
        time.sleep(SLOW_SEC)
        response.return_code = UNKNOWN_GOAL
        answered.append(request)
        return response

    _, goal, ends = make_goal(slow)
    ros.spin_until(lambda: goal.poll() is None, "the end of the goal", 20.0)
    ros.spin_until(lambda: len(answered) == len(asked), "the last answer")
    assert ends == [0]


def test_result_reveals_end_if_cancel_and_status_do_not(ros, make_goal):
    canceled = threading.Event()

    async def ignore(request, response):
        canceled.set()
        return await never_respond(request, response)

    def result(request, response):
        assert bytes(request.goal_id.uuid).hex() == GOAL
        canceled.wait(20.0)
        response.status = CANCELED
        return response

    _, goal, ends = make_goal(ignore, result)
    ros.spin_until(lambda: goal.poll() is None, "the end of the goal", 20.0)
    assert ends == [CANCELED]


def test_server_that_responds_only_to_new_clients_gets_new_client(ros, make_goal):
    from sar_compiler.ros import orphaned_goals

    def readers():
        topic = "rr/left/navigate_to_pose/_action/cancel_goalReply"
        there = host.node.get_subscriptions_info_by_topic(topic, no_mangle=True)
        return {bytes(each.endpoint_gid) for each in there}

    first: set[bytes] = set()

    async def deaf(request, response):
        first.update(first or readers())
        if not readers() - first:
            return await never_respond(request, response)
        response.return_code = UNKNOWN_GOAL
        return response

    host, goal, ends = make_goal(deaf)
    began = time.monotonic()
    ros.spin_until(lambda: goal.poll() is None, "the end of the goal", 30.0)
    assert ends == [0]
    assert time.monotonic() - began >= orphaned_goals._RENEWAL_SEC


def test_canceller_uses_own_context_and_names_unending_goals(ros, serve):
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionClient

    from sar_compiler.ros.leaves.goals import GoalEvent
    from sar_compiler.ros.orphaned_goals import Canceller

    server = serve("navigation", goals=[{"drive": None, "cancel": "ignore"}, {"drive": None}])
    client = ActionClient(ros.node("mission"), NavigateToPose, "navigate_to_pose")
    ros.spin_until(client.server_is_ready, "the server")
    goals = []
    for _ in range(2):
        sent = client.send_goal_async(NavigateToPose.Goal())
        ros.spin_until(sent.done, "the acceptance")
        goals.append(GoalEvent(bytes(sent.result().goal_id.uuid).hex(), "/navigate_to_pose"))
    requested: list[GoalEvent] = []
    apart = Canceller("canceller")
    try:
        assert apart.cancel(goals, 6.0, requested.append) == ["/navigate_to_pose"]
    finally:
        apart.close()
    assert requested == goals
    server.wait_for("ended", number=2, how="cancel")
    assert server.active == 1
