"""`sar-run --serve`: starts runs for clients, each in its own process."""

import json
import re
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from signal import SIGINT, SIGTERM
from threading import Thread
from typing import IO, TYPE_CHECKING, NamedTuple

from sar_compiler.commands import FINDINGS, OK, ROBOT_MAY_MOVE, USAGE, print_note
from sar_compiler.errors import SarError
from sar_compiler.execution.served_runs import EndedRun
from sar_compiler.journal.journal_entries import CommandAuthor
from sar_compiler.missions.mission_choice import mission_of
from sar_compiler.missions.parameter_file import read_parameter_file
from sar_compiler.missions.tree_check import check_mission
from sar_compiler.process_end import dependent_environment
from sar_compiler.project.command_line_settings import CommandLineSettings
from sar_compiler.ros.arguments import parameter_files
from sar_compiler.ros.middleware import require_middleware
from sar_compiler.ros.signals import StopSignals
from sar_compiler.terminal import findings_as_text
from sar_compiler.tree.diagnostic import TreeError

if TYPE_CHECKING:
    from concurrent.futures import Future

    from rclpy.node import Node

    from sar_compiler.execution.command_client import CommandClient
    from sar_compiler.missions.mission import Mission, OperatorCommand
    from sar_compiler.nodes.binding.bound import Binding
    from sar_compiler.project import Workspace

# Maximum number of error lines that the client of a failed run receives.
_LINES_SENT = 40
# Maximum time until the services of a new run are discovered, and interval of the checks, in seconds.
_DISCOVERY_SEC, _CHECK_SEC = 5.0, 0.05
# Maximum time until the remaining output of an ended process arrives, in seconds.
_READ_SEC = 5.0
# A line of ROS's log; rcl can write such lines before the first output of `sar-run`.
_LOG_LINE = re.compile(r"(\x1b\[\d*m)?\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[|>>> \[|\[rcutils\|")
# The exit status of a command that a signal has ended is higher than this value.
_SIGNALLED = 128


Holder = Callable[[bool, Callable[[], bool], Callable[[str], None]], None]
"""Pauses (True) or resumes (False) a mission. The function waits for the mission's services for as long as the second argument returns
True. It calls the third argument with the reason if the mission refuses the command."""


class ServedTree(NamedTuple):
    """A tree that clients can start.

    Attributes:
        path: The tree file.
        tree_id: The tree's ID in the file.
        node: The name of the mission's node.
        verbs: The mission's commands.
        path_parameters: The names of the mission's parameters that are file paths.
    """

    path: Path
    tree_id: str
    node: str
    verbs: "tuple[OperatorCommand, ...]"
    path_parameters: AbstractSet[str]


class ServedTreesError(SarError):
    """Raised if the trees cannot be served."""


class ServeOptions(NamedTuple):
    """The options of `sar-run --serve`.

    Attributes:
        program: The words of the command that runs a tree, without the tree.
        trees: The tree files, or the names of shipped trees.
        additions: See `RunOptions`; applies to all runs.
        params: See `RunOptions`; applies to all runs.
        ros: See `RunOptions`; applies to all runs.
        fault: See `RunOptions`; applies to all runs.
        is_managed: Whether a lifecycle manager controls the server's node.
    """

    program: Sequence[str]
    trees: Sequence[str]
    additions: CommandLineSettings
    params: Path | None = None
    ros: Sequence[str] = ()
    fault: Sequence[str] = ()
    is_managed: bool = False


def serve(argv: Sequence[str], options: ServeOptions, signals: StopSignals) -> int:
    """Start runs for clients until a signal arrives.

    Args:
        argv: The command-line options that follow the tree in the command of each run.
        options: The options of the server.
        signals: The requests to stop.

    Returns:
        The exit status: 2 if a tree is invalid and no lifecycle manager controls the server, 4 if a goal of the last run may still be
        active, otherwise 0.
    """
    require_middleware()
    from sar_compiler.execution.tree_server import serve_trees

    runs = ProcessRunStarter(argv, options)
    has_served = serve_trees(runs, options.ros, signals, is_managed=options.is_managed)
    return runs.status if has_served else USAGE


class ProcessRunStarter:
    """Starts runs of the served trees, each in its own process.

    Args:
        argv: The command-line options that follow the tree in the command of each run.
        options: The options of the server.

    Attributes:
        node: The server's node, which receives goals.
        status: The exit status: 4 if a goal of the last run may still be active, otherwise 0.
    """

    node: "Node"

    def __init__(self, argv: Sequence[str], options: ServeOptions) -> None:
        self._argv, self._options = argv, options
        self._trees: dict[str, ServedTree] = {}
        self._calls: dict[str, CommandClient] = {}
        self.status = OK

    def read_tree_ids(self) -> Sequence[str]:
        """Read all tree files again, and return the IDs of the trees.

        Raises:
            SarError: If a tree cannot be run with the server's options, or two trees have the same ID.
        """
        from sar_compiler.project import Workspace

        workspace = Workspace(self._options.additions, note=print_note, further_checks=[check_mission])
        found = [each for name in self._options.trees for each in self._trees_of(workspace, name)]
        workspace.report_use()
        self._trees = {each.tree_id: each for each in found}
        for each in found:
            if self._trees[each.tree_id] is not each:
                other = self._trees[each.tree_id].path
                raise ServedTreesError(
                    f"{each.path} and {other} both have a tree '{each.tree_id}'. Rename one of them"
                )
        return sorted(self._trees)

    def _trees_of(self, workspace: "Workspace", name: str) -> list[ServedTree]:
        """Return the executable trees of a file.

        Raises:
            ServedTreesError: If the file has errors.
            FaultError: If `--fault` names a fault that the mission does not have.
        """
        from sar_compiler.missions.mission_start import node_name, parse_faults, path_parameters

        found, ros = [], self._options.ros
        try:
            loaded = workspace.load(name)
            for element in loaded.forest.executable:
                tree_id = element.attributes.get("ID")
                binding = loaded.binding(tree_id)
                if tree_id is None:
                    raise ServedTreesError(
                        f'the tree in {name} has no ID, so goals cannot refer to the tree. Add ID="…" to the tree'
                    )
                mission = mission_of(loaded, binding)
                # Without this check, an error in the options would end each run instead of the server's start.
                parse_faults(self._options.fault, mission)
                node = _given_name(ros) or node_name(mission)
                files = parameter_files(ros, self._options.params)
                verbs = _verbs_of(mission, binding, files, f"/{node}")
                paths = path_parameters(mission, binding)
                found.append(ServedTree(loaded.path, tree_id, node, verbs, paths))
        except TreeError as error:
            findings = findings_as_text(error.findings, sys.stderr)
            raise ServedTreesError(f"{name} cannot be run with these options:\n{findings}") from error
        return found

    def refusal_reason(self, tree: str, parameters: Mapping[str, object]) -> str:
        """Return why no run of the tree can start with the parameters, or an empty string if a run can start."""
        paths = sorted(self._trees[tree].path_parameters & parameters.keys())
        if not paths:
            return ""
        return f"the payload cannot set {paths[0]}, because it is a file path. Start the server with -p {paths[0]}:=PATH"

    def start(
        self,
        tree: str,
        parameters: Mapping[str, object],
        tell: Callable[[str], None],
        end: Callable[[EndedRun], None],
    ) -> "ServedProcess":
        """Start a run; see `RunStarter.start`.

        Raises:
            OSError: If the run's process cannot be started.
        """
        served = self._trees[tree]
        overrides = [
            word for name, value in parameters.items() for word in ("-p", f"{name}:={json.dumps(value)}")
        ]
        ros = ["--ros-args", *self._options.ros, *overrides, "--"]

        def on_end(status: int, ended: EndedRun) -> None:
            self.status = ROBOT_MAY_MOVE if status == ROBOT_MAY_MOVE else OK
            end(ended)

        command = [*self._options.program, str(served.path), "--tree", served.tree_id, *self._argv, *ros]
        return ServedProcess(command, tell, on_end, self._holder(served))

    def _holder(self, served: ServedTree) -> "Holder":
        """Return a function that pauses or resumes the mission of a served tree."""
        from sar_compiler.execution.command_authors import RemoteCommandAuthor
        from sar_compiler.execution.command_client import CommandClient

        full = f"{self.node.get_namespace().rstrip('/')}/{served.node}"
        if full not in self._calls:
            # Created before the run, so that the mission's services are discovered early.
            sign = RemoteCommandAuthor(self.node, full).sign
            self._calls[full] = CommandClient(self.node, served.verbs, sign, full)
        by = self.node.get_fully_qualified_name()
        return holder(self._calls[full], {verb.role: verb.name for verb in served.verbs}, by)


def holder(calls: "CommandClient", verbs: Mapping[str, str], by: str) -> Holder:
    """Return the function that pauses or resumes a mission.

    Args:
        calls: The client of the mission's commands.
        verbs: The names of the mission's commands by role.
        by: The name that the journal records as the author of pause and resume commands.
    """
    from sar_compiler.missions.mission import CommandError

    # One thread sends the commands in order. It is not the executor's thread, which calls the services.
    senders = ThreadPoolExecutor(1, "commands")

    def send(
        verb: str, author: CommandAuthor, is_new: Callable[[], bool], refused: Callable[[str], None]
    ) -> None:
        def on_response(response: "Future[tuple[bool, str]]") -> None:
            error = response.exception()
            is_accepted, message = (False, str(error)) if error is not None else response.result()
            if not is_accepted:
                refused(message)

        while verb not in calls.available() and is_new():
            time.sleep(_CHECK_SEC)
        try:
            calls.send(verb, {}, author).add_done_callback(on_response)
        except CommandError as error:
            refused(str(error))

    def hold(wanted: bool, is_new: Callable[[], bool], refused: Callable[[str], None]) -> None:
        verb = verbs.get("hold" if wanted else "release")
        if verb is None:
            refused(f"the mission has no command to {'pause' if wanted else 'resume'} it")
        else:
            author = CommandAuthor(by, f"the server was {'de' if wanted else ''}activated")
            senders.submit(send, verb, author, is_new, refused)

    return hold


class ServedProcess:
    """A served run in its own process.

    Args:
        argv: The command line of the run, with the program.
        tell: Called with each line of standard output, except for the JSON summary.
        end: Called with the exit status and the outcome of the run.
        hold: Pauses or resumes the mission.

    Raises:
        OSError: If the process cannot be started.
    """

    def __init__(
        self,
        argv: Sequence[str],
        tell: Callable[[str], None],
        end: Callable[[int, EndedRun], None],
        hold: Holder,
    ) -> None:
        self._tell, self._end, self._hold = tell, end, hold
        self._process = subprocess.Popen(  # noqa: S603 - this interpreter, and the user's own command line
            argv,
            env=dependent_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            # Ctrl-C would reach the run twice: from the terminal's process group, and from the server.
            start_new_session=True,
        )
        self._error_lines: deque[str] = deque(maxlen=_LINES_SENT)
        self._has_output = False
        self._begun: float | None = None
        self._listener = Thread(
            target=self._listen, args=(self._process.stderr,), name="run's log", daemon=True
        )
        self._listener.start()
        self._last = ""
        self._follower = Thread(target=self._follow, args=(self._process.stdout,), name="run", daemon=True)
        self._follower.start()
        Thread(target=self._await_end, name="run's end", daemon=True).start()

    def stop(self) -> None:
        """Stop the run gracefully; a second call stops it immediately."""
        # Before its first output, the process may not have installed its SIGINT handler: Python would print a traceback.
        self._process.send_signal(SIGINT if self._has_output else SIGTERM)

    def hold(self, *, wanted: bool, refused: Callable[[str], None]) -> None:
        """Pause or resume the mission; see `ServedRun.hold`."""
        self._hold(wanted, self._is_new, refused)

    def _is_new(self) -> bool:
        """Return whether the run is active, but began so recently that its services may not be discovered yet."""
        is_young = self._begun is None or time.monotonic() - self._begun < _DISCOVERY_SEC
        return is_young and self._process.poll() is None

    def _listen(self, lines: IO[str]) -> None:
        for line in lines:
            self._has_output = True
            sys.stderr.write(line)
            self._error_lines.append(line.rstrip("\n"))

    def _follow(self, lines: IO[str]) -> None:
        for line in lines:
            self._has_output = True
            self._last = line.strip()
            if not self._last.startswith("{"):
                self._begun = self._begun or time.monotonic()
                self._tell(self._last)

    def _await_end(self) -> None:
        """Wait until the process ends and report the result, even if child processes keep the output pipes open."""
        status = self._process.wait()
        for reader in (self._follower, self._listener):
            reader.join(_READ_SEC)
        self._end(status, run_result(status, self._last, "\n".join([*self._error_lines])))


def run_result(status: int, last: str, complaints: str) -> EndedRun:
    """Return the outcome of a run from its exit status and output.

    Args:
        status: The exit status.
        last: The last line of standard output, which is the JSON summary if the run has started.
        complaints: The last lines of standard error.
    """
    if status == OK:
        return EndedRun("SUCCESS", last)
    try:
        reason = str(json.loads(last)["reason"])
    except (ValueError, TypeError, KeyError):  # the run has not started, or was killed
        was_stopped = status < 0 or status > _SIGNALLED
        reason = "the run was stopped before it was complete" if was_stopped else _start_failure(complaints)
        return EndedRun("IDLE", reason)
    return EndedRun("FAILURE" if status == FINDINGS else "IDLE", reason or "the run was stopped")


def _start_failure(complaints: str) -> str:
    """Extract the reason why a run did not start from its standard error.

    Errors that the command has printed take precedence over lines of the ROS log.
    """
    lines = complaints.split("\n")
    plain = [line for line in lines if not _LOG_LINE.match(line)] or lines
    return "\n".join(sorted(plain, key=lambda line: not line.startswith("sar-run: ")))


def _verbs_of(
    mission: "Mission | None", binding: "Binding", files: Sequence[Path], node: str
) -> "tuple[OperatorCommand, ...]":
    """Return the mission's commands, or no commands if the mission cannot start with the parameter files."""
    from sar_compiler.missions.mission_start import begin_run
    from sar_compiler.missions.parameter_reader import ParameterReader

    own = mission.default_parameters() if mission is not None and not files else None
    places = [*files, own] if own is not None else files
    values: dict[str, object] = {}
    with suppress(SarError):
        for place in places:
            values |= read_parameter_file(place, node)
        run, _, _ = begin_run(mission, ParameterReader.from_files(values, places, node), binding)
        return tuple(run.verbs())
    return ()


def _given_name(ros: Sequence[str]) -> str:
    """Return the node name that the ROS arguments set, or an empty string if they set no name."""
    names = [word.partition(":=")[2] for word in ros if word.startswith(("__node:=", "__name:="))]
    return names[-1] if names else ""
