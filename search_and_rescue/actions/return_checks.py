"""Leaves that check whether the robot can return home after its next leg, and that wait for a charged battery."""

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any

from py_trees.common import Status

from sar_compiler.leaves import (
    Clock,
    Kind,
    Outcome,
    RosLeaf,
    Seconds,
    Use,
    battery_share,
    of_node,
    qos_profile,
    register,
    robot_estimate,
    value_reports,
)
from search_and_rescue.actions.navigation import NavigateToBase, drive_outcomes
from search_and_rescue.homing_estimates import HomingEstimator
from search_and_rescue.planned_paths import PathRequests
from search_and_rescue.record import MissionRecord
from search_and_rescue.zone_manager import MapPose

if TYPE_CHECKING:
    from rclpy.node import Node

BATTERY_TOPIC = "battery_state"
"""The topic with the battery state, `sensor_msgs/msg/BatteryState`. Only the field `percentage` is used."""


_AT_CHARGE = "(at == 'base' || at == 'charging')"


class BatteryMeter:
    """Updates the energy estimates with data about the robot's battery, odometry and position.

    It listens as long as the node exists, even while no leaf is ticked, because the estimates are learned
    from all drives.

    Args:
        node: The mission's node.
        homing: Receives the readings.
    """

    def __init__(self, node: "Node", homing: HomingEstimator) -> None:
        from sensor_msgs.msg import BatteryState

        self._node, self._homing, self._robot = node, homing, robot_estimate(node)
        self._robot.listen_to_odometry(self._on_odometry)
        qos = qos_profile(type(self).__name__, "sensor_data")
        node.create_subscription(BatteryState, BATTERY_TOPIC, self._on_battery, qos)
        homing.is_asked = True

    @property
    def age_sec(self) -> float:
        """The seconds since the last battery message, by the node's clock. Infinite before the first message."""
        return self._now() - self._homing.energy.read_sec

    def update(self) -> None:
        """Update the robot's position."""
        place = self._robot.last_pose()
        if place is not None:
            self._homing.place = MapPose(x=place[0], y=place[1], yaw=place[2])

    def _on_odometry(self) -> None:
        if self._robot.odometry is not None:
            self._homing.energy.on_odometry(*self._robot.odometry[:2])

    def _on_battery(self, message: Any) -> None:
        # A battery whose percentage is always unusable is treated as silent.
        reports = value_reports(self._node)
        share = reports.read(f"Topic '{BATTERY_TOPIC}'", lambda: battery_share(message))
        if share is not None:
            self._homing.energy.read(self._now(), share)
        self.update()

    def _now(self) -> float:
        return float(self._node.get_clock().now().nanoseconds) / 1e9


@dataclass(eq=False, repr=False)
class _HomingLeaf(RosLeaf):
    """The base class of the leaves that observe the battery and the robot. The observation starts at setup.

    Args:
        homing: Estimates battery and time for the way home.
        clock: The mission's clock.
        record: Records the decision.
    """

    name: str
    homing: HomingEstimator
    clock: Clock
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)

    def __post_init__(self) -> None:
        super().__init__(self.name)

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the data about the battery and the robot."""
        super().setup(**kwargs)
        self._meter.update()

    @property
    def _meter(self) -> BatteryMeter:
        return of_node(self.node, BatteryMeter, lambda: BatteryMeter(self.node, self.homing))


@register(
    "ReturnInReach",
    kind=Kind.ACTION,
    uses=(Use.topic("battery_state"),),
    outcomes=(
        Outcome("SUCCESS", "in reach", "zones_left > 0"),
        Outcome("FAILURE", "out of reach", "zones_left > 0"),
        Outcome("FAILURE", "no zone", "zones_left == 0"),
        Outcome("RUNNING", "battery unknown", "zones_left > 0"),
    ),
    facts={"zones_left": 3},
)
@dataclass(eq=False, repr=False, kw_only=True)
class ReturnInReach(_HomingLeaf):
    """Check that battery and time suffice for the next leg and the drive home. Otherwise the leaf fails.

    The next leg is the drive to the current zone or open piece, and the search there. After this leg and the
    drive home, the battery must still contain the reserve, and mission time must be left. FAILURE means that
    the robot must go home first. The leaf is RUNNING until the first battery message, for at most
    `max_age_sec`. A battery that sends no message for longer is treated as empty.

    Args:
        homing: Estimates battery and time for the way home.
        clock: The mission's clock.
        record: Records that the robot goes home first.
        limit: Time limit of the mission, seconds of the mission's clock from the first tick on; 0 for no limit.
        max_age_sec: Maximum time without a battery message, seconds of the node's clock.
    """

    limit: Seconds = 0.0
    max_age_sec: Seconds = 30.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._began = math.nan

    def update(self) -> Status:
        """Decide whether the robot can start the next leg."""
        now = self.clock.now()
        if math.isnan(self._began):
            self._began = now
            self.homing.ends_at = now + self.limit if self.limit else math.inf
        if not self.homing.has_next:
            return self.outcome(Status.FAILURE, "no zone")
        if self._meter.age_sec > self.max_age_sec:
            return self._on_silence(now)
        self._meter.update()
        reason = self.homing.shortage(now)
        return self._refuse(reason) if reason else self._on_enough_charge()

    def _on_silence(self, now: float) -> Status:
        self.feedback_message = f"no message on '{BATTERY_TOPIC}' yet"
        if math.isnan(self.homing.energy.share) and now - self._began <= self.max_age_sec:
            return self.outcome(Status.RUNNING, "battery unknown")
        return self._refuse(f"no usable percentage on '{BATTERY_TOPIC}' for {self.max_age_sec:g} s")

    def _refuse(self, reason: str) -> Status:
        stop, pose = self.homing.charging_stop()
        near, home = self.homing.trip_to(pose).metres, self.homing.home().metres
        self.warn(
            f"{reason}: {f'the robot drives to {stop} first ({near:.0f} m away; home is {home:.0f} m away)' if stop else 'home first'}."
        )
        self.homing.await_charge()
        self.record.home_first(self.homing.next_zone, reason, stop, **self.homing.shortage_figures())
        return self.outcome(Status.FAILURE, "out of reach")

    def _on_enough_charge(self) -> Status:
        if self.record.homing_for:
            # The battery was swapped while no run was active.
            self.record.record_charge(self.homing.energy.share)
        self.feedback_message = f"the battery level of {self.homing.energy.share:.0%} suffices"
        return self.outcome(Status.SUCCESS, "in reach")


@register(
    "FullBatterySuffices",
    kind=Kind.ACTION,
    outcomes=(
        Outcome("SUCCESS", "suffices", "zones_left > 0"),
        Outcome("FAILURE", "too far", "zones_left > 0"),
        Outcome("FAILURE", "no zone", "zones_left == 0"),
        Outcome("RUNNING", "requesting paths", "zones_left > 0"),
    ),
    facts={"zones_left": 3},
)
@dataclass(eq=False, repr=False)
class FullBatterySuffices(RosLeaf):
    """Check that a full battery suffices for the next leg and the drive home. Otherwise the leaf fails.

    FAILURE means that charging cannot help. The leaf first requests the unknown paths of the leg from the
    planner, and is RUNNING meanwhile. If the planner does not provide a path, the length is estimated as 1.5
    times the straight line, and a warning is logged.

    Args:
        homing: Estimates battery and time for the way home.
        ways_timeout_sec: Time limit for all paths together, seconds of the machine's clock; without a planner the leaf does not wait.
        planner_id: ID of the planner in the planner server; empty if the server has only one planner.
    """

    name: str
    homing: HomingEstimator
    _: KW_ONLY
    ways_timeout_sec: Seconds = 5.0
    planner_id: str = ""

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self._ways: PathRequests | None = None

    def setup(self, **kwargs: Any) -> None:
        """Create the planner client."""
        self._release()
        super().setup(**kwargs)
        self._ways = PathRequests(
            self.node, self.homing.zones, self.ways_timeout_sec, self.planner_id, self._wake
        )

    def initialise(self) -> None:
        """Request the unknown paths of the next leg from the planner."""
        if self._ways is not None and self.homing.has_next:
            self._ways.request_paths(self.homing.required_paths())

    def update(self) -> Status:
        """Return RUNNING until the paths are known, and then whether a full battery suffices."""
        if not self.homing.has_next:
            return self.outcome(Status.FAILURE, "no zone")
        if self._ways is not None and self._ways.are_awaited():
            return self.outcome(Status.RUNNING, "requesting paths")
        if self._ways is not None and (news := self._ways.new_shortfall()):
            self.warn(f"'{self.name}': {news}.")
        reason = self.homing.excess()
        if reason:
            self.warn(f"{reason}.")
        return self.outcome(Status.FAILURE if reason else Status.SUCCESS, "too far" if reason else "suffices")

    def terminate(self, new_status: Status) -> None:
        """Cancel the requests for paths if the leaf is halted."""
        if new_status is Status.INVALID and self._ways is not None:
            self._ways.give_up()

    def shutdown(self) -> None:
        """Release the planner client and the ROS node."""
        self._release()
        super().shutdown()

    def _release(self) -> None:
        if self._ways is not None:
            self._ways.release()
        self._ways = None


@register(
    "NavigateToCharge",
    kind=Kind.ACTION,
    effects="drives the robot to the base station or a charging place",
    uses=(Use.action("{action}"), Use.nav2()),
    outcomes=drive_outcomes(Outcome("SUCCESS", "arrived", then="at = 'charging'; navigation_lost = false")),
    facts={"at": "", "navigation_lost": False},
)
@dataclass(eq=False, repr=False, kw_only=True)
class NavigateToCharge(NavigateToBase):
    """Drive to the place where the battery is charged: home, or a nearer charging place within reach.

    The leaf is RUNNING on the way, succeeds on arrival, and fails if the robot does not arrive. A charging
    place is within reach if the robot arrives there without using the reserve. If no place is within reach,
    the robot drives home, as with `NavigateToBase`.

    Args:
        homing: Estimates battery and time for the way home.
    """

    homing: HomingEstimator

    def __post_init__(self) -> None:
        super().__post_init__()
        self._stop = ""

    def goal(self) -> Any:
        """Return the goal for the charging place, or SUCCESS if an earlier run has already reached home."""
        self._stop, pose = self.homing.charging_stop()
        if not self._stop:
            return super().goal()
        trip = self.homing.trip_to(pose)
        headline = (
            f"{self._stop} is {trip.metres:.0f} m away and takes {self.homing.energy.need(trip):.0%} of the battery, "
            f"which is at {self.homing.energy.share:.0%}."
        )
        return self._drive_to(f"charging place {self._stop}", pose, headline=headline)

    def _on_arrival(self) -> None:
        if self._stop:
            self.record.charging_reached(self._stop)
        else:
            super()._on_arrival()


@register(
    "AwaitCharge",
    kind=Kind.ACTION,
    uses=(Use.topic("battery_state"),),
    outcomes=(
        Outcome("SUCCESS", "charged", f"zones_left > 0 && {_AT_CHARGE}"),
        Outcome("FAILURE", "not charged"),
        Outcome("RUNNING", "waiting", f"zones_left > 0 && {_AT_CHARGE}"),
    ),
    facts={"zones_left": 3, "at": ""},
)
@dataclass(eq=False, repr=False, kw_only=True)
class AwaitCharge(_HomingLeaf):
    """Wait at home or a charging place until the charged or swapped battery suffices for the next leg.

    The leaf is RUNNING while the robot waits, and then succeeds. It fails if the robot is at neither place, if
    `patience` expires, or if the remaining mission time is too short for the next leg.

    Args:
        homing: Estimates battery and time for the way home.
        clock: The clock that measures the patience.
        record: Contains whether the robot has arrived, and records the result.
        patience: Maximum wait, seconds of the mission's clock.
    """

    patience: Seconds = 900.0

    def initialise(self) -> None:
        """Start measuring the patience."""
        self._began = self.clock.now()

    def update(self) -> Status:
        """Return SUCCESS when the battery suffices, FAILURE if waiting cannot help, otherwise RUNNING."""
        now, share = self.clock.now(), self.homing.energy.share
        place = self.record.charging_at or ("home" if self.record.home else "")
        if not (self.homing.has_next and place):
            nowhere = "the robot is neither at home nor at a charging place, or no zone is left"
            self.warn(f"'{self.name}' cannot wait for a charge: {nowhere}.")
            return self.outcome(Status.FAILURE, "not charged")
        lacking = self.homing.shortage(now)
        if self.homing.is_charged and not lacking:
            self.log(f"The battery is at {share:.0%}: the robot continues to {self.homing.next_leg}.")
            self.record.record_charge(share)
            return self.outcome(Status.SUCCESS, "charged")
        if self.homing.late(now):
            return self._give_up(lacking)
        if now - self._began > self.patience:
            return self._give_up(f"the battery was not charged within {self.patience:g} s at {place}")
        self.feedback_message = f"waiting for a charge: the battery is at {share:.0%}"
        return self.outcome(Status.RUNNING, "waiting")

    def _give_up(self, reason: str) -> Status:
        self.warn(f"{reason[:1].upper()}{reason[1:]}.")
        self.record.record_alarm(reason)
        return self.outcome(Status.FAILURE, "not charged")
