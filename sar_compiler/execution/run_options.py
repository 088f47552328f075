"""The options of a run, and what has become of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sar_compiler.execution.supervision import Supervision
from sar_compiler.execution.until import Until
from sar_compiler.project.additions import Additions


@dataclass(frozen=True)
class RunOptions:
    """The options of a run, as those of `sar-run`.

    Attributes:
        tree: The tree file, or the name of a shipped tree.
        tree_id: The tree in the file; by default the one that the file executes.
        additions: Leaves, palettes and folders besides those of the project's configuration; the name of the mission.
        params: A ROS 2 parameter file; by default the mission's own.
        ros: ROS arguments, as after `--ros-args`: `["-p", "tick_rate_hz:=5.0"]`.
        until: When to end; by default, with *sim* once the mission is complete, or the root has succeeded or failed.
        sim: The world to simulate, a file or the name of a shipped one; None for an existing robot.
        speed: Simulated seconds per second, at most.
        seed: The seed of the simulation's noise.
        like: How the simulated Nav2 drives: `quick` or `nav2`.
        fault: Faults of the simulation: `["navigate_to_pose:reject=1"]`.
        stepped: Whether the simulated world takes turns with the mission in one thread, as fast as the machine can.
        check: Whether to wait for what the mission needs and plan its route, and to end without moving.
        journal: The journal; by default a file of the node's name, for a mission that can be resumed.
        no_journal: Whether no journal is written.
        resume: Whether to resume the mission in the journal.
        new: Whether to start over, and keep an unfinished journal under another name.
        keeps_journal: Whether a journal is written also for a mission that cannot be resumed.
        approved: Whether the tree must be exactly the one that a person has approved.
        properties: A file of properties to watch, or True for the mission's own.
        guardian: Whether another process cancels the goals if this one dies; by default with a journal and without *sim*.
        engine: What ticks the tree: `own` or `py_trees_ros`.
        executor: The executor of the mission's node: `events` or `single-threaded`.
        traceback: Whether tracebacks of leaves are logged.
        supervision: The supervisor of this process, if there is one.
    """

    tree: str
    tree_id: str | None = None
    additions: Additions = field(default_factory=Additions)
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


@dataclass(frozen=True)
class RunOutcome:
    """What has become of a run.

    Attributes:
        status: The exit status of `sar-run`: 0 if the mission is complete.
        reason: Why it has failed; empty if the mission is complete, or a signal has stopped it.
        duration_sec: How long the tree was ticked, seconds of the node's clock.
        ticks: The number of ticks.
        figures: The mission's figures by their names.
        verdicts: The verdict of each property that was watched, by its name; None if none was watched.
        deaths: How earlier processes of a supervised run have ended.
        head: The head of the journal's chain of hashes; empty without a journal.
        summary: The result in words, for people.
        hint: How to see a simulated run again; empty for any other.
        cause: The likeliest cause of a failure in one line; empty where none is known.
        messages: What else has to be said of its end, in words.
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
