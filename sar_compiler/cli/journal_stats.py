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
    add("journals", type=FILE, nargs="+", metavar="FILE", help="the journals, all of the same tree")
    text = "the confidence level of the Wilson intervals (default 0.95)"
    add("--confidence", type=confidence, default=0.95, metavar="C", help=text)
    text = f"{FORMAT_HELP}; yaml prints the section `outcomes:` of a properties file, with probabilities (p) and times (sec)"
    add("--format", choices=("text", "json", "yaml"), default="text", help=text)
    parser.set_defaults(run=print_statistics)


def print_statistics(options: argparse.Namespace) -> None:
    """Print the frequencies and durations of the leaf outcomes in all runs of the journals.

    Raises:
        JournalError: If a journal cannot be read, or records a different tree than the first journal.
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
                    "Count the outcomes of each tree with a separate command"
                )
            found.add(file.every_run(without=OF_ROBOT, is_condensed=True))
    return found


def node_identities(tree: Any) -> list[tuple[str, int, str, Any]]:
    """Return the name, depth, kind and attributes of each node of a tree in a journal."""
    from sar_compiler.journal.mission_state import tree_nodes

    return [(node.name, node.depth, node.kind, node.attributes) for node in tree_nodes(tree)]


def nodes_difference(old: Sequence[tuple[Any, ...]], new: Sequence[tuple[Any, ...]]) -> str:
    """Describe the first difference between two trees, given the results of `node_identities` for them."""
    for was, now in zip(old, new, strict=False):
        if was[:3] != now[:3]:
            return f"'{now[0]}' ({now[2]}) replaces '{was[0]}' ({was[2]})"
        if was != now:
            return f"'{now[0]}' has different attributes"
    return f"the tree has {len(new)} nodes instead of {len(old)}"
