"""The base class of leaves that call a ROS action."""

from abc import abstractmethod
from typing import Any, cast

from py_trees.common import Status

from sar_compiler.nodes.spec import MARK, Use
from sar_compiler.ros.leaves.client_leaf import ClientLeaf
from sar_compiler.ros.leaves.goal import SUCCEEDED, ActionGoal, ActionPort, GoalDeadlines, describe_status

_NAV2 = "nav2_msgs."


class ActionLeaf(ClientLeaf[ActionGoal]):
    """A leaf that sends one goal of an action in each activation; RUNNING until the goal has ended.

    When the leaf is interrupted the goal is cancelled, even if the server has not accepted it yet. The answers to an
    old goal never affect a new one.

    A subclass has the attributes `action_type` and `action_name`, of the class or set by its constructor, and the
    method `goal`; also `on_result`, if the result matters beyond success or failure.

    Attributes:
        action_type: `"package/action/Name"`, or the Python class.
        action_name: The action's (relative) name.
        server_timeout_sec: How long a server may be missing, before the goal is sent and while it is under way; this
            and the following in seconds of the steady clock.
        acceptance_timeout_sec: How long to wait for the goal to be accepted.
        feedback_timeout_sec: How long the server may be silent or gone, once it has sent feedback; None for no
            limit.
        interface: The Python class of the action, once the leaf is set up.

    Example:
        A leaf that docks, with a port::

            class Dock(ActionLeaf):
                action_type = "nav2_msgs/action/DockRobot"
                action_name = "dock_robot"

                def __init__(self, name: str, dock: Input[str]) -> None:
                    super().__init__(name)
                    self._dock = dock

                def goal(self) -> Any:
                    return self.interface.Goal(dock_id=self._dock.get())
    """

    action_type: Any = None
    action_name: str = ""
    acceptance_timeout_sec: float = 5.0
    feedback_timeout_sec: float | None = None

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._port: ActionPort | None = None
        self._goals_given_up: list[ActionGoal] = []

    @abstractmethod
    def goal(self) -> Any:
        """Return the goal, an `interface.Goal`.

        Or a `Status`, to send nothing: SUCCESS and FAILURE end the leaf, with RUNNING this method is called again at
        the next tick.
        """

    def on_feedback(self, feedback: Any) -> Status | None:  # noqa: ARG002 - for subclasses
        """Handle the latest feedback; called in the tick after its arrival.

        Returns:
            SUCCESS or FAILURE to end the leaf now, which cancels the goal; None or RUNNING to continue.
        """
        return None

    def on_result(self, status: int, result: Any) -> Status:  # noqa: ARG002 - for subclasses
        """Return the leaf's status after the end of the goal; with RUNNING the next `goal` is sent.

        By default SUCCESS if the status is `STATUS_SUCCEEDED`, else FAILURE.

        Args:
            status: A constant of `action_msgs/msg/GoalStatus`.
            result: The result, an `interface.Result`.
        """
        return Status.SUCCESS if status == SUCCEEDED else self.on_failure(describe_status(status))

    def shutdown(self) -> None:
        """Cancel a goal in flight, and release the clients.

        While a cancel request is unanswered, the clients are left to the node: a goal that is accepted only now
        must still be cancelled.
        """
        self._drop()
        if self._port is not None and self.settled():
            self._port.release()
        self._port = None
        super().shutdown()

    def settled(self) -> bool:
        """Return whether every cancel request is answered, or its server is gone."""
        self._goals_given_up = [goal for goal in self._goals_given_up if not goal.settled]
        under_way = bool(self._goals_given_up) or not (self._exchange is None or self._exchange.settled)
        return not (under_way and self._port is not None and self._port.server_is_ready)

    def _server(self) -> tuple[str, str, Any]:
        return "action", self.action_name, self.action_type

    def _connect(self) -> None:
        self._port = ActionPort(self.node, self.interface, self.action_name)

    def _message(self) -> Any:
        return self.goal()

    def _open(self, message: Any) -> ActionGoal:
        deadlines = GoalDeadlines(
            self.server_timeout_sec, self.acceptance_timeout_sec, self.feedback_timeout_sec
        )
        return ActionGoal(cast("ActionPort", self._port), message, deadlines, self._announce, self._hear)

    def _progress(self, exchange: ActionGoal) -> Status:
        status = super()._progress(exchange)
        feedback = exchange.take_feedback()
        if feedback is None or status is not Status.RUNNING:
            return status
        verdict = self.on_feedback(feedback)
        if verdict is None or verdict is Status.RUNNING:
            return Status.RUNNING
        self._cancel()
        return verdict

    def _explain(self, exchange: ActionGoal) -> str:
        if not (exchange.rejected and self.interface.__module__.startswith(_NAV2)):
            return exchange.trouble
        registration = getattr(type(self), MARK, None)
        if registration is None or Use.nav2() in registration.uses:
            return f"{exchange.trouble} Nav2 is once it has an initial pose."
        return (
            f"{exchange.trouble} Nav2 is once it has an initial pose: with Use.nav2() among what "
            f"<{registration.tag}> uses, the start gives it one and waits."
        )

    def _conclude(self, answer: Any) -> Status:
        return self.on_result(answer.status, answer.result)

    def _hear(self) -> None:
        self._complaints.clear()
        self._wake()

    def _cancel(self) -> None:
        if self._exchange is not None and self._exchange.in_flight:
            self.say(f"Canceling the goal of '{self.name}'.")
            self._exchange.abandon()

    def _drop(self) -> None:
        goal = self._exchange
        self._cancel()
        super()._drop()
        self._goals_given_up = [
            each for each in (*self._goals_given_up, goal) if each is not None and not each.settled
        ]
