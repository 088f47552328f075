"""A guardian: a small process of its own, which cancels the goals of a mission that dies or whose ticks stop.

A mission that is killed (SIGKILL, the kernel's own when memory is short, a crash) can cancel nothing, and a robot
drives on to its goal. The mission reports to its guardian through a pipe which goals it sends, which have ended, and a heartbeat
of the thread that ticks the tree; the system closes the pipe, however the mission ends, and the guardian then cancels, by their
ids, those that have not, and waits for their ends. It does the same when heartbeats stop: `ros.tick_watch` does so within the
process, but a leaf that keeps Python's interpreter lock stops that as well. A guardian that ends while its mission lives is replaced.
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
from sar_compiler.process_end import is_of_program
from sar_compiler.ros.heartbeats import REPORT_SEC, Heartbeat, heartbeats
from sar_compiler.ros.leaves.goals import GoalNews, end_in_words, goals_under_way
from sar_compiler.ros.run_extension import RunExtension

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.compiler import CompiledTree
    from sar_compiler.ros.engine import Engine
    from sar_compiler.ros.left_goals import LeftGoal

ADRIFT_SIGN = b"!"
"""What a guardian writes to who supervises its mission where it has not seen the end of a goal."""

# The first word of a line: a goal is sent, has ended; a heartbeat.
_SENT, _OVER, _BEAT = "+", "-", "."
_GONE = "the mission is gone"
# What a mission has to do itself where its ticks stop, it is given this much longer for, seconds.
_GRACE_SEC = 2.0
# How long the guardian tries to have the goals ended, seconds.
_TRYING_SEC = 10.0
# How often heartbeats are looked for, seconds; a look that comes later by as much as the other was this process's own standstill.
_LOOK_SEC, _OWN_PAUSE_SEC = 0.25, 1.0
# How long an orderly end waits for the guardian's, seconds; one that still has goals to cancel needs no mission.
_ENDING_SEC = 1.0
# A guardian that has ended so many times, each within so many seconds of its beginning, cannot be had.
_ATTEMPTS, _BRIEF_SEC = 3, 10.0


class Guardian(RunExtension):
    """The guardian of this process, from the mission's side.

    Args:
        node: The mission's node.
        security: The ROS arguments that a second participant of this mission needs (`--enclave`).
        signs: The descriptor of the pipe to who supervises the mission; None if nobody does.
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
        self.listen()

    def listen(self) -> None:
        """Guard the goals of the node from here on."""
        goals_under_way(self._node).listen(self.note)
        heartbeats(self._node).listen(self.take_heartbeat)

    def note(self, news: GoalNews) -> None:
        """Tell the guardian of a goal; never blocks."""
        with self._lock:
            if news.is_over:
                self._active.pop(news.goal_id, None)
            else:
                self._active[news.goal_id] = news.action
            self._write(_OVER if news.is_over else _SENT, news.goal_id, news.action)

    def take_heartbeat(self, beat: Heartbeat) -> None:
        """Pass a heartbeat on; never blocks, and may be called from any thread."""
        with self._lock:
            self._write(_BEAT, json.dumps(beat))

    def on_end(self, *, has_begun: bool) -> None:  # noqa: ARG002
        """Let the guardian end; it first cancels what was not seen to end."""
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
            # Ctrl-C, and the end of a terminal, are for whole groups of processes.
            start_new_session=True,
            bufsize=0,
            pass_fds=signs,
        )
        assert self._process.stdin is not None  # noqa: S101 - asked for
        self._pipe = self._process.stdin
        os.set_blocking(self._pipe.fileno(), False)
        for goal_id, action in self._active.items():
            self._write(_SENT, goal_id, action)
        self._minder = threading.Thread(target=self._mind, name="guardian", daemon=True)
        self._minder.start()

    def _write(self, *words: str) -> None:
        with suppress(OSError, ValueError):  # one that has ended is replaced, and told of what is active then
            os.write(self._pipe.fileno(), f"{' '.join(words)}\n".encode())

    def _mind(self) -> None:
        """Wait for the guardian's end; where the mission has not asked for it, begin another one."""
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
                self._complain(f"the guardian has ended, {how}: another one takes its place")
            else:
                self._complain(
                    f"the guardian is gone ({how}): nobody cancels the goals of a mission that dies"
                )


def main() -> None:
    """Run the guardian of the process at the other end of standard input, until that ends.

    Its arguments are the descriptor of the pipe to who supervises the mission, empty if nobody does, and ROS arguments.
    """
    signs, *security = sys.argv[1:]
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    from sar_compiler.process_end import end_process
    from sar_compiler.ros.left_goals import Canceller

    node = Canceller(f"sar_guardian_{os.getpid()}", security).node
    wards = _Wards(node)
    wards.follow(sys.stdin)
    if not wards.cancel(_GONE) and signs:
        os.write(int(signs), ADRIFT_SIGN)
    end_process(0, node.destroy_node)


class _Wards:
    """The goals of a mission as its guardian knows them.

    Args:
        node: The guardian's node.
    """

    def __init__(self, node: "Node") -> None:
        self._node = node
        self._active: dict[str, LeftGoal] = {}
        self._beat = Heartbeat()
        self._heard_at = 0.0
        self._is_reported = self._is_canceled = False
        self._why = ""

    def follow(self, lines: Iterable[str]) -> None:
        """Track the goals to the end of the mission; cancel them when its heartbeats stop."""
        came: SimpleQueue[str] = SimpleQueue()
        Thread(target=_pass_on, args=(lines, came), name="mission", daemon=True).start()
        while True:
            looked_at = time.monotonic()
            try:
                line = came.get(timeout=_LOOK_SEC)
            except Empty:
                line = None
            if time.monotonic() - looked_at > _OWN_PAUSE_SEC:  # the mission has perhaps not run either
                self._heard_at = time.monotonic()
            if line == _END:
                return
            if line is not None:
                self._take(line)
            elif self._beat.limit_sec is not None:
                self._look(self._beat.limit_sec, time.monotonic() - self._heard_at - _GRACE_SEC)

    def _take(self, line: str) -> None:
        sign, _, words = line.partition(" ")
        if sign == _BEAT:
            self._take_heartbeat(Heartbeat(*json.loads(words)))
        elif sign == _OVER:
            self._active.pop(words.split()[0], None)
        else:
            goal_id, action = words.split()
            self._add(GoalNews(goal_id, action))

    def _take_heartbeat(self, beat: Heartbeat) -> None:
        if beat.is_reported:
            self._is_reported = True
            return
        self._beat, self._heard_at = beat, time.monotonic()
        self._is_reported = self._is_canceled = False

    def _add(self, goal: GoalNews) -> None:
        """Take a goal as it is sent, so that its server is found when it has to be canceled."""
        from sar_compiler.ros.left_goals import UNKNOWN_SEC, LeftGoal

        def report_end(status: int) -> None:
            words = f"{goal.action} was told to cancel its goal, which {end_in_words(status)}"
            self._node.get_logger().warning(f"{self._why}: {words}")

        self._active[goal.goal_id] = LeftGoal(self._node, goal, on_end=report_end, patience_sec=UNKNOWN_SEC)

    def _look(self, limit_sec: float, silent_sec: float) -> None:
        """Do what the mission itself does where its ticks stop, if it cannot: report it, and cancel the goals; it may tick again later."""
        if silent_sec > REPORT_SEC and not self._is_reported:
            self._is_reported = True
            place = place_in_stack(self._beat)
            self._node.get_logger().error(
                f"nothing was ticked for {silent_sec + _GRACE_SEC:.0f} s, and the mission itself cannot report it: it is in {place}"
            )
        if silent_sec > limit_sec and not self._is_canceled:
            self._is_canceled = True
            self.cancel(f"nothing was ticked for {silent_sec + _GRACE_SEC:.0f} s")

    def cancel(self, why: str) -> bool:
        """Cancel what is active, until the ends are seen; return whether all were.

        Args:
            why: What the log says of the reason.
        """
        from sar_compiler.ros.left_goals import cancel_goals

        self._why = why
        active = cancel_goals([*self._active.values()], self._node, _TRYING_SEC)
        for goal in active:
            words = f"and {goal.action} does not end its goal: the robot may still be moving"
            self._node.get_logger().warning(f"{why}, {words}")
        return not active


def place_in_stack(beat: Heartbeat) -> str:
    """Return the line of a program in which a thread is, by what Python's fault handler has written of it.

    Args:
        beat: The last heartbeat, which says where the stacks are.
    """
    try:
        stacks = Path(beat.stack).read_text(encoding="utf-8", errors="replace")
    except OSError:  # another user's process, or it has just ended
        return "a place that cannot be read"
    _, _, stack = stacks.partition(f"{beat.thread:x} (most recent call first):")
    for file, line, function in re.findall(r'^  File "(.+)", line (\d+) in (.+)$', stack, re.MULTILINE):
        if is_of_program(file):
            return f"{file}:{line}, in {function}"
    return "native code"


# What comes after the last line.
_END = ""


def _pass_on(lines: Iterable[str], queue: "SimpleQueue[str]") -> None:
    for line in lines:
        queue.put(line)
    queue.put(_END)
