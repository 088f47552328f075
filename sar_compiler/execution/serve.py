"""`sar-run --serve`: runs that others start, each in a process of its own."""

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

from sar_compiler.commands import ADRIFT, FINDINGS, OK, USAGE, tell_note
from sar_compiler.errors import SarError
from sar_compiler.execution.served_runs import EndedRun
from sar_compiler.journal.journal_entries import CommandAuthor
from sar_compiler.missions.choosing import mission_of
from sar_compiler.missions.parameter_file import read_parameter_file
from sar_compiler.missions.tree_check import check_mission
from sar_compiler.process_end import dependent_environment
from sar_compiler.project.additions import Additions
from sar_compiler.ros.arguments import parameter_files
from sar_compiler.ros.middleware import require_middleware
from sar_compiler.ros.signals import StopSignals
from sar_compiler.terminal import findings_as_text
from sar_compiler.tree.diagnostic import TreeError

if TYPE_CHECKING:
    from concurrent.futures import Future

    from rclpy.node import Node

    from sar_compiler.execution.verb_calls import VerbCalls
    from sar_compiler.missions.mission import Mission, Verb
    from sar_compiler.nodes.binding.bound import Binding
    from sar_compiler.project import Workspace

# How many lines of a run's complaints its client is sent, at most.
_LINES_SENT = 40
# What a run that has just begun offers is found by others a little later, seconds.
_FOUND_SEC, _LOOK_SEC = 5.0, 0.05
# How long what an ended process has written may take to be read, seconds.
_READ_SEC = 5.0
# A line of ROS's log, of which rcl writes some before any command can say anything.
_LOG_LINE = re.compile(r"(\x1b\[\d*m)?\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[|>>> \[|\[rcutils\|")
# Exit statuses above are those of commands that a signal has ended.
_SIGNALLED = 128


Holder = Callable[[bool, Callable[[], bool], Callable[[str], None]], None]
"""What orders a mission to hold or to go on, waits for its services as long as it is new, and tells why it was not carried out."""


class ServedTree(NamedTuple):
    """A tree that others can start.

    Attributes:
        path: Its file.
        tree_id: Its ID in there.
        node: The name of the node on which its mission runs.
        verbs: What can be ordered of its mission.
        path_parameters: Those of its parameters that are paths of files.
    """

    path: Path
    tree_id: str
    node: str
    verbs: "tuple[Verb, ...]"
    path_parameters: AbstractSet[str]


class ServedTreesError(SarError):
    """The trees that are to be served cannot be."""


class ServeOptions(NamedTuple):
    """The options of a server of trees.

    Attributes:
        program: The command that runs a tree, before the tree.
        trees: The tree files, or the names of shipped trees.
        additions: As in `RunOptions`, for all runs.
        params: Likewise.
        ros: Likewise.
        fault: Likewise.
        is_managed: Whether the node has a life cycle, which a manager decides.
    """

    program: Sequence[str]
    trees: Sequence[str]
    additions: Additions
    params: Path | None = None
    ros: Sequence[str] = ()
    fault: Sequence[str] = ()
    is_managed: bool = False


def serve(argv: Sequence[str], options: ServeOptions, signals: StopSignals) -> int:
    """Start runs for others until a signal comes.

    Args:
        argv: What each run has on its command line, after its tree.
        options: The options.
        signals: The requests to stop.

    Returns:
        The exit status: 2 if a tree is wrong, and no lifecycle manager is waited for; 4 if the last run may have left a goal that is active.
    """
    require_middleware()
    from sar_compiler.execution.tree_server import serve_trees

    runs = Runs(argv, options)
    has_served = serve_trees(runs, options.ros, signals, is_managed=options.is_managed)
    return runs.status if has_served else USAGE


class Runs:
    """Starts runs of some trees, each in a process of its own.

    Args:
        argv: What each has on its command line, but for its tree.
        options: The options.

    Attributes:
        node: The node of which orders come.
        status: The exit status: 4 if the last run may have left a goal that is active, else 0.
    """

    node: "Node"

    def __init__(self, argv: Sequence[str], options: ServeOptions) -> None:
        self._argv, self._options = argv, options
        self._trees: dict[str, ServedTree] = {}
        self._calls: dict[str, VerbCalls] = {}
        self.status = OK

    def trees(self) -> Sequence[str]:
        """Read all trees anew, and return their IDs.

        Raises:
            SarError: If one of them cannot be flown, with these options, or two have the same ID.
        """
        from sar_compiler.project import Workspace

        workspace = Workspace(self._options.additions, note=tell_note, further_checks=[check_mission])
        found = [each for name in self._options.trees for each in self._trees_of(workspace, name)]
        workspace.note_use()
        self._trees = {each.tree_id: each for each in found}
        for each in found:
            if self._trees[each.tree_id] is not each:
                other = self._trees[each.tree_id].path
                raise ServedTreesError(f"{each.path} and {other} have a tree '{each.tree_id}' both")
        return sorted(self._trees)

    def _trees_of(self, workspace: "Workspace", name: str) -> list[ServedTree]:
        """Return the trees that can be flown of a file.

        Raises:
            ServedTreesError: If it has errors.
            FaultError: If `--fault` names one that is not of its mission.
        """
        from sar_compiler.missions.beginning import node_name, parse_faults, path_parameters

        found, ros = [], self._options.ros
        try:
            loaded = workspace.load(name)
            for element in loaded.forest.executable:
                tree_id = element.attributes.get("ID")
                binding = loaded.binding(tree_id)
                if tree_id is None:
                    raise ServedTreesError(
                        f"the tree in {name} has no ID, by which a goal could name it: give it one"
                    )
                mission = mission_of(loaded, binding)
                # A slip would end each run, and not the start of the server.
                parse_faults(self._options.fault, mission)
                node = _given_name(ros) or node_name(mission)
                files = parameter_files(ros, self._options.params)
                verbs = _verbs_of(mission, binding, files, f"/{node}")
                paths = path_parameters(mission, binding)
                found.append(ServedTree(loaded.path, tree_id, node, verbs, paths))
        except TreeError as error:
            said = findings_as_text(error.findings, sys.stderr)
            raise ServedTreesError(f"{name} cannot be run like this:\n{said}") from error
        return found

    def why_not(self, tree: str, parameters: Mapping[str, object]) -> str:
        """Return why a run of a tree cannot be started with some parameters: who can send a goal must not choose which files are read."""
        paths = sorted(self._trees[tree].path_parameters & parameters.keys())
        if not paths:
            return ""
        return f"the payload cannot set {paths[0]}, which is the path of a file: start the server with -p {paths[0]}:=PATH"

    def start(
        self,
        tree: str,
        parameters: Mapping[str, object],
        tell: Callable[[str], None],
        end: Callable[[EndedRun], None],
    ) -> "ServedProcess":
        """Start a run; see `RunStarter.start`.

        Raises:
            OSError: If there is no process for it.
        """
        served = self._trees[tree]
        chosen = [
            rule for name, value in parameters.items() for rule in ("-p", f"{name}:={json.dumps(value)}")
        ]
        ros = ["--ros-args", *self._options.ros, *chosen, "--"]

        def take_end(status: int, ended: EndedRun) -> None:
            self.status = ADRIFT if status == ADRIFT else OK
            end(ended)

        command = [*self._options.program, str(served.path), "--tree", served.tree_id, *self._argv, *ros]
        return ServedProcess(command, tell, take_end, self._holder(served))

    def _holder(self, served: ServedTree) -> "Holder":
        """Return what orders a mission to hold, or to go on."""
        from sar_compiler.execution.order_record import RemoteSignature
        from sar_compiler.execution.verb_calls import VerbCalls

        full = f"{self.node.get_namespace().rstrip('/')}/{served.node}"
        if full not in self._calls:
            # Their services are found by the time that they are needed.
            sign = RemoteSignature(self.node, full).sign
            self._calls[full] = VerbCalls(self.node, served.verbs, sign, full)
        by = self.node.get_fully_qualified_name()
        return holder(self._calls[full], {verb.role: verb.name for verb in served.verbs}, by)


def holder(calls: "VerbCalls", verbs: Mapping[str, str], by: str) -> Holder:
    """Return what orders a mission to hold, or to go on.

    Args:
        calls: Calls the services of the mission's verbs.
        verbs: The names of its verbs, by their roles.
        by: Who orders.
    """
    from sar_compiler.missions.mission import VerbError

    # One after the other, and not in the thread that calls the services.
    orders = ThreadPoolExecutor(1, "orders")

    def give(
        verb: str, author: CommandAuthor, is_new: Callable[[], bool], refused: Callable[[str], None]
    ) -> None:
        def take(answer: "Future[tuple[bool, str]]") -> None:
            error = answer.exception()
            was_done, said = (False, str(error)) if error is not None else answer.result()
            if not was_done:
                refused(said)

        while verb not in calls.available() and is_new():
            time.sleep(_LOOK_SEC)
        try:
            calls.give(verb, {}, author).add_done_callback(take)
        except VerbError as error:
            refused(str(error))

    def hold(wanted: bool, is_new: Callable[[], bool], refused: Callable[[str], None]) -> None:
        verb = verbs.get("hold" if wanted else "release")
        if verb is None:
            refused("it knows no such order")
        else:
            author = CommandAuthor(by, f"the server was {'de' if wanted else ''}activated")
            orders.submit(give, verb, author, is_new, refused)

    return hold


class ServedProcess:
    """A run in a process of its own.

    Args:
        argv: Its command line, with the program.
        tell: Is told each line that it shows.
        end: Is told its exit status, and how it has ended.
        hold: Orders its mission to hold, or to go on.

    Raises:
        OSError: If it cannot be started.
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
            # Ctrl-C is for whole groups of processes, and is passed on once.
            start_new_session=True,
        )
        self._complaints: deque[str] = deque(maxlen=_LINES_SENT)
        self._has_spoken = False
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
        """Have it end in order; called again, at once."""
        # Before its first words Python itself would answer a SIGINT, with a traceback.
        self._process.send_signal(SIGINT if self._has_spoken else SIGTERM)

    def hold(self, *, wanted: bool, refused: Callable[[str], None]) -> None:
        """Have its robot stand until that is not wanted any more; see `ServedRun.hold`."""
        self._hold(wanted, self._is_new, refused)

    def _is_new(self) -> bool:
        """Return whether it has not shown a line yet, or has only just begun to."""
        is_young = self._begun is None or time.monotonic() - self._begun < _FOUND_SEC
        return is_young and self._process.poll() is None

    def _listen(self, lines: IO[str]) -> None:
        for line in lines:
            self._has_spoken = True
            sys.stderr.write(line)
            self._complaints.append(line.rstrip("\n"))

    def _follow(self, lines: IO[str]) -> None:
        for line in lines:
            self._has_spoken = True
            self._last = line.strip()
            if not self._last.startswith("{"):
                self._begun = self._begun or time.monotonic()
                self._tell(self._last)

    def _await_end(self) -> None:
        """Wait for the end of the process, and report it; what it has begun may hold its output open for ever."""
        status = self._process.wait()
        for reader in (self._follower, self._listener):
            reader.join(_READ_SEC)
        self._end(status, ended_run(status, self._last, "\n".join([*self._complaints])))


def ended_run(status: int, last: str, complaints: str) -> EndedRun:
    """Return how a run has ended.

    Args:
        status: Its exit status.
        last: The last line that it has shown: its summary, if it has begun.
        complaints: The last lines of its standard error.
    """
    if status == OK:
        return EndedRun("SUCCESS", last)
    try:
        reason = str(json.loads(last)["reason"])
    except (ValueError, TypeError, KeyError):  # it has not begun, or was killed
        was_stopped = status < 0 or status > _SIGNALLED
        return EndedRun("IDLE", "it was stopped before its end" if was_stopped else _reason_in(complaints))
    return EndedRun("FAILURE" if status == FINDINGS else "IDLE", reason or "it was stopped")


def _reason_in(complaints: str) -> str:
    """Return why a run has not begun: what it has said itself comes first, and ROS's log only where it has said nothing."""
    lines = complaints.split("\n")
    plain = [line for line in lines if not _LOG_LINE.match(line)] or lines
    return "\n".join(sorted(plain, key=lambda line: not line.startswith("sar-run: ")))


def _verbs_of(
    mission: "Mission | None", binding: "Binding", files: Sequence[Path], node: str
) -> "tuple[Verb, ...]":
    """Return what can be ordered of a mission; nothing where its parameters are not all in files."""
    from sar_compiler.missions.beginning import begin_run
    from sar_compiler.missions.parameter_reader import ParameterReader

    own = mission.default_parameters() if mission is not None and not files else None
    places = [*files, own] if own is not None else files
    values: dict[str, object] = {}
    with suppress(SarError):
        for place in places:
            values |= read_parameter_file(place, node)
        run, _, _ = begin_run(mission, ParameterReader.of_files(values, places, node), binding)
        return tuple(run.verbs())
    return ()


def _given_name(ros: Sequence[str]) -> str:
    """Return the name that ROS arguments give the node of a mission; empty if none."""
    names = [word.partition(":=")[2] for word in ros if word.startswith(("__node:=", "__name:="))]
    return names[-1] if names else ""
