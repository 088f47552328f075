"""The parameters of Nav2's nodes that a mission depends on, queried without blocking."""

import math
import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from sar_compiler.nodes.nav2.log_lines import NAVIGATOR
from sar_compiler.ros.clock import AWAKE
from sar_compiler.ros.leaves.leaf import of_node

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.task import Future

NAV2_GOAL_TOLERANCE_M = 0.25
"""Nav2's default of `xy_goal_tolerance`, metres."""

_CONTROLLER = "controller_server"
# The nodes that send velocity commands, in the order of the commands' flow.
_DRIVERS = (_CONTROLLER, "behavior_server", "velocity_smoother", "collision_monitor", "docking_server")
_TIMEOUTS = ("default_server_timeout", "wait_for_service_timeout")
# Nav2's own actions are acknowledged within this time even on a busy computer, milliseconds; the recommended value.
_LEAST_TIMEOUT_MS, _ADVISED_TIMEOUT_MS = 500, 1000
_STAMPED = "enable_stamped_cmd_vel"
_ODOMETRY = "odometry/filtered"
_TOLERANCE = "xy_goal_tolerance"
_WANTED = {
    NAVIGATOR: re.compile("|".join((*_TIMEOUTS, "odom_topic"))),
    _CONTROLLER: re.compile(rf"odom_topic|{_STAMPED}|goal_checker_plugins|\w+\.{_TOLERANCE}"),
    **dict.fromkeys(_DRIVERS[1:], re.compile(_STAMPED)),
}
# How long a node may take for its answers, steady seconds.
_ANSWER_SEC = 2.0
# Fields by `type` of rcl_interfaces/msg/ParameterValue, without types that none of the parameters has.
_FIELDS = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value", 9: "string_array_value"}


class _ParameterQuery:
    """The query for some parameters of one node.

    A node of rclcpp returns no values if any queried parameter is undeclared, hence the first step.
    """

    def __init__(self, node: "Node", name: str, wanted: re.Pattern[str]) -> None:
        from rcl_interfaces.srv import GetParameters, ListParameters

        self.values: dict[str, Any] = {}
        self.is_over = False
        self._node, self._wanted = node, wanted
        self._service = node.resolve_service_name(f"{name}/list_parameters")
        self._lister = node.create_client(ListParameters, f"{name}/list_parameters")
        self._getter = node.create_client(GetParameters, f"{name}/get_parameters")
        self._names: list[str] = []
        self._call: Future | None = None
        self._asked_at = math.inf

    def is_awaited(self) -> bool:
        """Perform the next step; return whether the node is present but has not responded."""
        if self.is_over or (self._asked_at == math.inf and not self._node.count_services(self._service)):
            return False
        self._asked_at = min(self._asked_at, AWAKE.now())
        if self._call is None and self._lister.service_is_ready():
            self._call = self._lister.call_async(self._lister.srv_type.Request())
        elif self._call is not None and self._call.done():
            self._receive(self._call.result())
        if AWAKE.now() - self._asked_at > _ANSWER_SEC:
            self.close()
        return not self.is_over

    def close(self) -> None:
        """Destroy the clients, but keep the values."""
        if not self.is_over:
            self.is_over = True
            for client in (self._lister, self._getter):
                self._node.destroy_client(client)

    def _receive(self, answer: Any) -> None:
        if not self._names:
            self._names = [each for each in answer.result.names if self._wanted.fullmatch(each)]
            if self._names:
                self._call = self._getter.call_async(self._getter.srv_type.Request(names=self._names))
                return
        else:
            values = zip(self._names, answer.values, strict=False)
            self.values = {
                name: getattr(each, _FIELDS[each.type]) for name, each in values if each.type in _FIELDS
            }
        self.close()


class Nav2Parameters:
    """The parameters of Nav2's nodes that a mission depends on; use `nav2_parameters`.

    Args:
        node: The rclpy node that asks.
    """

    def __init__(self, node: "Node") -> None:
        self._node = node
        self._questions = {name: _ParameterQuery(node, name, wanted) for name, wanted in _WANTED.items()}

    def are_awaited(self) -> bool:
        """Query each present node once; return whether any response is pending."""
        return any([each.is_awaited() for each in self._questions.values()])  # noqa: C419 - all are to be asked

    def close(self) -> None:
        """Stop querying, but keep the responses."""
        for each in self._questions.values():
            each.close()

    @property
    def goal_tolerance(self) -> float:
        """Nav2's goal tolerance, metres; Nav2's default until its response arrives."""
        values = self._questions[_CONTROLLER].values
        names = values.get("goal_checker_plugins", ())
        tolerances = [values[key] for name in names if (key := f"{name}.{_TOLERANCE}") in values]
        usable = [each for each in tolerances if math.isfinite(each) and each >= 0.0]
        return max(usable, default=NAV2_GOAL_TOLERANCE_M)

    def advice(self) -> list[str]:
        """Describe the parameters that are likely to make drives fail, with corrections."""
        values = {name: each.values for name, each in self._questions.items()}
        return [
            *_timeout_advice(values[NAVIGATOR]),
            *self._odometry_advice(values),
            *self._stamp_advice(values),
        ]

    def _odometry_advice(self, values: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
        """Yield sentences about nodes whose odometry topic has no publisher."""
        node = self._node
        ours = node.resolve_topic_name(_ODOMETRY)
        for name in (NAVIGATOR, _CONTROLLER):
            topic = values[name].get("odom_topic", ours)
            theirs = node.resolve_topic_name(topic)
            published, theirs_published = node.count_publishers(ours), node.count_publishers(theirs)
            if theirs == ours or bool(published) == bool(theirs_published):
                continue
            if published:
                line = _line(name, f"odom_topic: {ours.removeprefix(node.get_namespace()).lstrip('/')}")
                yield f"{name} reads odometry from {theirs}, which no node publishes: {line}"
            else:
                yield (
                    f"no node publishes {ours}, and {name} reads odometry from {theirs}: "
                    f"add `--ros-args -r {_ODOMETRY}:={topic}` to the command"
                )
                return

    def _stamp_advice(self, values: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
        """Yield sentences about nodes whose velocity commands have a type that the robot does not accept."""
        heard = {
            each.topic_type.rpartition("/")[2]
            for each in self._node.get_subscriptions_info_by_topic(self._node.resolve_topic_name("cmd_vel"))
            if each.node_name not in _DRIVERS
        }
        if len(heard) != 1 or not heard <= {"Twist", "TwistStamped"}:
            return
        is_stamped = heard == {"TwistStamped"}
        for name in _DRIVERS:
            if values[name].get(_STAMPED, is_stamped) != is_stamped:
                line = _line(name, f"{_STAMPED}: {str(is_stamped).lower()}")
                yield f"the robot accepts {heard.pop()} on cmd_vel, and {name} sends the other type: {line}"
                return


def _timeout_advice(values: Mapping[str, Any]) -> Iterator[str]:
    for key in _TIMEOUTS:
        if (value := values.get(key, _ADVISED_TIMEOUT_MS)) < _LEAST_TIMEOUT_MS:
            line = _line(NAVIGATOR, f"{key}: {_ADVISED_TIMEOUT_MS}")
            yield (
                f"{key} of {NAVIGATOR} is {value} ms: it aborts a goal whenever another node of Nav2 answers later: {line}"
            )


def _line(node: str, line: str) -> str:
    return f"write `{line}` under `{node}: ros__parameters:` in Nav2's parameter file, and restart Nav2"


def nav2_parameters(node: "Node") -> Nav2Parameters:
    """Return the parameters of the Nav2 that receives a node's goals, one object for the lifetime of the node."""
    return of_node(node, Nav2Parameters, lambda: Nav2Parameters(node))
