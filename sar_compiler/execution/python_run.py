"""Running a mission from Python: from a test, a notebook, or another program."""

from collections.abc import Sequence
from contextlib import ExitStack

from sar_compiler.execution.run_options import RunOptions, RunOutcome
from sar_compiler.execution.run_setup import MakeExtension
from sar_compiler.ros.middleware import require_middleware
from sar_compiler.ros.signals import StopSignals
from sar_compiler.terminal import RunOutput


class _NoOutput(RunOutput):
    """Prints nothing, because the caller receives the result."""

    def print_momentary(self, text: str) -> None:
        """Ignore a text."""

    def draw(self, text: str) -> None:
        """Ignore terminal control sequences."""

    def print_important(self, text: str) -> None:
        """Ignore a text."""


def run_mission(options: RunOptions, extensions: Sequence[MakeExtension] = ()) -> RunOutcome:
    """Run a mission in this process, and return its result; ROS logs as usual.

    Ctrl-C stops the run gracefully, and the result reports it. Call this function in the main thread.

    Args:
        options: The options; `sim` simulates the robot.
        extensions: Create further extensions of the run; the options add the property monitor and the guardian.

    Raises:
        TreeError: If the tree is not valid; the robot has not moved.
        SarError: If the mission, a parameter or the world is wrong, or the tree's requirements do not appear in time; the robot has
            not moved.
    """
    from sar_compiler.execution.extensions import guardian_of
    from sar_compiler.execution.mission_run import run_mission as run

    makes = [*extensions]
    if options.properties:
        from sar_compiler.execution.run_watch import PropertyWatch

        makes.insert(0, PropertyWatch)
    if options.guardian is not False:
        makes.append(guardian_of)
    require_middleware()
    signals = StopSignals()
    try:
        with ExitStack() as ros:
            return run(options, makes, signals, ros, [], _NoOutput(), lambda _: None)
    finally:
        signals.restore_handlers()
