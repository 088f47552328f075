"""Nav2's status and error codes in words.

Source: the action definitions of nav2_msgs. Each server has a range of a hundred codes; `NavigateToPose` passes on
the code of the server that failed.
"""

from typing import Any

from sar_compiler.ros.leaves.goal import describe_status

_ABORTED = 6

FOR_GOOD = (101, 201, 204, 9001)
"""Codes of goals that fail as often as they are sent: no such plug-in or tree, a goal outside the map."""
OCCUPIED = 206
"""The code of a goal in an obstacle, of which some can move."""
_ROBOTS_PLACE = (203, 205)

_CODES = {
    1: "the goal was rejected by another server",
    2: "the goal could not be sent on to another server",
    101: "the controller that was asked for does not exist",
    102: "the controller could not transform a pose",
    103: "the controller was given an invalid path",
    104: "the controller's patience was exceeded",
    105: "the robot makes no progress",
    106: "the controller found no safe velocity",
    107: "the controller took too long",
    201: "the planner that was asked for does not exist",
    202: "the planner could not transform a pose",
    203: "the robot is outside the map",
    204: "the goal is outside the map",
    205: "the robot stands in an obstacle",
    206: "the goal lies in an obstacle",
    207: "the planner took too long",
    208: "there is no path to the goal",
    9001: "Nav2 could not load its behavior tree",
    9002: "Nav2 could not transform a pose",
    9003: "Nav2 took too long",
}

_RANGES = (
    (100, 199, "the controller failed"),
    (200, 299, "the planner failed"),
    (300, 399, "the planner for several poses failed"),
    (400, 499, "the route server failed"),
    (500, 599, "the smoother failed"),
    (600, 699, "the waypoint follower failed"),
    (700, 799, "a recovery behavior failed"),
    (900, 999, "docking or following failed"),
    (9000, 9999, "the navigator failed"),
)


def describe_end(status: int, result: Any, said: str = "") -> str:
    """Return the description of a failed drive.

    Args:
        status: The goal's status, a constant of `action_msgs/msg/GoalStatus` other than success.
        result: The result of `nav2_msgs/action/NavigateToPose`, which has no error code in older versions.
        said: What Nav2's nodes have logged meanwhile.

    Returns:
        Status and error code, each as a number and in words, and Nav2's own reason where it has given one.
    """
    code = int(getattr(result, "error_code", 0))
    own = str(getattr(result, "error_msg", ""))
    words = own or _describe_code(code, aborted=status == _ABORTED)
    quoted = f" ({said})" if said and not own else ""
    return f"{describe_status(status)}, error code {code}: {words}{quoted}{_advice(code)}"


def _advice(code: int) -> str:
    if code in FOR_GOOD:
        return "; it is not sent again"
    return "; no goal can be reached from there" if code in _ROBOTS_PLACE else ""


def _describe_code(code: int, *, aborted: bool) -> str:
    if code == 0:
        # Nav2 aborts so for many reasons: a server that was late or is dead, a node that is not active, no pose.
        return "no code" if aborted else "none"
    if code in _CODES:
        return _CODES[code]
    ranges = (words for first, last, words in _RANGES if first <= code <= last)
    return next(ranges, "a code that is not known here")
