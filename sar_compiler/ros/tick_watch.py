"""Detect a blocked executor, report the blocking leaf, and cancel the goals.

A leaf that waits in `update()` blocks the thread that executes all callbacks. Meanwhile, time limits, responses, commands and Ctrl-C
have no effect, and the robot continues to drive. A timer of the node sends heartbeats. A separate thread detects that the heartbeats
stop, and finds the blocking code in the stack of the blocked thread. A leaf that holds the interpreter lock also blocks this separate
thread. In this case, the guardian (`ros.guardian`), a process that also receives the heartbeats, detects the blocked leaf. The guardian
reads the stack that Python's fault handler has written. The fault handler does not need the lock.
"""

import faulthandler
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable
from types import FrameType

from py_trees.behaviour import Behaviour
from rclpy.node import Node

from sar_compiler.missions.parameter_reader import BLOCKED_TICK_SEC
from sar_compiler.process_end import thread_location
from sar_compiler.ros.clock import steady_timer
from sar_compiler.ros.engine import behaviour_title, source_locations
from sar_compiler.ros.heartbeats import REPORT_SEC, Heartbeat, heartbeats
from sar_compiler.ros.leaves.goals import active_goals_of
from sar_compiler.ros.orphaned_goals import CancelFunction
from sar_compiler.ros.signals import UNNOTICED_SEC, StopSignals
from sar_compiler.tree.display_text import escape_to_one_line

_PERIOD_SEC, _LOOK_SEC = 0.5, 0.2
# If a check is late by this time, in seconds, the whole process was suspended, and no leaf is the cause.
_OWN_PAUSE_SEC = 0.5
# Maximum wait until the goals have ended after the request to cancel them, in seconds of the steady clock.
_TRYING_SEC = 10.0


class TickWatch:
    """Context manager that checks whether a node's executor is blocked.

    Args:
        node: The node whose executor ticks the tree.
        root: The root of the tree.
        cancel: Cancels the node's goals if the executor is blocked for *cancel_sec*; None to cancel no goals, as in a simulation.
        cancel_sec: The time for which the executor may be blocked before the goals are cancelled, in seconds of the steady clock.
        signals: The requests to stop; None if the program handles signals itself.
        end: Called in the checking thread if the ticking thread is blocked after a request to stop. The argument is a description of the
            blocking code.
        settle_sec: The time for which the ticking thread may be blocked after it has noticed the request, in seconds of the steady clock.
        on_beat: Called in the executor's thread with each heartbeat.

    Attributes:
        end: The function *end*, which can be replaced.
    """

    def __init__(
        self,
        node: Node,
        root: Behaviour,
        *,
        cancel: CancelFunction | None,
        cancel_sec: float = BLOCKED_TICK_SEC,
        signals: StopSignals | None = None,
        end: Callable[[str], object] = lambda _: None,
        settle_sec: float = 0.0,
        on_beat: Callable[[], object] = lambda: None,
    ) -> None:
        self._node, self._root, self._logger = node, root, node.get_logger()
        self._cancel, self._cancel_sec = cancel, cancel_sec
        self.end, self._on_beat = end, on_beat
        self._signals, self._settle_sec = signals, settle_sec
        self._heartbeats = heartbeats(node)
        self._beat_at = time.monotonic()
        self._thread = threading.get_ident()
        self._is_over = threading.Event()
        self._is_reported = self._is_canceled = False
        # A file in memory, which the guardian can read under /proc.
        self._stack = os.memfd_create("stacks") if self._heartbeats.has_listeners else None

    def __enter__(self) -> None:
        """Start the heartbeats and the checking thread."""
        self._timer = steady_timer(self._node, _PERIOD_SEC, self._on_timer)
        self._on_alive()
        self._watcher = threading.Thread(target=self._watch, name="tick watch", daemon=True)
        self._watcher.start()

    def __exit__(self, *_: object) -> None:
        """Stop the heartbeats and the checking thread."""
        self._is_over.set()
        self._watcher.join(_OWN_PAUSE_SEC)  # the thread may be waiting for the ends of goals
        self._heartbeats.send(Heartbeat())
        if self._stack is not None:
            faulthandler.cancel_dump_traceback_later()
            os.close(self._stack)
        if self._node.context.ok():
            self._node.destroy_timer(self._timer)

    def _on_timer(self) -> None:
        self._on_alive()
        self._on_beat()

    def _on_alive(self) -> None:
        """Record that the executor is not blocked, and send a heartbeat; called in the executor's thread."""
        self._beat_at, self._thread = time.monotonic(), threading.get_ident()
        if self._stack is None:
            return
        os.ftruncate(self._stack, 0)
        os.lseek(self._stack, 0, os.SEEK_SET)
        faulthandler.dump_traceback_later(REPORT_SEC, file=self._stack)
        place = f"/proc/{os.getpid()}/fd/{self._stack}"
        self._heartbeats.send(Heartbeat(self._cancel_sec, stack=place, thread=self._thread))

    def _watch(self) -> None:
        checked_at = time.monotonic()
        while not self._is_over.wait(_LOOK_SEC):
            now = time.monotonic()
            late_sec, checked_at = now - checked_at - _LOOK_SEC, now
            if late_sec > _OWN_PAUSE_SEC:
                self._beat_at += late_sec
            self._check_heartbeat(now - self._beat_at)

    def _check_heartbeat(self, silent_sec: float) -> None:
        if silent_sec < REPORT_SEC:
            if self._is_reported:
                self._logger.info("The tree is ticked again.")
            self._is_reported = self._is_canceled = False
        elif not self._is_reported:
            self._is_reported = True
            self._heartbeats.send(Heartbeat(self._cancel_sec, is_reported=True))
            self._logger.error(
                f"The tree was not ticked for {silent_sec:.0f} s: {escape_to_one_line(self.blocking_location())}. While the tree is not "
                f"ticked, time limits, responses and commands have no effect. Send a request in initialise(), and check for its response "
                f"in update()."
            )
        if self._must_end(silent_sec):
            self.end(self.blocking_location())
        if silent_sec > self._cancel_sec and not self._is_canceled and self._cancel is not None:
            self._is_canceled = True
            self._cancel_goals(self._cancel)

    def _must_end(self, silent_sec: float) -> bool:
        """Return whether the ticking thread was blocked for too long after a request to stop."""
        if self._signals is None or (asked_at := self._signals.came_at) is None:
            return False
        patience_sec = self._settle_sec if self._signals.is_noticed else UNNOTICED_SEC
        return min(silent_sec, time.monotonic() - asked_at) > patience_sec

    def _cancel_goals(self, cancel: CancelFunction) -> None:
        if not len(active_goals_of(self._node)):
            return
        self._logger.error(f"The tree was not ticked for {self._cancel_sec:g} s. Canceling the goals.")
        for action in cancel(_TRYING_SEC):
            self._logger.error(
                f"The server of {action} has not ended the goal. The robot may still be moving."
            )

    def blocking_location(self) -> str:
        """Describe the blocking code: the blocking leaf with its source lines, or the line that the program is executing."""
        if (leaf := self.blocking_leaf()) is not None:
            return f"{behaviour_title(leaf)} blocks{source_locations(leaf, self._frames())}"
        place = thread_location(self._thread)
        return f"the program is executing {place}" if place else "the program does not spin the executor"

    def blocking_leaf(self) -> Behaviour | None:
        """Return the innermost behaviour whose method the ticking thread is executing; None for other code."""
        owners = (each.f_locals.get("self") for each, _ in self._frames())
        return next((each for each in owners if isinstance(each, Behaviour)), None)

    def _frames(self) -> list[tuple[FrameType, int]]:
        frame = sys._current_frames().get(self._thread)  # noqa: SLF001 - the only way to another thread's stack
        return list(traceback.walk_stack(frame)) if frame is not None else []
