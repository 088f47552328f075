"""Leaves that choose, visit, postpone and abandon the zones of the plan."""

from concurrent.futures import Future
from typing import Annotated, Any

from py_trees.common import Status

from sar_compiler.leaves import (
    Kind,
    Outcome,
    RosLeaf,
    Seconds,
    UnusableValueError,
    at_least,
    planar_point,
    register,
)
from search_and_rescue.actions.survivors import map_extent_of
from search_and_rescue.background_calls import run_in_background
from search_and_rescue.operator_commands import OperatorCommands
from search_and_rescue.planned_paths import PathRequests
from search_and_rescue.record import MissionRecord
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import MAP_FRAME, VisitingOrder, Zone, ZoneManager, is_ratio

Attempts = Annotated[int, at_least(1)]
# Zones are postponed in rounds: a postponed zone is next when all others have been tried. So the number of attempts at the current zone
# is the number of the round. A round is over when all remaining zones have been postponed in it.
_ROUND_IS_OVER = "postponed_in_round >= zones_left"
_NEXT_ROUND = f"({_ROUND_IS_OVER} ? round + 1 : round)"
_POSTPONED = (
    f"round += {_ROUND_IS_OVER} ? 1 : 0; postponed_in_round = {_ROUND_IS_OVER} ? 1 : postponed_in_round + 1"
)


@register(
    "AdvanceZone",
    kind=Kind.ACTION,
    effects="marks the current zone as visited",
    outcomes=(
        Outcome("SUCCESS", "advanced", "zones_left > 0", "zones_left -= 1"),
        Outcome("SUCCESS", "no zone", "zones_left == 0"),
    ),
    facts={"zones_left": 3},
    writes=("at",),
)
class AdvanceZone(RosLeaf):
    """Mark the current zone as visited. The next zone then becomes the current zone.

    Args:
        name: The node's name.
        zone_manager: The mission's zones.
    """

    def __init__(self, name: str, zone_manager: ZoneManager) -> None:
        super().__init__(name)
        self._zones = zone_manager

    def update(self) -> Status:
        """Advance to the next zone, and request a tick. Do nothing if no zone is left."""
        if not self._zones.has_remaining():
            return self.outcome(Status.SUCCESS, "no zone")
        self._zones.select_next_zone()
        self._wake()
        return self.outcome(Status.SUCCESS, "advanced")


@register(
    "ChooseZone",
    kind=Kind.ACTION,
    effects="chooses the current zone among the remaining ones",
    outcomes=(
        Outcome("SUCCESS", "chosen", "zones_left > 0"),
        Outcome("FAILURE", "no zone", "zones_left == 0"),
        Outcome("RUNNING", "choosing", "zones_left > 0"),
    ),
    facts={"zones_left": 3},
)
class ChooseZone(RosLeaf):
    """Choose the current zone from the remaining zones. The leaf computes the choice in the background.

    `listed` keeps the order of the plan. `nearest` chooses the zone that the robot reaches first.
    `expected_find` computes the order with the shortest expected time to the first detection, given the
    current probabilities, and chooses the first zone of this order. Postponed zones are chosen again when all
    others have been tried equally often.

    Before each choice, the leaf requests the unknown paths from the planner. If there are more than 30 zones,
    it only requests paths for the 30 zones with the highest probability per second. If the planner does not
    provide a path, the length is estimated as 1.5 times the straight line, and a warning is logged.

    Args:
        zone_manager: The mission's zones and their probabilities.
        order: The order: `listed` is the order of the plan, `nearest` chooses the zone that is reached first,
            and `expected_find` minimises the expected time to the first detection.
        ways_timeout_sec: Time limit for all paths together, seconds of the machine's clock; without a planner the leaf does not wait.
        planner_id: ID of the planner in the planner server; empty if the server has only one planner.
        orders: Accepts the operator's hints through the service `~/add_hint` (`sar_interfaces/srv/AddHint`).
        sweeps: The mission's sweeps; a hint with a position applies to the zone whose polygon contains it.
    """

    def __init__(
        self,
        name: str,
        zone_manager: ZoneManager,
        *,
        order: VisitingOrder = "listed",
        ways_timeout_sec: Seconds = 5.0,
        planner_id: str = "",
        orders: OperatorCommands | None = None,
        sweeps: SweepStates | None = None,
    ) -> None:
        super().__init__(name)
        self._zones, self._orders, self._sweeps = (
            zone_manager,
            orders or OperatorCommands(),
            sweeps or SweepStates(),
        )
        self._order: VisitingOrder = order
        self._ways_timeout_sec, self._planner_id = ways_timeout_sec, planner_id
        self._ways: PathRequests | None = None
        self._among: list[Zone] = []
        self._choice: Future[list[int]] | None = None
        self._approximation = ""

    def setup(self, **kwargs: Any) -> None:
        """Offer the service for hints, and create the planner clients if paths are needed."""
        self._release()
        super().setup(**kwargs)
        if self._zones.areas:
            map_extent_of(self.node)
            self._orders.offer(self.node, "add_hint", self._on_hint)
        if self._order != "listed":
            self._ways = PathRequests(
                self.node, self._zones, self._ways_timeout_sec, self._planner_id, self._wake
            )

    def update(self) -> Status:
        """Request the paths, start the computation, or use the result of the computation to choose a zone."""
        if not self._zones.has_remaining():
            return self.outcome(Status.FAILURE, "no zone")
        if self._ways is None:
            return self.outcome(Status.SUCCESS, "chosen")
        zones = self._zones.eligible_zones()
        if self._among != zones:
            self._among, self._choice = zones, None
            planned = self._zones.zones_to_plan(zones)
            self._ways.request_paths(self._zones.required_paths(planned, between=self._order != "nearest"))
        if self._choice is None and not self._ways.are_awaited():
            if news := self._ways.new_shortfall():
                self.warn(f"'{self.name}': {news}.")
            self._choice = self._begin(zones)
        elif self._choice is not None and self._choice.done():
            return self._choose(zones[self._choice.result()[0]]["id"])
        return self.outcome(Status.RUNNING, "choosing")

    def terminate(self, new_status: Status) -> None:
        """If the leaf is halted, discard all requests and computations."""
        if new_status is Status.INVALID:
            self._clear_choice()

    def shutdown(self) -> None:
        """Withdraw the service, and release the planner clients and the ROS node."""
        self._release()
        self._orders.destroy_services()
        super().shutdown()

    def _release(self) -> None:
        self._clear_choice()
        if self._ways is not None:
            self._ways.release()
        self._ways = None

    def _on_hint(self, request: Any, response: Any) -> Any:
        """Accept a hint from the operator. The hint takes effect when the next zone is chosen."""
        ratio, zone, refusal = request.likelihood_ratio, request.zone_id, ""
        if not zone:
            try:
                x, y = map_extent_of(self.node).check(*planar_point(request.point, MAP_FRAME))
                zone = self._zones.nearest(x, y, self._sweeps.zones_at(x, y))
            except UnusableValueError as error:
                refusal = str(error)
        if not refusal and not is_ratio(ratio):
            refusal = f"the likelihood ratio is {ratio:g}: write a number from 0.001 to 1000"
        elif not refusal and zone not in self._zones.areas:
            refusal = f"there is no zone '{zone}' with a probability"
        response.success, response.message = not refusal, refusal or f"the hint applies to {zone}"
        if refusal:
            self.warn(self._orders.line("add_hint", f"refused, {refusal}"))
        else:
            self._zones.hint(zone, ratio)
            self.log(self._orders.line("add_hint", f"{zone}, times {ratio:g}"))
        return response

    def _choose(self, zone_id: str) -> Status:
        self._clear_choice()
        self._zones.choose_zone(zone_id)
        self.log(f"Next zone by {self._order}: {zone_id}.")
        return self.outcome(Status.SUCCESS, "chosen")

    def _clear_choice(self) -> None:
        self._among, self._choice = [], None
        if self._ways is not None:
            self._ways.give_up()

    def _begin(self, zones: list[Zone]) -> Future[list[int]]:
        # Imported late, because the verification of trees does not need NumPy.
        from search_and_rescue.zone_order import approximation, order_areas

        how = approximation(len(zones)) if self._order == "expected_find" else ""
        if how and how != self._approximation:
            self.log(
                f"'{self.name}': {len(zones)} zones are ordered by {how}, which gives an order close to the best one."
            )
        self._approximation = how
        return run_in_background(self._wake, order_areas, self._order, self._zones.tour(zones))


@register(
    "PostponeZone",
    kind=Kind.ACTION,
    effects="moves the current zone to the end of the plan",
    outcomes=(
        Outcome("SUCCESS", "postponed", f"zones_left > 0 && {_NEXT_ROUND} < {{attempts}}", _POSTPONED),
        Outcome("FAILURE", "tried often enough", f"zones_left == 0 || {_NEXT_ROUND} >= {{attempts}}"),
    ),
    facts={"zones_left": 3, "round": 1, "postponed_in_round": 0},
)
class PostponeZone(RosLeaf):
    """Move the current zone to the end of the plan for a later attempt. The leaf fails after the last attempt.

    Args:
        zone_manager: The mission's zones.
        attempts: Number of attempts at a zone, 1 or more.
    """

    def __init__(self, name: str, zone_manager: ZoneManager, *, attempts: Attempts = 3) -> None:
        super().__init__(name)
        if attempts < 1:
            raise ValueError(f"attempts is {attempts}: write 1 or more")
        self._zones = zone_manager
        self._attempts = attempts

    def update(self) -> Status:
        """Postpone the current zone if attempts are left for this zone."""
        if not self._zones.has_remaining():
            self.warn(f"'{self.name}' cannot postpone a zone: no zone is left.")
            return Status.FAILURE
        zone_id, attempt = self._zones.current_zone()["id"], self._zones.times_postponed() + 1
        if attempt >= self._attempts:
            self.feedback_message = f"attempt {attempt} on {zone_id} was the last one"
            return Status.FAILURE
        self._zones.postpone()
        self.warn(f"{zone_id} is postponed after attempt {attempt} of {self._attempts}.")
        return Status.SUCCESS


@register(
    "AbandonZone",
    kind=Kind.ACTION,
    effects="removes the current zone from the plan without a visit",
    outcomes=(
        Outcome("SUCCESS", "abandoned", "zones_left > 0", "zones_left -= 1; zones_abandoned += 1"),
        Outcome("SUCCESS", "no zone", "zones_left == 0"),
    ),
    facts={"zones_left": 3, "zones_abandoned": 0},
)
class AbandonZone(RosLeaf):
    """Remove the current zone from the plan without a visit. The mission then stays incomplete.

    Args:
        zone_manager: The mission's zones.
    """

    def __init__(self, name: str, zone_manager: ZoneManager) -> None:
        super().__init__(name)
        self._zones = zone_manager

    def update(self) -> Status:
        """Abandon the current zone. Do nothing if no zone is left."""
        if not self._zones.has_remaining():
            return self.outcome(Status.SUCCESS, "no zone")
        zone_id, attempts = self._zones.current_zone()["id"], self._zones.times_postponed() + 1
        self._zones.abandon()
        self.warn(f"{zone_id} is abandoned after attempt {attempts}.")
        return self.outcome(Status.SUCCESS, "abandoned")


@register(
    "AbandonZones",
    kind=Kind.ACTION,
    effects="removes all remaining zones from the plan without a visit",
    outcomes=(Outcome("SUCCESS", "abandoned", then="zones_abandoned += zones_left; zones_left = 0"),),
    facts={"zones_left": 3, "zones_abandoned": 0},
)
class AbandonZones(RosLeaf):
    """Remove all remaining zones from the plan without a visit. The last failsafe defines the reason.

    Args:
        zone_manager: The mission's zones.
        record: Contains the reason, as recorded by a failsafe.
    """

    def __init__(self, name: str, zone_manager: ZoneManager, *, record: MissionRecord | None = None) -> None:
        super().__init__(name)
        self._zones = zone_manager
        self._record = record or MissionRecord()

    def update(self) -> Status:
        """Abandon the zones, if any are left."""
        reason = self._record.alarm or "the tree has ended the mission early"
        for zone in self._zones.remaining_zones():
            self._zones.abandon(reason)
            self.warn(f"{zone['id']} is abandoned: {reason}.")
        return Status.SUCCESS
