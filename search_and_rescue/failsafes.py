"""Failsafe conditions. They succeed in normal operation. If one fails, the tree ends the mission early."""

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
    """The base class of the failsafe conditions. A problem is reported only once until it is solved.

    Args:
        record: Records each problem as an alarm, whose text `AbandonZones` uses as the reason.
    """

    name: str
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self._raised = False

    def _report_problem(self, problem: str) -> Status:
        """Return FAILURE if there is a problem, and report the problem if it is new. Otherwise return SUCCESS."""
        if problem and not self._raised:
            self.warn(f"Failsafe: {problem}.")
            self.record.record_alarm(problem)
        self._raised = bool(problem)
        self.feedback_message = problem
        return Status.FAILURE if problem else Status.SUCCESS


@dataclass(eq=False, repr=False)
class _CommandCondition(_Failsafe):
    """The base class of conditions that fail after the operator has given a command to end the mission early.

    Args:
        orders: The operator's commands.
        record: Records the command as an alarm.
    """

    orders: OperatorCommands

    command = subject = ""

    def setup(self, **kwargs: Any) -> None:
        """Create the service of the command."""
        super().setup(**kwargs)
        self.orders.offer(self.node, self.command, self._on_command)

    def shutdown(self) -> None:
        """Destroy the services of the commands."""
        self.orders.destroy_services()
        super().shutdown()

    def update(self) -> Status:
        """Return FAILURE if the operator has given the command, otherwise SUCCESS."""
        return self._report_problem(self._reason() if self.command in self.orders.given else "")

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
    """Check that the operator has not aborted the mission with the service `~/abort` (`std_srvs/srv/Trigger`)."""

    command, subject = "abort", "the mission"


@register(
    "NotRecalled",
    kind=Kind.CONDITION,
    outcomes=(Outcome("SUCCESS", "not recalled"), Outcome("FAILURE", "recalled")),
)
class NotRecalled(_CommandCondition):
    """Check that the operator has not called the robot home with the service `~/go_home` (`std_srvs/srv/Trigger`)."""

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
    """Check that Nav2 and the localisation were available when the last drive ended. Otherwise the leaf fails.

    A drive that failed without navigation does not show whether the target is reachable. The zone is therefore
    neither postponed nor abandoned.

    Args:
        record: Contains the state of navigation, and records the problem as an alarm.
    """

    def update(self) -> Status:
        """Return FAILURE if navigation was unavailable when the last drive ended, otherwise SUCCESS."""
        lost = self.record.navigation_lost
        return self._report_problem(f"navigation is unavailable ({lost})" if lost else "")


@register(
    "BatterySuffices",
    kind=Kind.CONDITION,
    uses=(Use.topic("{topic}"),),
    outcomes=(Outcome("SUCCESS", "enough"), Outcome("FAILURE", "low")),
)
@dataclass(eq=False, repr=False, kw_only=True)
class BatterySuffices(_Failsafe, TopicLeaf):
    """Check the battery's charge. The leaf fails if the charge is below a limit, or unknown for too long.

    A percentage that is not a number from 0 to 1 is ignored.

    If the tree also contains `ReturnInReach`, this limit is added to the reserve for the way home.

    Args:
        record: Records the problem as an alarm.
        homing: The estimates for the way home, which take the limit into account.
        at_least: The minimum charge, 1 for a full battery.
        topic: The topic of the battery state (`sensor_msgs/msg/BatteryState`), whose `percentage` is used.
        max_age_sec: Maximum time without a message on the topic, seconds of the node's clock.
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
        self._is_limit_recorded = False

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the battery topic, and add the limit to the estimates for the way home."""
        super().setup(**kwargs)
        if self.homing is not None:
            self.homing.ends_below = max(self.homing.ends_below, self.at_least)

    def check_message(self, message: Any) -> None:
        """Check that the percentage is a number from 0 to 1."""
        battery_share(message)

    def on_message(self, message: Any) -> Status:
        """Compare the percentage with the limit."""
        self._silent_since = None
        share = battery_share(message)
        if not self._is_limit_recorded:  # the pages display the limit beside the charge
            self._is_limit_recorded = True
            self.record.journal.record_observation(BATTERY, share=share, at_least=self.at_least)
        # Rounded to whole percents, a charge just below the limit could look equal to the limit.
        digits = 0 if f"{share:.0%}" != f"{self.at_least:.0%}" else 1
        low = f"the battery is at {share:.{digits}%}, below {self.at_least:.0%}"
        return self._report_problem(low if share < self.at_least else "")

    def on_silence(self) -> Status:
        """Return SUCCESS while waiting for a message. After `max_age_sec` without a message, return FAILURE."""
        if self._silent_since is None:
            self._silent_since = self._now_sec()
        # After a first message, the base class calls this method only when `max_age_sec` has passed.
        waited = math.isfinite(self._received_sec) or self._now_sec() - self._silent_since > self.max_age_sec
        nothing = f"no message on '{self.topic_name}' for {self.max_age_sec:g} s"
        return self._report_problem(f"{nothing}{self.absence_reason}" if waited else "")


@register(
    "InsideFence",
    kind=Kind.CONDITION,
    outcomes=(Outcome("SUCCESS", "inside"), Outcome("FAILURE", "outside")),
)
@dataclass(eq=False, repr=False)
class InsideFence(_Failsafe):
    """Check that the robot is inside the geofence. The leaf also succeeds without a geofence or known position.

    The parameter `geofence` defines the geofence. The position is computed from the transform from `map` and
    the odometry, or otherwise taken from the last `amcl_pose`. The condition also returns FAILURE if the last
    pose is unusable, for example because a diverged localisation publishes NaN.

    Args:
        fence: The geofence.
        record: Records the problem as an alarm.
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
        """Return FAILURE if the robot is outside the geofence or its last pose is unusable, otherwise SUCCESS."""
        # Without a geofence, do not read a transform on each tick.
        robot = self._robot if self.fence else None
        if robot is not None and robot.pose_problem:
            return self._report_problem(
                f"the last pose of the localisation is unusable: {robot.pose_problem}"
            )
        pose = robot.last_pose() if robot is not None else None
        if pose is None or self.fence.contains(*pose[:2]):
            return self._report_problem("")
        return self._report_problem(f"the robot is at ({pose[0]:.2f}, {pose[1]:.2f}), outside the geofence")


@register(
    "MissionTimeLeft",
    kind=Kind.CONDITION,
    outcomes=(Outcome("SUCCESS", "time left"), Outcome("FAILURE", "time is up")),
)
@dataclass(eq=False, repr=False)
class MissionTimeLeft(_Failsafe):
    """Check that mission time is left. The leaf fails after the time limit, which begins at the first tick.

    Args:
        limit: Time limit of the mission, seconds of the mission's clock. The time continues while nodes are
            halted.
        clock: The mission's clock.
        record: Records the problem as an alarm.
    """

    limit: Seconds
    clock: Clock

    def __post_init__(self) -> None:
        super().__post_init__()
        self._began: float | None = None

    def update(self) -> Status:
        """Return FAILURE if the time limit has expired, otherwise SUCCESS."""
        now = self.clock.now()
        if self._began is None:
            self._began = now
        has_expired = now - self._began > self.limit
        problem = f"the mission's time limit of {self.limit:g} s has expired" if has_expired else ""
        return self._report_problem(problem)


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
    """Check that the base station is available. The leaf fails if its service is missing longer than `patience`.

    If the base station is killed, its service remains visible for about 20 s, which is the lease duration of
    the middleware. The time `patience` starts after these 20 s.

    Args:
        clock: The mission's clock, which measures the absence of the service.
        record: Records the problem as an alarm.
        service: The base station's service (`sar_interfaces/srv/ReportSurvivor`).
        patience: Maximum absence of the service, seconds of the mission's clock.
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
        """Return FAILURE if the base station's service has been missing for too long, otherwise SUCCESS."""
        now, service = self.clock.now(), self.node.resolve_service_name(self.service_name)
        if self._seen is None or self.node.count_services(service):
            self._seen = now
        absent_sec = now - self._seen
        problem = f"the base station ('{self.service_name}') has been unreachable for {absent_sec:.0f} s"
        return self._report_problem(problem if absent_sec > self.patience else "")
