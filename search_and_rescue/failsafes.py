"""The conditions of failsafes: SUCCESS while all is well, FAILURE with a reason where the mission is to be cut short."""

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, Any

from py_trees.common import Status

from sar_compiler.leaves import (
    Answer,
    Clock,
    Kind,
    RobotEstimate,
    RosLeaf,
    Seconds,
    TopicLeaf,
    Use,
    battery_share,
    register,
    robot_estimate,
    sensible,
)
from sar_compiler.missions import BATTERY
from search_and_rescue.homing import Homing
from search_and_rescue.orders import OperatorOrders
from search_and_rescue.record import MissionRecord
from search_and_rescue.zone_manager import Fence

_BASE_LOST = "losses_left -= base_lost ? 0 : 1; base_lost = true"


@dataclass(eq=False, repr=False)
class _Failsafe(RosLeaf):
    """The common base of these conditions, which report a problem once, until all is well again.

    Args:
        record: Where the reason is noted; for `AbandonZones`.
    """

    name: str
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self._raised = False

    def _judge(self, problem: str) -> Status:
        """Return FAILURE for a problem in words, and SUCCESS for an empty one."""
        if problem and not self._raised:
            self.complain(f"Failsafe: {problem}.")
            self.record.alarmed(problem)
        self._raised = bool(problem)
        self.feedback_message = problem
        return Status.FAILURE if problem else Status.SUCCESS


@dataclass(eq=False, repr=False)
class _OrderCondition(_Failsafe):
    """The common base of conditions on a command that cuts the mission short.

    Args:
        orders: The commands that were given.
        record: Where the reason is noted.
    """

    orders: OperatorOrders

    command = subject = ""

    def setup(self, **kwargs: Any) -> None:
        """Offer the service."""
        super().setup(**kwargs)
        self.orders.offer(self.node, self.command, self._on_command)

    def shutdown(self) -> None:
        """Withdraw the service."""
        self.orders.withdraw()
        super().shutdown()

    def update(self) -> Status:
        """Look at the orders."""
        return self._judge(self._reason() if self.command in self.orders.given else "")

    def _reason(self) -> str:
        return f"{self.subject} was {self.orders.said(self.command)}"

    def _on_command(self, _: Any, response: Any) -> Any:
        self.orders.give(self.command)
        self._wake()
        response.success, response.message = True, self._reason()
        return response


@register(
    "NotAborted",
    kind=Kind.CONDITION,
    answers=(Answer("SUCCESS", "not aborted"), Answer("FAILURE", "aborted")),
)
class NotAborted(_OrderCondition):
    """Has the operator not aborted the mission? FAILURE since the service `~/abort` (`std_srvs/srv/Trigger`) was called."""

    command, subject = "abort", "the mission"


@register(
    "NotRecalled",
    kind=Kind.CONDITION,
    answers=(Answer("SUCCESS", "not recalled"), Answer("FAILURE", "recalled")),
)
class NotRecalled(_OrderCondition):
    """Has the operator not called the robot home? FAILURE since `~/go_home` (`std_srvs/srv/Trigger`) was called."""

    command, subject = "go_home", "the robot"


@register(
    "NavigationAvailable",
    kind=Kind.CONDITION,
    answers=(
        Answer("SUCCESS", "available", "!navigation_lost"),
        Answer("FAILURE", "unavailable", "navigation_lost"),
    ),
    facts={"navigation_lost": False},
)
class NavigationAvailable(_Failsafe):
    """Did somebody judge the last drive? FAILURE if it has failed, or was cut off, while Nav2 or its localisation was away.

    Such a failure says nothing of the place, so it is no reason to postpone or to abandon a zone.

    Args:
        record: Knows it, and where the reason is noted.
    """

    def update(self) -> Status:
        """Look at what the last drive has come to."""
        lost = self.record.navigation_lost
        return self._judge(f"navigation is unavailable ({lost})" if lost else "")


@register(
    "BatterySuffices",
    kind=Kind.CONDITION,
    uses=(Use.topic("{topic}"),),
    answers=(Answer("SUCCESS", "enough"), Answer("FAILURE", "low")),
)
@dataclass(eq=False, repr=False, kw_only=True)
class BatterySuffices(_Failsafe, TopicLeaf):
    """Is there enough in the battery? FAILURE below a limit, or if it is not known for too long.

    A percentage that is not a number, or not from 0 to 1, says nothing.

    Where the tree asks whether the robot comes home again (`ReturnInReach`), the reserve counts above the limit.

    Args:
        record: Where the reason is noted.
        homing: What it takes to come home; is told the limit.
        at_least: The limit, of 1 for a full battery.
        topic: A topic of `sensor_msgs/msg/BatteryState`, whose `percentage` counts.
        max_age_sec: How long it may be silent, seconds of the node's clock.
    """

    at_least: Annotated[float, sensible(0, 1)] = 0.2
    topic: str = "battery_state"
    max_age_sec: Seconds = 30.0
    homing: Homing | None = None

    topic_type = "sensor_msgs/msg/BatteryState"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.topic_name = self.topic
        self._silent_since: float | None = None
        self._is_limit_told = False

    def setup(self, **kwargs: Any) -> None:
        """Let it be known where the mission ends."""
        super().setup(**kwargs)
        if self.homing is not None:
            self.homing.ends_below = max(self.homing.ends_below, self.at_least)

    def check_message(self, message: Any) -> None:
        """Hold the percentage against its definition."""
        battery_share(message)

    def on_message(self, message: Any) -> Status:
        """Look at the percentage."""
        self._silent_since = None
        share = battery_share(message)
        if not self._is_limit_told:  # for the gauge
            self._is_limit_told = True
            self.record.journal.watch(BATTERY, share=share, at_least=self.at_least)
        low = f"the battery is at {share:.0%}, below {self.at_least:.0%}"
        return self._judge(low if share < self.at_least else "")

    def on_silence(self) -> Status:
        """Give the first message time, too."""
        if self._silent_since is None:
            self._silent_since = self._now_sec()
        # After a message, the base class has waited already.
        waited = math.isfinite(self._received_sec) or self._now_sec() - self._silent_since > self.max_age_sec
        nothing = f"nothing on '{self.topic_name}' for {self.max_age_sec:g} s"
        return self._judge(f"{nothing}{self.silence_cause}" if waited else "")


@register(
    "InsideFence",
    kind=Kind.CONDITION,
    answers=(Answer("SUCCESS", "inside"), Answer("FAILURE", "outside")),
)
@dataclass(eq=False, repr=False)
class InsideFence(_Failsafe):
    """Is the robot inside its geofence, the parameter `geofence`? SUCCESS without one, and while nobody knows where the robot is.

    Where it is, the transform from `map` and the odometry say; without them the last `amcl_pose`. FAILURE as well if that is no usable
    pose: a localisation that has diverged says "not a number".

    Args:
        fence: The geofence.
        record: Where the reason is noted.
    """

    fence: Fence

    def __post_init__(self) -> None:
        super().__post_init__()
        self._robot: RobotEstimate | None = None

    def setup(self, **kwargs: Any) -> None:
        """Listen to what is said of the robot."""
        super().setup(**kwargs)
        self._robot = robot_estimate(self.node)

    def update(self) -> Status:
        """Look at the position."""
        # Without a fence a transform need not be read in each tick.
        robot = self._robot if self.fence else None
        if robot is not None and robot.pose_problem:
            return self._judge(f"the last pose of the localisation cannot be used: {robot.pose_problem}")
        place = robot.place() if robot is not None else None
        if place is None or self.fence.contains(*place[:2]):
            return self._judge("")
        return self._judge(f"the robot, at ({place[0]:.2f}, {place[1]:.2f}), is outside the geofence")


@register(
    "MissionTimeLeft",
    kind=Kind.CONDITION,
    answers=(Answer("SUCCESS", "time left"), Answer("FAILURE", "time is up")),
)
@dataclass(eq=False, repr=False)
class MissionTimeLeft(_Failsafe):
    """Is there time left? FAILURE when it is up; it counts from the first tick on, whatever is halted meanwhile.

    Args:
        limit: How long the mission may take, seconds of the mission's clock.
        clock: The clock.
        record: Where the reason is noted.
    """

    limit: Seconds
    clock: Clock

    def __post_init__(self) -> None:
        super().__post_init__()
        self._began: float | None = None

    def update(self) -> Status:
        """Look at the clock."""
        now = self.clock.now()
        if self._began is None:
            self._began = now
        up = now - self._began > self.limit
        return self._judge(f"the mission's time of {self.limit:g} s is up" if up else "")


@register(
    "BaseInReach",
    kind=Kind.CONDITION,
    uses=(Use.service("{service}"),),
    answers=(
        Answer("SUCCESS", "in reach", then="base_lost = false"),
        Answer("FAILURE", "lost", "base_lost || losses_left > 0", _BASE_LOST),
    ),
    facts={"base_lost": False, "losses_left": 1},
)
@dataclass(eq=False, repr=False)
class BaseInReach(_Failsafe):
    """Is the base station there? FAILURE if its service was in no network for too long.

    A base that was killed is seen for some 20 s more (the lease of the middleware), which come before the patience.

    Args:
        clock: The clock of the patience.
        record: Where the reason is noted.
        service: Its service, of the type `sar_interfaces/srv/ReportSurvivor`.
        patience: How long it may be away, seconds of the mission's clock.
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
        """Look whether there is a server."""
        now, service = self.clock.now(), self.node.resolve_service_name(self.service_name)
        if self._seen is None or self.node.count_services(service):
            self._seen = now
        away = now - self._seen
        lost = f"base ('{self.service_name}') is out of reach for {away:.0f} s"
        return self._judge(lost if away > self.patience else "")
