"""ROS, up for a while; and whether the middleware that `RMW_IMPLEMENTATION` asks for is installed.

That is looked at before rcl ends the process over it.
"""

import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from rclpy.context import Context

_VARIABLE = "RMW_IMPLEMENTATION"
_INDEX = Path("share", "ament_index", "resource_index", "rmw_typesupport")
# The package that loads the others; it registers itself among them.
_LOADER = "rmw_implementation"
# What rclpy says when a client is being taken down while it is answered; the client has a deadline of its own.
_UNHEARD = r"failed to send response \(timeout\)"


class MiddlewareError(SarError):
    """The middleware that is asked for is not installed."""


def require_middleware() -> None:
    """See that the middleware of `RMW_IMPLEMENTATION` is installed; to be called before rclpy is imported.

    Where nothing says what is installed, rcl decides.

    Raises:
        MiddlewareError: If it is not; names those that are.
    """
    wanted, installed = os.environ.get(_VARIABLE, ""), sorted(set(_installed()))
    if not wanted or not installed or wanted in installed:
        return
    message = (
        f"{_VARIABLE} is '{wanted}', which is not installed; there is {', '.join(installed)}: "
        f"unset {_VARIABLE}, or install it (on a robot: sudo apt install ros-jazzy-{wanted.replace('_', '-')})"
    )
    raise MiddlewareError(message)


@contextmanager
def ros_up(arguments: Sequence[str]) -> "Iterator[Context]":
    """Initialise ROS in a context of its own, and shut that down in the end; what killed processes have left is removed before.

    Signals are left to the caller: rclpy's handlers would take ROS down before a goal in flight could be cancelled.
    Meanwhile rclpy does not warn of an answer that its client does not hear, because it has just been taken down.

    Args:
        arguments: Those of `rclpy.init`.
    """
    import rclpy
    from rclpy.context import Context
    from rclpy.signals import SignalHandlerOptions

    from sar_compiler.ros.errors import readable_ros_errors
    from sar_compiler.ros.shared_memory import remove_what_the_dead_left

    remove_what_the_dead_left()
    context = Context()
    try:
        with readable_ros_errors():
            rclpy.init(args=list(arguments), context=context, signal_handler_options=SignalHandlerOptions.NO)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", _UNHEARD, RuntimeWarning)
            yield context
    finally:
        context.try_shutdown()


def _installed() -> Iterator[str]:
    """Yield the middlewares that are registered where ROS is: in sourced workspaces, or in this environment."""
    for prefix in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        folder = Path(prefix) / _INDEX
        if prefix and folder.is_dir():
            yield from (path.name for path in folder.iterdir() if path.name != _LOADER)
