"""The operator's orders to a mission under way: the services on its node that take them, and the verbs for them."""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from sar_compiler.leaves import alive, turn_by
from sar_compiler.missions import Journal, JournalEntry, Verb, VerbField, mission_context
from sar_compiler.missions.search_and_rescue.zone_manager import MAP_FRAME

if TYPE_CHECKING:
    from rclpy.node import Node

_ORDERS = ("hold", "release", "recall", "abort")


@mission_context
class OperatorOrders:
    """What the operator has ordered, until it is heeded.

    The services are those of the leaves that heed the orders: a tree without them offers none.

    Attributes:
        given: The orders that were given.
        held: Whether the robot is to stand where it is.
        replanned: Whether the plan has changed, so that the mission must look at it anew.
        has_skipped: Whether a zone was skipped in that.
        journal: Where the orders are written, `operator_ordered`; those on zones and survivors by who keeps these.
    """

    def __init__(self) -> None:
        self.journal = Journal(apply=self.apply)
        self.given: set[str] = set()
        self.held = self.replanned = self.has_skipped = False
        self._services: dict[str, tuple[Node, Any]] = {}

    def give(self, order: str) -> None:
        """Order the robot to stand (`hold`), to go on (`release`), to come home (`recall`), or to end the mission (`abort`)."""
        self.journal.note("operator_ordered", order=order)

    def apply(self, fact: JournalEntry) -> None:
        """Take an order that is a fact.

        Raises:
            LookupError or ValueError: If there is no such order.
        """
        if fact.kind != "operator_ordered":
            return
        order = fact.data["order"]
        if order not in _ORDERS:
            raise ValueError(f"{order!r} is no order")
        # Who is called home, or has ended, is held no more.
        self.held = order == "hold"
        self.given.add(order)

    def offer(self, node: "Node", verb: str, service_type: Any, answer: Callable[[Any, Any], Any]) -> None:
        """Serve an order on a node, as `~/verb`; another leaf may have done so before.

        Args:
            node: The mission's node.
            verb: The name of the service.
            service_type: Its Python class.
            answer: Is called with the request and the response, and returns the response.
        """
        if verb not in self._services:
            self._services[verb] = node, node.create_service(service_type, f"~/{verb}", answer)

    def withdraw(self) -> None:
        """Destroy the services, which are gone already where their node is."""
        services, self._services = self._services, {}
        for node, service in services.values():
            if alive(node):
                node.destroy_service(service)


def _add_zone(request: Any, values: Mapping[str, Any]) -> None:
    request.zone_id = values["zone"]
    request.pose.header.frame_id = MAP_FRAME
    place, turn = request.pose.pose.position, request.pose.pose.orientation
    place.x, place.y = values["x"], values["y"]
    turn_by(turn, math.radians(values["heading"]))


def _add_hint(request: Any, values: Mapping[str, Any]) -> None:
    request.zone_id, request.likelihood_ratio = values["zone"], values["times"]
    request.point.header.frame_id = MAP_FRAME
    # Without a zone and a place it is refused.
    request.point.point.x, request.point.point.y = (
        math.nan if values[axis] is None else values[axis] for axis in ("x", "y")
    )


def _add_area(request: Any, values: Mapping[str, Any]) -> None:
    from geometry_msgs.msg import Point32

    request.zone_id, request.outline.header.frame_id = values["zone"], MAP_FRAME
    request.outline.polygon.points = [Point32(x=x, y=y) for x, y in values["corners"]]
    request.poa, request.detection_range = (
        math.nan if values[name] is None else values[name] for name in ("poa", "detection_range")
    )


def _judge(request: Any, values: Mapping[str, Any]) -> None:
    request.survivor_id, request.same_as = values["survivor"], values["same_as"]
    request.verdict = getattr(type(request), values["verdict"])


VERBS = (
    Verb("pause", "Pause", "The robot stops where it is, and its goal is cancelled.", role="hold"),
    Verb("resume", "Resume", "The mission goes on.", role="release"),
    Verb(
        "skip_zone",
        "Skip zone",
        "The current zone is given up.",
        confirm="The current zone will not be searched. Whoever is there is not looked for.",
    ),
    Verb(
        "add_zone",
        "Add zone",
        "A further zone, after all others.",
        "sar_interfaces/srv/AddZone",
        (
            VerbField("zone", "Name"),
            VerbField("x", "x, metres", "number"),
            VerbField("y", "y, metres", "number"),
            VerbField("heading", "heading, degrees counterclockwise from x", "number"),
        ),
        fill=_add_zone,
    ),
    Verb(
        "add_area",
        "Draw an area",
        "A further area is swept, or one that nobody has begun to search is changed.",
        "sar_interfaces/srv/AddArea",
        (
            VerbField("zone", "Name; of an area that is there to change it"),
            VerbField("corners", "Corners", "polygon", optional=True),
            VerbField("poa", "probability that somebody is there, 0 to 1", "number", optional=True),
            VerbField("detection_range", "how far a survivor can be seen, metres", "number", optional=True),
        ),
        fill=_add_area,
    ),
    Verb(
        "add_hint",
        "Add a hint",
        "Somebody may be, or is hardly, in a zone: it counts when the next zone is chosen.",
        "sar_interfaces/srv/AddHint",
        (
            VerbField("zone", "Zone; empty for the one around a place, or nearest to it", optional=True),
            VerbField("x", "x, metres", "number", optional=True),
            VerbField("y", "y, metres", "number", optional=True),
            VerbField("times", "times likelier: 3 for, 0.3 against", "number"),
        ),
        fill=_add_hint,
    ),
    Verb(
        "judge_survivor",
        "Judge a find",
        "Judge whether a find is a survivor.",
        "sar_interfaces/srv/JudgeSurvivor",
        (
            VerbField("survivor", "Find", "found"),
            VerbField(
                "verdict",
                "It is",
                "choice",
                (("CONFIRMED", "a survivor"), ("REJECTED", "nobody"), ("SAME", "the same one as another")),
            ),
            VerbField("same_as", "The same as", "found", optional=True),
        ),
        fill=_judge,
    ),
    Verb(
        "go_home",
        "Go home",
        "The robot comes back to the base station.",
        confirm="The robot comes home, and the zones that are left are not searched.",
    ),
    Verb(
        "abort",
        "Abort",
        "The mission ends where the robot stands.",
        confirm="The mission ends here and now, and the robot stays where it is.",
        role="stop",
    ),
)
"""What can be ordered, in the order of the buttons: the services of `operating` and `failsafes`, in words."""
