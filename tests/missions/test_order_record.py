"""Each order to a mission is in its journal, with who gave it."""

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
    """A search whose node heeds two orders, and what its journal tells."""

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


def test_who_says_nothing_before_a_call_is_a_service_call(robot):
    robot.call("pause")
    assert robot.orders == [f"{A_CALL}: pause"]
    assert robot.reason == f"by {A_CALL}"


def test_an_order_that_is_refused_and_one_that_nothing_is_noted_of_are_told_by_themselves(robot):
    robot.refusal = "no zone is left"
    robot.call("pause")
    robot.refusal, robot.notes = "", False
    robot.call("resume")
    assert robot.orders == [f"{A_CALL}: Pause: refused, no zone is left", f"{A_CALL}: Resume"]
    assert robot.reason == ""


def test_each_order_is_in_the_journal_once(robot):
    robot.sign("pause", "Ada")
    robot.call("pause")
    said = {"by": "Ada", "reason": "", "refusal": ""}
    told = {"verb": "pause", "label": "Pause", **said, "is_told": True}
    assert [each.data for each in robot.entries if each.kind == "ordered"] == [told]


def test_what_is_no_answer_to_an_order_ends_nothing(robot):
    robot.record._execute(VERBS[0], lambda *_: None, None, None)
    assert robot.orders == [f"{A_CALL}: Pause"]


def test_who_is_about_to_call_says_so_by_a_parameter_of_the_node(robot):
    assert robot.sign("pause", "Ada")
    robot.call("pause")
    robot.call("resume")
    assert robot.orders == ["Ada: pause", f"{A_CALL}: resume"]


def test_what_somebody_says_counts_for_one_call_and_two_who_say_it_have_a_call_each(robot):
    robot.sign("pause", "Ada")
    robot.sign("pause", "Bob")
    for _ in range(3):
        robot.call("pause")
    assert robot.orders == ["Ada: pause", "Bob: pause", f"{A_CALL}: pause"]


def test_whoever_has_said_it_long_ago_and_not_called_is_not_who_calls(robot, monkeypatch):
    robot.sign("pause", "Ada")
    monkeypatch.setattr("sar_compiler.execution.command_authors._ANNOUNCEMENT_VALID_SEC", 0.0)
    robot.call("pause")
    assert robot.orders == [f"{A_CALL}: pause"]


@pytest.mark.parametrize(
    ("by", "said"), [("A\nda\x1b", "Ada"), ("", A_CALL), (7, "7"), ("x" * 999, "x" * 200)]
)
def test_what_somebody_says_is_a_short_line(robot, by, said):
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
def test_who_is_about_to_call_can_say_why(robot, said, order):
    assert robot.sign("pause", said)
    robot.call("pause")
    assert robot.orders == [order]
    assert robot.reason == f"by {order.replace(': pause', '', 1)}"


def test_a_name_alone_and_a_name_with_a_reason_may_follow_each_other(robot):
    for said in ("Ada", ["Bob", "smoke"], "Eve"):
        assert robot.sign("pause", said)
        robot.call("pause")
    assert robot.orders == ["Ada: pause", "Bob: pause: smoke", "Eve: pause"]


def test_the_reason_of_a_refused_order_is_recorded(robot):
    robot.refusal = "no zone is left"
    robot.sign("pause", ["Ada", "smoke"])
    robot.call("pause")
    assert robot.orders == ["Ada: Pause: smoke: refused, no zone is left"]
    (order,) = [each.data for each in robot.entries if each.kind == "ordered"]
    assert (order["by"], order["reason"], order["refusal"]) == ("Ada", "smoke", "no zone is left")


def test_other_parameters_sign_nothing(robot):
    from rclpy.parameter import Parameter

    for name in ("ordered_by.dance", "ordered_by", "signed.pause"):
        assert robot.node.set_parameters([Parameter(name, value="Eve")])[0].successful
    robot.call("pause")
    assert robot.orders == [f"{A_CALL}: pause"]


def test_the_state_says_by_whom_the_robot_is_held_and_forgets_it_when_that_is_over(robot):
    robot.sign("pause", "Ada")
    robot.call("pause")
    # Whoever orders the same again has changed nothing.
    robot.call("pause")
    assert robot.reason == "by Ada"
    robot.call("resume")
    assert robot.reason == ""


def test_what_the_mission_notes_after_an_order_was_not_ordered(robot):
    robot.call("resume")
    robot.search.orders.record("pause")
    assert robot.reason == "by the operator"


def test_the_end_of_a_mission_that_somebody_has_ended_says_who(robot):
    with robot.journal.ordered_by(CommandAuthor("Ada")):
        robot.search.orders.record("abort")
    robot.journal.end_run(Ending.OVER, 1, "It has ended here.")
    assert condition(robot.state).to_line() == "ABORTED: By Ada. It has ended here."


def signing(ros, of):
    """Return what says to a node who is about to give an order, from another node; it has found that node."""
    from rcl_interfaces.srv import SetParameters

    asker = ros.node("asker")
    signature, client = (
        RemoteCommandAuthor(asker, of),
        asker.create_client(SetParameters, f"{of}/set_parameters"),
    )
    ros.spin_until(client.service_is_ready, f"the parameters of {of}")
    return signature


def test_who_orders_from_another_node_is_heard_before_the_order_which_is_given_once(robot):
    given: list[str] = []
    signing(robot.ros, "/mission").sign("pause", CommandAuthor("Ada", "smoke"), lambda: given.append("pause"))
    robot.ros.spin_until(lambda: given, "the order")
    robot.call("pause")
    assert robot.orders == ["Ada: pause: smoke"]
    robot.ros.spin_for(1.2)
    assert given == ["pause"]


def test_an_answer_that_is_lost_keeps_no_order_from_being_given(ros):
    from rclpy.node import Node

    given: list[str] = []
    deaf = Node("deaf", context=ros.context)  # nobody spins it
    signing(ros, "/deaf").sign("pause", CommandAuthor("Ada", "smoke"), lambda: given.append("pause"))
    ros.spin_until(lambda: given, "the order")
    deaf.destroy_node()
    assert given == ["pause"]


def test_an_announcement_whose_third_value_is_not_what_was_seen_is_refused(robot):
    assert not robot.sign("pause", ["Ada", "smoke", "zone_a"])
