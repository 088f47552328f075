"""A process that cancels the goals of a crashed or blocked mission.

A mission that is killed (by SIGKILL, for lack of memory, by a crash) cannot cancel its goals, so the robot would continue to
its goal. The mission therefore reports through a pipe which goals it has sent and which goals have ended, and forwards the
heartbeats of the thread that ticks the tree. However the mission ends, the operating system closes the pipe. The guardian then cancels the
active goals by their IDs and waits until they have ended. The guardian does the same when the heartbeats stop: `ros.tick_watch` handles
this case within the mission's process, but a leaf that holds Python's interpreter lock also blocks `ros.tick_watch`. If the guardian ends
before the mission, the mission starts a new guardian.
"""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING

from sar_compiler.helper_process import helper_command
from sar_compiler.process_end import is_program_file
from sar_compiler.ros.heartbeats import REPORT_SEC, Heartbeat, heartbeats
from sar_compiler.ros.leaves.goals import GoalEvent, active_goals_of, end_in_words
from sar_compiler.ros.run_extension import RunExtension

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.compiler import CompiledTree
    from sar_compiler.ros.engine import Engine
    from sar_compiler.ros.orphaned_goals import OrphanedGoal

MAY_MOVE_SIGN = b"!"
"""The guardian's message to the mission's supervisor that the end of a goal was not observed."""

# The first characters of the lines to the guardian: a goal was sent, a goal has ended, a heartbeat.
_SENT, _OVER, _BEAT = "+", "-", "."
_GONE = "the mission's process has ended"
# Additional time in which the mission can handle a blocked tick itself, in seconds.
_GRACE_SEC = 2.0
# Maximum time for which the guardian tries to end the goals, in seconds.
_TRYING_SEC = 10.0
# Interval of the checks for heartbeats, in seconds. If a check takes longer than the second value, this process itself was suspended.
_LOOK_SEC, _OWN_PAUSE_SEC = 0.25, 1.0
# Maximum time for which the end of a run waits for the guardian, in seconds. The guardian can cancel goals without the mission.
_ENDING_SEC = 1.0
# If the guardian has ended this many times in a row, each time within this many seconds of its start, it is not replaced again.
_ATTEMPTS, _BRIEF_SEC = 3, 10.0


class Guardian(RunExtension):
    """Starts the guardian of this process, and sends the mission's goals and heartbeats to the guardian.

    Args:
        node: The mission's node.
        security: The ROS arguments for SROS 2 (`--enclave`), which the guardian's node also needs.
        signs: The file descriptor of the pipe to the mission's supervisor; None without a supervisor.
    """

    def __init__(self, node: "Node", security: Sequence[str], signs: int | None = None) -> None:
        self._node, self._security, self._signs = node, security, signs
        self._complain = node.get_logger().warning
        self._active: dict[str, str] = {}
        self._brief = 0
        self._is_closing = False
        self._lock = threading.Lock()
        self._start()

    def on_compiled(self, tree: "CompiledTree", engine: "Engine") -> None:  # noqa: ARG002
        """Guard the goals of the mission's node."""
        self.guard_goals()

    def guard_goals(self) -> None:
        """Report the node's goals and heartbeats to the guardian from now on."""
        active_goals_of(self._node).add_listener(self.report_goal)
        heartbeats(self._node).add_listener(self.forward_heartbeat)

    def report_goal(self, news: GoalEvent) -> None:
        """Report that a goal was sent or has ended. This method never blocks."""
        with self._lock:
            if news.is_over:
                self._active.pop(news.goal_id, None)
            else:
                self._active[news.goal_id] = news.action
            self._write(_OVER if news.is_over else _SENT, news.goal_id, news.action)

    def forward_heartbeat(self, beat: Heartbeat) -> None:
        """Forward a heartbeat to the guardian. This method never blocks, and any thread may call it."""
        with self._lock:
            self._write(_BEAT, json.dumps(beat))

    def on_end(self, *, has_begun: bool) -> None:  # noqa: ARG002
        """Request the end of the guardian, which first cancels the goals that are still active."""
        with self._lock:
            self._is_closing = True
            self._pipe.close()
        self._minder.join(_ENDING_SEC)

    def _start(self) -> None:
        signs = () if self._signs is None else (self._signs,)
        self._process = subprocess.Popen(  # noqa: S603 - this interpreter, and nothing from outside
            helper_command(__name__, main.__name__, ",".join(map(str, signs)), *self._security),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            # Otherwise Ctrl-C, or the end of the terminal, would also end the guardian.
            start_new_session=True,
            bufsize=0,
            pass_fds=signs,
        )
        assert self._process.stdin is not None  # noqa: S101 - asked for
        self._pipe = self._process.stdin
        os.set_blocking(self._pipe.fileno(), False)
        for goal_id, action in self._active.items():
            self._write(_SENT, goal_id, action)
        self._minder = threading.Thread(target=self._wait_for_end, name="guardian", daemon=True)
        self._minder.start()

    def _write(self, *words: str) -> None:
        with suppress(OSError, ValueError):  # the guardian's replacement receives the active goals
            os.write(self._pipe.fileno(), f"{' '.join(words)}\n".encode())

    def _wait_for_end(self) -> None:
        """Wait until the guardian ends, and start a new guardian if the mission did not request the end."""
        began = time.monotonic()
        status = self._process.wait()
        with self._lock:
            if self._is_closing:
                return
            self._pipe.close()
            self._brief = self._brief + 1 if time.monotonic() - began < _BRIEF_SEC else 0
            how = f"by {signal.Signals(-status).name}" if status < 0 else f"with status {status}"
            if self._brief < _ATTEMPTS:
                self._start()
                self._complain(
                    f"the guardian process has ended unexpectedly ({how}). A new guardian is started"
                )
            else:
                self._complain(
                    f"the guardian process has ended again ({how}). No new guardian is started. Goals are no longer canceled if this "
                    f"process crashes"
                )


def main() -> None:
    """Guard the goals of the mission that writes to this process's standard input, until the mission ends.

    The command-line arguments are the file descriptor of the pipe to the mission's supervisor (empty without a supervisor), and ROS arguments.
    """
    signs, *security = sys.argv[1:]
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    from sar_compiler.process_end import end_process
    from sar_compiler.ros.orphaned_goals import Canceller

    node = Canceller(f"sar_guardian_{os.getpid()}", security).node
    goals = _GuardedGoals(node)
    goals.follow(sys.stdin)
    if not goals.cancel(_GONE) and signs:
        os.write(int(signs), MAY_MOVE_SIGN)
    end_process(0, node.destroy_node)


class _GuardedGoals:
    """The goals that a mission has reported to its guardian.

    Args:
        node: The guardian's node.
    """

    def __init__(self, node: "Node") -> None:
        self._node = node
        self._active: dict[str, OrphanedGoal] = {}
        self._beat = Heartbeat()
        self._heard_at = 0.0
        self._is_reported = self._is_canceled = False
        self._why = ""

    def follow(self, lines: Iterable[str]) -> None:
        """Process the mission's lines until the mission ends; cancel the goals when the heartbeats stop."""
        received: SimpleQueue[str] = SimpleQueue()
        Thread(target=_forward_lines, args=(lines, received), name="mission", daemon=True).start()
        while True:
            checked_at = time.monotonic()
            try:
                line = received.get(timeout=_LOOK_SEC)
            except Empty:
                line = None
            if time.monotonic() - checked_at > _OWN_PAUSE_SEC:  # the mission may also have been suspended
                self._heard_at = time.monotonic()
            if line == _END:
                return
            if line is not None:
                self._handle_line(line)
            elif self._beat.limit_sec is not None:
                self._check_heartbeats(self._beat.limit_sec, time.monotonic() - self._heard_at - _GRACE_SEC)

    def _handle_line(self, line: str) -> None:
        sign, _, words = line.partition(" ")
        if sign == _BEAT:
            self._on_heartbeat(Heartbeat(*json.loads(words)))
        elif sign == _OVER:
            self._active.pop(words.split()[0], None)
        else:
            goal_id, action = words.split()
            self._add(GoalEvent(goal_id, action))

    def _on_heartbeat(self, beat: Heartbeat) -> None:
        if beat.is_reported:
            self._is_reported = True
            return
        self._beat, self._heard_at = beat, time.monotonic()
        self._is_reported = self._is_canceled = False

    def _add(self, goal: GoalEvent) -> None:
        """Store a goal as soon as it is sent, so that its server is discovered before the goal must be canceled."""
        from sar_compiler.ros.orphaned_goals import UNKNOWN_SEC, OrphanedGoal

        def report_end(status: int) -> None:
            words = f"the server of {goal.action} was requested to cancel the goal. The goal {end_in_words(status)}"
            self._node.get_logger().warning(f"{self._why}: {words}")

        self._active[goal.goal_id] = OrphanedGoal(
            self._node, goal, on_end=report_end, patience_sec=UNKNOWN_SEC
        )

    def _check_heartbeats(self, limit_sec: float, silent_sec: float) -> None:
        """Log missing heartbeats, and cancel the goals of a blocked mission, even if the mission may tick again later."""
        if silent_sec > REPORT_SEC and not self._is_reported:
            self._is_reported = True
            place = source_line_in_stack(self._beat)
            self._node.get_logger().error(
                f"the tree was not ticked for {silent_sec + _GRACE_SEC:.0f} s, and the mission cannot report this itself. "
                f"The mission is blocked in {place}"
            )
        if silent_sec > limit_sec and not self._is_canceled:
            self._is_canceled = True
            self.cancel(f"the tree was not ticked for {silent_sec + _GRACE_SEC:.0f} s")

    def cancel(self, why: str) -> bool:
        """Cancel the active goals and wait for them to end; return whether the ends of all goals were observed.

        Args:
            why: The reason, which is logged.
        """
        from sar_compiler.ros.orphaned_goals import cancel_goals

        self._why = why
        active = cancel_goals([*self._active.values()], self._node, _TRYING_SEC)
        for goal in active:
            words = f"and the server of {goal.action} has not ended the goal. The robot may still be moving"
            self._node.get_logger().warning(f"{why}, {words}")
        return not active


def source_line_in_stack(beat: Heartbeat) -> str:
    """Return the source line that the ticking thread executes.

    The line is read from the stacks that Python's fault handler has written.

    Args:
        beat: The last heartbeat, which names the file with the stacks of all threads.
    """
    try:
        stacks = Path(beat.stack).read_text(encoding="utf-8", errors="replace")
    except OSError:  # the process belongs to another user, or has just ended
        return "an unreadable location"
    _, _, stack = stacks.partition(f"{beat.thread:x} (most recent call first):")
    for file, line, function in re.findall(r'^  File "(.+)", line (\d+) in (.+)$', stack, re.MULTILINE):
        if is_program_file(file):
            return f"{file}:{line}, in {function}"
    return "native code"


# The queue's last entry, after the last line.
_END = ""


def _forward_lines(lines: Iterable[str], queue: "SimpleQueue[str]") -> None:
    for line in lines:
        queue.put(line)
    queue.put(_END)
