"""`sar-journal stats`: frequencies and durations of the outcomes of a tree's leaves."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sar_compiler.cli.arguments import FILE, FORMAT_HELP, confidence
from sar_compiler.commands import print_text
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import OF_ROBOT

if TYPE_CHECKING:
    from sar_compiler.reports.leaf_statistics import RunStatistics


def add_stats(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `stats`."""
    add = parser.add_argument
    add("journals", type=FILE, nargs="+", metavar="FILE", help="the journals, of one tree")
    text = "the confidence of the intervals, which are Wilson's (default 0.95)"
    add("--confidence", type=confidence, default=0.95, metavar="C", help=text)
    text = f"{FORMAT_HELP}; yaml: `outcomes:` of a properties file, with probabilities (p) and times (sec)"
    add("--format", choices=("text", "json", "yaml"), default="text", help=text)
    parser.set_defaults(run=print_statistics)


def print_statistics(options: argparse.Namespace) -> None:
    """Print the outcomes of the leaves in all runs of some journals.

    Raises:
        JournalError: If a journal cannot be read, or is of another tree than the first.
    """
    from sar_compiler.reports import leaf_statistics as view

    found = _statistics(options.journals)
    if options.format == "text":
        print_text(view.statistics_as_text(found, options.confidence))
    else:
        form = view.statistics_as_json if options.format == "json" else view.statistics_as_yaml
        print(form(found, options.confidence))


def _statistics(journals: Sequence[Path]) -> "RunStatistics":
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.reports.leaf_statistics import RunStatistics

    found, first = RunStatistics(), None
    for place in journals:
        with JournalFile.open_snapshot(place) as file:
            nodes = node_identities(file.description().get("tree"))
            first = nodes if first is None else first
            if nodes != first:
                raise JournalError(
                    f"{place} and {journals[0]} record different trees: {nodes_difference(first, nodes)}. "
                    "Outcomes can be counted for one tree only"
                )
            found.add(file.every_run(without=OF_ROBOT, is_condensed=True))
    return found


def node_identities(tree: Any) -> list[tuple[str, int, str, Any]]:
    """Return the identity of each node, which does not depend on the file's location."""
    from sar_compiler.journal.mission_state import tree_nodes

    return [(node.name, node.depth, node.kind, node.attributes) for node in tree_nodes(tree)]


def nodes_difference(there: Sequence[tuple[Any, ...]], here: Sequence[tuple[Any, ...]]) -> str:
    """Describe the first difference between two trees' nodes (`node_identities`)."""
    for was, now in zip(there, here, strict=False):
        if was[:3] != now[:3]:
            return f"'{now[0]}' ({now[2]}) replaces '{was[0]}' ({was[2]})"
        if was != now:
            return f"'{now[0]}' has different attributes"
    return f"it has {len(here)} nodes instead of {len(there)}"
