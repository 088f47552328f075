"""Query, without blocking, the parameters of Nav2's nodes on which a mission depends."""

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
"""Nav2's default value of `xy_goal_tolerance`, in metres."""

_CONTROLLER = "controller_server"
# The nodes that send velocity commands, in the order in which commands pass through them.
_DRIVERS = (_CONTROLLER, "behavior_server", "velocity_smoother", "collision_monitor", "docking_server")
_TIMEOUTS = ("default_server_timeout", "wait_for_service_timeout")
# For a timeout below the first value, the advice is to set the second value, in milliseconds. On a busy computer, Nav2's nodes acknowledge goals
# of other Nav2 nodes within the first time.
_LEAST_TIMEOUT_MS, _ADVISED_TIMEOUT_MS = 500, 1000
_STAMPED = "enable_stamped_cmd_vel"
_ODOMETRY = "odometry/filtered"
_TOLERANCE = "xy_goal_tolerance"
_WANTED = {
    NAVIGATOR: re.compile("|".join((*_TIMEOUTS, "odom_topic"))),
    _CONTROLLER: re.compile(rf"odom_topic|{_STAMPED}|goal_checker_plugins|\w+\.{_TOLERANCE}"),
    **dict.fromkeys(_DRIVERS[1:], re.compile(_STAMPED)),
}
# Maximum time until a node has responded to both requests, in seconds of awake time.
_RESPONSE_SEC = 2.0
# The fields of rcl_interfaces/msg/ParameterValue by its `type`, except for types that none of the queried parameters has.
_FIELDS = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value", 9: "string_array_value"}


class _ParameterQuery:
    """The query for the values of some parameters of one node.

    The query first requests the names of the node's parameters, because an rclcpp node returns no values if one of the requested parameters
    is not declared.
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
        """Perform the next step of the query; return whether the node is present and the query is still incomplete."""
        if self.is_over or (self._asked_at == math.inf and not self._node.count_services(self._service)):
            return False
        self._asked_at = min(self._asked_at, AWAKE.now())
        if self._call is None and self._lister.service_is_ready():
            self._call = self._lister.call_async(self._lister.srv_type.Request())
        elif self._call is not None and self._call.done():
            self._receive(self._call.result())
        if AWAKE.now() - self._asked_at > _RESPONSE_SEC:
            self.close()
        return not self.is_over

    def close(self) -> None:
        """Destroy the clients; the values received so far are kept."""
        if not self.is_over:
            self.is_over = True
            for client in (self._lister, self._getter):
                self._node.destroy_client(client)

    def _receive(self, response: Any) -> None:
        if not self._names:
            self._names = [each for each in response.result.names if self._wanted.fullmatch(each)]
            if self._names:
                self._call = self._getter.call_async(self._getter.srv_type.Request(names=self._names))
                return
        else:
            values = zip(self._names, response.values, strict=False)
            self.values = {
                name: getattr(each, _FIELDS[each.type]) for name, each in values if each.type in _FIELDS
            }
        self.close()


class Nav2Parameters:
    """The parameters of Nav2's nodes on which a mission depends; created by `nav2_parameters`.

    Args:
        node: The rclpy node that queries the parameters.
    """

    def __init__(self, node: "Node") -> None:
        self._node = node
        self._queries = {name: _ParameterQuery(node, name, wanted) for name, wanted in _WANTED.items()}

    def are_awaited(self) -> bool:
        """Continue the query of each node that is present; return whether one of these queries is incomplete."""
        return any([each.is_awaited() for each in self._queries.values()])  # noqa: C419 - every query must be continued

    def close(self) -> None:
        """End all queries; the values received so far are kept."""
        for each in self._queries.values():
            each.close()

    @property
    def goal_tolerance(self) -> float:
        """Nav2's goal tolerance, in metres; Nav2's default value if the actual value is unknown."""
        values = self._queries[_CONTROLLER].values
        names = values.get("goal_checker_plugins", ())
        tolerances = [values[key] for name in names if (key := f"{name}.{_TOLERANCE}") in values]
        usable = [each for each in tolerances if math.isfinite(each) and each >= 0.0]
        return max(usable, default=NAV2_GOAL_TOLERANCE_M)

    def advice(self) -> list[str]:
        """Return a description of each parameter whose value is likely to make drives fail, with the correct value."""
        values = {name: each.values for name, each in self._queries.items()}
        return [
            *_timeout_advice(values[NAVIGATOR]),
            *self._odometry_advice(values),
            *self._stamp_advice(values),
        ]

    def _odometry_advice(self, values: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
        """Yield advice about nodes whose odometry topic has no publisher."""
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
                yield f"{name} reads odometry from {theirs}, but no node publishes on this topic. {line}"
            else:
                yield (
                    f"no node publishes on {ours}, and {name} reads odometry from {theirs}. "
                    f"Add `--ros-args -r {_ODOMETRY}:={topic}` to the command"
                )
                return

    def _stamp_advice(self, values: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
        """Yield advice about a node that sends velocity commands of a type that the robot does not accept."""
        accepted = {
            each.topic_type.rpartition("/")[2]
            for each in self._node.get_subscriptions_info_by_topic(self._node.resolve_topic_name("cmd_vel"))
            if each.node_name not in _DRIVERS
        }
        if len(accepted) != 1 or not accepted <= {"Twist", "TwistStamped"}:
            return
        is_stamped = accepted == {"TwistStamped"}
        for name in _DRIVERS:
            if values[name].get(_STAMPED, is_stamped) != is_stamped:
                line = _line(name, f"{_STAMPED}: {str(is_stamped).lower()}")
                yield f"the robot accepts {accepted.pop()} on cmd_vel, but {name} sends the other type. {line}"
                return


def _timeout_advice(values: Mapping[str, Any]) -> Iterator[str]:
    for key in _TIMEOUTS:
        if (value := values.get(key, _ADVISED_TIMEOUT_MS)) < _LEAST_TIMEOUT_MS:
            line = _line(NAVIGATOR, f"{key}: {_ADVISED_TIMEOUT_MS}")
            yield (
                f"{key} of {NAVIGATOR} is {value} ms. So {NAVIGATOR} aborts a goal if another Nav2 node takes longer than that to respond. "
                f"{line}"
            )


def _line(node: str, line: str) -> str:
    return f"Write `{line}` under `{node}: ros__parameters:` in Nav2's parameter file, and restart Nav2"


def nav2_parameters(node: "Node") -> Nav2Parameters:
    """Return the `Nav2Parameters` of the Nav2 that receives a node's goals.

    Every call for a node returns the same object.
    """
    return of_node(node, Nav2Parameters, lambda: Nav2Parameters(node))
