"""`sar-compile mcp`: the server of tools, which the program of an agent starts."""

import argparse
import sys
from pathlib import Path

from sar_compiler.cli.arguments import FOLDER, seconds
from sar_compiler.cli.loading import add_project_options
from sar_compiler.commands import OK
from sar_compiler.errors import SarError

_LIMIT_SEC = 60.0


def add_mcp(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `mcp`."""
    text = "a folder whose files the tools may read (default: the current one); paths begin at the first; may be repeated"
    parser.add_argument("--root", action="append", default=[], type=FOLDER, metavar="FOLDER", help=text)
    text = f"give up a call after SEC seconds (default {_LIMIT_SEC:g})"
    parser.add_argument("--limit", type=seconds, default=_LIMIT_SEC, metavar="SEC", help=text)
    add_project_options(parser)
    parser.set_defaults(run=serve_agent)


def serve_agent(arguments: argparse.Namespace) -> int:
    """Serve an agent by standard input and output until it ends the session.

    Raises:
        SarError: If a folder to read is none, or nobody has said which, or modules of leaves are to be trusted whatever they become.
    """
    if arguments.trust:
        raise SarError(
            "--trust would trust what an agent makes of the modules; say it to another command, once"
        )
    from importlib.metadata import version

    from sar_compiler.agent.mcp_server import ToolAccess, agent_server, find_roots

    access = ToolAccess(
        find_roots(arguments.root),
        arguments.limit,
        [sys.executable, str(Path(sys.argv[0]).resolve())],
        [
            *(f"--nodes={each}" for each in arguments.nodes),
            *(f"--model={each}" for each in arguments.model),
        ],
        [f"--include-path={each}" for each in arguments.include_path],
    )
    agent_server(version("sar_compiler"), access).run("stdio")
    return OK
