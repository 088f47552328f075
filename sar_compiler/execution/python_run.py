"""Run a mission from a Python program, such as a test or a notebook."""

from collections.abc import Sequence
from contextlib import ExitStack

from sar_compiler.execution.run_options import RunOptions, RunOutcome
from sar_compiler.execution.run_setup import MakeExtension
from sar_compiler.ros.middleware import require_middleware
from sar_compiler.ros.signals import StopSignals
from sar_compiler.terminal import RunOutput


class _NoOutput(RunOutput):
    """An output that prints nothing, because the caller receives the result of the run."""

    def print_momentary(self, text: str) -> None:
        """Ignore the text."""

    def draw(self, text: str) -> None:
        """Ignore the terminal control sequences."""

    def print_important(self, text: str) -> None:
        """Ignore the text."""


def run_mission(options: RunOptions, extensions: Sequence[MakeExtension] = ()) -> RunOutcome:
    """Run a mission in this process and return the outcome; only the log of ROS is printed.

    Ctrl-C stops the run gracefully, and the outcome reports this. Call this function in the main thread.

    Args:
        options: The options of the run, such as `sim` for a simulated robot.
        extensions: Functions that create further extensions of the run. The options add the property monitor and the guardian.

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
