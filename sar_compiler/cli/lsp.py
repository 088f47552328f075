"""`sar-compile lsp`: the language server, which editors start."""

import argparse
import sys
from pathlib import Path

from sar_compiler.budget import Budget, memory_now_mb
from sar_compiler.cli.arguments import add_budget, add_project_options, additions, budget_of
from sar_compiler.commands import OK, exit_on_interrupt


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lsp`."""
    parser.add_argument("--stdio", action="store_true", help="use standard input and output (the default)")
    add_project_options(parser)
    add_budget(parser)
    parser.set_defaults(run=serve)


def serve(arguments: argparse.Namespace) -> int:
    """Serve an editor until it ends the session."""
    from sar_compiler.commands import version_of
    from sar_compiler.lsp.features import tree_server

    options = [word for word in sys.argv[1:] if word not in ("lsp", "--stdio")]
    command = [sys.executable, str(Path(sys.argv[0]).resolve())]
    # The output of an imported module of leaves must not mix with the server's messages.
    output, sys.stdout = sys.stdout.buffer, sys.stderr
    exit_on_interrupt()

    def new_budget() -> Budget:
        return budget_of(arguments, patience_sec=0.0, memory=memory_now_mb)

    server = tree_server(version_of("sar_compiler"), additions(arguments), command, options, new_budget)
    server.start_io(stdout=output)
    return OK
