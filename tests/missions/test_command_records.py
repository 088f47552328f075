"""Tests of command records: each command to a mission is in its journal with its author."""

from typing import Any

import pytest

from sar_compiler.execution.command_authors import CommandAuthors, RemoteCommandAuthor
from sar_compiler.execution.command_client import CommandClient
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import CommandAuthor, Ending, JournalEntry
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.status_line import condition
from search_and_rescue.operator_commands import VERBS
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager

pytestmark = pytest.mark.ros

A_CALL = "a service call"


class Robot:
    """A search whose node serves three commands, with its journal and state."""

    def __init__(self, ros: Any) -> None:
        from std_srvs.srv import Trigger

        zone = {"id": "zone_a", "x": 1.0, "y": 1.0, "yaw": 0.0}
        self.search = Search(ZoneManager([zone], {"x": 0.0, "y": 0.0, "yaw": 0.0}))
        self.state, journal = MissionState(), Journal()
        self.entries: list[JournalEntry] = []
        journal.add_listener(self.state.apply)
        journal.add_listener(self.entries.append)
        self.search.use_journal(journal)
        journal.begin({}, {})
        self.ros, self.journal = ros, journal
        self.notes, self.refusal = True, ""
        self.node = ros.node("mission", allow_undeclared_parameters=True)
        self.record = CommandAuthors(self.node, VERBS, journal)
        for name, order in (("pause", "pause"), ("resume", "resume"), ("abort", "abort")):
            self.node.create_service(Trigger, f"~/{name}", self.answer(order))
        self.record.begin()
        self.calls = CommandClient(ros.node("tester"), VERBS[:2], of="/mission")
        ros.spin_until(lambda: len(self.calls.available()) == 2, "the services")

    def answer(self, order: str) -> Any:
        def carry_out(_: Any, response: Any) -> Any:
            if self.notes and not self.refusal:
                self.search.orders.record(order)
            response.success, response.message = not self.refusal, self.refusal
            return response

        return carry_out

    def call(self, verb: str) -> None:
        given = self.calls.send(verb, {})
        self.ros.spin_until(given.done, "the answer")

    def sign(self, verb: str, by: Any) -> bool:
        from rclpy.parameter import Parameter

        (said,) = self.node.set_parameters([Parameter(f"ordered_by.{verb}", value=by)])
        return bool(said.successful)

    @property
    def orders(self) -> list[str]:
        return [fact.text for fact in self.state.facts]

    @property
    def reason(self) -> str:
        return condition(self.state).reason


@pytest.fixture
def robot(ros):
    return Robot(ros)


def test_unannounced_call_is_recorded_as_service_call(robot):
    robot.call("pause")
    assert robot.orders == [f"{A_CALL}: pause"]
    assert robot.reason == f"by {A_CALL}"


def test_refused_and_unrecorded_commands_get_entries_of_their_own(robot):
    robot.refusal = "no zone is left"
    robot.call("pause")
    robot.refusal, robot.notes = "", False
    robot.call("resume")
    assert robot.orders == [f"{A_CALL}: Pause: refused, no zone is left", f"{A_CALL}: Resume"]
    assert robot.reason == ""


def test_command_is_recorded_once(robot):
    robot.sign("pause", "Ada")
    robot.call("pause")
    said = {"by": "Ada", "reason": "", "refusal": ""}
    expected = {"verb": "pause", "label": "Pause", **said, "is_told": True}
    assert [each.data for each in robot.entries if each.kind == "ordered"] == [expected]


def test_command_without_response_is_recorded(robot):
    robot.record._execute(VERBS[0], lambda *_: None, None, None)
    assert robot.orders == [f"{A_CALL}: Pause"]


def test_parameter_announces_author_of_next_call(robot):
    assert robot.sign("pause", "Ada")
    robot.call("pause")
    robot.call("resume")
    assert robot.orders == ["Ada: pause", f"{A_CALL}: resume"]


def test_each_announcement_applies_to_one_call(robot):
    robot.sign("pause", "Ada")
    robot.sign("pause", "Bob")
    for _ in range(3):
        robot.call("pause")
    assert robot.orders == ["Ada: pause", "Bob: pause", f"{A_CALL}: pause"]


def test_expired_announcement_is_ignored(robot, monkeypatch):
    robot.sign("pause", "Ada")
    monkeypatch.setattr("sar_compiler.execution.command_authors._ANNOUNCEMENT_VALID_SEC", 0.0)
    robot.call("pause")
    assert robot.orders == [f"{A_CALL}: pause"]


@pytest.mark.parametrize(
    ("by", "said"), [("A\nda\x1b", "Ada"), ("", A_CALL), (7, "7"), ("x" * 999, "x" * 200)]
)
def test_author_is_reduced_to_a_short_line(robot, by, said):
    robot.sign("pause", by)
    robot.call("pause")
    assert robot.orders == [f"{said}: pause"]


@pytest.mark.parametrize(
    ("said", "order"),
    [
        (["Ada", "smoke in the corridor."], "Ada: pause: smoke in the corridor"),
        (["", "smoke"], f"{A_CALL}: pause: smoke"),
        (["Ada", ""], "Ada: pause"),
        (["Ada"], "Ada: pause"),
        (["Ada", "smoke", "{}", "and more"], "Ada: pause: smoke"),
        (["Ada", "sm\nok\x1b[2Je\u202e"], "Ada: pause: smok[2Je"),
        (["Ada", "x" * 999], f"Ada: pause: {'x' * 200}"),
    ],
)
def test_announcement_can_state_reason(robot, said, order):
    assert robot.sign("pause", said)
    robot.call("pause")
    assert robot.orders == [order]
    assert robot.reason == f"by {order.replace(': pause', '', 1)}"


def test_announcements_with_and_without_reason_can_alternate(robot):
    for said in ("Ada", ["Bob", "smoke"], "Eve"):
        assert robot.sign("pause", said)
        robot.call("pause")
    assert robot.orders == ["Ada: pause", "Bob: pause: smoke", "Eve: pause"]


def test_reason_of_refused_command_is_recorded(robot):
    robot.refusal = "no zone is left"
    robot.sign("pause", ["Ada", "smoke"])
    robot.call("pause")
    assert robot.orders == ["Ada: Pause: smoke: refused, no zone is left"]
    (order,) = [each.data for each in robot.entries if each.kind == "ordered"]
    assert (order["by"], order["reason"], order["refusal"]) == ("Ada", "smoke", "no zone is left")


def test_other_parameters_announce_nothing(robot):
    from rclpy.parameter import Parameter

    for name in ("ordered_by.dance", "ordered_by", "signed.pause"):
        assert robot.node.set_parameters([Parameter(name, value="Eve")])[0].successful
    robot.call("pause")
    assert robot.orders == [f"{A_CALL}: pause"]


def test_status_names_author_of_pause_until_resume(robot):
    robot.sign("pause", "Ada")
    robot.call("pause")
    # Repeating the command changes nothing.
    robot.call("pause")
    assert robot.reason == "by Ada"
    robot.call("resume")
    assert robot.reason == ""


def test_event_after_command_is_not_attributed_to_its_author(robot):
    robot.call("resume")
    robot.search.orders.record("pause")
    assert robot.reason == "by the operator"


def test_status_of_aborted_mission_names_author(robot):
    with robot.journal.ordered_by(CommandAuthor("Ada")):
        robot.search.orders.record("abort")
    robot.journal.end_run(Ending.OVER, 1, "It has ended here.")
    assert condition(robot.state).to_line() == "ABORTED: By Ada. It has ended here."


def make_remote_author(ros, of):
    """Return a remote author that announces commands to a node from another node, once it has found that node."""
    from rcl_interfaces.srv import SetParameters

    asker = ros.node("asker")
    signature, client = (
        RemoteCommandAuthor(asker, of),
        asker.create_client(SetParameters, f"{of}/set_parameters"),
    )
    ros.spin_until(client.service_is_ready, f"the parameters of {of}")
    return signature


def test_remote_author_is_announced_before_command_which_is_sent_once(robot):
    given: list[str] = []
    make_remote_author(robot.ros, "/mission").sign(
        "pause", CommandAuthor("Ada", "smoke"), lambda: given.append("pause")
    )
    robot.ros.spin_until(lambda: given, "the order")
    robot.call("pause")
    assert robot.orders == ["Ada: pause: smoke"]
    robot.ros.spin_for(1.2)
    assert given == ["pause"]


def test_lost_response_to_announcement_does_not_block_command(ros):
    from rclpy.node import Node

    given: list[str] = []
    deaf = Node("deaf", context=ros.context)  # never spun
    make_remote_author(ros, "/deaf").sign(
        "pause", CommandAuthor("Ada", "smoke"), lambda: given.append("pause")
    )
    ros.spin_until(lambda: given, "the order")
    deaf.destroy_node()
    assert given == ["pause"]


def test_invalid_third_value_of_announcement_is_rejected(robot):
    assert not robot.sign("pause", ["Ada", "smoke", "zone_a"])
