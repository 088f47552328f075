"""`sar-compile mcp`: the tool server that an agent's program starts."""

import argparse
import sys
from pathlib import Path

from sar_compiler.cli.arguments import FOLDER, add_project_options, count, seconds
from sar_compiler.commands import OK, exit_on_interrupt
from sar_compiler.errors import SarError

_LIMIT_SEC = 60.0
_MEMORY_MIB, _MIN_MEMORY_MIB = 2048, 256
"""The default and the minimum address space of a call; the imported libraries alone need about 150 MiB."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `mcp`."""
    text = "a folder that the tools may read (default: the current folder); may be repeated; relative paths refer to the first folder"
    parser.add_argument("--root", action="append", default=[], type=FOLDER, metavar="FOLDER", help=text)
    text = f"abort a call after SEC seconds (default {_LIMIT_SEC:g})"
    parser.add_argument("--limit", type=seconds, default=_LIMIT_SEC, metavar="SEC", help=text)
    text = f"limit a call to MIB mebibytes of memory, {_MIN_MEMORY_MIB} or more (default {_MEMORY_MIB})"
    parser.add_argument("--memory", type=_memory, default=_MEMORY_MIB, metavar="MIB", help=text)
    add_project_options(parser)
    parser.set_defaults(run=serve_agent)


def _memory(text: str) -> int:
    """Parse a number of mebibytes of at least `_MIN_MEMORY_MIB`."""
    if (parsed := count(text)) < _MIN_MEMORY_MIB:
        raise argparse.ArgumentTypeError(f"'{text}' is too small: a call needs {_MIN_MEMORY_MIB} MiB")
    return parsed


def serve_agent(arguments: argparse.Namespace) -> int:
    """Serve an agent over standard input and output until it ends the session.

    Raises:
        SarError: If `--root` does not name a folder, if it is required but missing, or if `--trust` is passed.
    """
    if arguments.trust:
        raise SarError(
            "--trust cannot be used with this command, because it would also trust changes that an agent makes to the modules. To trust the current modules, run sar-compile validate with --trust once"
        )
    from sar_compiler.agent.mcp_server import ToolAccess, agent_server, find_roots
    from sar_compiler.commands import version_of
    from sar_compiler.nodes.palettes import is_palette_name

    # Calls run in the first folder instead of the current one.
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
