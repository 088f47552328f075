"""Servers that misbehave as scripted by a test, in a separate process that can be killed and frozen.

Roles: `navigation` (the action `navigate_to_pose`, and Nav2's two lifecycle nodes), `survivors` (the two services),
`localiser` (node `amcl`), `clock` (`/clock`). The process reports events as lines of JSON in a separate pipe, because
Fast DDS writes its warnings to standard output. It reads orders from standard input.
"""

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from tests.waiting import SILENCE_SEC, News

_TICK_SEC = 0.01
_CLOCK_PERIOD_SEC = 0.02
# Time for which Nav2 keeps the result of a goal, seconds.
_RESULT_SEC = 10


class Servers:
    """The test's interface to a process of servers.

    Args:
        role: The servers that it runs.
        env: Changes to the environment.
        script: The behaviour; see the classes of the roles.
    """

    def __init__(self, role: str, env: "dict[str, str] | None" = None, **script: Any) -> None:
        self.events: list[dict[str, Any]] = []
        self._news = News()
        read_end, write_end = os.pipe()
        self._events = os.fdopen(read_end, encoding="utf-8")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.servers", str(write_end), role, json.dumps(script)],
            stdin=subprocess.PIPE,
            pass_fds=[write_end],
            text=True,
            env={**os.environ, **(env or {})},
        )
        os.close(write_end)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.wait_for("ready")

    def _read(self) -> None:
        for line in self._events:
            with self._news:
                self.events.append(json.loads(line))
                self._news.tell()

    def of(self, event: str, **fields: Any) -> "list[dict[str, Any]]":
        """Return the events of a kind with these fields."""
        wanted = {"event": event, **fields}
        with self._news:
            return [each for each in self.events if wanted.items() <= each.items()]

    def wait_for(self, event: str, times: int = 1, **fields: Any) -> "dict[str, Any]":
        """Wait until an event has happened `times` times; return the last of these."""
        with self._news:
            self._news.wait_until(
                lambda: len(self.of(event, **fields)) >= times, lambda: f"no {event} {fields}: {self.events}"
            )
        return self.of(event, **fields)[times - 1]

    @property
    def active(self) -> int:
        """Return the number of accepted goals that have not ended."""
        return len(self.of("accepted")) - len(self.of("ended"))

    def order(self, **order: Any) -> None:
        """Send an order to the process."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{json.dumps(order)}\n")
        self._process.stdin.flush()

    def freeze(self) -> None:
        """Suspend the process."""
        self._process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        """Continue the process."""
        self._process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        """Kill the process."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        self._reader.join(SILENCE_SEC)
        for pipe in (self._process.stdin, self._events):
            if pipe is not None:
                pipe.close()


_to_test: "list[int]" = []


def tell(event: str, **fields: Any) -> None:
    """Report an event to the test immediately; usable in any thread."""
    for descriptor in _to_test:
        os.write(descriptor, f"{json.dumps({'event': event, **fields})}\n".encode())


class Navigation:
    """The action `navigate_to_pose` and the states of `amcl` and `bt_navigator`.

    Script:
        goals: The behaviour for each goal in the order of arrival; the last entry applies to all later goals.
            `accept` (true), `accept_after` (0.0 s), `drive` (0.2 s; null: for ever), `feedback` (true), `end` ("succeed" or
            "abort"), `code` (of an abort), `says` (on /rosout, as Nav2's controller, before its end), `cancel` ("grant", "ignore": granted and not heeded, "refuse", "mute": not
            answered), `result` ("send" or "lose"), `drives_on` (0.0 s after its end, unless `follow_path` is cancelled).
        states: The states of the lifecycle nodes by name; null: a node that is not there.
        odometry: Whether the robot has odometry, which says 0.3 m/s while it drives (false).
        runs_away: Whether a robot that drives on does so whatever is cancelled (false).
        pose: x and y that the localisation has from the start (none).
        arrives: Whether a localisation that has a pose is at the goal when that has succeeded (true).
        deaf: Whether no goal is answered before there is a client that was not there when the first one came (false).
        preempts: Whether a goal that is accepted aborts the one under way (false).

    A pose on `initialpose` makes `bt_navigator` active.

    Orders: `{"state": {"bt_navigator": "inactive"}}`; `{"goals": […]}` for goals from now on.
    """

    def __init__(self, node: Any, script: "dict[str, Any]") -> None:
        from lifecycle_msgs.srv import GetState
        from nav2_msgs.action import NavigateToPose
        from rcl_interfaces.msg import Log
        from rclpy.action import ActionServer, CancelResponse, GoalResponse
        from rclpy.callback_groups import ReentrantCallbackGroup
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._node, self._type = node, NavigateToPose
        self._goals: list[dict[str, Any]] = script.get("goals", [{}])
        self._count = 0
        self._scripts: dict[bytes, dict[str, Any]] = {}
        self._preempts = script.get("preempts", False)
        self._newest = 0
        self._states = {"amcl": "active", "bt_navigator": "active", **script.get("states", {})}
        self._responses, self._cancels = GoalResponse, CancelResponse
        group = ReentrantCallbackGroup()
        loses, scripts = self._loses, self._scripts
        deaf, first = script.get("deaf", False), set[bytes]()

        class Server(ActionServer):
            async def _execute_get_result_request(self, header_and_request: Any) -> None:
                goal = bytes(header_and_request[1].goal_id.uuid)
                if goal not in scripts:
                    tell("asked")
                if not loses(goal):
                    await super()._execute_get_result_request(header_and_request)

            async def _execute_goal_request(self, header_and_request: Any) -> None:
                # The goal callback does not receive the id of the goal; this request has it.
                accept.id = bytes(header_and_request[1].goal_id.uuid)
                if deaf and not first:
                    first.update(_readers_of_answers(node))
                if deaf and not _readers_of_answers(node) - first:
                    tell("unanswered")
                    return
                await super()._execute_goal_request(header_and_request)

        accept = threading.local()
        self._accept = accept
        self._server = Server(
            node,
            NavigateToPose,
            "navigate_to_pose",
            execute_callback=self._drive,
            goal_callback=self._judge,
            cancel_callback=self._cancel,
            callback_group=group,
            result_timeout=_RESULT_SEC,
        )
        for name, state in self._states.items():
            if state is not None:
                node.create_service(
                    GetState, f"{name}/get_state", lambda _, response, name=name: self._state(name, response)
                )
        self._arrives = script.get("arrives", True)
        self._tell_place = self._serve_poses(node, script.get("pose"))
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._line, self._log = Log, node.create_publisher(Log, "/rosout", latched)
        self._drives_until = -math.inf
        if script.get("odometry", False):
            self._serve_odometry(node, runs_away=script.get("runs_away", False))

    def obey(self, order: "dict[str, Any]") -> None:
        self._states.update(order.get("state", {}))
        self._goals = order.get("goals", self._goals)
        if "goals" in order:
            self._count = 0  # goal numbers restart

    def _serve_odometry(self, node: Any, *, runs_away: bool) -> None:
        """Publish the odometry, and handle the cancellation of `follow_path` like Nav2's controller."""
        from action_msgs.srv import CancelGoal
        from nav_msgs.msg import Odometry

        publisher, message = node.create_publisher(Odometry, "odometry/filtered", 10), Odometry()

        def publish() -> None:
            message.twist.twist.linear.x = 0.3 if time.monotonic() < self._drives_until else 0.0
            publisher.publish(message)

        def stop(request: Any, response: Any) -> Any:
            tell("follow_path cancelled", all=not any(request.goal_info.goal_id.uuid))
            self._drives_until = self._drives_until if runs_away else -math.inf
            return response

        node.create_timer(0.05, publish)
        node.create_service(CancelGoal, "follow_path/_action/cancel_goal", stop)

    def _serve_poses(self, node: Any, pose: "list[float] | None") -> "Callable[[float, float], None]":
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        if self._states.get("amcl", "") is None:  # another process localises
            self._is_localised = True
            return lambda _x, _y: None
        poses = node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched)

        def take(message: Any) -> None:
            position = message.pose.pose.position
            tell("initialpose", x=position.x, y=position.y)
            self._states["bt_navigator"] = "active"
            self._is_localised = True
            poses.publish(message)

        def tell_place(x: float, y: float) -> None:
            known = PoseWithCovarianceStamped()
            known.header.frame_id, known.pose.pose.orientation.w = "map", 1.0
            known.pose.pose.position.x, known.pose.pose.position.y = x, y
            poses.publish(known)

        if pose is not None:
            tell_place(*pose)
        self._is_localised = pose is not None
        node.create_subscription(PoseWithCovarianceStamped, "initialpose", take, 10)
        return tell_place

    def _state(self, name: str, response: Any) -> Any:
        response.current_state.label = self._states[name]
        return response

    def _judge(self, goal: Any) -> Any:
        script = self._goals[min(self._count, len(self._goals) - 1)]
        self._count += 1
        number = self._count
        self._scripts[self._accept.id] = {**script, "number": number}
        position = goal.pose.pose.position
        tell("goal", number=number, x=position.x, y=position.y)
        time.sleep(script.get("accept_after", 0.0))
        if not script.get("accept", True) or self._states["bt_navigator"] != "active":
            tell("rejected", number=number)
            return self._responses.REJECT
        tell("accepted", number=number)
        return self._responses.ACCEPT

    async def _cancel(self, handle: Any) -> Any:
        script = self._script_of(handle)
        tell("cancel", number=script["number"])
        manner = script.get("cancel", "grant")
        if manner == "mute":
            from rclpy.task import Future

            await Future()
        return self._cancels.REJECT if manner == "refuse" else self._cancels.ACCEPT

    def _drive(self, handle: Any) -> Any:
        script = self._script_of(handle)
        drive = script.get("drive", 0.2)
        heeds = script.get("cancel", "grant") == "grant"
        began = told = time.monotonic()
        how = script.get("end", "succeed")
        self._newest = script["number"]
        while drive is None or time.monotonic() - began < drive:
            self._drives_until = time.monotonic() + 0.1
            if handle.is_cancel_requested and heeds:
                how = "cancel"
                break
            if self._preempts and self._newest > script["number"]:
                how = "abort"
                break
            if script.get("feedback", True) and time.monotonic() - told > 0.1:
                told = time.monotonic()
                handle.publish_feedback(self._type.Feedback(distance_remaining=1.0))
                tell("feedback")
            time.sleep(_TICK_SEC)
        ends = {"succeed": handle.succeed, "abort": handle.abort, "cancel": handle.canceled}
        self._drives_until = time.monotonic() + script.get("drives_on", 0.0)
        if "says" in script:
            self._log.publish(self._line(level=40, name="controller_server", msg=script["says"]))
        if how == "succeed" and self._arrives and self._is_localised:
            place = handle.request.pose.pose.position
            self._tell_place(place.x, place.y)
        ends[how]()
        tell("ended", number=script["number"], how=how)
        return self._type.Result(error_code=script.get("code", 0) if how == "abort" else 0)

    def _script_of(self, handle: Any) -> "dict[str, Any]":
        return self._scripts[bytes(handle.goal_id.uuid)]

    def _loses(self, goal: bytes) -> bool:
        return self._scripts.get(goal, {}).get("result") == "lose"


def _readers_of_answers(node: Any) -> "set[bytes]":
    """Return the endpoint ids of the clients that receive the responses of the action's server."""
    readers = node.get_subscriptions_info_by_topic(
        "rr/navigate_to_pose/_action/send_goalReply", no_mangle=True
    )
    return {bytes(each.endpoint_gid) for each in readers}


class Localiser:
    """Node `amcl` in a separate process: its state, `amcl_pose`, and transforms from `map`.

    Orders: `{"transforms": false}`.
    """

    def __init__(self, node: Any, script: "dict[str, Any]") -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
        from lifecycle_msgs.srv import GetState
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from tf2_msgs.msg import TFMessage

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        poses = node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched)
        pose, offset = PoseWithCovarianceStamped(), TransformStamped()
        pose.header.frame_id, pose.pose.pose.orientation.w = "map", 1.0
        poses.publish(pose)
        offset.header.frame_id, offset.child_frame_id = "map", "odom"
        self._sends = script.get("transforms", True)
        transforms = node.create_publisher(TFMessage, "/tf", 10)

        def publish() -> None:
            if self._sends:
                transforms.publish(TFMessage(transforms=[offset]))

        def answer(_: Any, response: Any) -> Any:
            response.current_state.label = "active"
            return response

        node.create_timer(0.1, publish)
        node.create_service(GetState, "amcl/get_state", answer)

    def obey(self, order: "dict[str, Any]") -> None:
        self._sends = order.get("transforms", self._sends)


class Survivors:
    """The services `detect_survivor` and `report_survivor`.

    Script:
        found: Positions by zone.
        detect, report: The response to each call, in order like the goals of `Navigation`: `answer` (true), `after` (0.0 s).
    """

    def __init__(self, node: Any, script: "dict[str, Any]") -> None:
        from rclpy.callback_groups import ReentrantCallbackGroup
        from sar_interfaces.srv import DetectSurvivor, ReportSurvivor

        self._script = script
        self._counts = {"detect": 0, "report": 0}
        group = ReentrantCallbackGroup()
        node.create_service(DetectSurvivor, "detect_survivor", self._detect, callback_group=group)
        node.create_service(ReportSurvivor, "report_survivor", self._report, callback_group=group)

    def obey(self, order: "dict[str, Any]") -> None:
        self._script.update(order)

    async def _answer(self, kind: str) -> None:
        from rclpy.task import Future

        manners = self._script.get(kind, [{}])
        manner = manners[min(self._counts[kind], len(manners) - 1)]
        self._counts[kind] += 1
        if manner.get("after"):
            over = Future()
            threading.Timer(manner["after"], over.set_result, [None]).start()
            await over
        if not manner.get("answer", True):
            await Future()

    async def _detect(self, request: Any, response: Any) -> Any:
        tell("detect", zone=request.zone_id)
        await self._answer("detect")
        place = self._script.get("found", {}).get(request.zone_id)
        if place is not None:
            response.found, (response.survivor_x, response.survivor_y) = True, map(float, place)
        return response

    async def _report(self, request: Any, response: Any) -> Any:
        point = request.location.point
        tell("report", id=request.survivor_id, x=point.x, y=point.y)
        await self._answer("report")
        response.acknowledged = True
        return response


class Clock:
    """The topic `/clock`.

    Script:
        start: The first time (100.0 s).
        speed: Simulated seconds per real second (1.0).

    Orders: `{"stop": true}`, `{"stop": false}`, `{"jump": seconds}`.
    """

    def __init__(self, node: Any, script: "dict[str, Any]") -> None:
        from rosgraph_msgs.msg import Clock as Message

        self._publisher, self._type = node.create_publisher(Message, "/clock", 10), Message
        self._now, self._stopped = script.get("start", 100.0), False
        self._step = _CLOCK_PERIOD_SEC * script.get("speed", 1.0)
        node.create_timer(_CLOCK_PERIOD_SEC, self._tick)

    def obey(self, order: "dict[str, Any]") -> None:
        self._stopped = order.get("stop", self._stopped)
        self._now += order.get("jump", 0.0)
        tell("obeyed", **order)

    def _tick(self) -> None:
        if not self._stopped:
            self._now += self._step
            message = self._type()
            message.clock.sec, message.clock.nanosec = int(self._now), int(self._now % 1.0 * 1e9)
            self._publisher.publish(message)


_ROLES: "dict[str, Any]" = {
    "navigation": Navigation,
    "localiser": Localiser,
    "survivors": Survivors,
    "clock": Clock,
}


def main(descriptor: str, role: str, script: str) -> None:
    """Serve until the test kills the process or closes its standard input."""
    import rclpy
    from rclpy.executors import MultiThreadedExecutor

    _to_test.append(int(descriptor))
    rclpy.init()
    node = rclpy.create_node(f"scripted_{role}")
    servers = _ROLES[role](node, json.loads(script))
    executor = MultiThreadedExecutor(num_threads=8)
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    tell("ready")
    for line in sys.stdin:
        servers.obey(json.loads(line))
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
