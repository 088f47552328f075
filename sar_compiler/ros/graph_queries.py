"""Queries of the ROS graph: which nodes provide a name, which names are similar, and why messages do not arrive.

The readiness check, the monitor of a running tree, messages of leaves and `ros2 doctor` use these queries. They neither block nor subscribe to
a topic: the results contain what discovery has found so far.
"""

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from inspect import signature
from typing import TYPE_CHECKING, Any, TypeVar

from py_trees.behaviour import Behaviour

from sar_compiler.nodes.spec import Use
from sar_compiler.ros.clock import AWAKE
from sar_compiler.ros.discovery_wait import node_names
from sar_compiler.ros.leaves.leaf import NAMED_QOS, interface_name, of_node, qos_profile
from sar_compiler.tree.guessing import nearest

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile

T = TypeVar("T")

# The time for which results are reused, in seconds of awake time, because a wait queries 20 times a second.
_FRESH_SEC = 0.25
_GOAL_SERVICE, _STATE_SERVICE = "/_action/send_goal", "/get_state"
# The attributes of a leaf that declare its endpoints.
_DECLARED_IN = {
    "action": ("action_name", "action_type"),
    "service": ("service_name", "service_type"),
    "topic": ("topic_name", "topic_type"),
}
_ACTION_PARTS = ("send_goal", "cancel_goal", "get_result", "feedback", "status")
_CLOCK_TYPE = "rosgraph_msgs/msg/Clock"
# The maximum number of similar names in a message.
_MOST = 3
# If a name begins with another name that is longer than this, the two names are similar.
_LEAST_SHARED = 4
# Types that do not indicate the purpose of a name.
_GENERIC_TYPES = ("std_msgs/", "std_srvs/", "lifecycle_msgs/", "rcl_interfaces/")
# Types of topics that should have one publisher. Two publishers belong to two robots, or to an old node and its replacement.
_ONE_SOURCE = (
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/OccupancyGrid",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "sensor_msgs/msg/BatteryState",
)
_REMAP_TRANSFORMS = "-r /tf:=tf -r /tf_static:=tf_static"
# The name that the ROS graph shows for a node whose endpoints are discovered before the node itself.
UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"


@dataclass(frozen=True)
class Endpoint:
    """An action, service, topic or node that a program uses.

    Attributes:
        kind: `action`, `service`, `topic` (to which the program subscribes), `listeners` (of a topic on which the program publishes) or
            `node` (a lifecycle node).
        name: The name as the program writes it, usually relative.
        type_name: The type, such as `package/srv/Name`; empty for any type.
        qos: The QoS profiles of the program's subscriptions to the topic; for `listeners`, of the program's publishers.
        attribute: The attribute of the tree file that sets the name; empty if there is none.
    """

    kind: str
    name: str
    type_name: str = ""
    qos: "tuple[QoSProfile, ...]" = field(default=(), compare=False)
    attribute: str = ""

    def remappings(self, target: str) -> list[str]:
        """Return the remapping rules that map this name to another full name."""
        parts = {
            "action": [f"/_action/{part}" for part in _ACTION_PARTS],
            "node": [_STATE_SERVICE],
        }.get(self.kind, [""])
        return [f"-r {self.name}{part}:={target}{part}" for part in parts]


@dataclass(frozen=True)
class EndpointState:
    """The result of a query for an endpoint.

    Attributes:
        endpoint: The endpoint that was queried.
        full_name: The endpoint's full name after remapping.
        nodes: The full names of the other nodes that provide the endpoint.
        problem: The reason why the endpoint cannot be used, in words; empty if it can be used.
        is_there: Whether another node provides the endpoint.
        is_contested: Whether several servers would accept the same call.
        elsewhere: The full names of the same endpoint in other namespaces, or of similar endpoints, most likely first.
        is_same: Whether `elsewhere` contains the same relative name in other namespaces.
    """

    endpoint: Endpoint
    full_name: str
    nodes: tuple[str, ...] = ()
    problem: str = ""
    is_there: bool = False
    is_contested: bool = False
    elsewhere: tuple[str, ...] = ()
    is_same: bool = False

    @property
    def title(self) -> str:
        """The endpoint's kind and name."""
        kind = "topic" if self.endpoint.kind == "listeners" else self.endpoint.kind
        return f"{kind} {with_full_name(self.endpoint.name, self.full_name)}"

    @property
    def hint(self) -> str:
        """A sentence ending with the alternatives, such as `, but there is /tb1/scan`; empty if there are none."""
        return f", but there is {join_names(self.elsewhere, 'or')}" if self.elsewhere else ""

    @property
    def line(self) -> str | None:
        """The problem with the endpoint and its alternatives; None if there is no problem."""
        return f"{self.title}: {self.problem}{self.hint}" if self.problem else None

    @property
    def remedy(self) -> str:
        """The instruction that remaps this endpoint to the first alternative; empty if there is no alternative."""
        if not self.elsewhere:
            return ""
        target = self.elsewhere[0]
        rules = f"run with `--ros-args {' '.join(self.endpoint.remappings(target))}`"
        attribute = self.endpoint.attribute
        return f'write {attribute}="{target}" in the tree, or {rules}' if attribute else rules

    @property
    def explanation(self) -> str:
        """A sentence ending with the alternatives and the remedy; empty if there are no alternatives."""
        return f"{self.hint}: {self.remedy}" if self.elsewhere else ""

    @property
    def namespaces(self) -> list[str]:
        """The namespaces that contain the same relative name."""
        tail = f"/{self.endpoint.name}"
        relative = self.is_same and not self.endpoint.name.startswith(("/", "~"))
        return [name.removesuffix(tail) or "/" for name in self.elsewhere if relative and name.endswith(tail)]


class RosGraph:
    """The ROS graph as a node sees it.

    Args:
        node: The node that queries the graph. Its own endpoints are not part of the results.
    """

    def __init__(self, node: "Node") -> None:
        self._node = node
        self._own = node.get_fully_qualified_name()
        self._cache: dict[Any, Any] = {}
        self._cached_at = -math.inf

    def query(self, endpoint: Endpoint) -> EndpointState:
        """Return the state of an endpoint: whether it can be used and, if not, the problem and the alternatives."""
        return self._get_cached((endpoint, str(endpoint.qos)), lambda: self._query_endpoint(endpoint))

    def advice(self, endpoints: Iterable[Endpoint]) -> str:
        """Return an instruction that remaps all missing endpoints, or an empty string if there are no alternatives.

        The instruction sets a namespace if this needs fewer rules than remapping each name.
        """
        states = [self.query(each) for each in dict.fromkeys(endpoints)]
        absent = [each for each in states if not each.is_there and each.elsewhere]
        if not absent:
            return ""
        spaces = sorted({space for each in absent for space in each.namespaces})
        one_by_one = self._rules_in(states, "")
        in_spaces = {space: self._rules_in(states, space) for space in spaces}
        space = min(spaces, key=lambda each: len(in_spaces[each]), default="")
        if not space or len(in_spaces[space]) > len(one_by_one) - (len(absent) == 1):
            text = f"run with `--ros-args {' '.join(one_by_one)}`"
            written = [each for each in absent if each.endpoint.attribute]
            attributes = " and ".join(f'{each.endpoint.attribute}="{each.elsewhere[0]}"' for each in written)
            return f"{text}, or write {attributes} in the tree" if attributes else text
        text = f"run with `--ros-args {' '.join(in_spaces[space])}`"
        others = [other for other in spaces if other != space and self._fits_as_well(absent, other, space)]
        return f"{text}, or use {' or '.join(others)} instead of {space}" if others else text

    def node_counts(self) -> "Counter[str]":
        """Count the discovered nodes, including the querying node, by full name."""
        return self._get_cached("names", lambda: node_names(self._node))

    def publishers(self, topic: str) -> tuple[str, ...]:
        """Return the sorted full names of the other nodes that publish on a topic.

        Args:
            topic: The relative or full name of the topic, which is remapped.
        """
        return tuple(sorted({_node_of(each) for each in self._infos(self._node.resolve_topic_name(topic))}))

    def publisher_ids(self, topic: str) -> frozenset[bytes]:
        """Return the unique IDs of other nodes' publishers on a topic."""
        infos = self._infos(self._node.resolve_topic_name(topic))
        return frozenset(bytes(each.endpoint_gid) for each in infos)

    def publisher_conflict(self, topic: str) -> str:
        """Describe the conflict if a topic that should have one publisher has several; otherwise return ''."""
        full = self._node.resolve_topic_name(topic)
        nodes, types = self.publishers(topic), {each.topic_type for each in self._infos(full)}
        if len(nodes) < 2 or not types & set(_ONE_SOURCE):  # noqa: PLR2004 - one source
            return ""
        return f"topic {with_full_name(topic, full)}: published by {join_names(nodes)}. Stop all of these nodes but one"

    def contested_topics(self) -> list[str]:
        """Describe all discovered topics that should have one publisher, but have several."""
        several = {topic: nodes for topic, nodes in self._topics_of_others().items() if len(nodes) > 1}
        single = {*_ONE_SOURCE, _CLOCK_TYPE}
        return [
            f"topic {topic}: published by {join_names(sorted(nodes))}. Stop all of these nodes but one"
            for topic, nodes in sorted(several.items())
            if single.intersection(*nodes.values())
        ]

    def transforms(self) -> str:
        """Explain that the robot's transforms are published on another topic than the node's `/tf`.

        The robot's nodes may be in a namespace and remap `/tf` to a topic in this namespace. The result is empty if the transforms are not
        published on another topic.
        """
        return self._get_cached("transforms", self._find_transforms)

    @property
    def is_clock_contested(self) -> bool:
        """Whether the node uses simulated time, and `/clock` has several publishers."""
        return bool(self._node.get_clock().ros_time_is_active) and len(self.publisher_ids("/clock")) > 1

    def explain_missing_transforms(self) -> str:
        """Explain why the node cannot receive transforms; return an empty string if it can receive them."""
        there = self.publishers("/tf") or self.publishers("/tf_static")
        here = self._node.resolve_topic_name("/tf")
        return self.transforms() or (
            "" if there else f"transforms: no node publishes on {here} or {here}_static"
        )

    def clock(self) -> str:
        """Describe a problem with simulated time, or return '' if there is no problem or simulated time is not used."""
        node_clock = self._node.get_clock()
        if not node_clock.ros_time_is_active:
            return ""
        topic = self._node.resolve_topic_name("/clock")
        nodes = self.publishers(topic)
        if self.is_clock_contested:
            return (
                f"topic {topic} has {len(self.publisher_ids(topic))} publishers (nodes {join_names(nodes)}), so the time jumps between "
                f"their clocks. Stop all publishers but one"
            )
        if node_clock.now().nanoseconds > 0:
            return ""
        missing = "use_sim_time is set, but no message has arrived on /clock"
        if nodes:
            return f"{missing} from {nodes[0]}: is the simulation paused?"
        others = sorted(name for name, types in self._topics().items() if _CLOCK_TYPE in types)
        if others:
            return f"{missing}. Clock messages are published on {others[0]}: run with `--ros-args -r /clock:={others[0]}`"
        return missing

    def unused_clock_problem(self) -> str:
        """Describe the problem if simulated time is published but the node does not use it; otherwise return ''."""
        nodes = self.publishers("/clock")
        if not nodes or self._node.get_clock().ros_time_is_active:
            return ""
        return (
            f"/clock is published by {join_names(nodes)}, but use_sim_time is not set, so the time stamps of the robot's messages appear old. "
            "Run with `--ros-args -p use_sim_time:=true`"
        )

    def foreign_localisation_problem(self) -> str:
        """Explain why the localisation may belong to another robot; return '' if nothing indicates this."""
        poses = self.query(Endpoint("topic", "amcl_pose", _ONE_SOURCE[2]))
        if not poses.is_there and poses.is_same:
            return f"{poses.title} has no publisher{poses.hint}"
        if len(poses.nodes) > 1:
            return f"{poses.title} has several publishers: {join_names(poses.nodes)}"
        return self.publisher_conflict("odometry/filtered") or self.transforms()

    def other_robots(self) -> tuple[str, ...]:
        """Return the nodes of other robots that publish on this robot's `/tf`.

        If several nodes share a full name, the result includes these nodes, because one of them must belong to another robot.
        """
        topic, space = self._node.resolve_topic_name("/tf"), self._node.get_namespace().rstrip("/")
        nodes = [_node_of(each) for each in self._infos(topic)]
        return tuple(
            sorted(
                node
                for node in set(nodes)
                if nodes.count(node) > 1 or self._has_localisation(node.rpartition("/")[0], space)
            )
        )

    def _has_localisation(self, space: str, own: str) -> bool:
        topics, services = self._topics(), self._services_of_others()
        is_there = f"{space}/amcl_pose" in topics or f"{space}/amcl{_STATE_SERVICE}" in services
        return space != own and is_there

    def _query_endpoint(self, endpoint: Endpoint) -> EndpointState:
        if endpoint.kind in ("topic", "listeners"):
            return self._query_topic(endpoint)
        suffix = {"action": _GOAL_SERVICE, "node": _STATE_SERVICE}.get(endpoint.kind, "")
        service = self._node.resolve_service_name(f"{endpoint.name}{suffix}")
        full, count = service.removesuffix(suffix), int(self._node.count_services(service))
        if not count:
            return self._absent_state(endpoint, full, "no server")
        nodes = tuple(sorted(name for name, served in self._servers() if service in served))
        problem, is_contested = "", count > 1 and endpoint.kind != "node"
        if is_contested:
            number, which = ("two", "one") if count == 2 else (count, "all but one")  # noqa: PLR2004
            of_nodes = f", {join_names(nodes)}" if len(set(nodes)) == count else ""
            problem = f"{number} servers provide {full}{of_nodes}. Stop {which}"
        elif endpoint.type_name:
            types = {kind for _, served in self._servers() for kind in served.get(service, ())}
            # The node of a server may be discovered later than the server. Until then, the types also include those of clients.
            types = types or set(dict(self._node.get_service_names_and_types()).get(service, ()))
            problem = _wrong_type("served", types, endpoint.type_name)
        problem = problem or self._unheard_service(service)
        return EndpointState(endpoint, full, nodes, problem, is_there=True, is_contested=is_contested)

    def _unheard_service(self, service: str) -> str:
        """Explain why QoS profiles block the requests or responses of a service, or return '' if nothing is blocked."""
        from rclpy.qos import qos_profile_services_default as own

        for topic, hears in ((f"rq{service}Request", True), (f"rr{service}Reply", False)):
            infos = self._find_infos(topic, hears=hears, is_service=True)
            pairs = ((own, each.qos_profile) if hears else (each.qos_profile, own) for each in infos)
            reasons = [_incompatibility(*pair) for pair in pairs]
            if reasons and all(reasons):
                what = "no request reaches" if hears else "no response arrives from"
                return f"{what} {_node_of(infos[0])} ({reasons[0]}): create its service with qos_profile_services_default"
        return ""

    def _query_topic(self, endpoint: Endpoint) -> EndpointState:
        full = self._node.resolve_topic_name(endpoint.name)
        hears = endpoint.kind == "listeners"
        infos = self._infos(full, hears=hears)
        if not infos:
            return self._absent_state(endpoint, full, "no subscriber" if hears else "no publisher")
        how = "subscribed" if hears else "published"
        problem = _wrong_type(how, {each.topic_type for each in infos}, endpoint.type_name)
        unheard = _qos_conflict(infos, endpoint.qos, hears=hears)
        nodes = tuple(sorted({_node_of(each) for each in infos}))
        return EndpointState(endpoint, full, nodes, problem or unheard, is_there=True)

    def _absent_state(self, endpoint: Endpoint, full: str, problem: str) -> EndpointState:
        find: dict[str, Callable[[], dict[str, set[str]]]] = {
            "action": self._actions,
            "service": self._services,
            "topic": self._topics,
            "listeners": partial(self._topics, hears=True),
            "node": self._lifecycle_nodes,
        }
        there = find[endpoint.kind]()
        same = _same_elsewhere(endpoint, full, there)
        near = same or _nearest_names(endpoint, full, self._node.get_namespace(), there)
        return EndpointState(endpoint, full, (), problem, elsewhere=tuple(near[:_MOST]), is_same=bool(same))

    def _rules_in(self, states: Sequence[EndpointState], space: str) -> list[str]:
        """Return the rules that remap all missing endpoints in a namespace; '' stands for the current namespace."""
        rules = [f"-r __ns:={space}"] if space else []
        if space not in ("", "/") and f"{space}/tf" in self._topics() and self._resolves_tf_globally:
            rules.append(_REMAP_TRANSFORMS)
        for each in states:
            target = each.full_name if each.is_there else next(iter(each.elsewhere), "")
            is_relative = not each.endpoint.name.startswith(("/", "~"))
            stays = each.is_there and (not space or not is_relative)
            moves = space in each.namespaces or (
                bool(space) and is_relative and self._is_in(each.endpoint, space)
            )
            if target and not stays and not moves:
                rules += each.endpoint.remappings(target)
        return rules

    def _is_in(self, endpoint: Endpoint, space: str) -> bool:
        """Return whether a relative name exists in a namespace."""
        moved = Endpoint(endpoint.kind, f"{space.rstrip('/')}/{endpoint.name}")
        return self.query(moved).is_there

    def _fits_as_well(self, absent: Sequence[EndpointState], space: str, chosen: str) -> bool:
        fits = [each for each in absent if chosen in each.namespaces]
        return bool(fits) and all(space in each.namespaces for each in fits)

    @property
    def _resolves_tf_globally(self) -> bool:
        return bool(self._node.resolve_topic_name("/tf") == "/tf")

    def _find_transforms(self) -> str:
        here, space = self._node.resolve_topic_name("/tf"), self._node.get_namespace().rstrip("/")
        heard, localisers = set(self.publishers("/tf")), set(self.publishers("amcl_pose"))
        for topic, nodes in sorted(self._topics_of_others().items()):
            if not topic.endswith("/tf") or topic == here:
                continue
            # If other robots also publish on the topic, it is this robot's topic only if nodes of this robot publish on it.
            inside = {
                node for node in heard.union(nodes) if space and node.startswith(f"{space}/")
            } | localisers
            is_ours = bool(inside & set(nodes)) and not inside & heard
            if not is_ours and (heard or (localisers and topic != f"{space}/tf")):
                continue
            is_own = topic == f"{space}/tf"
            rules = _REMAP_TRANSFORMS if is_own else f"-r /tf:={topic} -r /tf_static:={topic}_static"
            return (
                f"transforms: published on {topic} by {join_names(sorted(nodes))}, but this node subscribes to {here}. Run with "
                f"`--ros-args {rules}`"
            )
        return ""

    def _infos(self, topic: str, *, hears: bool = False) -> list[Any]:
        """Return the publishers of other nodes on a topic, given the topic's full name.

        If *hears* is True, return the subscriptions of other nodes.
        """
        return self._get_cached((topic, "infos", hears), lambda: self._find_infos(topic, hears=hears))

    def _find_infos(self, topic: str, *, hears: bool, is_service: bool = False) -> list[Any]:
        from rclpy.duration import Duration, Infinite

        node = self._node
        # Contrary to rclpy's documentation, and unlike `count_publishers`, these functions remap the name.
        find = node.get_subscriptions_info_by_topic if hears else node.get_publishers_info_by_topic
        infos = find(topic, no_mangle=is_service)
        for qos in (each.qos_profile for each in infos):
            # The graph reports "infinite" if there is no limit, and `qos_check_compatible` would treat this as a limit.
            if qos.deadline == Infinite:
                qos.deadline = Duration()
            if qos.liveliness_lease_duration == Infinite:
                qos.liveliness_lease_duration = Duration()
        return [each for each in infos if _node_of(each) != self._own]

    def _topics_of_others(self, *, hears: bool = False) -> dict[str, dict[str, set[str]]]:
        """Return, for each topic on which other nodes publish, the types that each of these nodes uses.

        If *hears* is True, return the topics to which other nodes subscribe.
        """
        return self._get_cached(("nodes", hears), lambda: self._find_publishing(hears=hears))

    def _find_publishing(self, *, hears: bool) -> dict[str, dict[str, set[str]]]:
        from rclpy.node import NodeNameNonExistentError

        find = (
            self._node.get_subscriber_names_and_types_by_node
            if hears
            else self._node.get_publisher_names_and_types_by_node
        )
        found: dict[str, dict[str, set[str]]] = {}
        for name, space in self._node.get_node_names_and_namespaces():
            node = f"{space.rstrip('/')}/{name}"
            if node == self._own or name == UNKNOWN_NODE:
                continue
            with suppress(NodeNameNonExistentError):  # the node has just disappeared
                for topic, types in find(name, space):
                    found.setdefault(topic, {}).setdefault(node, set()).update(types)
        return found

    def _topics(self, *, hears: bool = False) -> dict[str, set[str]]:
        """Return the topics on which other nodes publish, with the types of each topic.

        If *hears* is True, return the topics to which other nodes subscribe.
        """
        publishing = self._topics_of_others(hears=hears)
        return {
            topic: set().union(*nodes.values()) for topic, nodes in publishing.items() if "/_" not in topic
        }

    def _services_of_others(self) -> dict[str, set[str]]:
        """Return the services of other nodes, with their types."""
        return self._get_cached("services", self._find_served)

    def _find_served(self) -> dict[str, set[str]]:
        found: dict[str, set[str]] = {}
        for _, served in self._servers():
            for name, types in served.items():
                found.setdefault(name, set()).update(types)
        return found

    def _servers(self) -> list[tuple[str, dict[str, list[str]]]]:
        """Return the full names of the other nodes, each with its services and their types."""
        return self._get_cached(
            "servers", lambda: [each for each in self._find_servers() if each[0] != self._own]
        )

    def _find_servers(self) -> Iterator[tuple[str, dict[str, list[str]]]]:
        for name, space, served in services_by_node(self._node):
            yield f"{space.rstrip('/')}/{name}", served

    def _services(self) -> dict[str, set[str]]:
        return {name: types for name, types in self._services_of_others().items() if "/_" not in name}

    def _actions(self) -> dict[str, set[str]]:
        return {
            name.removesuffix(_GOAL_SERVICE): {each.removesuffix("_SendGoal") for each in types}
            for name, types in self._services_of_others().items()
            if name.endswith(_GOAL_SERVICE)
        }

    def _lifecycle_nodes(self) -> dict[str, set[str]]:
        return {
            name.removesuffix(_STATE_SERVICE): types
            for name, types in self._services_of_others().items()
            if name.endswith(_STATE_SERVICE)
        }

    def _get_cached(self, key: Any, find: Callable[[], T]) -> T:
        now = AWAKE.now()
        if now - self._cached_at > _FRESH_SEC:
            self._cache, self._cached_at = {}, now
        if key not in self._cache:
            self._cache[key] = find()
        found: T = self._cache[key]
        return found


def ros_graph(node: "Node") -> RosGraph:
    """Return the ROS graph as a node sees it; every call for a node returns the same object."""
    return of_node(node, RosGraph, lambda: RosGraph(node))


def declared_endpoints(root: Behaviour) -> dict[Use, Endpoint]:
    """Return the actions, services and topics that the leaves of a tree declare, with types and QoS profiles."""
    found: dict[Use, Endpoint] = {}
    for leaf in root.iterate():
        for word, (of_name, of_type) in _DECLARED_IN.items():
            name, written = getattr(leaf, of_name, None), getattr(leaf, of_type, None)
            if not isinstance(name, str) or not written:
                continue
            use, type_name = Use(word, name), written if isinstance(written, str) else interface_name(written)
            qos = (qos_profile(type(leaf).__name__, leaf.qos),) if hasattr(leaf, "qos") else ()
            attribute = word if word in signature(type(leaf)).parameters else ""
            before = found[use].qos if use in found else ()
            found[use] = Endpoint(word, name, type_name, (*before, *qos), attribute)
    return found


def explain_absence(node: "Node", leaf: Behaviour, kind: str, name: str) -> str:
    """Return the end of a message that explains why a leaf cannot reach a server or topic, and names the remedy.

    The result is empty for a topic whose messages reach the leaf.
    """
    endpoint = declared_endpoints(leaf).get(Use(kind, name), Endpoint(kind, name))
    return explain_endpoint(node, endpoint)


def explain_endpoint(node: "Node", endpoint: Endpoint) -> str:
    """Return the end of a message that explains why an endpoint is unreachable; see `explain_absence`."""
    state = ros_graph(node).query(endpoint)
    if state.is_there:
        connected = "" if endpoint.kind == "topic" else "it exists, but is not connected yet"
        problem = state.problem or connected
        return problem and f": {problem}"
    causes = {"topic": ", because no node publishes it", "listeners": ""}
    return state.explanation or causes.get(endpoint.kind, ", because no node serves it")


def with_full_name(name: str, resolved: str) -> str:
    """Return a name, followed by the resolved name in parentheses if the two differ by more than a leading slash."""
    return name if resolved == f"/{name.lstrip('/')}" else f"{name} ({resolved})"


def join_names(names: Collection[str], conjunction: str = "and") -> str:
    """Join names to a phrase such as `/a, /b and /c`."""
    *most, last = names
    return f"{', '.join(most)} {conjunction} {last}" if most else last


def services_by_node(node: "Node") -> Iterator[tuple[str, str, dict[str, list[str]]]]:
    """Yield the name and namespace of each discovered node, with its services and their types."""
    from rclpy.node import NodeNameNonExistentError

    for name, namespace in node.get_node_names_and_namespaces():
        with suppress(NodeNameNonExistentError):  # the node has just disappeared
            yield name, namespace, dict(node.get_service_names_and_types_by_node(name, namespace))


def _node_of(info: Any) -> str:
    """Return the full name of the node to which a publisher or subscription belongs."""
    if info.node_name == UNKNOWN_NODE:
        return "a node whose name is not known yet"
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


def _wrong_type(how: str, types: Collection[str], wanted: str) -> str:
    """Describe the mismatch if an endpoint has only types other than the wanted type; otherwise return ''."""
    # The goal service of an action has a type derived from the action's type.
    there = sorted({each.removesuffix("_SendGoal") for each in types})
    return (
        ""
        if not wanted or not there or wanted in there
        else f"{how} as {', '.join(there)}, but must be {wanted}"
    )


def _qos_conflict(infos: Sequence[Any], own: Iterable["QoSProfile"], *, hears: bool) -> str:
    """Explain which QoS profiles block all messages, and name the remedy; return '' if messages can arrive.

    Args:
        infos: The publishers of other nodes; if *hears* is True, the subscriptions of other nodes.
        own: The QoS profiles of this node's subscriptions; if *hears* is True, of this node's publishers.
        hears: Whether other nodes subscribe and this node publishes.
    """

    def conflict(other: Any, mine: "QoSProfile") -> str:
        theirs = other.qos_profile
        return _incompatibility(mine, theirs) if hears else _incompatibility(theirs, mine)

    for mine in own:
        reasons = [(each, conflict(each, mine)) for each in infos]
        if not reasons or not all(reason for _, reason in reasons):
            continue
        # The remedy is the most demanding profile that all publishers offer, or the least demanding profile that suffices for all subscribers.
        names = list(NAMED_QOS) if hears else list(reversed(NAMED_QOS))
        fits = [name for name in names if not any(conflict(each, qos_profile("", name)) for each in infos)]
        info, reason = reasons[0]
        what = f"no message reaches {_node_of(info)}" if hears else f"no message of {_node_of(info)} arrives"
        return f'{what} ({reason}). Write qos="{fits[0]}"' if fits else f"{what} ({reason})"
    return ""


def _incompatibility(offered: "QoSProfile", wanted: "QoSProfile") -> str:
    """Explain why the QoS profiles of a publisher and a subscription are incompatible; return '' if they match."""
    from rclpy.qos import QoSCompatibility, qos_check_compatible

    verdict, reasons = qos_check_compatible(offered, wanted)
    if verdict != QoSCompatibility.ERROR:
        return ""
    return ", ".join(
        each.removeprefix("ERROR: ").lower() for each in reasons.split(";") if each.startswith("ERROR")
    )


def _same_elsewhere(endpoint: Endpoint, full: str, there: Mapping[str, Collection[str]]) -> list[str]:
    """Return endpoints in other namespaces with the same relative name and the wanted type, least nested first."""
    tails = {f"/{endpoint.name.lstrip('/~')}", full}
    same = [name for name in there if any(name.endswith(tail) for tail in tails) or full.endswith(name)]
    fitting = [name for name in same if not endpoint.type_name or endpoint.type_name in there[name]]
    return sorted(fitting, key=lambda name: (name.count("/"), name))


def _nearest_names(
    endpoint: Endpoint, full: str, space: str, there: Mapping[str, Collection[str]]
) -> list[str]:
    """Return the full names of endpoints of the wanted type that the user may have meant.

    Their names are similar to the wanted name.
    """
    wanted = endpoint.name.lstrip("/~")
    fitting = [name for name in sorted(there) if not endpoint.type_name or endpoint.type_name in there[name]]
    depth, inner = wanted.count("/") + 1, f"{space.rstrip('/')}/"
    tails = {"/".join(name.split("/")[-depth:]): name for name in fitting}
    tails |= {name.removeprefix(inner): name for name in fitting if name.startswith(inner)}
    near = nearest(wanted, tails)
    if near is not None:
        return [tails[near]]
    if not endpoint.type_name or endpoint.kind == "node":
        return []
    longer = [name for name in fitting if _is_longer(name, full) or _is_longer(full, name)]
    is_telling = not endpoint.type_name.startswith(_GENERIC_TYPES) and len(fitting) <= _MOST
    return longer or (fitting if is_telling else [])


def _is_longer(name: str, beginning: str) -> bool:
    """Return whether a name begins with another name that is long enough for a meaningful match."""
    return name.startswith(beginning) and len(beginning) > _LEAST_SHARED
