"""A guardian: a small process of its own, which cancels the goals that a mission leaves behind when it dies.

A mission that is killed (SIGKILL, the kernel's own when memory is short, a crash) can cancel nothing, and a robot
drives on to its goal. The mission tells its guardian through a pipe which goals it sends and which have ended; the
system closes the pipe, however the mission ends, and the guardian then cancels, by their ids, those that have not,
and waits for their ends. A guardian that ends while its mission lives is replaced.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from sar_compiler.ros.companion import Companion
from sar_compiler.ros.leaves.goals import GoalNews, end_in_words, goals_under_way

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.compiler import CompiledTree
    from sar_compiler.ros.engine import Engine
    from sar_compiler.ros.left_goals import LeftGoal

ADRIFT_SIGN = b"!"
"""What a guardian writes to who supervises its mission where it has not seen the end of a goal."""

_SENT, _OVER = "+", "-"
# How long the guardian tries to have the goals ended, seconds.
_TRYING_SEC = 10.0
# How long a server must say that it does not know a goal: it may be accepted only after its client's death; seconds.
_UNKNOWN_SEC = 3.0
_TURN_SEC = 0.1
# How long an orderly end waits for the guardian's, seconds; one that still has goals to cancel needs no mission.
_ENDING_SEC = 1.0
# A guardian that has ended so many times, each within so many seconds of its beginning, cannot be had.
_ATTEMPTS, _BRIEF_SEC = 3, 10.0
# The program: its first statement keeps the current folder, from which `-c` would import, out of the way.
_PROGRAM = "import sys; sys.path[:] = {path!r}; from sar_compiler.ros.guardian import main; main({signs}, sys.argv[1:])"


class Guardian(Companion):
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

    def begin(self, tree: "CompiledTree", engine: "Engine") -> None:  # noqa: ARG002
        """Guard the goals of the mission's node."""
        goals_under_way(self._node).listen(self.note)

    def note(self, news: GoalNews) -> None:
        """Tell the guardian of a goal; never blocks."""
        with self._lock:
            if news.is_over:
                self._active.pop(news.goal_id, None)
            else:
                self._active[news.goal_id] = news.action
            self._write(_OVER if news.is_over else _SENT, news.goal_id, news.action)

    def end(self, *, has_begun: bool) -> None:  # noqa: ARG002
        """Let the guardian end; it first cancels what was not seen to end."""
        with self._lock:
            self._is_closing = True
            self._pipe.close()
        self._minder.join(_ENDING_SEC)

    def _start(self) -> None:
        signs = () if self._signs is None else (self._signs,)
        self._process = subprocess.Popen(  # noqa: S603 - this interpreter, and nothing from outside
            [sys.executable, "-c", _PROGRAM.format(path=sys.path, signs=signs), *self._security],
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

    def _write(self, sign: str, goal_id: str, action: str) -> None:
        with suppress(OSError, ValueError):  # one that has ended is replaced, and told of what is active then
            os.write(self._pipe.fileno(), f"{sign} {goal_id} {action}\n".encode())

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


def main(signs: Sequence[int], security: Sequence[str]) -> None:
    """Run the guardian of the process at the other end of standard input, until that ends.

    Args:
        signs: The descriptor of the pipe to who supervises the mission, if anybody does.
        security: ROS arguments.
    """
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    import rclpy
    from rclpy.context import Context
    from rclpy.node import Node
    from rclpy.signals import SignalHandlerOptions

    from sar_compiler.ros.middleware import leave

    context = Context()
    arguments = ["--ros-args", *security] if security else []
    rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
    name = f"sar_guardian_{os.getpid()}"
    node = Node(name, context=context, start_parameter_services=False, enable_rosout=False)
    if not _cancel(node, _goals_left(node, sys.stdin)):
        for descriptor in signs:
            os.write(descriptor, ADRIFT_SIGN)
    leave(0, node.destroy_node)


def _goals_left(node: "Node", lines: Iterable[str]) -> list["LeftGoal"]:
    """Track the goals to the end of the mission; return those that have not ended.

    Each is made as it is sent, so that it has found its server when that is needed.
    """
    from sar_compiler.ros.left_goals import LeftGoal

    def tell_end(action: str, status: int) -> None:
        words = f"the mission is gone: {action} was told to cancel its goal, which {end_in_words(status)}"
        node.get_logger().warning(words)

    active: dict[str, LeftGoal] = {}
    for line in lines:
        sign, goal_id, action = line.split()
        if sign == _OVER:
            active.pop(goal_id, None)
        else:
            goal = GoalNews(goal_id, action)
            active[goal_id] = LeftGoal(node, goal, partial(tell_end, action), _UNKNOWN_SEC)
    return [*active.values()]


def _cancel(node: "Node", left: Sequence["LeftGoal"]) -> bool:
    """Cancel what is left, until the ends are seen; return whether all were."""
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + _TRYING_SEC
    while (missing := [goal for goal in left if goal.missing()]) and time.monotonic() < deadline:
        executor.spin_once(_TURN_SEC)
    for goal in missing:
        node.get_logger().warning(
            f"the mission is gone, and {goal.action} does not end its goal: the robot may still be moving"
        )
    return not missing
