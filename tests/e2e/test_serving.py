"""Tests of `sar-run --serve` with a client for the tree server of BehaviorTree.ROS2."""

import json
import signal
from contextlib import closing
from typing import Any

import pytest

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import ORDERED
from tests.processes import children_of, wait_for_end_of
from tests.trees import document

pytestmark = pytest.mark.ros

SHORT = document(
    '<Sequence name="Look"><Sleep name="First" msec="50"/><Sleep name="Second" msec="50"/></Sequence>',
    main="Short",
)
LONG = document('<Sequence name="Wait"><Sleep msec="1000000"/></Sequence>', main="Long")
ZONES = document("<ZonesRemaining/>", main="Zones")
FAILING = document("<AlwaysFailure/>", main="Failing")
TIMED = document('<Sleep msec="{@patience_msec}"/>', main="Timed")
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
IDLE, SUCCESS, FAILURE = 0, 2, 3


class Client:
    """A client that requests runs from a tree server."""

    def __init__(self, ros):
        from btcpp_ros2_interfaces.action import ExecuteTree
        from btcpp_ros2_interfaces.srv import GetTrees
        from rclpy.action import ActionClient

        self._ros, self._kind = ros, ExecuteTree
        self.node = ros.node("client")
        self._trees = self.node.create_client(GetTrees, "get_loaded_trees")
        self._action = ActionClient(self.node, ExecuteTree, "bt_execution")
        self.told = []

    def result_of(self, future, what):
        self._ros.spin_until(future.done, what)
        return future.result()

    def call(self, kind, name, request):
        client = self.node.create_client(kind, name)
        self._ros.spin_until(client.service_is_ready, name)
        return self.result_of(client.call_async(request), f"the answer of {name}")

    def listen(self, kind, topic):
        """Return a list to which published messages are appended."""
        heard: list[Any] = []
        self.node.create_subscription(kind, topic, heard.append, 100)
        return heard

    def wait_for(self, condition, what):
        self._ros.spin_until(condition, what)

    def trees(self):
        self._ros.spin_until(self._trees.service_is_ready, "the server's service")
        return self.result_of(self._trees.call_async(self._trees.srv_type.Request()), "the trees").tree_ids

    def send_goal(self, tree, payload=""):
        self._ros.spin_until(self._action.server_is_ready, "the server's action")
        goal = self._kind.Goal(target_tree=tree, payload=payload)
        sent = self._action.send_goal_async(
            goal, lambda told: self.told.extend(told.feedback.message.splitlines())
        )
        return self.result_of(sent, "the answer to a goal")

    def wait_for_feedback(self, text):
        try:
            self._ros.spin_until(lambda: any(text in line for line in self.told), f"feedback: {text}")
        except AssertionError:
            pytest.fail(f"no feedback with {text!r}, only {self.told[-20:]}")

    def cancel(self, goal):
        self.result_of(goal.cancel_goal_async(), "the answer to a cancellation")

    def end(self, goal):
        """Wait for the result; return the status of the goal, the status of the tree, and the message."""
        found = self.result_of(goal.get_result_async(), "the end of a goal")
        return found.status, found.result.node_status.status, found.result.return_message

    def run(self, tree, payload=""):
        return self.end(self.send_goal(tree, payload))


@pytest.fixture
def client(ros):
    return Client(ros)


@pytest.fixture
def serve(start, tmp_path):
    def start_server(*texts, options=()):
        paths = []
        for number, text in enumerate(texts):
            paths.append(tmp_path / f"tree_{number}.xml")
            paths[-1].write_text(text, encoding="utf-8")
        return start("sar-run", "--serve", *paths, *options)

    return start_server


def state_of(client):
    from lifecycle_msgs.srv import GetState

    return client.call(GetState, "sar_tree_server/get_state", GetState.Request()).current_state.label


def request_transition(client, label, *, by_label=False):
    """Request a transition, by its number like Nav2's manager, or by its label; return whether it succeeded."""
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    by_number = Transition(id=getattr(Transition, f"TRANSITION_{label.upper()}"))
    wanted = Transition(label=label) if by_label else by_number
    return client.call(
        ChangeState, "sar_tree_server/change_state", ChangeState.Request(transition=wanted)
    ).success


@pytest.mark.costly
def test_client_runs_trees_by_name_one_after_another(client, serve):
    server = serve(SHORT, FAILING)
    assert client.trees() == ["Failing", "Short"]
    assert client.run("Failing") == (ABORTED, FAILURE, "The root of the tree ended with FAILURE.")
    server.wait_for("Starting a run of 'Failing'.")
    server.wait_for("Run of 'Failing' ended with FAILURE: The root of the tree ended with FAILURE.")
    # Feedback arrives only after discovery, which is complete by now, and before the result that the client has requested.
    client.told.clear()
    goal = client.send_goal("Short")
    client.wait_for_feedback("Look SUCCESS")
    status, root, said = client.end(goal)
    assert (status, root) == (SUCCEEDED, SUCCESS)
    assert json.loads(said)["status"] == 0
    shown = [" ".join(line.split()[1:3]).rstrip(",") for line in client.told]
    assert [line for line in shown if not line.startswith("AlwaysFailure")] == [
        "First RUNNING",
        "Look RUNNING",
        "First SUCCESS",
        "Second RUNNING",
        "Second SUCCESS",
        "Look SUCCESS",
    ]
    server.send(signal.SIGINT)
    assert server.end() == 0


def test_canceled_goal_ends_its_run(client, serve):
    server = serve(LONG)
    goal = client.send_goal("Long")
    client.wait_for_feedback("Wait RUNNING")
    (run,) = children_of(server.pid)
    client.cancel(goal)
    status, root, said = client.end(goal)
    assert (status, root) == (CANCELED, IDLE)
    assert said == "the run was stopped"
    wait_for_end_of(run)
    # The server accepts the next goal.
    client.cancel(client.send_goal("Long"))


def test_invalid_goal_is_rejected_with_reason_in_log(client, serve):
    server = serve(LONG, SHORT, ZONES)
    assert not client.send_goal("Shrt").accepted
    server.wait_for("); did you mean 'Short'?")
    assert not client.send_goal("Short", "patience: 3").accepted
    server.wait_for("Goal refused: the payload is not JSON")
    assert not client.send_goal("Short", json.dumps({"a\0b": 1})).accepted
    server.wait_for("Goal refused: the payload has an invalid parameter name 'a\\x00b'. Use only letters")
    assert not client.send_goal("Zones", json.dumps({"areas_file": "/etc/passwd"})).accepted
    server.wait_for("Goal refused: the payload cannot set areas_file, because it is a file path")
    assert client.send_goal("Long").accepted
    assert not client.send_goal("Short").accepted
    server.wait_for("Goal refused: a mission is running")


@pytest.mark.costly
def test_payload_sets_parameters_and_result_reports_their_errors(client, serve):
    serve(TIMED)
    assert client.run("Timed", '{"patience_msec": 10}')[:2] == (SUCCEEDED, SUCCESS)
    status, root, said = client.run("Timed", '{"tick_rate_hz": -1.0}')
    assert (status, root) == (ABORTED, IDLE)
    assert "sar-run: parameter tick_rate_hz: " in said


def test_stopped_server_ends_its_run(client, serve):
    server = serve(LONG)
    goal = client.send_goal("Long")
    client.wait_for_feedback("Wait RUNNING")
    (run,) = children_of(server.pid)
    server.send(signal.SIGTERM)
    assert client.end(goal)[:2] == (ABORTED, IDLE)
    assert server.end() == 0
    wait_for_end_of(run)


def test_run_does_not_outlive_killed_server(client, serve):
    server = serve(LONG)
    client.send_goal("Long")
    client.wait_for_feedback("Wait RUNNING")
    (run,) = children_of(server.pid)
    server.kill()
    wait_for_end_of(run)


def test_managed_server_accepts_goals_only_while_active(client, serve):
    server = serve(LONG, options=["--managed"])
    assert state_of(client) == "unconfigured"
    assert client.trees() == []
    assert not client.send_goal("Long").accepted
    assert request_transition(client, "configure")
    assert client.trees() == ["Long"]
    assert not client.send_goal("Long").accepted
    server.wait_for("Goal refused: this node is not active")
    assert request_transition(client, "activate")
    goal = client.send_goal("Long")
    client.wait_for_feedback("Wait RUNNING")
    # This tree has no command to pause it.
    assert request_transition(client, "deactivate")
    server.wait_for(
        "The mission is stopped, because it cannot be paused: the mission has no command to pause it"
    )
    assert client.end(goal)[:2] == (ABORTED, IDLE)
    assert request_transition(client, "cleanup")
    assert client.trees() == []


@pytest.mark.costly
def test_invalid_transition_is_rejected_and_mission_continues(client, serve):
    server = serve(LONG, options=["--managed"])
    assert request_transition(client, "configure")
    assert request_transition(client, "activate")
    goal = client.send_goal("Long")
    client.wait_for_feedback("Wait RUNNING")
    assert not request_transition(client, "configure", by_label=True)
    assert not request_transition(client, "configure")
    server.wait_for("Refused: the state 'active' has no transition 1.")
    assert state_of(client) == "active"
    client.cancel(goal)
    assert client.end(goal)[0] == CANCELED


def test_managed_server_has_bond_while_active(client, serve):
    from bond.msg import Status

    heard = client.listen(Status, "bond")
    server = serve(LONG, options=["--managed"])
    assert request_transition(client, "configure")
    assert heard == []
    assert request_transition(client, "activate")
    client.wait_for(lambda: len(heard) > 1, "two beats of the bond")
    assert {(each.id, each.active) for each in heard} == {("sar_tree_server", True)}
    (end,) = {each.instance_id for each in heard}
    assert request_transition(client, "deactivate")
    client.wait_for(lambda: not heard[-1].active, "the bond's end")
    assert heard[-1].instance_id == end
    heard.clear()
    # For the manager, this is a new bond.
    assert request_transition(client, "activate")
    client.wait_for(lambda: heard, "a beat of a new bond")
    assert (heard[0].active, heard[0].instance_id == end) == (True, False)
    server.send(signal.SIGINT)
    client.wait_for(lambda: not heard[-1].active, "the new bond's end")
    assert server.end() == 0


def test_missing_bond_package_is_reported_and_server_can_be_activated(client, serve, tmp_path, monkeypatch):
    (tmp_path / "bond.py").touch()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    server = serve(LONG, options=["--managed"])
    server.wait_for("This node has no bond, because the ROS package 'bond' is not installed")
    assert request_transition(client, "configure")
    assert request_transition(client, "activate")


def test_unmanaged_server_has_no_bond(client, serve):
    serve(LONG)
    assert client.trees() == ["Long"]
    assert client.node.count_publishers("bond") == 0


@pytest.mark.costly
def test_mission_is_paused_while_server_is_inactive(client, start, tmp_path):
    journal = tmp_path / "run.journal"
    options = ["--sim", "--speed", "5", "--managed", "--journal", journal]
    server = start("sar-run", "--serve", "search_and_rescue_guarded", *options)
    assert request_transition(client, "configure")
    assert request_transition(client, "activate")
    goal = client.send_goal("GuardedSearchAndRescue")
    client.wait_for_feedback("NavigateToZone RUNNING")
    assert request_transition(client, "deactivate")
    client.wait_for_feedback("Hold RUNNING")
    assert request_transition(client, "activate")
    assert client.end(goal)[:2] == (SUCCEEDED, SUCCESS)
    server.send(signal.SIGINT)
    assert server.end() == 0
    with closing(JournalFile.read(journal)) as file:
        orders = [entry.data for entry in file.stream() if entry.kind == ORDERED]
    assert [(each["verb"], each["by"]) for each in orders] == [
        ("pause", "/sar_tree_server"),
        ("resume", "/sar_tree_server"),
    ]


def test_invalid_tree_ends_server_at_start(serve):
    server = serve(SHORT, document("<Sleep/>", main="Wrong"))
    assert server.end() == 2
    assert "tree_1.xml cannot be run with these options:" in server.output
    assert "missing-attribute" in server.output


def test_tree_without_id_is_rejected(serve):
    server = serve(SHORT.replace(' ID="Short"', ""))
    assert server.end() == 2
    assert "has no ID, so goals cannot refer to the tree. Add ID=" in server.output


def test_two_trees_with_same_id_are_rejected(serve):
    server = serve(SHORT, SHORT)
    assert server.end() == 2
    assert "both have a tree 'Short'" in server.output


def test_invalid_fault_ends_server_at_start(start):
    server = start("sar-run", "--serve", "search_and_rescue", "--sim", "--fault", "navigate_to_pose:abort")
    assert server.end() == 2
    assert "fault 'navigate_to_pose:abort': expected" in server.output


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["tree.xml", "--serve", "search_and_rescue"], "--serve itself names the trees to serve"),
        (["--serve", "search_and_rescue", "--resume"], "--serve starts a run for each goal"),
        (["search_and_rescue", "--managed"], "--managed requires --serve TREE"),
    ],
)
def test_options_that_conflict_with_serving_are_rejected(start, options, said):
    run = start("sar-run", *options)
    assert run.end() == 2
    assert said in run.output
