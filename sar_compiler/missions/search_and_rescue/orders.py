"""The operator's orders to a mission under way, and the services on its node that take them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.ros.leaves.leaf import alive
from sar_compiler.runtime.context import mission_context

if TYPE_CHECKING:
    from rclpy.node import Node


@mission_context
class OperatorOrders:
    """What the operator has ordered, until it is heeded.

    The services are those of the leaves that heed the orders: a tree without them offers none.

    Attributes:
        held: Whether the robot is to stand where it is.
        recalled: Whether the robot is to come home.
        aborted: Whether the mission is to end where the robot stands.
        replanned: Whether the plan has changed, so that the mission must look at it anew.
        journal: Where the orders are written, `operator_ordered`; those on zones and survivors by who keeps these.
    """

    def __init__(self) -> None:
        self.journal = Journal(apply=self.apply)
        self.held = False
        self.recalled = False
        self.aborted = False
        self.replanned = False
        self._services: dict[str, Any] = {}

    def hold(self) -> None:
        """Order the robot to stand where it is."""
        self.journal.note("operator_ordered", order="hold")

    def release(self) -> None:
        """Order the robot to go on."""
        self.journal.note("operator_ordered", order="release")

    def recall(self) -> None:
        """Order the robot home; a hold is over."""
        self.journal.note("operator_ordered", order="recall")

    def abort(self) -> None:
        """Order the end of the mission; a hold is over."""
        self.journal.note("operator_ordered", order="abort")

    def apply(self, fact: JournalEntry) -> None:
        """Take an order that is a fact.

        Raises:
            LookupError or ValueError: If there is no such order.
        """
        if fact.kind != "operator_ordered":
            return
        order = fact.data["order"]
        if order not in ("hold", "release", "recall", "abort"):
            message = f"{order!r} is no order"
            raise ValueError(message)
        # Who is called home, or has ended, is held no more.
        self.held = order == "hold"
        self.recalled = self.recalled or order == "recall"
        self.aborted = self.aborted or order == "abort"

    def offer(self, node: "Node", verb: str, service_type: Any, answer: Callable[[Any, Any], Any]) -> None:
        """Serve an order on a node, as `~/verb`; another leaf may have done so before.

        Args:
            node: The mission's node.
            verb: The name of the service.
            service_type: Its Python class.
            answer: Is called with the request and the response, and returns the response.
        """
        if verb not in self._services:
            self._services[verb] = node.create_service(service_type, f"~/{verb}", answer)

    def withdraw(self, node: "Node") -> None:
        """Destroy the services on a node."""
        services, self._services = self._services, {}
        for service in services.values() if alive(node) else ():
            node.destroy_service(service)
