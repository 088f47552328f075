"""`sar-compile mcp`: the server of tools, which the program of an agent starts."""

import argparse
import sys
from pathlib import Path

from sar_compiler.cli.arguments import FOLDER, count, seconds
from sar_compiler.cli.loading import add_project_options
from sar_compiler.commands import OK, exit_on_interrupt
from sar_compiler.errors import SarError

_LIMIT_SEC = 60.0
_MEMORY_MIB, _LEAST_MEMORY_MIB = 2048, 256
"""How much address space a call may take, of which its libraries alone take some 150 MiB."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `mcp`."""
    text = "a folder whose files the tools may read (default: the current one); paths begin at the first; may be repeated"
    parser.add_argument("--root", action="append", default=[], type=FOLDER, metavar="FOLDER", help=text)
    text = f"give up a call after SEC seconds (default {_LIMIT_SEC:g})"
    parser.add_argument("--limit", type=seconds, default=_LIMIT_SEC, metavar="SEC", help=text)
    text = f"let a call take MIB mebibytes of memory at most, {_LEAST_MEMORY_MIB} or more (default {_MEMORY_MIB})"
    parser.add_argument("--memory", type=_memory, default=_MEMORY_MIB, metavar="MIB", help=text)
    add_project_options(parser)
    parser.set_defaults(run=serve_agent)


def _memory(text: str) -> int:
    """Read a number of mebibytes in which a call can begin."""
    if (given := count(text)) < _LEAST_MEMORY_MIB:
        raise argparse.ArgumentTypeError(
            f"'{text}' is too little: a call takes {_LEAST_MEMORY_MIB} MiB to begin"
        )
    return given


def serve_agent(arguments: argparse.Namespace) -> int:
    """Serve an agent by standard input and output until it ends the session.

    Raises:
        SarError: If a folder to read is none, or nobody has said which, or modules of leaves are to be trusted whatever they become.
    """
    if arguments.trust:
        raise SarError(
            "--trust would trust what an agent makes of the modules; say it to another command, once"
        )
    from sar_compiler.agent.mcp_server import ToolAccess, agent_server, find_roots
    from sar_compiler.commands import version_of
    from sar_compiler.nodes.palettes import is_palette_name

    # The calls run in the first folder, and not here.
    models = [each if is_palette_name(str(each)) else each.resolve() for each in arguments.model]
    folders = [each.resolve() for each in arguments.include_path]
    access = ToolAccess(
        find_roots(arguments.root),
        arguments.limit,
        arguments.memory * 2**20,
        [sys.executable, str(Path(sys.argv[0]).resolve())],
        vocabulary=[
            *(f"--nodes={each}" for each in arguments.nodes),
            *(f"--model={each}" for each in models),
            *(["--isolated"] if arguments.isolated else []),
        ],
        includes=[f"--include-path={each}" for each in folders],
        named=[*models, *folders],
    )
    exit_on_interrupt()
    agent_server(version_of("sar_compiler"), access).run("stdio")
    return OK
