"""Test bench for mission leaves: a mission node, and servers that follow the instructions of a test."""

import itertools
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from queue import Empty, Queue
from typing import Any, TypeVar

from nav2_msgs.action import NavigateThroughPoses, NavigateToPose
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sar_interfaces.srv import DetectSurvivor as DetectService
from sar_interfaces.srv import ReportSurvivor as ReportService
from tf2_msgs.msg import TFMessage

from sar_compiler.runtime.outcomes import DeclaredOutcomes
from search_and_rescue import SPECS
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager
from tests.waiting import SILENCE_SEC

L = TypeVar("L", bound=Behaviour)

ZONES: list[dict[str, Any]] = [
    {"id": "zone_a", "x": -3.0, "y": 3.0, "yaw": 1.57},
    {"id": "zone_b", "x": 3.5, "y": 3.0, "yaw": 0.0},
]
BASE: dict[str, Any] = {"x": 0.5, "y": -0.25, "yaw": 3.14}

_numbers = itertools.count(1)


# Some of several reports may be delivered before the base stops responding: no declared outcome states how many.
_MAY_LEAVE_OPEN = {("DeliverReports", "FAILURE")}
_DECLARED = {spec.tag: DeclaredOutcomes(spec.outcomes) for spec in SPECS}


def _checked(leaf: Behaviour) -> Callable[[], None]:
    """Return a `tick_once` for the leaf that raises if the outcome is not one of its declared outcomes."""
    tick_once, tag = leaf.tick_once, type(leaf).__name__

    def checked() -> None:
        tick_once()
        status, declared = leaf.status.value, _DECLARED[tag]
        said = getattr(leaf, "outcome_label", "")
        assert declared.why_invalid(status, said) == ""
        assert declared.label(status, said) or (tag, status) in _MAY_LEAVE_OPEN, (leaf.name, status)

    return checked


class Recorder:
    """A logger that stores its lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.warnings: list[str] = []

    def info(self, text: str) -> None:
        self.lines.append(text)

    def warning(self, text: str) -> None:
        self.warnings.append(text)

    def debug(self, text: str) -> None:
        """Ignore debug lines: no test checks them."""

    warn = error = warning

    def get_child(self, name: str) -> "Recorder":
        return self


class RecordingNode(Node):
    """A node that stores the log lines of its leaves for the test."""

    def __init__(self, name: str, namespace: str, context: Any) -> None:
        self.recorder = Recorder()
        # As the launch of a mission in a namespace does: each namespace has its own frames.
        remap = ["--ros-args", "-r", "/tf_static:=tf_static"]
        super().__init__(name, namespace=namespace, context=context, enable_rosout=False, cli_args=remap)

    def get_logger(self) -> Recorder:
        return self.recorder


class Host:
    """A node for servers that spins in its own threads until it is closed."""

    def __init__(self, name: str, namespace: str, context: Any) -> None:
        self.node = RecordingNode(name, namespace, context)
        self.group = ReentrantCallbackGroup()
        self._executor = MultiThreadedExecutor(num_threads=6, context=context)
        self._executor.add_node(self.node)
        self._closing = threading.Event()
        self._at_close: list[Callable[[], None]] = []
        self._at_end: list[Callable[[], None]] = []
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        while not self._closing.is_set():
            self._executor.spin_once(timeout_sec=0.1)

    def at_close(self, action: Callable[[], None]) -> None:
        """Register an action at close that lets running callbacks finish."""
        self._at_close.append(action)

    def at_end(self, action: Callable[[], None]) -> None:
        """Register an action at close, after the executor has stopped reading from the servers."""
        self._at_end.append(action)

    def close(self) -> None:
        """Remove the node and its servers from the graph, as when their process exits."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._executor.wake()
        self._thread.join()
        # Not before: destroying a server while the executor reads from it would raise there. Not after
        # releasing its callbacks either: their responses would still be sent.
        for action in self._at_end:
            action()
        for action in self._at_close:
            action()
        self._executor.shutdown()
        self.node.destroy_node()


@dataclass
class SeenGoal:
    """A goal as the server received it; instructions in `orders` are executed one by one."""

    goal: Any
    orders: "Queue[str]" = field(default_factory=Queue)
    final: str = ""
    handle: Any = None

    @property
    def pose(self) -> tuple[str, float, float, float, float]:
        pose = self.goal.pose
        return (
            pose.header.frame_id,
            pose.pose.position.x,
            pose.pose.position.y,
            pose.pose.orientation.z,
            pose.pose.orientation.w,
        )


class NavServer:
    """An action server of Nav2's navigator that follows instructions: `succeed`, `abort`, `feedback`, `2 left`.

    Attributes:
        accept: Whether goals are accepted.
        accept_after: Seconds between a goal's arrival and its acceptance.
        heed_cancel: Whether cancel requests are granted.
        script: The instructions that every goal starts with.
        error_code: The error code of an abort; 105 means no progress.
        loses_results: Whether requests for the result of an accepted goal get no response.
        goals: The accepted goals.
        requests: How many goals arrived.
        cancels: How many cancel requests arrived.
        host: The host of the server.
    """

    def __init__(self, host: Host, name: str = "navigate_to_pose", action_type: Any = NavigateToPose) -> None:
        self.host, self._type = host, action_type
        self.accept = True
        self.accept_after = 0.0
        self.heed_cancel = True
        self.script: list[str] = []
        self.error_code = 105
        self.loses_results = False
        self.goals: list[SeenGoal] = []
        self.requests = 0
        self.cancels = 0
        self._held: threading.Event | None = None
        self._closing = threading.Event()
        self._started = threading.Event()
        self._ended = threading.Event()
        loses = self._loses

        class Server(ActionServer):
            async def _execute_get_result_request(self, header_and_request: Any) -> None:
                if not loses(bytes(header_and_request[1].goal_id.uuid)):
                    await super()._execute_get_result_request(header_and_request)

        self._server = Server(
            host.node,
            action_type,
            name,
            execute_callback=self._execute,
            goal_callback=self._on_goal,
            cancel_callback=self._on_cancel,
            callback_group=host.group,
        )
        host.at_close(self._closing.set)
        host.at_end(self._server.destroy)

    def order(self, *orders: str) -> None:
        """Queue instructions for the latest goal."""
        for order in orders:
            self.goals[-1].orders.put(order)

    def wait_for_start(self) -> None:
        """Wait, without spinning the mission's node, until a goal is accepted and executed."""
        assert self._started.wait(SILENCE_SEC), "no goal was accepted"

    def wait_for_end(self) -> None:
        """Wait, without spinning the mission's node, until the latest goal has ended."""
        assert self._ended.wait(SILENCE_SEC), "the goal did not end"

    @property
    def active(self) -> list[SeenGoal]:
        """The accepted goals that have not ended."""
        return [goal for goal in self.goals if not goal.final]

    def _loses(self, goal_id: bytes) -> bool:
        return self.loses_results and any(bytes(seen.handle.goal_id.uuid) == goal_id for seen in self.goals)

    def hold(self) -> threading.Event:
        """Delay acceptance of the next goal until the returned event is set."""
        self._held = threading.Event()
        self.host.at_close(self._held.set)
        return self._held

    def _on_goal(self, goal: Any) -> GoalResponse:
        self.requests += 1
        held, self._held = self._held, None
        if held is not None:
            held.wait()
        self._closing.wait(self.accept_after)
        return GoalResponse.ACCEPT if self.accept else GoalResponse.REJECT

    def _on_cancel(self, handle: Any) -> CancelResponse:
        self.cancels += 1
        return CancelResponse.ACCEPT if self.heed_cancel else CancelResponse.REJECT

    def _execute(self, handle: Any) -> Any:
        seen = SeenGoal(handle.request, handle=handle)
        for order in self.script:
            seen.orders.put(order)
        self.goals.append(seen)
        self._started.set()
        result = self._type.Result()
        while not seen.final and not self._closing.is_set():
            self._obey(seen, result)
        self._ended.set()
        return result

    def _obey(self, seen: SeenGoal, result: Any) -> None:
        if seen.handle.is_cancel_requested:
            seen.final = "canceled"  # before the client is notified
            seen.handle.canceled()
            return
        try:
            order = seen.orders.get(timeout=0.005)
        except Empty:
            return
        if order == "feedback":
            seen.handle.publish_feedback(self._type.Feedback(distance_remaining=2.5))
        elif order.endswith(" left"):
            left = int(order.removesuffix(" left"))
            seen.handle.publish_feedback(self._type.Feedback(number_of_poses_remaining=left))
        elif order == "succeed":
            seen.final = "succeeded"
            seen.handle.succeed()
        elif order == "abort":
            result.error_code = self.error_code
            seen.final = "aborted"
            seen.handle.abort()


class ScriptedService:
    """A service that stores its requests and responds as scripted.

    Attributes:
        requests: The requests that arrived.
        answered: How many requests were answered.
        answer: Fills the response to a request.
        gate: Set unless responses are to be delayed.
        loses_answers: Whether responses are dropped.
        host: The host of the service.
    """

    def __init__(self, host: Host, service_type: Any, name: str, answer: Callable[[Any, Any], None]) -> None:
        self.host = host
        self.requests: list[Any] = []
        self.answered = 0
        self.answer = answer
        self.loses_answers = False
        self.gate = threading.Event()
        self.gate.set()
        self._service = host.node.create_service(service_type, name, self._serve, callback_group=host.group)
        self._send, self._service.send_response = self._service.send_response, self._send_unless_lost
        host.at_close(self.gate.set)

    def _send_unless_lost(self, response: Any, header: Any) -> None:
        if not self.loses_answers:
            self._send(response, header)

    def _serve(self, request: Any, response: Any) -> Any:
        self.requests.append(request)
        self.gate.wait()
        self.answer(request, response)
        self.answered += 1
        return response


class FrameListener:
    """A subscriber to `/tf_static` with depth 1 that stores the latest message."""

    def __init__(self, node: Node) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.messages = 0
        self.frames: dict[str, Any] = {}
        self._subscription = node.create_subscription(TFMessage, "/tf_static", self._take, latched)

    def _take(self, message: Any) -> None:
        self.messages += 1
        self.frames = {frame.child_frame_id: frame for frame in message.transforms}

    def position(self, frame: str) -> tuple[float, float, float]:
        translation = self.frames[frame].transform.translation
        return (translation.x, translation.y, translation.z)


class Stage:
    """One mission with its servers and listeners, in its own namespace.

    Args:
        context: The ROS context of the mission's node.
        server_context: The ROS context of the servers' nodes, if it is a different one.
    """

    def __init__(self, context: Any, server_context: Any = None) -> None:
        self.context = context
        self._server_context = server_context or context
        self.namespace = f"/stage_{next(_numbers)}"
        self.node = self._mission_node()
        search = Search(ZoneManager(ZONES, BASE))
        self.zones, self.record, self.kept = search.zones, search.record, search.kept
        self.wakes = 0
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self._hosts: list[Host] = []
        self._listeners: list[FrameListener] = []
        self._leaves: list[Behaviour] = []

    def _mission_node(self) -> RecordingNode:
        return RecordingNode("mission", self.namespace, self.context)

    def renew_node(self) -> None:
        """Replace the mission's node, as when its process crashes and a new one starts."""
        self._executor.remove_node(self.node)
        self.node.destroy_node()
        self.node = self._mission_node()
        self._executor.add_node(self.node)

    @property
    def lines(self) -> list[str]:
        return self.node.recorder.lines

    @property
    def warnings(self) -> list[str]:
        return self.node.recorder.warnings

    def static_frames(self, node: Node | None = None) -> "FrameListener":
        """Subscribe to the static frames that a node of this namespace receives."""
        listener = FrameListener(node or self.node)
        self._listeners.append(listener)
        return listener

    def wake(self) -> None:
        self.wakes += 1

    def host(self) -> Host:
        self._hosts.append(Host(f"host_{len(self._hosts)}", self.namespace, self._server_context))
        return self._hosts[-1]

    def nav_server(self, name: str = "navigate_to_pose") -> NavServer:
        return NavServer(self.host(), name)

    def through_server(self) -> NavServer:
        return NavServer(self.host(), "navigate_through_poses", NavigateThroughPoses)

    def nav_server_on(self, host: Host) -> NavServer:
        return NavServer(host)

    def detect_service(self, survivors: dict[str, tuple[float, float]]) -> ScriptedService:
        def answer(request: Any, response: Any) -> None:
            if request.zone_id in survivors:
                response.found = True
                response.survivor_x, response.survivor_y = survivors[request.zone_id]

        return ScriptedService(self.host(), DetectService, "detect_survivor", answer)

    def report_service(self, *, acknowledged: bool) -> ScriptedService:
        def answer(_: Any, response: Any) -> None:
            response.acknowledged = acknowledged

        return ScriptedService(self.host(), ReportService, "report_survivor", answer)

    def take(self, leaf: L) -> L:
        """Set up a leaf as a runner does, and check that each of its outcomes is declared."""
        self._leaves.append(leaf)
        if type(leaf).__name__ in _DECLARED:
            leaf.tick_once = _checked(leaf)  # type: ignore[method-assign]
        leaf.setup(node=self.node, wake=self.wake)
        return leaf

    def until(self, condition: Callable[[], object], what: str, timeout_sec: float = SILENCE_SEC) -> None:
        """Spin the mission's node until a condition is true."""
        end = time.monotonic() + timeout_sec
        while not condition():
            if time.monotonic() > end:
                message = f"{what}: did not come within {timeout_sec:g} s; log: {self.lines} {self.warnings}"
                raise AssertionError(message)
            self.spin()

    def spin(self) -> None:
        """Spin the mission's node once, for at most 10 ms."""
        self._executor.spin_once(timeout_sec=0.01)

    def tick_until(self, leaf: Behaviour, condition: Callable[[], object], what: str) -> None:
        """Tick a leaf and spin until a condition is true."""

        def ticked() -> object:
            leaf.tick_once()
            return condition()

        self.until(ticked, f"{what} (last status {leaf.status})")

    def run(self, leaf: Behaviour) -> Status:
        """Tick a leaf until it has completed, and return its status."""
        leaf.tick_once()
        if leaf.status is Status.RUNNING:
            self.tick_until(leaf, lambda: leaf.status is not Status.RUNNING, "the end of the leaf")
        return leaf.status

    def close(self) -> None:
        try:
            for leaf in self._leaves:
                leaf.stop(Status.INVALID)
                leaf.shutdown()
        finally:
            for host in self._hosts:
                host.close()
            self._executor.shutdown()
            self.node.destroy_node()
            if self._server_context is not self.context:
                self.context.try_shutdown()
