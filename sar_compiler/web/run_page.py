"""The page of a run or of journals. This module and its dependencies are only imported if the page is requested."""

import sys
import time
import webbrowser
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any

from sar_compiler.commands import print_error
from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.journal.database import JournalFile, is_locked
from sar_compiler.journal.display import AwaitedItem
from sar_compiler.journal.journal_entries import BREAKPOINT, RUN_BEGAN, RUN_ENDED, STATUS, JournalEntry
from sar_compiler.journal.mission_state import FAILURE, RunProcess
from sar_compiler.missions.mission import LONGEST, OperatorCommand
from sar_compiler.reports.explanation import Explanation
from sar_compiler.reports.report_files import report_page
from sar_compiler.reports.why import FailureAnalysis
from sar_compiler.ros.clock import NodeTime
from sar_compiler.ros.engine import Engine
from sar_compiler.ros.run_extension import RunExtension
from sar_compiler.terminal import draws_in_place
from sar_compiler.web.feed import LiveFeed, ReplayFeed
from sar_compiler.web.page_server import CommandHandler, CommandSender, PageQuery, PageServer, Tools
from sar_compiler.web.page_tools import LiveTools, ToolError, journal_tools
from sar_compiler.web.replay import Replay
from sar_compiler.web.team_commands import TeamCommands, open_team_commands

if TYPE_CHECKING:
    from sar_compiler.execution.command_client import CommandClient
    from sar_compiler.execution.run_setup import RunSetup
    from sar_compiler.project import Workspace

# The interval between reads of other processes' journals, in seconds; each process writes once a second.
_POLL_SEC = 0.5
# The interval between reads of another program's run, in seconds.
_PROGRAM_POLL_SEC = 0.2


class RunPage(RunExtension):
    """The page of a run.

    Args:
        run: The run.
        port: The port, as for `AppServer`.
        opens: Whether to open the page in a browser.

    Raises:
        PageError: If the port cannot be used.
    """

    def __init__(self, run: "RunSetup", port: int | None = None, *, opens: bool = False) -> None:
        from sar_compiler.execution.command_client import CommandClient

        self._run, self._has_ended, self._is_staying = run, False, False
        self._place = run.journal.path
        journal, node, verbs = run.journal, run.node, run.mission.verbs()
        calls = CommandClient(node, verbs, run.orders.sign)
        # The server's thread has its own clock. Only the mission's clock reports stops and jumps of the time.
        clock = NodeTime(node)

        def record_breakpoint(text: str, reason: str) -> None:
            node.get_logger().warning(text)
            journal.record_observation(BREAKPOINT, text=reason)

        self._tools = LiveTools(record_breakpoint)

        def heartbeat() -> dict[str, object]:
            if self._has_ended:
                return {}
            self._tools.release_abandoned()
            try:
                return {"time": clock.now(), "verbs": [calls.available()]}
            except Exception:  # noqa: BLE001 - ROS may be shut down meanwhile, in another thread
                return {}

        robots, forms = [node.get_fully_qualified_name()], [[_form(verb) for verb in verbs]]
        tools = {
            **self._tools.tools,
            **({"report": PageQuery(self._report)} if journal.is_kept else {}),
        }
        hello: dict[str, object] = {"robots": robots, "verbs": forms, "tools": [*tools]}
        self._feed = feed = LiveFeed(hello, heartbeat, journals=[journal.path] if journal.is_kept else [])
        for entry in journal.earlier():
            feed.add_entry(entry)
        # These are separate listeners, so that the page continues if one of them fails.
        for listener in (feed.add_entry, _FailureExplainer(feed).add_entry, self._tools.add_entry):
            journal.add_listener(listener)
        self._orders = _LocalCommands(calls)
        self._server = PageServer(feed, port, self._orders, tools)
        self._server.start()
        print_error(f"The page of this run: {self._server.url}")
        if opens:
            open_page(self._server.url)

    def on_compiled(self, tree: CompiledTree, engine: Engine) -> None:
        """Enable queries about the tree."""
        self._tools.begin(tree, engine)

    def on_awaited(self, items: Sequence[AwaitedItem]) -> None:
        """Show the resources that the run waits for before it starts."""
        self._feed.set_awaited(items)

    def on_end(self, *, has_begun: bool) -> None:
        """Stop serving the page: on a terminal after Ctrl-C, otherwise immediately."""
        self._has_ended = self._orders.has_ended = True
        self._tools.stop_pausing()
        if has_begun and self._has_viewers and not self._run.signals.came:
            self._run.staying.append(self._wait_for_viewers)
        else:
            self._server.close()

    @property
    def _has_viewers(self) -> bool:
        is_terminal = draws_in_place(sys.stdout) and draws_in_place(sys.stderr)
        return is_terminal and not self._run.options.supervision.is_there

    def _report(self, _: Mapping[str, Any]) -> str:
        """Return the report after the run. During the run, raise an error so that the mission is not slowed down."""
        if not self._is_staying:
            raise ToolError("the page has no report while the run is active. Use sar-journal report instead")
        return report_page(self._place)

    def _wait_for_viewers(self) -> None:
        self._is_staying = True
        print_error(f"The run has ended. Its page stays open until Ctrl-C: {self._server.url}")
        while not self._run.signals.wait(_POLL_SEC) and not self._server.wait(0.0):
            pass
        self._server.close()


def open_page(url: str) -> None:
    """Open a page in the default browser, without waiting for the browser to start."""

    def show() -> None:
        if not webbrowser.open(url):
            print_error(f"No browser was found. Open {url}")

    Thread(target=show, name="browser", daemon=True).start()


class _LocalCommands:
    """Carries out commands to the robot of this process.

    Args:
        calls: Calls the services of the commands.
    """

    def __init__(self, calls: "CommandClient") -> None:
        self._calls = calls
        self.has_ended = False

    def send(self, verb: str, values: Mapping[str, Any], giver: CommandSender) -> Future[tuple[bool, str]]:
        """Send a command; see `CommandClient.send`.

        Raises:
            CommandError: If the command is invalid.
            SarError: If the run has ended.
        """
        if self.has_ended:
            message = "the run has ended"
            raise SarError(message)
        return self._calls.send(verb, values, giver.author(f"page, {giver.address}"), giver.seen)


def replay_journals(paths: Sequence[Path], port: int | None, *, opens: bool = False) -> None:
    """Serve a replay page of journals, one for each robot, until Ctrl-C.

    Raises:
        JournalError: If a journal cannot be read.
        PageError: If the port cannot be used.
    """
    from sar_compiler.project import Workspace

    replay = Replay(paths, lambda path: _explanation_data(_explain(path, Workspace())))
    tools = journal_tools(paths)
    feed = ReplayFeed(replay, {"robots": _names(paths), "tools": [*tools]})
    with _serve(feed, port, tools, opens=opens) as server:
        server.wait()


def watch_journals(paths: Sequence[Path], port: int | None, *, opens: bool = False) -> None:
    """Serve a page of missions that run in other processes, from the missions' journals, until Ctrl-C.

    Raises:
        JournalError: If a file is not a journal, or cannot be read.
        PageError: If the port cannot be used.
    """
    team = _TeamPage(paths)
    tools = journal_tools(paths, team.reading)
    hello: dict[str, object] = {"robots": _names(paths), "tools": [*tools]}
    team.feed = feed = LiveFeed(hello, team.heartbeat, len(paths), paths)
    with open_team_commands(print_error) as orders, _serve(feed, port, tools, orders, opens=opens) as server:
        team.orders = orders
        while not server.wait(_POLL_SEC):
            team.poll()


def watch_entries(
    name: str, news: Callable[[], Iterable[JournalEntry]], port: int | None, *, opens: bool = False
) -> None:
    """Serve a page of a run from its entries until Ctrl-C.

    Args:
        name: The name of the robot.
        news: Returns the entries since the last call.
        port: The port, as for `AppServer`.
        opens: Whether to open the page in a browser.

    Raises:
        PageError: If the port cannot be used.
    """
    feed = LiveFeed({"robots": [name], "verbs": [[]], "tools": []}, dict)
    explainer = _FailureExplainer(feed)
    with _serve(feed, port, {}, opens=opens) as server:
        while not server.wait(_PROGRAM_POLL_SEC):
            entries = [*news()]
            for entry in entries:
                feed.add_entry(entry)
                explainer.add_entry(entry)
            if any(
                entry.kind == STATUS and entry.data.get("node") == 0 and entry.data.get("status") == FAILURE
                for entry in entries
            ):
                explainer.explain()


class _TeamPage:
    """The data for a page of missions in other processes.

    Args:
        paths: The journals of the missions.

    Attributes:
        feed: The events for the page.
        orders: Carries out commands; None without ROS.
        reading: The lock that is held while a journal is read. Otherwise the check for a writer would release the file locks of other
            readers in this process.
    """

    feed: LiveFeed

    def __init__(self, paths: Sequence[Path]) -> None:
        from sar_compiler.journal.journal_follower import JournalFollower

        self.orders: TeamCommands | None = None
        self.reading = Lock()
        self._followers = [JournalFollower(path) for path in paths]
        self._heard = [time.monotonic() for _ in paths]

    def poll(self) -> None:
        """Send the new entries of all journals to the page.

        Raises:
            JournalError: If a file is not a journal, or cannot be read.
        """
        with self.reading:
            self._send_new()

    def _send_new(self) -> None:
        for robot, follower in enumerate(self._followers):
            is_gone = not is_locked(follower.path)
            for entry in follower.read_new():
                self._heard[robot] = time.monotonic()
                self.feed.add_entry(entry, robot)
                self._process_entry(robot, entry, follower.path)
            self.feed.set_process(RunProcess(is_gone, time.monotonic() - self._heard[robot]), robot)

    def _process_entry(self, robot: int, entry: JournalEntry, path: Path) -> None:
        if entry.kind == RUN_BEGAN and self.orders is not None:
            self.feed.offer([_form(verb) for verb in self.orders.add_run(robot, entry)], robot)
        if entry.kind == RUN_ENDED and (why := _explanation_data(_explain(path))) is not None:
            self.feed.set_why(why, robot)

    def heartbeat(self) -> dict[str, object]:
        """Return the values of the heartbeat that is sent every second."""
        if self.orders is None:
            return {}
        return {"verbs": [self.orders.available(robot) for robot, _ in enumerate(self._followers)]}


def _explain(path: Path, workspace: "Workspace | None" = None) -> Explanation:
    with JournalFile.open_snapshot(path) as file:
        return Explanation.explain(file, workspace)


def _explanation_data(explained: Explanation) -> dict[str, Any] | None:
    return explained.data() if explained.reasons.has_cause else None


class _FailureExplainer:
    """Sends a page the cause of the mission's failure at the end of a run.

    Args:
        feed: The events for the page.
    """

    def __init__(self, feed: LiveFeed) -> None:
        self._feed = feed
        self._analysis = FailureAnalysis()

    def add_entry(self, entry: JournalEntry) -> None:
        """Add an entry of the run to the analysis. At the end of the run, send the cause of a failure."""
        self._analysis.add_entry(entry)
        if entry.kind == RUN_ENDED:
            self.explain()

    def explain(self) -> None:
        """Send the cause of the failure if the mission has failed."""
        why = _explanation_data(Explanation(self._analysis.find_cause(), self._analysis.state.nodes))
        if why is not None:
            self._feed.set_why(why)


@contextmanager
def _serve(
    feed: "LiveFeed | ReplayFeed",
    port: int | None,
    tools: Tools,
    orders: CommandHandler | None = None,
    *,
    opens: bool,
) -> Iterator[PageServer]:
    with closing(PageServer(feed, port, orders, tools)) as server:
        server.start()
        print(f"Page: {server.url} (stop it with Ctrl-C)", flush=True)
        if opens:
            open_page(server.url)
        yield server


def _names(paths: Sequence[Path]) -> list[str]:
    """Return the robots' names: the namespaces in the journal file names if unique, otherwise the file names."""
    stems = [path.stem for path in paths]
    spaces = [stem.partition(".")[0] for stem in stems]
    return spaces if len(set(spaces)) == len(stems) else stems


def _form(verb: OperatorCommand) -> dict[str, Any]:
    """Convert a command to JSON values for the page."""
    own = {name: value for name, value in verb._asdict().items() if name not in ("service_type", "fill")}
    return {**own, "fields": [{**field._asdict(), "longest": LONGEST} for field in verb.fields]}
