"""Run a server as a command, or spin a node in the background."""

import faulthandler
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from threading import Thread
from typing import TYPE_CHECKING

from sar_compiler.commands import OK, CommandParser, add_version, run
from sar_compiler.ros.arguments import init_arguments, node_arguments, split_arguments
from sar_compiler.ros.middleware import require_middleware, ros_up
from sar_compiler.ros.signals import StopSignals

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node

# A signal is handled between two turns of the executor.
_TURN_SEC = 0.1
# On a busy machine, one destruction of a node in a hundred hangs in DDS, and blocks all other threads.
_TAKING_DOWN_SEC = 10.0

NodeFactory = Callable[["Context", list[str]], "Node"]
"""Creates the node in a context, with the node's own arguments."""


def server_parser(prog: str, description: str) -> CommandParser:
    """Return the parser of a server's command, which has only ROS arguments."""
    parser = CommandParser(
        prog,
        description,
        epilog="ROS arguments follow --ros-args: -p name:=value, -r from:=to, --params-file FILE. "
        "Ctrl-C or SIGTERM end it, with status 0.",
    )
    add_version(parser)
    return parser


def serve(make_node: NodeFactory, prog: str, description: str, argv: Sequence[str] | None = None) -> int:
    """Run a node as a command until SIGINT or SIGTERM.

    Args:
        make_node: Creates the node; it may import ROS, which has not been imported before.
        prog: The command's name.
        description: The description in `--help`.
        argv: The command line without the command, `--ros-args` included; by default the process's.

    Returns:
        0 once it was stopped, which is the normal end of a server; 2 for a wrong command
        line, or if ROS is not installed. If DDS does not release the node, the process exits after 10 s with
        status 1 and reports on standard error where it hung.
    """
    # Before any slow step, so that Ctrl-C ends the command cleanly from its first moment.
    signals = StopSignals()
    parser = server_parser(prog, description)
    split = split_arguments(sys.argv[1:] if argv is None else argv)
    parser.parse_args(split.own)
    try:
        return run(lambda: _run(make_node, split.ros, lambda: signals.came), prog)
    finally:
        signals.restore_handlers()


def _run(make_node: NodeFactory, ros: Sequence[str], stopped: Callable[[], bool]) -> int:
    require_middleware()
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    try:
        with ros_up(init_arguments(ros)) as context, suppress(ExternalShutdownException):
            node = make_node(context, node_arguments(ros))
            with SingleThreadedExecutor(context=context) as executor:
                executor.add_node(node)
                while context.ok() and not stopped():
                    executor.spin_once(timeout_sec=_TURN_SEC)
            faulthandler.dump_traceback_later(_TAKING_DOWN_SEC, exit=True)
            node.destroy_node()
    finally:
        faulthandler.cancel_dump_traceback_later()
    return OK


@contextmanager
def spinning_node(name: str) -> "Iterator[Node]":
    """Yield a node that is spun in a background thread."""
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    with ros_up([]) as context, SingleThreadedExecutor(context=context) as executor:
        node = Node(name, context=context, start_parameter_services=False)
        executor.add_node(node)
        thread = Thread(target=executor.spin, name=name, daemon=True)
        thread.start()
        try:
            yield node
        finally:
            executor.shutdown()
            thread.join()
            node.destroy_node()
