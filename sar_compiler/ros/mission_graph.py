"""Find running missions in the ROS graph, and send commands to them."""

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
# Duration of the search for missions after the last node was discovered, and maximum duration, in seconds of the steady clock.
_LOOK_SEC, _LONGEST_LOOK_SEC = 2.0, 15.0
# Maximum wait for the response to a command, in seconds of the steady clock.
_RESPONSE_SEC = 10.0


class MissionCommandError(SarError):
    """Raised if a command could not be sent or was not executed."""


def find_missions(node: Node) -> list[LeaseClaim]:
    """Find the running missions, and return the claim of each mission to its robot.

    On a busy machine, nodes discover each other late. The search therefore continues for some time after each discovery. It also continues
    while a discovered mission has not sent its claim.

    Args:
        node: The node that receives the claims. Another thread must spin the node.
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
    """Return the names of the commands that a mission currently accepts and that have no fields.

    Args:
        node: The node that queries the ROS graph.
        of: The full name of the mission's node.
    """
    prefix = f"{of}/"
    found = [name for name, types in node.get_service_names_and_types() if _TRIGGER in types]
    return sorted(name.removeprefix(prefix) for name in found if name.startswith(prefix))


def send_command(node: Node, of: str, order: str, sign: Callable[[Callable[[], None]], object]) -> str:
    """Send a command to a mission, and return the message of the response.

    Args:
        node: The node that sends the command. Another thread must spin the node.
        of: The full name of the mission's node.
        order: The name of the command.
        sign: Announces the author of the command, then calls the function that sends the command.

    Raises:
        MissionCommandError: If the mission does not respond, or does not execute the command.
    """
    client: Any = node.create_client(Trigger, f"{of}/{order}")
    has_response, responses = Event(), list[Any]()

    def on_response(future: Any) -> None:
        responses.append(future.result())
        has_response.set()

    if not client.wait_for_service(_RESPONSE_SEC):
        raise MissionCommandError(f"{of} no longer accepts '{order}'")
    sign(lambda: client.call_async(Trigger.Request()).add_done_callback(on_response))
    if not has_response.wait(_RESPONSE_SEC):
        raise MissionCommandError(
            f"{of} has not responded within {_RESPONSE_SEC:g} s, so it is unknown whether the mission has accepted '{order}'"
        )
    if not responses[0].success:
        raise MissionCommandError(f"not executed: {responses[0].message}")
    return str(responses[0].message)
