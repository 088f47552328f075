"""Conditions of failsafes: SUCCESS in normal operation, FAILURE with a reason to end the mission early."""

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, Any

from py_trees.common import Status

from sar_compiler.leaves import (
    Clock,
    Kind,
    Outcome,
    RobotEstimate,
    RosLeaf,
    Seconds,
    TopicLeaf,
    Use,
    battery_share,
    plausible_number,
    register,
    robot_estimate,
)
from sar_compiler.missions import BATTERY
from search_and_rescue.homing_estimates import HomingEstimator
from search_and_rescue.operator_commands import OperatorCommands
from search_and_rescue.record import MissionRecord
from search_and_rescue.zone_manager import Geofence

_BASE_LOST = "losses_left -= base_lost ? 0 : 1; base_lost = true"


@dataclass(eq=False, repr=False)
class _Failsafe(RosLeaf):
    """Base class of these conditions, which report a problem once until it is solved.

    Args:
        record: Records the reason for `AbandonZones`.
    """

    name: str
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self._raised = False

    def _judge(self, problem: str) -> Status:
        """Return FAILURE for a problem, or SUCCESS for an empty string."""
        if problem and not self._raised:
            self.warn(f"Failsafe: {problem}.")
            self.record.record_alarm(problem)
        self._raised = bool(problem)
        self.feedback_message = problem
        return Status.FAILURE if problem else Status.SUCCESS


@dataclass(eq=False, repr=False)
class _CommandCondition(_Failsafe):
    """Base class of conditions on a command that ends the mission early.

    Args:
        orders: The commands that were given.
        record: Records the reason.
    """

    orders: OperatorCommands

    command = subject = ""

    def setup(self, **kwargs: Any) -> None:
        """Offer the service."""
        super().setup(**kwargs)
        self.orders.offer(self.node, self.command, self._on_command)

    def shutdown(self) -> None:
        """Withdraw the service."""
        self.orders.destroy_services()
        super().shutdown()

    def update(self) -> Status:
        """Check the commands."""
        return self._judge(self._reason() if self.command in self.orders.given else "")

    def _reason(self) -> str:
        return f"{self.subject} was {self.orders.describe(self.command)}"

    def _on_command(self, _: Any, response: Any) -> Any:
        self.orders.record(self.command)
        self._wake()
        response.success, response.message = True, self._reason()
        return response


@register(
    "NotAborted",
    kind=Kind.CONDITION,
    outcomes=(Outcome("SUCCESS", "not aborted"), Outcome("FAILURE", "aborted")),
)
class NotAborted(_CommandCondition):
    """Check that the operator has not aborted the mission: FAILURE once the service `~/abort` (`std_srvs/srv/Trigger`) was called."""

    command, subject = "abort", "the mission"


@register(
    "NotRecalled",
    kind=Kind.CONDITION,
    outcomes=(Outcome("SUCCESS", "not recalled"), Outcome("FAILURE", "recalled")),
)
class NotRecalled(_CommandCondition):
    """Check that the operator has not called the robot home: FAILURE once `~/go_home` (`std_srvs/srv/Trigger`) was called."""

    command, subject = "go_home", "the robot"


@register(
    "NavigationAvailable",
    kind=Kind.CONDITION,
    outcomes=(
        Outcome("SUCCESS", "available", "!navigation_lost"),
        Outcome("FAILURE", "unavailable", "navigation_lost"),
    ),
    facts={"navigation_lost": False},
)
class NavigationAvailable(_Failsafe):
    """Check that navigation is available: FAILURE if Nav2 or its localisation was unavailable when the last drive ended.

    Such a failure says nothing about the target, so it is no reason to postpone or to abandon a zone.

    Args:
        record: Holds the state of navigation, and records the reason.
    """

    def update(self) -> Status:
        """Check the result of the last drive."""
        lost = self.record.navigation_lost
        return self._judge(f"navigation is unavailable ({lost})" if lost else "")


@register(
    "BatterySuffices",
    kind=Kind.CONDITION,
    uses=(Use.topic("{topic}"),),
    outcomes=(Outcome("SUCCESS", "enough"), Outcome("FAILURE", "low")),
)
@dataclass(eq=False, repr=False, kw_only=True)
class BatterySuffices(_Failsafe, TopicLeaf):
    """Check that the battery suffices: FAILURE below a limit, or if its charge is unknown for too long.

    A percentage that is not a number from 0 to 1 is ignored.

    If the tree checks the way home (`ReturnInReach`), the reserve is added to this limit.

    Args:
        record: Records the reason.
        homing: Estimates the way home; receives the limit.
        at_least: The limit, 1 for a full battery.
        topic: A topic of `sensor_msgs/msg/BatteryState`, whose `percentage` is used.
        max_age_sec: Maximum silence of the topic, seconds of the node's clock.
    """

    at_least: Annotated[float, plausible_number(0, 1)] = 0.2
    topic: str = "battery_state"
    max_age_sec: Seconds = 30.0
    homing: HomingEstimator | None = None

    topic_type = "sensor_msgs/msg/BatteryState"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.topic_name = self.topic
        self._silent_since: float | None = None
        self._is_limit_told = False

    def setup(self, **kwargs: Any) -> None:
        """Report the limit at which the mission ends."""
        super().setup(**kwargs)
        if self.homing is not None:
            self.homing.ends_below = max(self.homing.ends_below, self.at_least)

    def check_message(self, message: Any) -> None:
        """Check the percentage against its definition."""
        battery_share(message)

    def on_message(self, message: Any) -> Status:
        """Check the percentage."""
        self._silent_since = None
        share = battery_share(message)
        if not self._is_limit_told:  # the gauge shows it
            self._is_limit_told = True
            self.record.journal.record_observation(BATTERY, share=share, at_least=self.at_least)
        low = f"the battery is at {share:.0%}, below {self.at_least:.0%}"
        return self._judge(low if share < self.at_least else "")

    def on_silence(self) -> Status:
        """Return the status without a message, allowing time for the first one."""
        if self._silent_since is None:
            self._silent_since = self._now_sec()
        # After a message, the base class has already waited.
        waited = math.isfinite(self._received_sec) or self._now_sec() - self._silent_since > self.max_age_sec
        nothing = f"no message on '{self.topic_name}' for {self.max_age_sec:g} s"
        return self._judge(f"{nothing}{self.absence_reason}" if waited else "")


@register(
    "InsideFence",
    kind=Kind.CONDITION,
    outcomes=(Outcome("SUCCESS", "inside"), Outcome("FAILURE", "outside")),
)
@dataclass(eq=False, repr=False)
class InsideFence(_Failsafe):
    """Check that the robot is inside the parameter `geofence`: SUCCESS without a geofence, and while the robot's position is unknown.

    The position comes from the transform from `map` and the odometry, otherwise from the last `amcl_pose`. FAILURE also if the pose is
    unusable: a localisation that has diverged publishes NaN.

    Args:
        fence: The geofence.
        record: Records the reason.
    """

    fence: Geofence

    def __post_init__(self) -> None:
        super().__post_init__()
        self._robot: RobotEstimate | None = None

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the robot's pose."""
        super().setup(**kwargs)
        self._robot = robot_estimate(self.node)

    def update(self) -> Status:
        """Check the position."""
        # Without a fence there is no need to read a transform on each tick.
        robot = self._robot if self.fence else None
        if robot is not None and robot.pose_problem:
            return self._judge(f"the last pose of the localisation is unusable: {robot.pose_problem}")
        place = robot.last_pose() if robot is not None else None
        if place is None or self.fence.contains(*place[:2]):
            return self._judge("")
        return self._judge(f"the robot, at ({place[0]:.2f}, {place[1]:.2f}), is outside the geofence")


@register(
    "MissionTimeLeft",
    kind=Kind.CONDITION,
    outcomes=(Outcome("SUCCESS", "time left"), Outcome("FAILURE", "time is up")),
)
@dataclass(eq=False, repr=False)
class MissionTimeLeft(_Failsafe):
    """Check that mission time is left: FAILURE after the limit. Time runs from the first tick on, even while nodes are halted.

    Args:
        limit: Time limit of the mission, seconds of the mission's clock.
        clock: The clock.
        record: Records the reason.
    """

    limit: Seconds
    clock: Clock

    def __post_init__(self) -> None:
        super().__post_init__()
        self._began: float | None = None

    def update(self) -> Status:
        """Check the clock."""
        now = self.clock.now()
        if self._began is None:
            self._began = now
        up = now - self._began > self.limit
        return self._judge(f"the mission's time limit of {self.limit:g} s has expired" if up else "")


@register(
    "BaseInReach",
    kind=Kind.CONDITION,
    uses=(Use.service("{service}"),),
    outcomes=(
        Outcome("SUCCESS", "in reach", then="base_lost = false"),
        Outcome("FAILURE", "lost", "base_lost || losses_left > 0", _BASE_LOST),
    ),
    facts={"base_lost": False, "losses_left": 1},
)
@dataclass(eq=False, repr=False)
class BaseInReach(_Failsafe):
    """Check that the base station is available: FAILURE if its service was missing from the network for too long.

    A killed base station remains visible for about 20 s (the lease of the middleware), in addition to the patience.

    Args:
        clock: The clock that measures the patience.
        record: Records the reason.
        service: Its service, of the type `sar_interfaces/srv/ReportSurvivor`.
        patience: Maximum absence, seconds of the mission's clock.
    """

    clock: Clock
    _: KW_ONLY
    service: str = "report_survivor"
    patience: Seconds = 60.0

    service_type = "sar_interfaces/srv/ReportSurvivor"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.service_name = self.service
        self._seen: float | None = None

    def update(self) -> Status:
        """Check whether a server exists."""
        now, service = self.clock.now(), self.node.resolve_service_name(self.service_name)
        if self._seen is None or self.node.count_services(service):
            self._seen = now
        away = now - self._seen
        lost = f"base ('{self.service_name}') has been unreachable for {away:.0f} s"
        return self._judge(lost if away > self.patience else "")
