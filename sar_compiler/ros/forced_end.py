"""The end of a run from another thread than the one that ticks its tree: that one is blocked, or was asked to end twice."""

from collections.abc import Callable
from typing import NoReturn

from py_trees.behaviour import Behaviour
from rclpy.node import Node

from sar_compiler.commands import ADRIFT, print_error
from sar_compiler.process_end import end_at_once, try_for
from sar_compiler.ros.engine import send_cancels
from sar_compiler.ros.leaves.goals import goals_under_way
from sar_compiler.ros.left_goals import Cancel
from sar_compiler.ros.signals import StopSignals

# How long leaves may take to be stopped from another thread than the one that is blocked, seconds; a ROS context of its own to be made; and its
# node to find the servers.
_LEAVES_SEC, _APART_SEC, _DISCOVERY_SEC = 1.0, 5.0, 5.0


class ForcedEnd:
    """Ends the process of a run as signals have asked for.

    Args:
        name: The name of the program, for its messages.
        node: The run's node.
        root: The tree.
        signals: The requests to stop.
        cancel: Cancels the node's goals; None where they end with this process, as in a simulation.
        settle_sec: How long the goals have to end, steady seconds.
        moves: Whether the robot moves although no goal is active.
        before_message: Called before anything is printed.
    """

    def __init__(
        self,
        name: str,
        node: Node,
        root: Behaviour,
        signals: StopSignals,
        cancel: Cancel | None,
        settle_sec: float,
        *,
        moves: Callable[[], bool] = lambda: False,
        before_message: Callable[[], object] = lambda: None,
    ) -> None:
        self._name, self._node, self._root, self._signals = name, node, root, signals
        self._cancel, self._settle_sec = cancel, settle_sec
        self._moves, self._before_message = moves, before_message

    def end_blocked(self, where: str) -> NoReturn:
        """End the process, since the thread that ticks does not hear of the request; *where* says what blocks it."""
        settle_sec = self._settle_sec + _DISCOVERY_SEC

        def cancel() -> int | None:
            self._print(f"stopped although {where}")
            # Leaves may have more to stop than goals; one that blocks there as well keeps nobody.
            try_for(_LEAVES_SEC, lambda: send_cancels(self._root, self._node))
            active = self._cancel(settle_sec) if self._cancel is not None else []
            if not active:
                return self._signals.exit_status
            words = "a goal may still be active, and the robot may still be moving"
            self._print(f"{words}: {', '.join(active)}")
            return ADRIFT

        may_be_adrift = self._cancel is not None and goals_under_way(self._node).active()
        status = ADRIFT if may_be_adrift else self._signals.exit_status
        end_at_once(status, cancel, _LEAVES_SEC + _APART_SEC + settle_sec)

    def hurry(self) -> int | None:
        """Do what there is time for before the process ends at once, because it was asked twice; return its exit status, None for the signal's."""
        active = len(goals_under_way(self._node)) or self._moves()
        # Before anything that may take its time, which there is little of.
        send_cancels(self._root, self._node)
        if not active:
            self._print("ended at once, as asked twice")
            return None
        self._print(
            "ended at once, as asked twice: what is under way was told to stop, the robot may still be moving"
        )
        return ADRIFT

    def _print(self, text: str) -> None:
        self._before_message()
        print_error(f"{self._name}: {text}")
