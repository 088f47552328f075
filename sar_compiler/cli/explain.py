"""`sar-compile explain`: explain a kind of finding."""

import argparse

from sar_compiler.cli.arguments import ArgumentKind
from sar_compiler.commands import OK
from sar_compiler.errors import SarError


def add_explain(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `explain`."""
    text = "the code of a finding, shown in brackets after its severity"
    parser.add_argument("code", type=ArgumentKind("code"), metavar="CODE", help=text)
    parser.set_defaults(run=explain_code)


def explain_code(arguments: argparse.Namespace) -> int:
    """Print the page about a kind of finding, and return the exit status.

    Raises:
        SarError: If there is no such kind.
        ResourceError: If the pages are not installed.
    """
    from sar_compiler.tree.guessing import did_you_mean, nearest
    from sar_compiler.tree.kinds import KINDS
    from sar_compiler.views.findings import page_of

    if arguments.code not in KINDS:
        advice = did_you_mean(nearest(arguments.code, KINDS))
        raise SarError(f"no finding is called '{arguments.code}'{advice}")
    print(page_of(arguments.code), end="")
    return OK
