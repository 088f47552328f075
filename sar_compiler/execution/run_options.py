"""The options and the outcome of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sar_compiler.execution.supervision import Supervision
from sar_compiler.execution.until import Until
from sar_compiler.project.command_line_settings import CommandLineSettings


@dataclass(frozen=True)
class RunOptions:
    """The options of a run, corresponding to those of `sar-run`.

    Attributes:
        tree: The tree file, or the name of a shipped tree.
        tree_id: The ID of the tree in the file; by default the main tree.
        additions: The name of the mission, and leaves, palettes and folders to use in addition to those in the project's configuration.
        params: A ROS 2 parameter file; by default the mission's default file.
        ros: ROS arguments, as after `--ros-args`, such as `["-p", "tick_rate_hz:=5.0"]`.
        until: The condition that ends the run. By default, a mission with its own end condition ends when it is complete in a
            simulation, and never on a robot. Other runs end with the tree's root.
        sim: The world to simulate, as a file or the name of a shipped world; None for an existing robot.
        speed: The maximum number of simulated seconds per second.
        seed: The seed of the simulation's noise.
        like: The driving model of the simulated Nav2: `quick` or `nav2`.
        fault: Faults to inject into the simulation, such as `["navigate_to_pose:reject=1"]`.
        stepped: Whether the simulated world and the mission take turns in one thread, as fast as possible.
        check: Whether to wait for the mission's requirements and plan its route, and then end without moving the robot.
        journal: The journal's path; by default derived from the node's name, for a mission that can be resumed.
        no_journal: Whether to write no journal.
        resume: Whether to resume the mission in the journal.
        new: Whether to start over and keep an unfinished journal under another name.
        keeps_journal: Whether to write a journal even for a mission that cannot be resumed.
        approved: Whether the tree must be exactly the version that a person approved.
        properties: A file of properties to monitor, or True for the mission's default properties.
        guardian: Whether another process cancels the goals if this process crashes. By default only on a robot, if a journal is written.
        engine: The engine that ticks the tree: `own` or `py_trees_ros`.
        executor: The executor of the mission's node: `events` or `single-threaded`.
        traceback: Whether tracebacks of leaves are logged.
        supervision: The connection to the supervisor of this process, if there is one.
        command: The words of the command line that can resume the mission; empty if another program starts the run.
    """

    tree: str
    tree_id: str | None = None
    additions: CommandLineSettings = field(default_factory=CommandLineSettings)
    params: Path | None = None
    ros: Sequence[str] = ()
    until: Until | None = None
    sim: str | None = None
    speed: float = 1.0
    seed: int = 0
    like: str = "quick"
    fault: Sequence[str] = ()
    stepped: bool = False
    check: bool = False
    journal: Path | None = None
    no_journal: bool = False
    resume: bool = False
    new: bool = False
    keeps_journal: bool = False
    approved: bool = False
    properties: Path | bool | None = None
    guardian: bool | None = None
    engine: str = "own"
    executor: str = "events"
    traceback: bool = False
    supervision: Supervision = field(default_factory=Supervision)
    command: Sequence[str] = ()


@dataclass(frozen=True)
class RunOutcome:
    """The outcome of a run.

    Attributes:
        status: The exit status of `sar-run`: 0 if the run achieved its goal.
        reason: Why the run failed; empty if the run succeeded or a signal stopped it.
        duration_sec: Time from the first to the last tick, in seconds of the node's clock.
        ticks: The number of ticks.
        figures: The mission's figures by name.
        verdicts: The verdict of each monitored property by name; None without monitoring.
        deaths: How earlier processes of a supervised run ended; None without a supervisor.
        head: The last hash of the journal's hash chain; empty without a journal.
        summary: The paragraphs of the run's summary.
        hint: A sentence with the command that replays a simulated run; empty for other runs.
        cause: The most likely cause of a failure on one line; empty if no cause is known.
        messages: Further messages about the end of the run.
    """

    status: int
    reason: str = ""
    duration_sec: float = 0.0
    ticks: int = 0
    figures: Mapping[str, object] = field(default_factory=dict)
    verdicts: Mapping[str, str] | None = None
    deaths: Sequence[str] | None = None
    head: str = ""
    summary: Sequence[str] = ()
    hint: str = ""
    cause: str = ""
    messages: Sequence[str] = ()
