"""The ROS node of `sar-run --serve`. It starts runs for clients of the action `bt_execution`, like BehaviorTree.ROS2's server.

It is a lifecycle node. It reads its trees when it is configured, accepts goals while it is active, and pauses the current run when it is
deactivated. If a lifecycle manager controls the node, the two share a bond, as with Nav2's nodes.
"""

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any
from uuid import uuid4

from btcpp_ros2_interfaces.action import ExecuteTree
from btcpp_ros2_interfaces.msg import NodeStatus
from btcpp_ros2_interfaces.srv import GetTrees
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.task import Future
from rclpy.timer import Timer

from sar_compiler.errors import SarError
from sar_compiler.execution.served_runs import EndedRun, PayloadError, RunStarter, ServedRun, parameters_of
from sar_compiler.ros.arguments import init_arguments
from sar_compiler.ros.middleware import ros_up
from sar_compiler.ros.signals import StopSignals
from sar_compiler.tree.display_text import escape_to_one_line, shorten_to_line
from sar_compiler.tree.guessing import did_you_mean, nearest

NODE_NAME = "sar_tree_server"
ACTION, TREES_SERVICE, BOND = "bt_execution", "get_loaded_trees", "bond"
# The values of Nav2's nodes, in seconds of the steady clock, because simulated time may stop.
_BOND_PERIOD_SEC, _BOND_TIMEOUT_SEC, _BOND_DEPTH = 0.1, 4.0, 5
# Maximum wait until the manager has received the end of the bond, in seconds.
_LAST_MESSAGE_SEC = 1.0
# Signals are handled between two turns of the executor.
_TURN_SEC, _LAST_TURNS = 0.1, 5


def serve_trees(starter: RunStarter, ros: Sequence[str], signals: StopSignals, *, is_managed: bool) -> bool:
    """Start runs for clients until a signal arrives and the current run has ended.

    Args:
        starter: Starts the runs. Its attribute `node` is set to the server's node.
        ros: The user's ROS arguments.
        signals: The requests to stop.
        is_managed: Whether a lifecycle manager configures and activates the node.

    Returns:
        False if no goals were accepted because the trees cannot be run; the log contains the reason.
    """
    with ros_up(init_arguments(ros)) as context, suppress(ExternalShutdownException):
        node = TreeExecutionServer(context, starter, is_managed=is_managed)
        starter.node = node
        with SingleThreadedExecutor(context=context) as executor:
            executor.add_node(node)
            can_serve = is_managed or node.is_activated()
            if can_serve:
                _spin(executor, node, signals)
        node.destroy_node()
        return can_serve
    return True


def _spin(executor: Executor, node: "TreeExecutionServer", signals: StopSignals) -> None:
    is_asked = False
    while not (signals.came and not node.is_busy):
        if signals.came and not is_asked:
            is_asked = True
            node.stop_run()
        executor.spin_once(_TURN_SEC)
    # The executor still has to send the result to the client.
    for _ in range(_LAST_TURNS):
        executor.spin_once(_TURN_SEC)


class Bond:
    """A node's bond, which shows a lifecycle manager that the process is alive.

    The two processes of a bond publish heartbeats on the topic `bond`, and a last message before they end. Nav2's lifecycle manager regards
    a node as crashed if it receives no heartbeat for `bond_timeout`, and does not activate a node without a bond.

    Args:
        node: The node whose name identifies the bond, and whose executor sends the heartbeats.

    Raises:
        ModuleNotFoundError: If the ROS package `bond`, a dependency of Nav2, is not installed.
    """

    def __init__(self, node: Node) -> None:
        from bond.msg import Status

        self._node, self._clock, self._message = node, Clock(clock_type=ClockType.STEADY_TIME), Status
        self._publisher = node.create_publisher(Status, BOND, _BOND_DEPTH)
        self._timer: Timer | None = None
        self._end = ""

    def begin(self) -> None:
        """Send heartbeats until `announce_end` is called."""
        self.announce_end()
        # The manager expects a new instance ID from a node that is activated again.
        self._end = str(uuid4())
        self._timer = self._node.create_timer(
            _BOND_PERIOD_SEC, lambda: self._publish(is_there=True), clock=self._clock
        )

    def announce_end(self) -> None:
        """Announce the end of the bond."""
        if self._timer is None:
            return
        self._node.destroy_timer(self._timer)
        self._timer = None
        self._publish(is_there=False)
        # The process may end before the message is sent.
        self._publisher.wait_for_all_acked(Duration(seconds=_LAST_MESSAGE_SEC))

    def _publish(self, *, is_there: bool) -> None:
        status = self._message(
            id=self._node.get_name(),
            instance_id=self._end,
            active=is_there,
            heartbeat_timeout=_BOND_TIMEOUT_SEC,
            heartbeat_period=_BOND_PERIOD_SEC,
        )
        status.header.stamp = self._clock.now().to_msg()
        self._publisher.publish(status)


class TreeExecutionServer(LifecycleNode):
    """The lifecycle node that receives goals and starts a run of a tree for each goal.

    Args:
        context: The ROS context.
        starter: Starts the runs.
        is_managed: Whether a lifecycle manager monitors the node through a bond.
    """

    def __init__(self, context: Context, starter: RunStarter, *, is_managed: bool) -> None:
        super().__init__(NODE_NAME, context=context)
        self._starter = starter
        self._trees: Sequence[str] = ()
        self._run: ServedRun | None = None
        self._is_active, self._is_taken = False, False
        self._due: deque[Callable[[], object]] = deque()
        self._bond = _new_bond(self) if is_managed else None
        self._action: Any = ActionServer(
            self,
            ExecuteTree,
            ACTION,
            execute_callback=self._execute,
            goal_callback=self._on_goal,
            cancel_callback=self._on_cancel,
        )
        self.create_service(GetTrees, TREES_SERVICE, self._list_trees)
        # rclpy raises an exception if the current state has no such transition. The exception would end the server and its mission.
        service = self._service_change_state
        service.callback = partial(self._change_if_possible, service.callback)

    def _change_if_possible(self, change: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        wanted, (_, state) = request.transition, self._state_machine.current_state
        if wanted.label or wanted.id in [each[0] for each in self._state_machine.available_transitions]:
            return change(request, response)
        self.get_logger().warning(f"Refused: the state '{state}' has no transition {wanted.id}.")
        response.success = False
        return response

    @property
    def is_busy(self) -> bool:
        """Whether a run is active."""
        return self._is_taken

    def is_activated(self) -> bool:
        """Configure and activate the node if it has no lifecycle manager; return whether this succeeded."""
        success = TransitionCallbackReturn.SUCCESS
        return bool(self.trigger_configure() == success and self.trigger_activate() == success)

    def stop_run(self) -> None:
        """Stop the current run gracefully; a second call stops it immediately."""
        if self._run is not None:
            self._run.stop()

    def destroy_node(self) -> None:
        """Destroy the action server and the node."""
        self._reject_goals()
        self._action.destroy()
        super().destroy_node()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Read the tree files."""
        try:
            self._trees = self._starter.read_tree_ids()
        except SarError as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Accept goals, and resume a paused run."""
        self._is_active = True
        if self._run is not None:
            self._run.hold(wanted=False, refused=self._log_not_resumed)
        if self._bond is not None:
            self._bond.begin()
        self.get_logger().info(
            f"Ready to run the trees {', '.join(self._trees)}. Send a goal to '{ACTION}' to start one of them."
        )
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Reject goals, and pause the current run until the next activation; stop the run if it cannot be paused."""
        self._reject_goals()
        if self._run is not None:
            self._run.hold(
                wanted=True, refused=lambda why: self._schedule(lambda: self._stop_unpausable_run(why))
            )
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Discard the list of trees and stop the current run."""
        self._trees = ()
        self.stop_run()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Reject all further goals and stop the current run."""
        self._reject_goals()
        return self.on_cleanup(state)

    def _reject_goals(self) -> None:
        self._is_active = False
        if self._bond is not None:
            self._bond.announce_end()

    def _stop_unpausable_run(self, why: str) -> None:
        if self._run is not None:
            self.get_logger().warning(
                f"The mission is stopped, because it cannot be paused: {escape_to_one_line(why)}"
            )
            self._run.stop()

    def _log_not_resumed(self, why: str) -> None:
        self.get_logger().warning(f"The mission could not be resumed: {escape_to_one_line(why)}")

    def _list_trees(self, _request: GetTrees.Request, response: GetTrees.Response) -> GetTrees.Response:
        response.tree_ids = [*self._trees]
        return response

    def _on_goal(self, goal: ExecuteTree.Goal) -> GoalResponse:
        """Accept a goal if its run can be started; log the reason for a rejection."""
        why = self._rejection_reason(goal)
        if why:
            self.get_logger().warning(f"Goal refused: {escape_to_one_line(why)}")
            return GoalResponse.REJECT
        self._is_taken = True
        return GoalResponse.ACCEPT

    def _rejection_reason(self, goal: ExecuteTree.Goal) -> str:
        """Return why the run of a goal cannot start, or an empty string if the run can start."""
        tree = str(goal.target_tree)
        if not self._is_active:
            return "this node is not active"
        if tree not in self._trees:
            return f"unknown tree '{tree}' (known: {', '.join(self._trees)}){did_you_mean(nearest(tree, self._trees))}"
        if self._is_taken:
            return "a mission is running"
        try:
            return self._starter.refusal_reason(tree, parameters_of(str(goal.payload)))
        except PayloadError as error:
            return str(error)

    def _on_cancel(self, _goal: ServerGoalHandle) -> CancelResponse:
        self.get_logger().info("The client has requested the end of the run.")
        self.stop_run()
        return CancelResponse.ACCEPT

    async def _execute(self, goal: ServerGoalHandle) -> ExecuteTree.Result:
        """Start the run of an accepted goal, wait for its end, and return the result."""
        ended: Future = Future(executor=self.executor)
        lines: deque[str] = deque()

        def tell(line: str) -> None:
            lines.append(line)
            self._schedule(lambda: self._publish_feedback(goal, lines))

        request, say = goal.request, self.get_logger().info
        say(f"Starting a run of '{request.target_tree}'.")
        try:
            self._run = self._starter.start(
                str(request.target_tree),
                parameters_of(str(request.payload)),
                tell,
                lambda end: self._schedule(lambda: ended.set_result(end)),
            )
        except OSError as error:
            ended.set_result(EndedRun("IDLE", f"the run's process could not be started: {error}"))
        end: EndedRun = await ended
        self._run, self._is_taken = None, False
        reason = "" if end.outcome == "SUCCESS" else f": {shorten_to_line(end.message)}"
        say(f"Run of '{request.target_tree}' ended with {end.outcome}{reason}")
        if goal.is_cancel_requested:
            goal.canceled()
        elif end.outcome == "SUCCESS":
            goal.succeed()
        else:
            goal.abort()
        status = NodeStatus(status=getattr(NodeStatus, end.outcome))
        return ExecuteTree.Result(node_status=status, return_message=end.message)

    def _publish_feedback(self, goal: ServerGoalHandle, lines: deque[str]) -> None:
        """Publish the lines in one message, because a client keeps only ten messages that it has not handled."""
        message = "\n".join(lines.popleft() for _ in range(len(lines)))
        if message and goal.is_active:
            goal.publish_feedback(ExecuteTree.Feedback(message=message))

    def _schedule(self, call: Callable[[], object]) -> None:
        """Schedule a call in the executor's thread; calls are executed in order."""
        self._due.append(call)
        executor = self.executor
        if executor is not None:
            executor.create_task(self._run_scheduled)

    def _run_scheduled(self) -> None:
        while self._due:
            self._due.popleft()()


def _new_bond(node: TreeExecutionServer) -> Bond | None:
    try:
        return Bond(node)
    except ModuleNotFoundError as error:
        node.get_logger().warning(
            f"This node has no bond, because the ROS package 'bond' is not installed ({error}). "
            "Install the package, or set bond_timeout: 0.0 for the lifecycle manager."
        )
        return None
