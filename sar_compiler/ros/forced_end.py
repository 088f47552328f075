"""End a run's process from another thread if the ticking thread is blocked or a second signal arrives."""

from collections.abc import Callable
from typing import NoReturn

from py_trees.behaviour import Behaviour
from rclpy.node import Node

from sar_compiler.commands import ROBOT_MAY_MOVE, print_error
from sar_compiler.process_end import call_with_limit, end_at_once
from sar_compiler.ros.engine import send_cancels
from sar_compiler.ros.leaves.goals import active_goals_of
from sar_compiler.ros.orphaned_goals import CancelFunction
from sar_compiler.ros.signals import StopSignals

# Maximum times in seconds: to stop the leaves from another thread, to create another ROS context, and for the node
# in that context to discover the servers.
_LEAVES_SEC, _CONTEXT_SEC, _DISCOVERY_SEC = 1.0, 5.0, 5.0


class ForcedEnd:
    """Ends the process of a run after a signal that the ticking thread does not handle.

    Args:
        name: The program's name, for messages.
        node: The run's node.
        root: The root of the tree.
        signals: The requests to stop.
        cancel: Cancels the node's goals; None if the goals end together with this process, as in a simulation.
        settle_sec: The maximum wait until the goals have ended, in seconds of the steady clock.
        moves: Returns whether the robot moves although no goal is active.
        before_message: Called before a message is printed.
    """

    def __init__(
        self,
        name: str,
        node: Node,
        root: Behaviour,
        signals: StopSignals,
        cancel: CancelFunction | None,
        settle_sec: float,
        *,
        moves: Callable[[], bool] = lambda: False,
        before_message: Callable[[], object] = lambda: None,
    ) -> None:
        self._name, self._node, self._root, self._signals = name, node, root, signals
        self._cancel, self._settle_sec = cancel, settle_sec
        self._moves, self._before_message = moves, before_message

    def end_blocked(self, where: str) -> NoReturn:
        """End the process although the ticking thread is blocked; *where* describes the blocking code."""
        settle_sec = self._settle_sec + _DISCOVERY_SEC

        def cancel() -> int | None:
            self._print(f"stopped although {where}")
            # Leaves may have to stop work other than goals. If a leaf blocks here as well, the process ends without waiting for the leaf.
            call_with_limit(_LEAVES_SEC, lambda: send_cancels(self._root, self._node))
            active = self._cancel(settle_sec) if self._cancel is not None else []
            if not active:
                return self._signals.exit_status
            words = "a goal may still be active, and the robot may still be moving"
            self._print(f"{words}: {', '.join(active)}")
            return ROBOT_MAY_MOVE

        could_still_move = self._cancel is not None and active_goals_of(self._node).active()
        status = ROBOT_MAY_MOVE if could_still_move else self._signals.exit_status
        end_at_once(status, cancel, _LEAVES_SEC + _CONTEXT_SEC + settle_sec)

    def end_immediately(self) -> int | None:
        """Stop the leaves after a second signal; return the exit status, or None to exit with the signal's status."""
        active = len(active_goals_of(self._node)) or self._moves()
        send_cancels(self._root, self._node)
        if not active:
            self._print("terminated at once after the second signal")
            return None
        self._print(
            "terminated at once after the second signal. The leaves were stopped, but the robot may still be moving"
        )
        return ROBOT_MAY_MOVE

    def _print(self, text: str) -> None:
        self._before_message()
        print_error(f"{self._name}: {text}")
