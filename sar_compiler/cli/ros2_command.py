"""`ros2 mission`: subcommands of `ros2` that check and run missions, and send commands to running missions."""

import argparse
import getpass
import socket
import sys
import time
from collections.abc import Sequence
from functools import partial

from ros2cli.command import CommandExtension

from sar_compiler.commands import OK, USAGE
from sar_compiler.journal.journal_entries import CommandAuthor
from sar_compiler.ros.mission_graph import (
    MissionCommandError,
    available_commands,
    find_missions,
    send_command,
)
from sar_compiler.ros.serving import spinning_node

_COMMANDS = {
    "pause": "pause a mission: its robot stops",
    "resume": "resume a paused mission",
    "skip": "skip the current task of a mission",
    "abort": "end a mission; its robot stays where it is",
}
# No argument starts with this prefix, so argparse finds no options and passes all arguments on to the command.
_NO_PREFIX = "\0"


class MissionCommand(CommandExtension):
    """Check and run missions, and send commands to running ones."""

    def add_arguments(
        self,
        parser: argparse.ArgumentParser,
        cli_name: str,  # noqa: ARG002 - the interface of ros2cli
        *,
        argv: Sequence[str] | None = None,  # noqa: ARG002 - the interface of ros2cli
    ) -> None:
        """Add the subcommands."""
        verbs = parser.add_subparsers(dest="_verb", metavar="VERB")
        for name, text in (
            ("validate", "check trees, as sar-compile validate does"),
            ("run", "run a mission, as sar-run does"),
        ):
            passed = verbs.add_parser(name, help=text, prefix_chars=_NO_PREFIX, add_help=False)
            passed.add_argument("rest", nargs=argparse.REMAINDER)
        verbs.add_parser("list", help="list the missions that drive a robot, and their commands")
        for name, text in (*_COMMANDS.items(), ("order", "send any command that has no values")):
            order = verbs.add_parser(name, help=text)
            if name == "order":
                order.add_argument("order", metavar="ORDER", help="the command's name, or a prefix of it")
            order.add_argument(
                "--node", help="the mission's node (may be omitted if only one mission is running)"
            )
            order.add_argument("--reason", default="", help="the reason to record in the journal")

    def main(self, *, parser: argparse.ArgumentParser, args: argparse.Namespace) -> int:
        """Execute the subcommand, and return the exit status."""
        if args._verb is None:  # noqa: SLF001 - our own
            parser.print_help()
            return OK
        return _main(args._verb, args)  # noqa: SLF001 - our own


def _main(verb: str, args: argparse.Namespace) -> int:
    if verb == "validate":
        from sar_compiler.cli.compile import main as sar_compile

        return sar_compile(["validate", *args.rest])
    if verb == "run":
        from sar_compiler.cli.run import main as sar_run

        return sar_run(args.rest)
    if verb == "list":
        return _list()
    try:
        print(_send_command(args.order if verb == "order" else verb, args.node, args.reason))
    except MissionCommandError as error:
        print(f"ros2 mission {verb}: {error}", file=sys.stderr)
        return USAGE
    return OK


def _list() -> int:
    with spinning_node("sar_mission_list") as node:
        claims = find_missions(node)
        for claim in claims:
            since = time.strftime("%H:%M:%S", time.localtime(claim.since / 1e9))
            state = "running" if claim.runs else "waiting"
            print(f"{claim.describe()}: {state} since {since}, drives {claim.action}")
            if commands := available_commands(node, claim.node):
                print(f"  commands: {', '.join(commands)}")
    if not claims:
        print("No mission that drives a robot was found.")
    return OK


def _send_command(name: str, mission_node: str | None, reason: str) -> str:
    from sar_compiler.execution.command_authors import RemoteCommandAuthor

    with spinning_node("sar_mission_order") as node:
        claims = find_missions(node)
        known = {claim.node for claim in claims}
        if mission_node is None and len(known) != 1:
            message = (
                f"several missions are running ({', '.join(sorted(known))}): choose one with --node"
                if known
                else "no mission was found"
            )
            raise MissionCommandError(message)
        full = f"/{mission_node.lstrip('/')}" if mission_node is not None else known.pop()
        commands = available_commands(node, full)
        matching = [each for each in commands if each == name] or [
            each for each in commands if each.startswith(name)
        ]
        if len(matching) != 1:
            raise MissionCommandError(
                f"{full} has no command '{name}' (known commands: {', '.join(commands) or 'no commands without values'})"
            )
        author = CommandAuthor(f"ros2 mission of {getpass.getuser()}@{socket.gethostname()}", reason)
        signature = RemoteCommandAuthor(node, full)
        return (
            send_command(node, full, matching[0], partial(signature.sign, matching[0], author))
            or f"{matching[0]}: done"
        )
