"""Commands to missions in other processes, sent to the services of the missions' nodes."""

import getpass
import socket
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.missions.mission import CommandError, MissionRun, OperatorCommand
from sar_compiler.missions.mission_choice import load_missions
from sar_compiler.missions.parameter_reader import ParameterReader
from sar_compiler.web.page_server import CommandSender

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.execution.command_client import CommandClient


class TeamCommands:
    """Carries out commands to several robots.

    Args:
        node: The node that sends the commands.
    """

    def __init__(self, node: "Node") -> None:
        self._node, self._page = node, f"team page of {_user()}@{socket.gethostname()}"
        self._calls: dict[int, tuple[str, CommandClient]] = {}

    def add_run(self, robot: int, began: JournalEntry) -> list[OperatorCommand]:
        """Process the start of a robot's run. Return the mission's commands, or none if the mission is not installed."""
        from sar_compiler.execution.command_authors import RemoteCommandAuthor
        from sar_compiler.execution.command_client import CommandClient

        mission, name = run_of(began), str(began.data["run"].get("node") or "")
        verbs = [*mission.verbs()] if mission is not None and name else []
        # A node that starts again under the same name has the same services.
        if verbs and self._calls.get(robot, ("",))[0] != name:
            sign = RemoteCommandAuthor(self._node, name).sign
            self._calls[robot] = name, CommandClient(self._node, verbs, sign, name)
        return verbs

    def available(self, robot: int) -> list[str]:
        """Return the names of the commands that a robot currently accepts."""
        return self._calls[robot][1].available() if robot in self._calls else []

    def send(self, verb: str, values: Mapping[str, Any], giver: CommandSender) -> "Future[tuple[bool, str]]":
        """Send a command; see `CommandClient.send`.

        Raises:
            CommandError: If the command is invalid, or the mission of the robot is not installed.
        """
        if giver.robot not in self._calls:
            raise CommandError(
                "this page cannot send commands to the robot, because its mission is not installed"
            )
        return self._calls[giver.robot][1].send(verb, values, giver.author(self._page), giver.seen)


@contextmanager
def open_team_commands(complain: Callable[[str], object]) -> Iterator[TeamCommands | None]:
    """Yield the object that carries out commands, or None if ROS is missing or cannot be used."""
    from sar_compiler.ros.middleware import MiddlewareError, require_middleware
    from sar_compiler.ros.serving import spinning_node

    try:
        require_middleware()
    except MiddlewareError as error:
        complain(f"This page cannot send commands: {error}")
        yield None
        return
    if find_spec("rclpy") is None:
        yield None
        return
    with spinning_node("sar_journal_watch") as node:
        yield TeamCommands(node)


def run_of(began: JournalEntry) -> MissionRun | None:
    """Return a run of the mission that a journal's first entry names; None if this mission is not installed."""
    try:
        mission = load_missions()[began.data["mission"]]
        # A journal may come from an untrusted source, so no file that it names is read. The parameters contain the content of such files.
        given = began.data["run"]["parameters"].items()
        return mission.begin(
            ParameterReader({name: value for name, value in given if name not in mission.path_parameters})
        )
    except Exception:  # noqa: BLE001 - the mission has changed since the run, or is not installed
        return None


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # the process has no user name
        return "an unknown user"
