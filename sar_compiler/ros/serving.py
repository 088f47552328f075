"""Run a server node as a command, or spin a node in a background thread."""

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

# Maximum duration of a turn of the executor, in seconds. Signals are handled between two turns.
_TURN_SEC = 0.1
# Maximum time to destroy the node, in seconds. On a busy machine, about one in a hundred destructions hangs in DDS and blocks all other threads.
_DESTRUCTION_SEC = 10.0

NodeFactory = Callable[["Context", list[str]], "Node"]
"""Creates a node, given its context and its own ROS arguments."""


def server_parser(prog: str, description: str) -> CommandParser:
    """Create the argument parser of a server command. Such a command has only ROS arguments."""
    parser = CommandParser(
        prog,
        description,
        epilog="ROS arguments follow --ros-args: -p name:=value, -r from:=to, --params-file FILE. "
        "Ctrl-C or SIGTERM stops the server, with status 0.",
    )
    add_version(parser)
    return parser


def serve(make_node: NodeFactory, prog: str, description: str, argv: Sequence[str] | None = None) -> int:
    """Run a node as a command until SIGINT or SIGTERM arrives.

    Args:
        make_node: Creates the node. This function should import the ROS modules itself, so that signals are handled during the import.
        prog: The command's name.
        description: The description in `--help`.
        argv: The command line without the command, including `--ros-args`; by default the command line of the process.

    Returns:
        The exit status: 0 after a signal, 2 if the command line is wrong or ROS is not installed. If DDS does not destroy the node, the process
        exits after 10 s with status 1, and prints the blocking location on standard error.
    """
    # The signal handlers are installed before slow steps, so that Ctrl-C always ends the command cleanly.
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
            faulthandler.dump_traceback_later(_DESTRUCTION_SEC, exit=True)
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
