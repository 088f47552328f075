"""`sar-journal why`: explain why a mission failed, and which outcomes would have made it succeed."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import (
    FILE,
    FORMAT_HELP,
    ArgumentKind,
    add_budget,
    add_project_options,
    budget_of,
    workspace,
)
from sar_compiler.commands import OK, print_text
from sar_compiler.journal.refused_start import read_refusal
from sar_compiler.opener import is_file
from sar_compiler.tree.plain import as_json

if TYPE_CHECKING:
    from sar_compiler.reports.why import RunDifference


def add_why(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `why`."""
    add = parser.add_argument
    add("journal", type=FILE, metavar="FILE", help="the journal; its last run is explained")
    text = "also show the first difference from the last run in the journal OTHER"
    add("--against", type=FILE, metavar="OTHER", help=text)
    text = "the tree file, used to search for outcomes that would have led to success (default: the file that the journal names)"
    add("--tree-file", type=ArgumentKind("tree", Path), metavar="TREE", help=text)
    add_project_options(parser)
    add_budget(parser)
    add("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)
    parser.set_defaults(run=print_explanation)


def print_explanation(options: argparse.Namespace) -> int:
    """Print why the last run of a mission failed, and which outcomes would have made it succeed.

    If another run is given, also print the first difference between the two runs.

    Returns:
        0; 130 if Ctrl-C has ended the search for outcomes that would have led to success.

    Raises:
        JournalError: If a journal cannot be read.
    """
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.reports.explanation import Explanation
    from sar_compiler.reports.why import difference_data, difference_text

    refused = read_refusal(options.journal)
    if refused is not None and not is_file(options.journal):
        if options.format == "json":
            print(as_json({"refused_start": refused._asdict()}))
        else:
            print_text(refused.sentence)
        return OK
    with JournalFile.open_snapshot(options.journal) as file:
        # The explanation does not check the budget, so it is abandoned without a grace period.
        budget = budget_of(options, patience_sec=0.0)
        explained = Explanation.explain(
            file, workspace(options), options.tree_file, is_gone=not file.is_written, budget=budget
        )
    difference = None if options.against is None else _difference(options.journal, options.against)
    if options.format == "json":
        data = explained.data()
        more = {"difference": difference_data(difference)} if options.against is not None else {}
        more |= {"refused_start": refused._asdict()} if refused is not None else {}
        print(as_json({**data, **more}))
        return budget.exit_status if budget.is_interrupted else OK
    if refused is not None:
        print_text(f"{refused.sentence}\n\nThe previous run:\n")
    print_text(explained.text())
    if options.against is not None:
        print_text(f"\n{difference_text(difference, (str(options.journal), str(options.against)))}")
    return budget.exit_status if budget.is_interrupted else OK


def _difference(place: Path, other_place: Path) -> "RunDifference | None":
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.reports.explanation import tree_entries
    from sar_compiler.reports.why import first_difference

    with JournalFile.open_snapshot(place) as file, JournalFile.open_snapshot(other_place) as other:
        return first_difference(tree_entries(file), tree_entries(other))
