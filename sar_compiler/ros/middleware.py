"""The middleware that `RMW_IMPLEMENTATION` asks for: whether it is installed, before rcl ends the process over it."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from sar_compiler.errors import SarError

_VARIABLE = "RMW_IMPLEMENTATION"
_INDEX = Path("share", "ament_index", "resource_index", "rmw_typesupport")
# The package that loads the others; it registers itself among them.
_LOADER = "rmw_implementation"


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


def _installed() -> Iterator[str]:
    """Yield the middlewares that are registered where ROS is: in sourced workspaces, or in this environment."""
    for prefix in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        folder = Path(prefix) / _INDEX
        if prefix and folder.is_dir():
            yield from (path.name for path in folder.iterdir() if path.name != _LOADER)
