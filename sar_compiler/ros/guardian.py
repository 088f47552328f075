"""A guardian: a small process of its own, which cancels the goals that a mission leaves behind when it dies.

A mission that is killed (SIGKILL, the kernel's own when memory is short, a crash) can cancel nothing, and a robot
drives on to its goal. The mission tells its guardian through a pipe which goals it sends and which have ended; the
system closes the pipe, however the mission ends, and the guardian then cancels, by their ids, those that have not.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.leaves.goals_under_way import GoalNews

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.executors import Executor
    from rclpy.node import Node

_SENT, _OVER = "+", "-"
# How long the guardian tries to reach a server, seconds; a goal may be accepted only after its client's death.
_TRYING_SEC = 10.0
_AGAIN_EVERY_SEC = 0.5
_ANSWER_SEC = 2.0
# How long an orderly end waits for the guardian's, seconds; one that still has goals to cancel needs no mission.
_ENDING_SEC = 1.0
# The program: its first statement keeps the current folder, from which `-c` would import, out of the way.
_PROGRAM = (
    "import sys; sys.path[:] = {path!r}; from sar_compiler.ros.guardian import main; main(sys.argv[1:])"
)


class Guardian:
    """The guardian of this process, from the mission's side.

    Args:
        security: The ROS arguments that a second participant of this mission needs (`--enclave`).
        complain: Called once, with a message, if the guardian is gone.
    """

    def __init__(self, security: Sequence[str], complain: "Callable[[str], None]") -> None:
        self._complain = complain
        self._is_lost = False
        self._process = subprocess.Popen(  # noqa: S603 - this interpreter, and nothing from outside
            [sys.executable, "-c", _PROGRAM.format(path=sys.path), *security],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            # Ctrl-C, and the end of a terminal, are for whole groups of processes.
            start_new_session=True,
            bufsize=0,
        )
        assert self._process.stdin is not None  # noqa: S101 - asked for
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)

    def note(self, news: GoalNews) -> None:
        """Tell the guardian of a goal; never blocks."""
        line = f"{_OVER if news.is_over else _SENT} {news.goal_id} {news.canceller}\n"
        try:
            os.write(self._pipe, line.encode())
        except OSError as error:
            if not self._is_lost:
                self._is_lost = True
                self._complain(
                    f"the guardian is gone ({error.strerror}): nobody cancels the goals of a mission that dies"
                )

    def close(self) -> None:
        """Let the guardian end; it first cancels what was not seen to end."""
        assert self._process.stdin is not None  # noqa: S101 - asked for
        self._process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_ENDING_SEC)


def main(security: Sequence[str]) -> None:
    """Be the guardian of the process at the other end of standard input, until that ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    import rclpy
    from rclpy.context import Context
    from rclpy.node import Node
    from rclpy.signals import SignalHandlerOptions

    context = Context()
    arguments = ["--ros-args", *security] if security else []
    rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
    name = f"sar_guardian_{os.getpid()}"
    node = Node(name, context=context, start_parameter_services=False, enable_rosout=False)
    cancels = _Cancels(node)
    cancels.follow(sys.stdin)
    cancels.send()
    # Nothing is left to tidy up, and what DDS does at the end may take long.
    sys.stderr.flush()
    os._exit(0)


class _Cancels:
    """The goals that may have to be cancelled, and the means."""

    def __init__(self, node: "Node") -> None:
        self._node = node
        self._active: dict[str, str] = {}
        # Made with the first goal of an action, so that it has found the server when it is needed.
        self._clients: dict[str, Any] = {}

    def follow(self, lines: Iterable[str]) -> None:
        """Keep count of the goals, to the end of the mission."""
        from action_msgs.srv import CancelGoal

        for line in lines:
            sign, goal_id, canceller = line.split()
            if sign == _OVER:
                self._active.pop(goal_id, None)
                continue
            self._active[goal_id] = canceller
            if canceller not in self._clients:
                self._clients[canceller] = self._node.create_client(CancelGoal, canceller)

    def send(self) -> None:
        """Cancel what is active: again, until a server has answered that it does, or that the goal has ended."""
        from rclpy.executors import SingleThreadedExecutor

        executor = SingleThreadedExecutor(context=self._node.context)
        deadline = time.monotonic() + _TRYING_SEC
        while self._active and time.monotonic() < deadline:
            for goal_id, canceller in list(self._active.items()):
                if news := self._cancel(goal_id, self._clients[canceller], executor):
                    del self._active[goal_id]
                    self._say(f"the mission is gone: {_action(canceller)} {news}")
            if self._active:
                time.sleep(_AGAIN_EVERY_SEC)
        for canceller in self._active.values():
            self._say(
                f"the mission is gone, and {_action(canceller)} does not cancel its goal: the robot may still be moving"
            )

    def _cancel(self, goal_id: str, client: Any, executor: "Executor") -> str:
        """Ask a server to cancel a goal; return what it says where it does, or the goal has ended, else an empty text."""
        from action_msgs.srv import CancelGoal

        if not client.wait_for_service(_AGAIN_EVERY_SEC):
            return ""
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(bytes.fromhex(goal_id))
        answer = client.call_async(request)
        executor.add_node(self._node)
        executor.spin_until_future_complete(answer, _ANSWER_SEC)
        executor.remove_node(self._node)
        if not answer.done():
            client.remove_pending_request(answer)
            return ""
        response = answer.result()
        if response.goals_canceling:
            return "was told to cancel its goal, and does"
        # Of a goal that it does not know yet it may learn in a moment.
        return "has ended its goal" if response.return_code == response.ERROR_GOAL_TERMINATED else ""

    def _say(self, text: str) -> None:
        self._node.get_logger().warning(text)


def _action(canceller: str) -> str:
    return canceller.removesuffix("/_action/cancel_goal")
