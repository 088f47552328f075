"""`sar-run`: run a mission on ROS 2."""

import sys
from argparse import BooleanOptionalAction, Namespace
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from sar_compiler.cli.arguments import REPORT_FORMS, Parser, count, pair_of_ports, port, seed, speed
from sar_compiler.cli.loading import FILE_HELP, add_mission, add_project_options
from sar_compiler.cli.supervision import Supervision, own_supervision
from sar_compiler.cli.terminal import findings_as_text
from sar_compiler.commands import USAGE, add_version, print_error, run
from sar_compiler.resources import find
from sar_compiler.ros.arguments import split_arguments
from sar_compiler.ros.middleware import leave, require_middleware
from sar_compiler.ros.signals import StopSignals
from sar_compiler.sim.placement import MANNER_NAMES, QUICK_NAME
from sar_compiler.tree.gc_pause import gc_paused

if TYPE_CHECKING:
    from sar_compiler.missions.ending import Until

PROG = "sar-run"

ENGINES = ("own", "py_trees_ros")
_DEFAULT_TREE = "search_and_rescue"
_DEFAULT_WORLD = "disaster_zone"
_RESUMED = 3


@dataclass(frozen=True)
class Options:
    """The options of the command line.

    Attributes:
        tree: A tree file or the name of a shipped one; empty for the mission's default.
        tree_id: The tree in the file; None for the one that the file executes.
        params: A parameter file.
        sim: The world to simulate; None for an existing robot.
        seed: The seed of the simulation's noise.
        speed: Upper limit of simulated seconds per second.
        like: How the stand-in for Nav2 drives.
        until: The condition that ends the run; None leaves it to the tree.
        view: How to show the mission: `text`, `web` or `none`.
        web_port: The port of the page; None for the usual one.
        groot2: The port on which Groot2 is answered; None for none.
        groot2_hooks: Whether Groot2 may hold the tree, and replace outcomes.
        publish: Whether to publish the tree's states and the mission's.
        record: The file in which to record the mission; None for none.
        summary: How to sum up: `text` or `json`.
        check: Whether to stop before the robot moves.
        guardian: Whether a process of its own cancels the goals of a run that dies; None for what is usual.
        engine: The engine that ticks the tree: `own` or `py_trees_ros`.
        mission: The name of the mission; None to choose it by the tree's leaves.
        report: The reports to write at the end.
        journal: The mission's journal; None for the default place, or for none.
        no_journal: Whether there is to be none.
        resume: Whether to go on with the mission in the journal.
        new: Whether to begin a mission whatever is in the journal.
        fault: The faults of the simulated servers, as written.
        nodes: Modules of leaves.
        model: Palettes.
        include_path: Further folders that files may be included from.
        trust: Whether to run the modules beside the project's configuration.
        traceback: Whether to show the tracebacks of leaves that fail.
        ros: ROS arguments, without `--ros-args`.
    """

    tree: str
    tree_id: str | None
    params: Path | None
    sim: str | None
    seed: int
    speed: float
    like: str
    until: "Until | None"
    view: str
    web_port: int | None
    groot2: int | None
    groot2_hooks: bool
    publish: bool
    record: Path | None
    summary: str
    check: bool
    guardian: bool | None
    engine: str
    mission: str | None
    report: Sequence[Path]
    journal: Path | None
    no_journal: bool
    resume: bool
    new: bool
    supervise: int | None
    fault: Sequence[str]
    nodes: Sequence[str]
    model: Sequence[Path]
    include_path: Sequence[Path]
    trust: bool
    traceback: bool
    ros: Sequence[str]
    supervision: Supervision = field(default_factory=Supervision)


def command() -> NoReturn:
    """Be `sar-run`: the process ends with its exit status, however ROS is taken down."""
    with ExitStack() as ros:
        status = _main(sys.argv[1:], ros)
        leave(status, ros.pop_all().close)


def main(argv: Sequence[str] | None = None) -> int:
    """Run `sar-run` in this process and return its exit status."""
    with ExitStack() as ros:
        return _main(sys.argv[1:] if argv is None else argv, ros)


def _main(argv: Sequence[str], ros: ExitStack) -> int:
    # Before anything that takes time, so that Ctrl-C ends the command in order from its first moment.
    signals = StopSignals()
    try:
        return run(lambda: _run(argv, signals, ros), PROG)
    finally:
        signals.give_back()


def _run(argv: Sequence[str], signals: StopSignals, ros: ExitStack) -> int:
    options = _of_this_run(_options(argv), own_supervision())
    if options.supervise is not None and not options.supervision.is_there:
        from sar_compiler.cli.supervisor import supervise

        return supervise(argv, options.supervise, signals, options.report)
    require_middleware()
    with gc_paused():  # in what is imported there is nothing to collect
        from sar_compiler.cli.run_mission import run_mission
        from sar_compiler.tree.diagnostic import TreeError

    options = replace(options, tree=options.tree or _default_tree(options.mission))
    try:
        return run_mission(options, signals, ros)
    except TreeError as error:
        print(findings_as_text(error.findings, sys.stderr), file=sys.stderr)
        print_error(f"{PROG}: {options.tree} cannot be run like this; nothing has moved")
        return USAGE


def _of_this_run(options: Options, supervision: Supervision) -> Options:
    """Return the options of a run that somebody may supervise: one that has died is resumed, and recorded in another file."""
    if supervision.has_begun:
        options = replace(options, resume=True, new=False)
    record = options.record
    if record is not None and supervision.deaths:
        record = record.with_stem(f"{record.stem}.{len(supervision.deaths) + 1}")
    return replace(options, supervision=supervision, record=record)


def _options(argv: Sequence[str]) -> Options:
    from sar_compiler.missions.ending import Until

    split = split_arguments(argv)
    parser = _parser()
    given = parser.parse_args(split.own)
    if given.tree == "":
        parser.error("the name of the tree file is empty")
    for option, value in (
        ("--speed", given.speed),
        ("--fault", given.fault or None),
        ("--seed", given.seed),
        ("--like", given.like),
    ):
        if given.sim is None and value is not None:
            parser.error(f"{option} is for the simulator: add --sim")
    for is_wrong, message in _contradictions(given):
        if is_wrong:
            parser.error(message)
    read = {
        "tree": given.tree or "",
        "seed": given.seed or 0,
        "speed": given.speed or 1.0,
        "like": given.like or QUICK_NAME,
        "until": Until(given.until) if given.until else None,
        "ros": split.ros,
    }
    return Options(**{**vars(given), **read})


def _contradictions(given: Namespace) -> Iterator[tuple[object, str]]:
    """Yield which options do not go together, and whether they are given."""
    yield given.web_port is not None and given.view != "web", "--web-port is for the page: add --view web"
    yield (
        given.check and given.view == "web",
        "--check begins nothing that a page could show: leave --view web out",
    )
    yield (
        given.check and (given.resume or given.new or given.report),
        "--check begins nothing: --resume, --new and --report are for the run itself",
    )
    yield (
        given.check and (given.groot2 is not None or given.publish or given.record is not None),
        "--check begins nothing that could be watched: leave --groot2, --publish and --record out",
    )
    if given.record is not None:
        named = given.record.parent / f"{given.record.stem}.mcap"
        yield (
            given.record.suffix != ".mcap",
            f"--record writes MCAP, which readers know by its ending: {named}",
        )
    yield (
        given.groot2_hooks and given.groot2 is None,
        "--groot2-hooks is about what Groot2 may do: add --groot2 PORT",
    )
    yield (
        given.groot2_hooks and given.engine != ENGINES[0],
        f"--groot2-hooks: {given.engine} cannot be held in the middle of a tick; leave --engine out",
    )
    yield (
        given.no_journal and (given.journal or given.resume or given.new),
        "--no-journal does not go with --journal, --resume or --new",
    )
    yield (
        given.supervise is not None and (given.no_journal or given.check),
        "--supervise resumes a mission from its journal: leave --no-journal and --check out",
    )
    yield (
        given.sim is not None and _looks_like_a_tree(given.sim),
        f"--sim takes a world, and '{given.sim}' looks like a tree: put the tree before --sim",
    )


def _default_tree(mission: str | None) -> str:
    """Return the tree to run if none is named.

    Raises:
        MissionError: If there is no such mission, or it has no default tree.
    """
    if mission is None:
        return _DEFAULT_TREE
    from sar_compiler.missions.choosing import MissionError, find_mission

    tree = find_mission(mission).default_tree
    if tree is None:
        message = f"the mission '{mission}' comes without a tree: name one"
        raise MissionError(message)
    return tree


def _looks_like_a_tree(world: str) -> bool:
    """Return whether the argument for a world is a tree file, or the name of a shipped tree and of no world."""
    if world.endswith(".xml"):
        return True
    named = (find(kind, world, suffix) for kind, suffix in (("worlds", ".yaml"), ("trees", ".xml")))
    is_world, is_tree = (path.is_file() for path in named)
    return is_tree and not is_world


_EPILOG = (
    "Everything after --ros-args is for ROS 2: -p name:=value, -r from:=to, -r __ns:=/robot1. "
    "Exit status: 0 if the mission is complete (a tree of no mission: the root has succeeded, or what --until names has come); "
    "1 if it has failed or is incomplete, and the summary says what is missing (with --check: if a place is not where the robot can go); "
    "2 for wrong usage, an invalid tree or parameter, or a journal of a mission that is not over: nothing has moved; "
    "3 if something that the mission needs did not appear in time; "
    "4 if it was stopped and a goal may still be active, which is named: the robot may still be moving; "
    "129, 130 or 143 if SIGHUP, SIGINT or SIGTERM stopped it before completion, and every goal was seen to have ended."
)


def _parser() -> Parser:
    # py_trees, which comes with it, cannot be imported where standard output is closed.
    from sar_compiler.missions.ending import Until

    parser = Parser(
        PROG,
        "Run a mission: check the tree, wait for what it needs, tick it.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "tree",
        nargs="?",
        metavar="TREE",
        help=f"{FILE_HELP} (default: the one that --mission brings, else {_DEFAULT_TREE})",
    )
    parser.add_argument(
        "--tree", dest="tree_id", metavar="ID", help="the tree to run (default: the one the file executes)"
    )
    parser.add_argument(
        "--params", type=Path, metavar="FILE", help="a ROS 2 parameter file (default: the mission's own)"
    )
    parser.add_argument(
        "--sim",
        nargs="?",
        const=_DEFAULT_WORLD,
        metavar="WORLD",
        help="simulate a world (a file, or a shipped one: disaster_zone, empty), Nav2 and the mission's servers in this process; "
        "without it, they must run already",
    )
    parser.add_argument(
        "--seed", type=seed, metavar="N", help="with --sim: the seed of all noise (default 0)"
    )
    parser.add_argument(
        "--speed",
        type=speed,
        metavar="N",
        help="with --sim: simulated seconds per second, at most; time slows rather than skipping a step (default 1)",
    )
    parser.add_argument(
        "--like",
        choices=MANNER_NAMES,
        help="with --sim: how Nav2's stand-in drives, to the point (quick, the default) or as Nav2 does with the shipped "
        "parameters (nav2)",
    )
    parser.add_argument(
        "--until",
        choices=[until.value for until in Until],
        help="when to end: once the root succeeds or fails (end; default for trees and missions without an end of their "
        "own); once the mission is complete, or can no longer become so (complete; default with --sim); once the root succeeds, or "
        "fails, each round that ends otherwise being logged (success, failure); or never (forever; default otherwise)",
    )
    add_mission(parser)
    parser.add_argument(
        "--view",
        choices=("text", "web", "none"),
        default="none",
        help="show the mission while it runs: in place on a terminal, else a line for each change (text); on a page for a browser on "
        "this machine (web); or not (default none)",
    )
    parser.add_argument(
        "--web-port",
        type=port,
        metavar="N",
        help="with --view web: the page's port (default 8043; 0 for any)",
    )
    parser.add_argument(
        "--groot2",
        type=pair_of_ports,
        metavar="PORT",
        help="show the tree live in Groot2, on this port of 127.0.0.1 and the next one (Groot2 asks for 1667)",
    )
    parser.add_argument(
        "--groot2-hooks",
        action="store_true",
        help="let Groot2 hold the tree at breakpoints, and override outcomes",
    )
    parser.add_argument(
        "--publish",
        action="store_true",
        help="publish the tree's log (behavior_tree_log), /diagnostics, and, latched, the tree, its state and markers for RViz",
    )
    parser.add_argument(
        "--record",
        type=Path,
        metavar="FILE.mcap",
        help="record the mission in a new MCAP file: its topics, the tree's log, the mission's log",
    )
    parser.add_argument(
        "--summary",
        choices=("text", "json"),
        default="text",
        help="sum up for people (default text), or for scripts in one line: status, reason, duration in seconds, figures",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="wait until everything that the mission needs is there, plan its way on the map, then end; nothing moves",
    )
    parser.add_argument(
        "--guardian",
        action=BooleanOptionalAction,
        help="have a small process of its own cancel the goals of a run that is killed or crashes (default with a journal, "
        "without --sim)",
    )
    parser.add_argument(
        "--engine",
        choices=ENGINES,
        default=ENGINES[0],
        help="what ticks the tree: the project's runner (default own), or py_trees_ros where that is installed",
    )
    parser.add_argument(
        "--journal",
        type=Path,
        metavar="FILE",
        help="write the mission's journal to this file (default without --sim, for a mission that can be resumed: a file of the "
        "node's name in ~/.local/state/sar_compiler)",
    )
    parser.add_argument(
        "--report",
        action="append",
        default=[],
        type=Path,
        metavar="FILE",
        help=f"write a report when the run has ended, {REPORT_FORMS}; may be repeated",
    )
    parser.add_argument("--no-journal", action="store_true", help="write no journal")
    begun = parser.add_mutually_exclusive_group()
    begun.add_argument(
        "--resume",
        action="store_true",
        help="go on with the mission in the journal; goals still under way are cancelled first",
    )
    begun.add_argument(
        "--new", action="store_true", help="begin anew, and keep an unfinished journal under another name"
    )
    parser.add_argument(
        "--supervise",
        nargs="?",
        const=_RESUMED,
        type=count,
        metavar="N",
        help="resume the mission when its process has died, stands still for 10 s, or has not found what it needs, at most N times "
        f"(default {_RESUMED})",
    )
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="SPEC",
        help="with --sim: let something go wrong, for instance navigate_to_pose:reject=1; may be repeated",
    )
    parser.add_argument(
        "--traceback",
        action="store_true",
        help="show the traceback of a leaf that fails (its line of the tree file and of Python are named in any case)",
    )
    add_version(parser)
    add_project_options(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
