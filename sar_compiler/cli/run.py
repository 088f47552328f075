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
    TREE,
    WORLD,
    YAML_FILE,
    add_page_options,
    pair_of_ports,
    report_forms,
    restarts,
    seed,
    speed,
)
from sar_compiler.cli.loading import (
    FILE_HELP,
    add_mission,
    add_project_options,
    additions,
    require_there,
)
from sar_compiler.cli.parser import Parser
from sar_compiler.cli.run_extensions import extensions_asked_for
from sar_compiler.commands import USAGE, add_version, print_error, run
from sar_compiler.execution.supervision import Supervision, own_supervision
from sar_compiler.helper_process import helper_command
from sar_compiler.opener import is_file
from sar_compiler.process_end import end_process, shut_down
from sar_compiler.resources import find
from sar_compiler.ros.arguments import split_arguments
from sar_compiler.ros.middleware import require_middleware
from sar_compiler.ros.signals import StopSignals
from sar_compiler.sim.placement import MANNER_NAMES, QUICK_NAME
from sar_compiler.terminal import RunOutput, findings_as_text
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.gc_pause import gc_paused
from sar_compiler.tree.json_values import json_text

if TYPE_CHECKING:
    from sar_compiler.execution.run_options import RunOptions, RunOutcome

PROG = "sar-run"

ENGINES = ("own", "py_trees_ros")
_RESUMED = 3
_NO_JOURNAL = Path("none")
_SERVE, _MANAGED = "--serve", "--managed"


def command() -> NoReturn:
    """Be `sar-run`: the process ends with its exit status, however ROS is taken down."""
    with ExitStack() as ros:
        status = run_in(sys.argv[1:], ros)
        end_process(status, ros.pop_all().close, PROG)


def main(argv: Sequence[str] | None = None) -> int:
    """Run `sar-run` in this process and return its exit status."""
    with ExitStack() as ros:
        return run_in(sys.argv[1:] if argv is None else argv, ros)


def run_in(argv: Sequence[str], ros: ExitStack, *, stepped: bool = False) -> int:
    """Run `sar-run` in this process, and leave it to the caller to take ROS down.

    Args:
        argv: The arguments.
        ros: Takes ROS down.
        stepped: Whether the simulated world takes turns with the mission, in one thread.

    Returns:
        The exit status.
    """
    # Before anything that takes time, so that Ctrl-C ends the command in order from its first moment.
    signals = StopSignals()
    try:
        return run(lambda: _run(argv, signals, ros, stepped), PROG)
    finally:
        signals.give_back()


def _own_program() -> list[str]:
    """Return the command of a run in another process, which imports what this one can."""
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
        return serve(_passed_on(argv, options), served, signals)
    _supervise(options, supervision)
    if options.tree is not None and options.journal is None:
        require_there(options.tree)  # beside a journal that is named, a refused start is recorded
    require_middleware()
    with gc_paused():  # in what is imported there is nothing to collect
        from sar_compiler.execution.mission_run import run_mission

    options.tree = options.tree or _default_tree(options.mission)
    staying: list[Callable[[], object]] = []
    output = RunOutput()
    try:
        makes = list(extensions_asked_for(options))  # what they lack is said before anything starts
        given, report = _run_options(options, supervision), partial(_print_outcome, output, options.format)
        status = run_mission(given, makes, signals, ros, staying, output, report).status
    except TreeError as error:
        print(findings_as_text(error.findings, sys.stderr), file=sys.stderr)
        print_error(f"{PROG}: {options.tree} cannot be run like this; nothing has moved")
        return USAGE
    if staying:  # without ROS: others may have the robot meanwhile
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
    """Print what has become of a run."""
    if outcome.hint:
        print_error(outcome.hint)
    if form == "text":
        head = f"The journal's head, for sar-journal check --head: {outcome.head}" if outcome.head else ""
        for text in filter(None, (*outcome.summary, head, outcome.cause and f"  {outcome.cause}")):
            output.say(text)
    elif outcome.summary:
        said = {"status": outcome.status, "reason": outcome.reason, "duration": outcome.duration_sec}
        said |= {"ticks": outcome.ticks}
        said |= {} if outcome.deaths is None else {"deaths": outcome.deaths}
        said |= {"figures": outcome.figures}
        said |= {} if outcome.verdicts is None else {"properties": outcome.verdicts}
        said |= {"head": outcome.head} if outcome.head else {}
        output.say(json_text(said))
    for message in outcome.messages:
        print_error(f"{PROG}: {message}")


def _reports(options: Namespace) -> Callable[[Path], object]:
    """Return what writes the reports of a run, given its journal."""
    from sar_compiler.reports.report_files import report_journal

    return lambda journal: report_journal(journal, options.report)


def _supervise(options: Namespace, supervision: Supervision) -> None:
    """Make the options those of a run that may be supervised: one that has died is resumed, and recorded in another file."""
    if supervision.has_begun:
        options.resume, options.new = True, False
    if options.record is not None and supervision.deaths:
        options.record = options.record.with_stem(f"{options.record.stem}.{len(supervision.deaths) + 1}")


def _passed_on(argv: Sequence[str], options: Namespace) -> list[str]:
    """Return what each run has on its command line: what this one has, without its trees and what is for ROS."""
    own, left = split_arguments(argv).own, list[str]()
    while own:
        word = own.pop(0)
        if word == _SERVE:
            del own[: len(options.serve)]
        elif not word.startswith(f"{_SERVE}=") and word != _MANAGED:
            left.append(word)
    shown = [] if options.view == "web" else ["--view", "text"]
    anew = [] if options.no_journal else ["--new"]
    return [*left, *shown, "--format", "json", *anew]


def _options(argv: Sequence[str]) -> Namespace:
    from sar_compiler.execution.until import Until

    split = split_arguments(argv)
    parser = _parser()
    given: Namespace = parser.parse_args(split.own)
    if given.tree == "":
        parser.error("the name of the tree file is empty")
    given.no_journal = given.journal == _NO_JOURNAL
    given.journal = None if given.no_journal else given.journal
    for message in (*_slips(given), *_slips_of_serving(given), *_slips_of_companions(given)):
        parser.error(message)
    given.seed, given.speed, given.like = given.seed or 0, given.speed or 1.0, given.like or QUICK_NAME
    given.until = Until(given.until) if given.until else None
    given.ros, given.additions = split.ros, additions(given)
    return given


def _slips(given: Namespace) -> Iterator[str]:
    """Yield which options do not go together."""
    for option in ("speed", "fault", "seed", "like"):
        if given.sim is None and getattr(given, option) not in (None, []):
            yield f"--{option} is for the simulator: add --sim"
    if given.sim is not None and _looks_like_a_tree(given.sim):
        yield f"--sim takes a world, and '{given.sim}' looks like a tree: put the tree before --sim"
    if given.check and (given.resume or given.new or given.report):
        yield "--check begins nothing: --resume, --new and --report are for the run itself"
    if given.no_journal and (given.resume or given.new):
        yield "--journal none does not go with --resume or --new"
    if given.supervise is not None and (given.no_journal or given.check):
        yield "--supervise resumes a mission from its journal: leave --journal none and --check out"


def _slips_of_serving(given: Namespace) -> Iterator[str]:
    if given.managed and given.serve is None:
        yield "--managed is about a server of trees: add --serve TREE"
    if given.serve is None:
        return
    if given.tree is not None or given.tree_id is not None:
        yield "--serve names its trees itself, and each goal one of them: leave TREE and --tree out"
    if given.check or given.resume or given.report or given.record is not None:
        yield "--serve begins a run for each goal: --check, --resume, --report and --record are for one"


def _slips_of_companions(given: Namespace) -> Iterator[str]:
    for option, is_given in (("--web-port", given.web_port is not None), ("--open", given.open)):
        if is_given and given.view != "web":
            yield f"{option} is for the page: add --view web"
    if given.check and given.view == "web":
        yield "--check begins nothing that a page could show: leave --view web out"
    if given.check and (given.groot2 is not None or given.publish or given.record is not None):
        yield "--check begins nothing that could be watched: leave --groot2, --publish and --record out"
    if given.record is not None and given.record.suffix != ".mcap":
        named = given.record.parent / f"{given.record.stem}.mcap"
        yield f"--record writes MCAP, which readers know by its ending: {named}"


def _default_tree(mission: str | None) -> str:
    """Return the tree to run if none is named.

    Raises:
        MissionError: If there is no such mission, or it has no default tree.
    """
    from sar_compiler.missions.choosing import MissionError, default_mission, find_mission

    mission = mission or default_mission()
    if mission is None:
        raise MissionError("no installed package declares a default tree: name a tree")
    tree = find_mission(mission).default_tree
    if tree is None:
        raise MissionError(f"the mission '{mission}' comes without a tree: name one")
    return tree


def _looks_like_a_tree(world: str) -> bool:
    """Return whether the argument for a world is a tree file, or the name of a shipped tree and of no world."""
    if world.endswith(".xml"):
        return True
    named = (find(kind, world, suffix) for kind, suffix in (("worlds", ".yaml"), ("trees", ".xml")))
    is_world, is_tree = (is_file(path) for path in named)
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
    text = "Run a mission: check the tree, wait for what it needs, tick it."
    parser = Parser(PROG, text, epilog=_EPILOG)
    _add_what_is_flown(parser, parser.add_argument_group("what to fly"))
    _add_simulation(parser, parser.add_argument_group("simulate"))
    _add_companions(parser, parser.add_argument_group("see and record"))
    _add_safety(parser, parser.add_argument_group("safety"))
    _add_for_experts(parser, parser.add_argument_group("expert"))
    add_version(parser)
    parser.hide(*add_project_options(parser))
    return parser


def _add_what_is_flown(parser: Parser, group: _ArgumentGroup) -> None:
    # py_trees, which comes with it, cannot be imported where standard output is closed.
    from sar_compiler.execution.until import Until

    add = group.add_argument
    text = f"{FILE_HELP} (default: the one that the mission brings, which --mission names)"
    parser.add_argument("tree", nargs="?", type=TREE, metavar="TREE", help=text)
    text = "the tree to run (default: the one the file executes)"
    add("--tree", dest="tree_id", metavar="ID", help=text)
    add_mission(group)
    text = "a ROS 2 parameter file (default: the mission's own)"
    add("--params", type=YAML_FILE, metavar="FILE", help=text)
    text = (
        "when to end: once the root succeeds or fails (end; default for trees and missions without an end of their "
        "own); once the mission is complete, or can no longer become so (complete; default with --sim); once the root succeeds, or "
        "fails, each round that ends otherwise being logged (success, failure); or never (forever; default otherwise)"
    )
    add("--until", choices=[until.value for until in Until], help=text)


def _add_simulation(parser: Parser, group: _ArgumentGroup) -> None:
    add = group.add_argument
    text = (
        "simulate a world (a file, or a shipped one: disaster_zone, empty), Nav2 and the mission's servers in this process; "
        "without it, they must run already"
    )
    add("--sim", nargs="?", const=DEFAULT_WORLD, type=WORLD, metavar="WORLD", help=text)
    text = "with --sim: simulated seconds per second, at most; time slows rather than skipping a step (default 1)"
    add("--speed", type=speed, metavar="N", help=text)
    text = (
        "with --sim: how Nav2's stand-in drives, to the point (quick, the default) or as Nav2 does with the shipped "
        "parameters (nav2)"
    )
    add("--like", choices=MANNER_NAMES, help=text)
    text = "with --sim: let something go wrong, for instance navigate_to_pose:reject=1; may be repeated"
    add("--fault", action="append", default=[], metavar="SPEC", help=text)
    parser.hide(add("--seed", type=seed, metavar="N", help="with --sim: the seed of all noise (default 0)"))


def _add_companions(parser: Parser, group: _ArgumentGroup) -> None:
    """Add the options that say who goes along with the run."""
    add = group.add_argument
    text = (
        "show the mission while it runs: in place on a terminal, else a line for each change (text); on a page for a browser on "
        "this machine, which a terminal keeps after the end until Ctrl-C (web); or not (default none)"
    )
    add("--view", choices=("text", "web", "none"), default="none", help=text)
    web_port = add_page_options(group, "with --view web: ")
    text = f"write a report when the run has ended, {report_forms()}; may be repeated"
    add("--report", action="append", default=[], type=FILE, metavar="FILE", help=text)
    text = "record the mission in a new MCAP file: its topics, the tree's log, the mission's log"
    add("--record", type=FILE, metavar="FILE.mcap", help=text)
    text = "publish the tree's log (behavior_tree_log), /diagnostics, and, latched, the tree, its state and markers for RViz"
    add("--publish", action="store_true", help=text)
    text = "show the tree live in Groot2, on this port of 127.0.0.1 and the next one (Groot2 asks for 1667)"
    add("--groot2", type=pair_of_ports, metavar="PORT", help=text)
    text = "sum up for people (default text), or for scripts in one line: status, reason, duration in seconds, figures"
    add("--format", choices=("text", "json"), default="text", help=text)
    parser.hide(web_port)


def _add_safety(parser: Parser, group: _ArgumentGroup) -> None:
    add = group.add_argument
    text = "wait until everything that the mission needs is there, plan its way on the map, then end; nothing moves"
    add("--check", action="store_true", help=text)
    text = (
        "write the mission's journal to this file, or none (default for a mission that can be resumed: a file of the node's name "
        "in ~/.local/state/sar_compiler; with --sim: a new one in the folder simulated there, which keeps the last ten)"
    )
    add("--journal", type=FILE, metavar="FILE", help=text)
    text = "watch the run for the properties of this file (default with the option alone: the mission's own): what breaks one is an alarm"
    add("--properties", nargs="?", const=True, type=YAML_FILE, metavar="FILE", help=text)
    text = "start the tree only if it is exactly as somebody has approved it with sar-compile approve"
    add("--approved", action="store_true", help=text)
    begun = group.add_mutually_exclusive_group()
    text = "go on with the mission in the journal; goals still under way are cancelled first"
    begun.add_argument("--resume", action="store_true", help=text)
    text = "begin anew, and keep an unfinished journal under another name"
    begun.add_argument("--new", action="store_true", help=text)
    text = (
        "resume the mission when its process has died, stands still for 10 s, or has not found what it needs, at most N times "
        f"(default {_RESUMED})"
    )
    add("--supervise", nargs="?", const=_RESUMED, type=restarts, metavar="N", help=text)
    text = (
        "have a small process of its own cancel the goals of a run that is killed or crashes (default with a journal, "
        "without --sim)"
    )
    parser.hide(add("--guardian", action=BooleanOptionalAction, help=text))


def _add_for_experts(parser: Parser, group: _ArgumentGroup) -> None:
    text = "what ticks the tree: the project's runner (default own), or py_trees_ros where that is installed"
    engine = group.add_argument("--engine", choices=ENGINES, default=ENGINES[0], help=text)
    text = (
        "which executor of rclpy runs the callbacks of the mission's node: EventsExecutor, where rclpy has it and it can serve the "
        "leaves (default events), or SingleThreadedExecutor (single-threaded)"
    )
    executor = group.add_argument(
        "--executor", choices=("events", "single-threaded"), default="events", help=text
    )
    text = (
        "do not fly, but start these trees for others, one at a time: by BehaviorTree.ROS2's action bt_execution (ExecuteTree), whose "
        "goals name the tree by its ID; the other options are those of each run"
    )
    parser.hide(group.add_argument("--serve", nargs="+", type=TREE, metavar="TREE", help=text))
    text = "with --serve: wait for a lifecycle manager, such as Nav2's, to configure and activate the server"
    parser.hide(group.add_argument("--managed", action="store_true", help=text))
    text = "show the traceback of a leaf that fails (its line of the tree file and of Python are named in any case)"
    parser.hide(engine, executor, group.add_argument("--traceback", action="store_true", help=text))


if __name__ == "__main__":
    sys.exit(main())
