"""Leaves that execute operator commands: pause, resume, change the plan, and review detections."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import Any

from py_trees.common import Status

from sar_compiler.leaves import (
    Kind,
    Outcome,
    RosLeaf,
    Standstill,
    UnusableValueError,
    register,
    robot_estimate,
    stamped_pose,
)
from search_and_rescue.actions.survivors import MapExtent, map_extent_of
from search_and_rescue.operator_commands import OperatorCommands
from search_and_rescue.record import DetectionVerdict, MissionRecord
from search_and_rescue.zone_manager import MAP_FRAME, Geofence, Zone, ZoneManager

_SKIPPED = "orders_left -= 1; zones_left -= 1; zones_abandoned += 1"


@register(
    "NotHeld",
    kind=Kind.CONDITION,
    outcomes=(
        Outcome("SUCCESS", "free"),
        Outcome("FAILURE", "held", "orders_left > 0", "orders_left -= 1"),
        Outcome("FAILURE", "zone skipped", "orders_left > 0 && zones_left > 0", _SKIPPED),
        Outcome("FAILURE", "plan changed", "orders_left > 0", "orders_left -= 1"),
    ),
    facts={"orders_left": 1, "zones_left": 3, "zones_abandoned": 0},
)
@dataclass(eq=False, repr=False)
class NotHeld(RosLeaf):
    """Check that the mission may run. The leaf fails while paused, and for one tick after a change of the plan.

    Put this condition before the mission in a ReactiveSequence. The mission is paused between the commands
    `~/pause` and `~/resume`. FAILURE halts the mission, which cancels the current goal. Afterwards the
    mission's nodes start over. The services on the mission's node are `~/pause`, `~/resume` and `~/skip_zone`
    for the current zone (`std_srvs/srv/Trigger`), `~/add_zone` (`sar_interfaces/srv/AddZone`) and
    `~/judge_survivor` (`sar_interfaces/srv/JudgeSurvivor`).

    Args:
        orders: The operator's commands.
        zone_manager: The mission's zones.
        fence: The geofence, which must contain every added zone.
        record: Records reviews of detections.
    """

    name: str
    orders: OperatorCommands
    zone_manager: ZoneManager
    _: KW_ONLY
    fence: Geofence = field(default_factory=Geofence)
    record: MissionRecord = field(default_factory=MissionRecord)

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self._extent: MapExtent | None = None

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the map, and create the services of the commands."""
        super().setup(**kwargs)
        self._extent = map_extent_of(self.node)
        carry_out: dict[str, Callable[[Any], str | None]] = {
            "pause": lambda _: self.orders.record("pause"),
            "resume": lambda _: self.orders.record("resume"),
            "skip_zone": self._skip_zone,
            "add_zone": self._add_zone,
            "judge_survivor": self._review_survivor,
        }
        for command, action in carry_out.items():
            self.orders.offer(self.node, command, partial(self._execute, command, action))

    def update(self) -> Status:
        """Return FAILURE if the mission is paused or the plan has changed, otherwise SUCCESS."""
        orders = self.orders
        if orders.plan_change:
            label = "zone skipped" if orders.has_skipped else "plan changed"
            self.feedback_message = f"the plan has changed: {orders.plan_change}"
            orders.plan_change, orders.has_skipped = "", False
            self._wake()
            return self.outcome(Status.FAILURE, label)
        self.feedback_message = orders.describe("pause") if orders.held else ""
        return self.outcome(Status.FAILURE, "held") if self.orders.held else Status.SUCCESS

    def shutdown(self) -> None:
        """Destroy the services of the commands."""
        self.orders.destroy_services()
        super().shutdown()

    def _execute(
        self, command: str, carry_out: Callable[[Any], str | None], request: Any, response: Any
    ) -> Any:
        """Execute a command, and return the response. If `carry_out` returns an error, the command is refused."""
        refusal = carry_out(request)
        response.success, response.message = not refusal, refusal or "done"
        if refusal:
            self.warn(self.orders.line(command, f"refused, {refusal}"))
        else:
            self.log(self.orders.line(command))
            self._wake()
        return response

    def _skip_zone(self, _: Any) -> str:
        if not self.zone_manager.has_remaining():
            return "no zone is left"
        zone_id, by = self.zone_manager.current_zone()["id"], self.orders.author
        self.zone_manager.abandon(f"skipped by {by}")
        self.orders.change_plan(f"{zone_id} was skipped by {by}", skips=True)
        return ""

    def _add_zone(self, request: Any) -> str:
        zone_id = request.zone_id
        if not zone_id or self.zone_manager.has_zone(zone_id):
            return f"zone '{zone_id}' exists: choose another name" if zone_id else "the zone has no name"
        try:
            pose = stamped_pose(request.pose, MAP_FRAME)
        except UnusableValueError as error:
            return str(error)
        objection = self._extent.why_impossible(pose.x, pose.y) if self._extent is not None else ""
        if objection or not self.fence.contains(pose.x, pose.y):
            return objection or f"({pose.x:.2f}, {pose.y:.2f}) is outside the geofence"
        if (same := self.zone_manager.zone_at(pose.x, pose.y)) is not None:
            return f"{same} is already at ({pose.x:.2f}, {pose.y:.2f}): choose another position"
        # If no other zone is left, restart the mission with this zone, because the robot may be on the way home.
        if not self.zone_manager.has_remaining():
            self.orders.change_plan(f"{zone_id} was added by {self.orders.author}")
        self.zone_manager.add(Zone(id=zone_id, x=pose.x, y=pose.y, yaw=pose.yaw))
        return ""

    def _review_survivor(self, request: Any) -> str:
        survivor_id, same_as = request.survivor_id, request.same_as
        standing = _VERDICTS.get(request.verdict)
        if standing is None:
            return f"unknown verdict {request.verdict}"
        if self.record.survivor(survivor_id) is None:
            return f"unknown survivor '{survivor_id}'"
        merged = standing is DetectionVerdict.MERGED
        if merged and (same_as == survivor_id or self.record.survivor(same_as) is None):
            return f"'{survivor_id}' cannot be merged with '{same_as}'"
        self.record.survivor_judged(survivor_id, standing, same_as if merged else None)
        return ""


@register(
    "AwaitStandstill",
    kind=Kind.ACTION,
    outcomes=(Outcome("SUCCESS", "stands"), Outcome("RUNNING", "moves")),
)
class AwaitStandstill(RosLeaf):
    """Wait until the robot stands still. After `settle_timeout_sec`, succeed anyway and log a warning.

    The odometry must show standstill, and the goals of all actions must have ended, because a robot with an
    active goal may be about to drive. Without odometry, the robot is assumed to stand still as soon as the
    goals have ended.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._rest: Standstill | None = None

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the odometry."""
        super().setup(**kwargs)
        robot_estimate(self.node)

    def initialise(self) -> None:
        """Start to wait until the robot stands still."""
        self._rest = Standstill(self, self._wake, "the command to stop", with_goals=True)

    def update(self) -> Status:
        """Return RUNNING until the robot stands still or the time limit expires, then SUCCESS."""
        return Status.RUNNING if self._rest is not None and self._rest.is_awaited() else Status.SUCCESS

    def terminate(self, new_status: Status) -> None:
        """If the leaf was halted, stop waiting."""
        if new_status is Status.INVALID and self._rest is not None:
            self._rest.give_up()


# The constants of sar_interfaces/srv/JudgeSurvivor.
_VERDICTS = {1: DetectionVerdict.CONFIRMED, 2: DetectionVerdict.REJECTED, 3: DetectionVerdict.MERGED}
