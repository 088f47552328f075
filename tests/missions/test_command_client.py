"""Tests of the command client: commands from other threads become service calls in the thread of the node's executor."""

from typing import Any

import pytest

from sar_compiler.execution.command_client import CommandClient
from sar_compiler.missions.mission import CommandError, OperatorCommand

pytestmark = pytest.mark.ros

PAUSE = OperatorCommand("pause", "Pause", "Stops it.")


class Stage:
    """A node with its own service, and the client that calls it."""

    def __init__(self, ros, *verbs):
        from std_srvs.srv import Trigger

        self.ros, self.node = ros, ros.node("mission")
        self.carried_out: list[Any] = []
        self.calls = CommandClient(self.node, verbs)
        self.node.create_service(Trigger, "~/pause", self.pause)

    def pause(self, _, response):
        self.carried_out.append("pause")
        response.success, response.message = False, "it stands still already"
        return response

    def ready(self):
        self.ros.spin_until(lambda: self.calls.available() == ["pause"], "the service")
        return self

    def answer(self, order):
        self.ros.spin_until(order.done, "the answer")
        return order


@pytest.fixture
def stage(ros):
    return Stage(ros, PAUSE).ready()


def test_command_is_called_and_response_returned(stage):
    assert stage.answer(stage.calls.send("pause", {})).result() == (False, "it stands still already")
    assert stage.carried_out == ["pause"]


def test_command_canceled_before_sending_is_not_executed(stage):
    given_up, heeded = stage.calls.send("pause", {}), stage.calls.send("pause", {})
    assert given_up.cancel()
    stage.answer(heeded)
    assert stage.carried_out == ["pause"]


def test_sent_command_cannot_be_canceled(stage):
    order = stage.calls.send("pause", {})
    stage.ros.spin_until(order.running, "the call")
    assert not order.cancel()
    assert stage.answer(order).result() == (False, "it stands still already")


def test_failed_sending_raises_and_later_commands_work(stage, monkeypatch):
    client = stage.calls._clients["pause"]

    def refuse(_):
        "\ud800".encode()

    with monkeypatch.context() as broken:
        broken.setattr(client, "call_async", refuse)
        order = stage.answer(stage.calls.send("pause", {}))
    with pytest.raises(CommandError, match=r"the command cannot be sent: .* surrogates not allowed"):
        order.result()
    assert stage.answer(stage.calls.send("pause", {})).result()[1] == "it stands still already"


def test_command_without_service_is_rejected(ros):
    stage = Stage(ros, PAUSE, OperatorCommand("dance", "Dance", "Dances.")).ready()
    with pytest.raises(CommandError, match="no node of this tree executes 'dance'"):
        stage.calls.send("dance", {})
    with pytest.raises(CommandError, match=r"unknown command 'swim\\n'"):
        stage.calls.send("swim\n", {})
