"""Names of Nav2's nodes, and selection of the lines in their logs that explain a failure."""

import math
import re
from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

NAV2_NODES = ("amcl", "bt_navigator")
"""The lifecycle nodes of Nav2 that localise and navigate, by their relative names."""

NAVIGATOR = NAV2_NODES[-1]
"""The lifecycle node whose actions drive the robot."""

DRIVING_NODES = (*NAV2_NODES, "planner_server", "controller_server", "behavior_server")
"""The nodes needed for driving.

If one of these nodes is inactive or silent, a goal that fails may still be reachable.
"""

MANAGER = "lifecycle_manager_navigation"
"""The lifecycle manager that brings Nav2 up."""
BEFORE_NAVIGATOR = (
    "controller_server",
    "smoother_server",
    "planner_server",
    "route_server",
    "behavior_server",
    "velocity_smoother",
    "collision_monitor",
)
"""The nodes that the lifecycle manager activates before the navigator, in this order."""

# Maximum number of quoted lines, and their maximum length.
_QUOTED, _LONGEST = 2, 120

# Phrases of Nav2 (1.1 to 1.5) that name a cause. Lines with such a phrase rank before all others, regardless of the logger:
# an action client logs as `bt_navigator_navigate_to_pose_rclcpp_node`, a library as `tf_help`.
_CAUSES = re.compile(
    r"timed out while waiting for action server|server not available|is inactive|while inactive"
    r"|transform data too old|transform timeout|timed out waiting for transform|(extrapolation|connectivity) error"
    r"|no transform|to transform|pose is not available|no pose"
    r"|failed to make progress|patience exceeded|collision|no valid"
    r"|failed to (generate|plan)|is outside|lethal|is not a valid|which does not exist"
    r"|open input xml|bt file not found|exception when loading bt|behavior tree threw",
    re.IGNORECASE,
)
# Lines that occur without a failure: on a busy computer, and when a default is used.
_SECONDARY = re.compile(
    r"missed its desired rate|tick rate .* exceeded|No (goal|progress) checker was specified|No (planner|controller)s? (was )?specified"
    r"|Received a preemption|will use only plugin"
)
# Lines that report a failure without its cause, and a line that appears at each start.
_EMPTY = re.compile(
    r"Goal failed|Aborting handle|in node halt|Error_code parameters were not set|\[ActionServer\]|Failed to change state|Aborting bringup|has been idle"
)
_LOGGERS = {*DRIVING_NODES, *BEFORE_NAVIGATOR, MANAGER, "local_costmap", "global_costmap", "tf_help"}


class GoalEnd(Enum):
    """The end of a goal, as the navigator reports it in its log."""

    SUCCEEDED = "Goal succeeded"
    FAILED = "Goal failed"
    CANCELED = "Goal canceled"


class LoggedLine(NamedTuple):
    """A line of the log.

    Attributes:
        at: The time of arrival, in seconds.
        who: The name of the logger, without the namespace.
        text: The text of the line.
        is_error: Whether the line is an error, not a warning.
    """

    at: float
    who: str
    text: str
    is_error: bool

    @property
    def rank(self) -> int | None:
        """The rank of the line as an explanation of a failure: 0 is best, None explains no failure."""
        if _EMPTY.search(self.text):
            return None
        if _SECONDARY.search(self.text):
            return 3
        if _CAUSES.search(self.text):
            return 0
        is_nav2 = any(self.who == name or self.who.startswith((f"{name}.", f"{name}_")) for name in _LOGGERS)
        return 1 if is_nav2 else 2 if self.is_error else None


def goal_end(who: str, text: str) -> GoalEnd | None:
    """Return the end of a goal that a line of the navigator reports, or None for any other line.

    Args:
        who: The name of the logger, which may have a namespace.
        text: The text of the line.
    """
    if who.rpartition(".")[2] != NAVIGATOR:
        return None
    return next((each for each in GoalEnd if text.startswith(each.value)), None)


def quote_lines(lines: Iterable[LoggedLine], begin: float = -math.inf, end: float = math.inf) -> str:
    """Quote the lines that best explain a failure, such as `controller_server: "Failed to make progress"`.

    The result is empty if no line explains a failure. Of equally good lines, those that were logged from *begin* to *end* are quoted.
    """
    ranked = [(rank, each) for each in lines if (rank := each.rank) is not None]
    lowest = min((rank for rank, _ in ranked), default=None)
    best = [each for rank, each in ranked if rank == lowest]
    best = [each for each in best if begin <= each.at <= end] or best
    quoted = [f'{each.who}: "{_first_line(each.text)}"' for each in best]
    return "; ".join(list(dict.fromkeys(quoted))[-_QUOTED:])


def _first_line(text: str) -> str:
    """Return the first line of a text, shortened if it is long."""
    first = text.strip().partition("\n")[0]
    return first if len(first) <= _LONGEST else f"{first[: _LONGEST - 1]}…"
