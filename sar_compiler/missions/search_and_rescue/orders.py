"""The operator's orders to a mission under way, and the services on its node that take them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from sar_compiler.journal.journal import Journal
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
        self.journal = Journal()
        self.held = False
        self.recalled = False
        self.aborted = False
        self.replanned = False
        self._services: dict[str, Any] = {}

    def hold(self) -> None:
        """Order the robot to stand where it is."""
        self.journal.note("operator_ordered", order="hold")
        self.held = True

    def release(self) -> None:
        """Order the robot to go on."""
        self.journal.note("operator_ordered", order="release")
        self.held = False

    def recall(self) -> None:
        """Order the robot home; a hold is over."""
        self.journal.note("operator_ordered", order="recall")
        self.recalled, self.held = True, False

    def abort(self) -> None:
        """Order the end of the mission; a hold is over."""
        self.journal.note("operator_ordered", order="abort")
        self.aborted, self.held = True, False

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
