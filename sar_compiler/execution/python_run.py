"""A run of a mission, called from Python: from a test, a notebook, a program of your own."""

from collections.abc import Sequence
from contextlib import ExitStack

from sar_compiler.execution.run_options import RunOptions, RunOutcome
from sar_compiler.execution.run_setup import MakeExtension
from sar_compiler.ros.middleware import require_middleware
from sar_compiler.ros.signals import StopSignals
from sar_compiler.terminal import RunOutput


class _NoOutput(RunOutput):
    """Prints nothing: the caller has the result."""

    def show(self, text: str) -> None:
        """Ignore a text."""

    def draw(self, text: str) -> None:
        """Ignore what a terminal would obey."""

    def say(self, text: str) -> None:
        """Ignore a text."""


def run_mission(options: RunOptions, extensions: Sequence[MakeExtension] = ()) -> RunOutcome:
    """Run a mission in this process, and return its result; ROS logs as usual.

    Ctrl-C stops the run in order, and the result says so. Call it in the main thread.

    Args:
        options: The options; `sim` simulates the robot.
        extensions: Make further extensions of the run; the options bring the watch of properties and the guardian.

    Raises:
        TreeError: If the tree is not valid; the robot has not moved.
        SarError: If the mission, a parameter or the world is wrong, or the tree's requirements do not appear in time; the robot has
            not moved.
    """
    from sar_compiler.execution.extensions import guardian_of
    from sar_compiler.execution.mission_run import run_mission as run

    makes = [*extensions]
    if options.properties:
        from sar_compiler.execution.run_watch import RunWatch

        makes.insert(0, RunWatch)
    if options.guardian is not False:
        makes.append(guardian_of)
    require_middleware()
    signals = StopSignals()
    try:
        with ExitStack() as ros:
            return run(options, makes, signals, ros, [], _NoOutput(), lambda _: None)
    finally:
        signals.give_back()
