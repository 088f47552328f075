"""`sar-run`: run a mission on ROS 2."""

import sys
from argparse import BooleanOptionalAction, Namespace, _ArgumentGroup
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from sar_compiler.cli.arguments import (
    DEFAULT_WORLD,
    FILE,
    FILE_HELP,
    TREE,
    WORLD,
    YAML_FILE,
    add_mission,
    add_page_options,
    add_project_options,
    additions,
    pair_of_ports,
    report_forms,
    restarts,
    seed,
    speed,
)
from sar_compiler.cli.parser import Parser
from sar_compiler.cli.run_extensions import requested_extensions
from sar_compiler.commands import USAGE, add_version, print_error, run
from sar_compiler.execution.supervision import Supervision, own_supervision
from sar_compiler.gc_pause import gc_paused
from sar_compiler.helper_process import helper_command
from sar_compiler.json_values import json_text
from sar_compiler.opener import is_file
from sar_compiler.process_end import end_process, shut_down
from sar_compiler.resources import find, require_tree_file
from sar_compiler.ros.arguments import split_arguments
from sar_compiler.ros.middleware import require_middleware
from sar_compiler.ros.signals import StopSignals
from sar_compiler.sim.placement import MANNER_NAMES, QUICK_NAME
from sar_compiler.terminal import RunOutput, findings_as_text
from sar_compiler.tree.diagnostic import TreeError

if TYPE_CHECKING:
    from sar_compiler.execution.run_options import RunOptions, RunOutcome

PROG = "sar-run"

ENGINES = ("own", "py_trees_ros")
_DEFAULT_RESTARTS = 3
_NO_JOURNAL = Path("none")
_SERVE, _MANAGED = "--serve", "--managed"


def command() -> NoReturn:
    """Run `sar-run` and end the process with its exit status, even if ROS fails to shut down."""
    with ExitStack() as ros:
        status = run_with_ros(sys.argv[1:], ros)
        end_process(status, ros.pop_all().close, PROG)


def main(argv: Sequence[str] | None = None) -> int:
    """Run `sar-run` in this process and return its exit status."""
    with ExitStack() as ros:
        return run_with_ros(sys.argv[1:] if argv is None else argv, ros)


def run_with_ros(argv: Sequence[str], ros: ExitStack, *, stepped: bool = False) -> int:
    """Run `sar-run` in this process. The caller must shut down ROS after the run.

    Args:
        argv: The arguments.
        ros: Receives the functions that shut down ROS.
        stepped: Whether the simulated world and the mission run alternately in one thread.

    Returns:
        The exit status.
    """
    # Signals are handled before any slow step, so that Ctrl-C always ends the command gracefully.
    signals = StopSignals()
    try:
        return run(lambda: _run(argv, signals, ros, stepped), PROG)
    finally:
        signals.restore_handlers()


def _own_program() -> list[str]:
    """Return the command that starts a run in another process with the same import paths."""
    return helper_command("sar_compiler.cli.console", "sar_run")


def _run(argv: Sequence[str], signals: StopSignals, ros: ExitStack, stepped: bool) -> int:
    signals.ends_unnoticed = True
    options, supervision = _options(argv), own_supervision()
    options.stepped = stepped
    if options.supervise is not None and options.serve is None and not supervision.is_there:
        from sar_compiler.execution.supervisor import supervise

        return supervise(
            [*_own_program(), *argv],
            options.supervise,
            signals,
            _reports(options) if options.report else None,
        )
    if options.serve is not None:
        from sar_compiler.execution.serve import ServeOptions, serve

        served = ServeOptions(
            _own_program(),
            options.serve,
            options.additions,
            options.params,
            options.ros,
            options.fault,
            options.managed,
        )
        return serve(_served_run_options(argv, options), served, signals)
    _adapt_to_supervision(options, supervision)
    if options.tree is not None and options.journal is None:
        require_tree_file(options.tree)  # with --journal, a later check also records the refusal
    require_middleware()
    with gc_paused():  # imports create no garbage
        from sar_compiler.execution.mission_run import run_mission

    options.tree = options.tree or _default_tree(options.mission)
    staying: list[Callable[[], object]] = []
    output = RunOutput()
    try:
        makes = list(requested_extensions(options))  # reports missing libraries before the start
        chosen, report = _run_options(options, supervision), partial(_print_outcome, output, options.format)
        status = run_mission(chosen, makes, signals, ros, staying, output, report).status
    except TreeError as error:
        print(findings_as_text(error.findings, sys.stderr), file=sys.stderr)
        print_error(f"{PROG}: {options.tree} cannot be run with these options. The robot has not moved")
        return USAGE
    if staying:  # ROS is shut down first, because another program may use the robot in the meantime
        shut_down(status, ros.close)
    for stay in staying:
        stay()
    return status


def _run_options(options: Namespace, supervision: Supervision) -> "RunOptions":
    from sar_compiler.execution.run_options import RunOptions

    own = {
        each.name: getattr(options, each.name) for each in fields(RunOptions) if hasattr(options, each.name)
    }
    return RunOptions(**own, keeps_journal=options.supervise is not None, supervision=supervision)


def _print_outcome(output: RunOutput, form: str, outcome: "RunOutcome") -> None:
    """Print the outcome of a run in the format of `--format`."""
    if outcome.hint:
        print_error(outcome.hint)
    if form == "text":
        head = f"Journal hash (verify with sar-journal check --head): {outcome.head}" if outcome.head else ""
        for text in filter(None, (*outcome.summary, head, outcome.cause and f"  {outcome.cause}")):
            output.print_important(text)
    elif outcome.summary:
        data = {"status": outcome.status, "reason": outcome.reason, "duration": outcome.duration_sec}
        data |= {"ticks": outcome.ticks}
        data |= {} if outcome.deaths is None else {"deaths": outcome.deaths}
        data |= {"figures": outcome.figures}
        data |= {} if outcome.verdicts is None else {"properties": outcome.verdicts}
        data |= {"head": outcome.head} if outcome.head else {}
        output.print_important(json_text(data))
    for message in outcome.messages:
        print_error(f"{PROG}: {message}")


def _reports(options: Namespace) -> Callable[[Path], object]:
    """Return a function that writes the reports of a run, given its journal."""
    from sar_compiler.reports.report_files import report_journal

    return lambda journal: report_journal(journal, options.report)


def _adapt_to_supervision(options: Namespace, supervision: Supervision) -> None:
    """Set the options so that a run restarted after a crash resumes the mission and records to a new file."""
    if supervision.has_begun:
        options.resume, options.new = True, False
    if options.record is not None and supervision.deaths:
        options.record = options.record.with_stem(f"{options.record.stem}.{len(supervision.deaths) + 1}")


def _served_run_options(argv: Sequence[str], options: Namespace) -> list[str]:
    """Return the server's options that apply to each served run.

    The result omits --serve, --managed and ROS arguments.
    """
    own, kept = split_arguments(argv).own, list[str]()
    while own:
        word = own.pop(0)
        if word == _SERVE:
            del own[: len(options.serve)]
        elif not word.startswith(f"{_SERVE}=") and word != _MANAGED:
            kept.append(word)
    view_option = [] if options.view == "web" else ["--view", "text"]
    new_option = [] if options.no_journal else ["--new"]
    return [*kept, *view_option, "--format", "json", *new_option]


def _options(argv: Sequence[str]) -> Namespace:
    from sar_compiler.execution.until import Until

    split = split_arguments(argv)
    parser = _parser()
    options: Namespace = parser.parse_args(split.own)
    if options.tree == "":
        parser.error("the name of the tree file is empty")
    options.no_journal = options.journal == _NO_JOURNAL
    options.journal = None if options.no_journal else options.journal
    errors = (*_option_errors(options), *_serving_option_errors(options), *_extension_option_errors(options))
    for message in errors:
        parser.error(message)
    options.seed, options.speed, options.like = (
        options.seed or 0,
        options.speed or 1.0,
        options.like or QUICK_NAME,
    )
    options.until = Until(options.until) if options.until else None
    options.ros, options.additions, options.command = split.ros, additions(options), argv
    return options


def _option_errors(options: Namespace) -> Iterator[str]:
    """Yield errors about options that exclude each other or require another option."""
    for option in ("speed", "fault", "seed", "like"):
        if options.sim is None and getattr(options, option) not in (None, []):
            yield f"--{option} requires --sim"
    if options.sim is not None and _looks_like_a_tree(options.sim):
        yield f"--sim expects a world, but '{options.sim}' looks like a tree. Write the tree before --sim"
    if options.check and (options.resume or options.new or options.report):
        yield "--check does not run the mission: remove --resume, --new and --report"
    if options.no_journal and (options.resume or options.new):
        yield "--resume and --new require a journal: remove them, or remove --journal none"
    if options.supervise is not None and (options.no_journal or options.check):
        yield "--supervise resumes a mission from its journal: remove --journal none and --check"


def _serving_option_errors(options: Namespace) -> Iterator[str]:
    if options.managed and options.serve is None:
        yield "--managed requires --serve TREE"
    if options.serve is None:
        return
    if options.tree is not None or options.tree_id is not None:
        yield "--serve itself names the trees to serve: remove TREE and --tree"
    if options.check or options.resume or options.report or options.record is not None:
        yield "--serve starts a run for each goal: remove --check, --resume, --report and --record"


def _extension_option_errors(options: Namespace) -> Iterator[str]:
    for option, is_given in (("--web-port", options.web_port is not None), ("--open", options.open)):
        if is_given and options.view != "web":
            yield f"{option} requires --view web"
    if options.check and options.view == "web":
        yield "--check does not run the mission: remove --view web"
    if options.check and (options.groot2 is not None or options.publish or options.record is not None):
        yield "--check does not run the mission: remove --groot2, --publish and --record"
    if options.record is not None and options.record.suffix != ".mcap":
        renamed = options.record.parent / f"{options.record.stem}.mcap"
        yield f"--record writes an MCAP file, whose name must end with .mcap, such as {renamed}"


def _default_tree(mission: str | None) -> str:
    """Return the tree to run if the command line names no tree.

    Raises:
        MissionError: If the mission does not exist, or has no default tree.
    """
    from sar_compiler.missions.mission_choice import MissionError, default_mission, find_mission

    mission = mission or default_mission()
    if mission is None:
        raise MissionError("no installed package declares a default tree. Specify a tree file")
    tree = find_mission(mission).default_tree
    if tree is None:
        raise MissionError(f"the mission '{mission}' has no default tree. Specify a tree file")
    return tree


def _looks_like_a_tree(world: str) -> bool:
    """Return whether the argument of `--sim` names a tree instead of a world."""
    if world.endswith(".xml"):
        return True
    named = (find(kind, world, suffix) for kind, suffix in (("worlds", ".yaml"), ("trees", ".xml")))
    is_world, is_tree = (is_file(path) for path in named)
    return is_tree and not is_world


_EPILOG = (
    "ROS arguments follow --ros-args: -p name:=value, -r from:=to, -r __ns:=/robot1. "
    "Exit status: 0 mission complete (without a mission: ended as --until requires); 1 failed or incomplete; "
    "2 wrong usage, tree, parameter or journal: the robot has not moved; 3 a requirement was not available in time; "
    "4 stopped, but the robot may still be moving; 129, 130, 143 stopped by a signal."
)
_RARE = (
    "--mission", "--like", "--seed", "--open", "--web-port", "--publish", "--groot2", "--format", "--approved", "--guardian",
    "--no-guardian", "--engine", "--executor", "--serve", "--managed", "--traceback", "--model", "--trust", "--isolated",
    "--include-path",
)  # fmt: skip
"""The options that only `--help-all` shows."""
_SHORT = {
    "tree": "a tree file or shipped tree (default: the mission's)",
    "until": "the end condition (default: see --help-all)",
    "sim": "simulate a world, Nav2 and the mission's servers",
    "speed": "with --sim: simulated seconds per second (default 1)",
    "fault": "with --sim: inject navigate_to_pose:reject=1, ...",
    "view": "show the run on the terminal, or in a browser",
    "report": "write a report after the run, such as report.html",
    "record": "record topics and logs in a new MCAP file",
    "check": "wait for requirements, plan the route, and end",
    "journal": "the journal, or none (default: see --help-all)",
    "properties": "monitor properties (default: the mission's own)",
    "resume": "resume the mission in the journal",
    "new": "start over, and rename an unfinished journal",
    "supervise": f"resume after a crash, at most N times (default {_DEFAULT_RESTARTS})",
    "nodes": "load a module of leaves; may be repeated",
}
"""The short help texts of options in `--help`, which must fit on one screen."""


def _parser() -> Parser:
    text = "Run a mission: check the tree, wait for its requirements, tick it."
    parser = Parser(PROG, text, epilog=_EPILOG)
    _add_run_options(parser, parser.add_argument_group("what to run"))
    _add_simulation(parser.add_argument_group("simulate"))
    _add_extension_options(parser.add_argument_group("see and record"))
    _add_safety_options(parser.add_argument_group("safety"))
    _add_expert_options(parser.add_argument_group("expert"))
    add_version(parser)
    add_project_options(parser)
    parser.abridge(*_RARE, **_SHORT)
    return parser


def _add_run_options(parser: Parser, group: _ArgumentGroup) -> None:
    # Imported late, because the module imports py_trees, whose import fails if standard output is closed.
    from sar_compiler.execution.until import Until

    add = group.add_argument
    text = f"{FILE_HELP} (default: the mission's own)"
    parser.add_argument("tree", nargs="?", type=TREE, metavar="TREE", help=text)
    add("--tree", dest="tree_id", metavar="ID", help="the tree to run (default: the main tree)")
    add_mission(group)
    text = "a ROS 2 parameter file (default: the mission's own)"
    add("--params", type=YAML_FILE, metavar="FILE", help=text)
    text = (
        "the condition that ends the run: end when the root succeeds or fails (default for a mission without an end condition), "
        "complete when the mission is complete or can no longer be completed (default with --sim), success or failure when the "
        "root returns this status (another result is logged, and the tree starts again), or forever for no condition (default otherwise)"
    )
    add("--until", choices=[until.value for until in Until], help=text)


def _add_simulation(group: _ArgumentGroup) -> None:
    add = group.add_argument
    text = "simulate a world (a file, disaster_zone or empty), Nav2 and the mission's servers, instead of using a running Nav2 and running servers"
    add("--sim", nargs="?", const=DEFAULT_WORLD, type=WORLD, metavar="WORLD", help=text)
    text = "with --sim: at most N simulated seconds per second (default 1); no step is skipped"
    add("--speed", type=speed, metavar="N", help=text)
    text = "with --sim: drive accurately (quick, default), or like Nav2 with the shipped parameters (nav2)"
    add("--like", choices=MANNER_NAMES, help=text)
    text = "with --sim: inject a fault, such as navigate_to_pose:reject=1; may be repeated"
    add("--fault", action="append", default=[], metavar="SPEC", help=text)
    add("--seed", type=seed, metavar="N", help="with --sim: the seed of all simulated noise (default 0)")


def _add_extension_options(group: _ArgumentGroup) -> None:
    """Add the options for the page, reports and recordings."""
    add = group.add_argument
    text = (
        "show the run on the terminal, or write one line for each change if the output is not a terminal (text); serve a page on this "
        "machine, which on a terminal stays open after the run until Ctrl-C (web); or show nothing (none, default)"
    )
    add("--view", choices=("text", "web", "none"), default="none", help=text)
    add_page_options(group, "with --view web: ")
    text = f"write a report after the run, {report_forms()}; may be repeated"
    add("--report", action="append", default=[], type=FILE, metavar="FILE", help=text)
    text = "record topics, the tree's log and the mission's log in a new MCAP file"
    add("--record", type=FILE, metavar="FILE.mcap", help=text)
    text = "publish the tree's log (behavior_tree_log) and /diagnostics, and, on latched topics, the tree, the tree's state, and markers for RViz"
    add("--publish", action="store_true", help=text)
    text = "show the tree live in Groot2, on this port of 127.0.0.1 and the next one (Groot2's default: 1667)"
    add("--groot2", type=pair_of_ports, metavar="PORT", help=text)
    text = "print the result as text (default), or as one line of JSON with the status, the reason, the duration in seconds, and the mission's figures"
    add("--format", choices=("text", "json"), default="text", help=text)


def _add_safety_options(group: _ArgumentGroup) -> None:
    add = group.add_argument
    text = "wait for all requirements, plan the route on the map, then end; the robot does not move"
    add("--check", action="store_true", help=text)
    text = (
        "the journal file, or none. Default for a mission that can be resumed: a file named after the node in "
        "~/.local/state/sar_compiler, or with --sim a new file in the subfolder simulated, which keeps the last ten journals"
    )
    add("--journal", type=FILE, metavar="FILE", help=text)
    text = "monitor these properties (without FILE: the mission's own); a violation raises an alarm"
    add("--properties", nargs="?", const=True, type=YAML_FILE, metavar="FILE", help=text)
    text = "start the tree only if a person has approved this version with sar-compile approve"
    add("--approved", action="store_true", help=text)
    start = group.add_mutually_exclusive_group()
    text = "cancel the goals that are still active, then resume the mission in the journal"
    start.add_argument("--resume", action="store_true", help=text)
    text = "start over, and keep an unfinished journal under another name"
    start.add_argument("--new", action="store_true", help=text)
    text = (
        "resume the mission if its process crashes, is blocked for 10 s or misses a requirement, at most N times "
        f"(default {_DEFAULT_RESTARTS})"
    )
    add("--supervise", nargs="?", const=_DEFAULT_RESTARTS, type=restarts, metavar="N", help=text)
    text = "let a separate process cancel the goals of a run that crashes or is killed (default: with a journal and without --sim)"
    add("--guardian", action=BooleanOptionalAction, help=text)


def _add_expert_options(group: _ArgumentGroup) -> None:
    add = group.add_argument
    text = "the engine that ticks the tree: the engine of sar_compiler (own, default), or an installed py_trees_ros"
    add("--engine", choices=ENGINES, default=ENGINES[0], help=text)
    text = (
        "the rclpy executor of the mission's node: EventsExecutor, if rclpy provides it and it supports the "
        "leaves (events, default), or SingleThreadedExecutor (single-threaded)"
    )
    add("--executor", choices=("events", "single-threaded"), default="events", help=text)
    text = (
        "serve BehaviorTree.ROS2's action bt_execution (ExecuteTree), and run these trees for clients, one at a time. A goal names "
        "the ID of a tree. The other options apply to each run"
    )
    add("--serve", nargs="+", type=TREE, metavar="TREE", help=text)
    text = "with --serve: wait for a lifecycle manager, such as Nav2's, to configure and activate the server"
    add("--managed", action="store_true", help=text)
    text = "show the traceback of a failing leaf (its line in the tree file and the line of Python code are always reported)"
    add("--traceback", action="store_true", help=text)


if __name__ == "__main__":
    sys.exit(main())
