"""Heeding the operator: pause, resume, another plan, and a word on each find."""

import math
from typing import Any

from py_trees.common import Status

from sar_compiler.missions.fence import Fence
from sar_compiler.missions.search_and_rescue.kept_reports import KeptReports
from sar_compiler.missions.search_and_rescue.orders import OperatorOrders
from sar_compiler.missions.search_and_rescue.record import MissionRecord, Standing
from sar_compiler.missions.search_and_rescue.zone_manager import MAP_FRAME, Zone, ZoneManager
from sar_compiler.nodes.register import register
from sar_compiler.nodes.spec import Kind
from sar_compiler.ros.leaves.leaf import RosLeaf
from sar_compiler.ros.poses import yaw_of
from sar_compiler.runtime.answers import Answer


@register(
    "NotHeld",
    kind=Kind.CONDITION,
    outcomes={Status.SUCCESS, Status.FAILURE},
    answers=[
        Answer("SUCCESS", "free"),
        Answer("FAILURE", "held", "orders_left > 0", "orders_left -= 1"),
        Answer(
            "FAILURE",
            "zone skipped",
            "orders_left > 0 && zones_left > 0",
            "orders_left -= 1; zones_left -= 1; zones_abandoned += 1",
        ),
    ],
    facts={"orders_left": 1, "zones_left": 3, "zones_abandoned": 0},
)
class NotHeld(RosLeaf):
    """Is the robot free to go on? FAILURE from `~/pause` to `~/resume`, and in one tick where the operator has changed the plan.

    In front of the mission in a ReactiveSequence a failure halts the mission, which cancels the goal; then the mission is
    started again. The services are on the mission's node: `~/pause`, `~/resume`, `~/skip_zone` (the current one; all
    three `std_srvs/srv/Trigger`), `~/add_zone` (`sar_interfaces/srv/AddZone`) and `~/judge_survivor`
    (`sar_interfaces/srv/JudgeSurvivor`).

    Args:
        orders: What the operator has ordered.
        zone_manager: The mission's zones.
        fence: The geofence, for zones that are added.
        record: Where orders are noted.
        kept_reports: The reports that are kept; who was no survivor need not be reported.
    """

    def __init__(
        self,
        name: str,
        orders: OperatorOrders,
        zone_manager: ZoneManager,
        *,
        fence: Fence | None = None,
        record: MissionRecord | None = None,
        kept_reports: KeptReports | None = None,
    ) -> None:
        super().__init__(name)
        self._orders = orders
        self._zones = zone_manager
        self._fence = fence or Fence()
        self._record = record or MissionRecord()
        self._kept = KeptReports() if kept_reports is None else kept_reports

    def setup(self, **kwargs: Any) -> None:
        """Offer the services."""
        from sar_interfaces.srv import AddZone, JudgeSurvivor
        from std_srvs.srv import Trigger

        super().setup(**kwargs)
        for verb, service_type, carry_out in (
            ("pause", Trigger, self._pause),
            ("resume", Trigger, self._resume),
            ("skip_zone", Trigger, self._skip_zone),
            ("add_zone", AddZone, self._add_zone),
            ("judge_survivor", JudgeSurvivor, self._judge),
        ):
            self._offer(verb, service_type, carry_out)

    def update(self) -> Status:
        """Look at the orders."""
        if self._orders.replanned:
            self._orders.replanned = False
            self._wake()
            self.feedback_message = "the plan has changed"
            return Status.FAILURE
        self.feedback_message = "held by the operator" if self._orders.held else ""
        return Status.FAILURE if self._orders.held else Status.SUCCESS

    def shutdown(self) -> None:
        """Withdraw the services."""
        if self._node is not None:
            self._orders.withdraw(self._node)
        super().shutdown()

    def _offer(self, verb: str, service_type: Any, carry_out: Any) -> None:
        """Offer one service; what `carry_out` returns is what is wrong with the order, empty if nothing is."""

        def answer(request: Any, response: Any) -> Any:
            refusal = carry_out(request)
            response.success, response.message = not refusal, refusal or "done"
            if refusal:
                self.complain(f"Operator: {verb}: refused, {refusal}.")
            else:
                self.say(f"Operator: {verb}.")
                self._wake()
            return response

        self._orders.offer(self.node, verb, service_type, answer)

    def _pause(self, _: Any) -> str:
        self._orders.hold()
        return ""

    def _resume(self, _: Any) -> str:
        self._orders.release()
        return ""

    def _skip_zone(self, _: Any) -> str:
        if not self._zones.has_remaining():
            return "no zone is left"
        zone_id = self._zones.current_zone()["id"]
        reason = "the operator has skipped it"
        self._zones.abandon(reason)
        self._record.zone_given_up(zone_id, reason)
        self._orders.replanned = True
        return ""

    def _add_zone(self, request: Any) -> str:
        pose, yaw = request.pose.pose.position, yaw_of(request.pose.pose.orientation)
        zone_id, frame = request.zone_id, request.pose.header.frame_id
        if not zone_id or self._zones.knows(zone_id):
            return f"there is a zone '{zone_id}' already" if zone_id else "the zone has no name"
        if frame != MAP_FRAME:
            return f"the pose is in the frame '{frame}', and must be in '{MAP_FRAME}'"
        if not all(map(math.isfinite, (pose.x, pose.y, yaw))):
            return "the pose is not finite"
        if not self._fence.contains(pose.x, pose.y):
            return f"({pose.x:.2f}, {pose.y:.2f}) is outside the geofence"
        # On the way home already: the mission begins anew, with this zone.
        self._orders.replanned = self._orders.replanned or not self._zones.has_remaining()
        self._zones.add(Zone(id=zone_id, x=pose.x, y=pose.y, yaw=yaw))
        return ""

    def _judge(self, request: Any) -> str:
        survivor_id, same_as = request.survivor_id, request.same_as
        standing = _STANDINGS.get(request.verdict)
        if standing is None:
            return f"there is no verdict {request.verdict}"
        if self._record.survivor(survivor_id) is None:
            return f"there is no '{survivor_id}'"
        merged = standing is Standing.MERGED
        if merged and (same_as == survivor_id or self._record.survivor(same_as) is None):
            return f"'{survivor_id}' cannot be merged with '{same_as}'"
        self._record.survivor_judged(survivor_id, standing, same_as if merged else None)
        if standing is not Standing.CONFIRMED:
            self._kept.delivered(survivor_id)
        return ""


# The constants of sar_interfaces/srv/JudgeSurvivor.
_STANDINGS = {1: Standing.CONFIRMED, 2: Standing.REJECTED, 3: Standing.MERGED}
