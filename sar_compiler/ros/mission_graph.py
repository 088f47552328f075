"""Running missions in the ROS graph, and the commands that they accept."""

import time
from collections.abc import Callable
from threading import Event
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from sar_compiler.errors import SarError
from sar_compiler.ros.robot_lease import CLAIMS, LeaseClaim, parse_claim

_TRIGGER = "std_srvs/srv/Trigger"
_TURN_SEC = 0.1
# How long to look for missions after the last node was discovered, and at most; steady seconds.
_LOOK_SEC, _LONGEST_LOOK_SEC = 2.0, 15.0
# How long a command may take to be answered, steady seconds.
_ANSWER_SEC = 10.0


class MissionCommandError(SarError):
    """A command could not be sent or was not carried out."""


def find_missions(node: Node) -> list[LeaseClaim]:
    """Return the claims of missions that drive a robot.

    On a busy machine nodes discover each other late. The search continues for a while after a discovery, or without a claim.

    Args:
        node: The node that listens, which must be spun elsewhere.
    """
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    claims: dict[str, LeaseClaim] = {}
    heard: dict[str, bool] = {}

    def listen_to_topic(topic: str) -> None:
        def on_message(message: String) -> None:
            heard[topic] = True
            claim = parse_claim(message.data)
            if claim is not None:
                claims[claim.key] = claim

        heard[topic] = False
        node.create_subscription(String, topic, on_message, latched)

    began = changed = time.monotonic()
    seen: set[tuple[str, str]] = set()
    while True:
        now, nodes = time.monotonic(), set(node.get_node_names_and_namespaces())
        if nodes - seen:
            seen, changed = seen | nodes, now
        for topic, _ in node.get_topic_names_and_types():
            if topic.endswith(CLAIMS) and topic not in heard:
                listen_to_topic(topic)
        is_over = now - changed > _LOOK_SEC and all(heard.values())
        if is_over or now - began > _LONGEST_LOOK_SEC:
            return sorted(claims.values(), key=lambda claim: (claim.node, claim.since))
        time.sleep(_TURN_SEC)


def available_commands(node: Node, of: str) -> list[str]:
    """Return the names of the commands without values that a mission's node accepts now.

    Args:
        node: The node that asks.
        of: The full name of the mission's node.
    """
    before = f"{of}/"
    found = [name for name, types in node.get_service_names_and_types() if _TRIGGER in types]
    return sorted(name.removeprefix(before) for name in found if name.startswith(before))


def send_command(node: Node, of: str, order: str, sign: Callable[[Callable[[], None]], object]) -> str:
    """Send a command, and return the response.

    Args:
        node: The node that sends the command, which must be spun elsewhere.
        of: The full name of the mission's node.
        order: The name of the command's service.
        sign: Announces the sender, then calls the function that sends the command.

    Raises:
        MissionCommandError: If the command is not answered, or not carried out.
    """
    client: Any = node.create_client(Trigger, f"{of}/{order}")
    answered, answers = Event(), list[Any]()

    def on_response(answer: Any) -> None:
        answers.append(answer.result())
        answered.set()

    if not client.wait_for_service(_ANSWER_SEC):
        raise MissionCommandError(f"{of} no longer accepts '{order}'")
    sign(lambda: client.call_async(Trigger.Request()).add_done_callback(on_response))
    if not answered.wait(_ANSWER_SEC):
        raise MissionCommandError(
            f"{of} has not responded within {_ANSWER_SEC:g} s. It may have accepted '{order}'"
        )
    if not answers[0].success:
        raise MissionCommandError(f"not carried out: {answers[0].message}")
    return str(answers[0].message)
