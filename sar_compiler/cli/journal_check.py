"""`sar-journal check`: use the hash chain to check that a journal was not altered."""

import argparse
import re

from sar_compiler.cli.arguments import FILE, FORMAT_HELP
from sar_compiler.commands import FINDINGS, OK, print_text
from sar_compiler.tree.plain import as_json

_DIGITS = re.compile("[0-9a-f]{64}")


def head(text: str) -> str:
    """Parse the head of a hash chain.

    Raises:
        argparse.ArgumentTypeError: If the text does not have 64 hexadecimal digits.
    """
    if not _DIGITS.fullmatch(text.lower()):
        raise argparse.ArgumentTypeError(f"'{text}' is not a journal hash, which has 64 hexadecimal digits")
    return text.lower()


def add_check(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `check`."""
    add = parser.add_argument
    add(
        "journals",
        type=FILE,
        nargs="+",
        metavar="FILE",
        help="the journals to check; their missions may still be running",
    )
    text = "the hash of the journal, as printed in the run's summary or report; allowed only with a single journal"
    add("--head", type=head, metavar="HEX", help=text)
    add("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)
    parser.set_defaults(run=lambda options: check_journals(parser, options))


def check_journals(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Report for each journal whether it was altered.

    Returns 1 if a journal was altered or cannot be checked, otherwise 0.

    Raises:
        JournalError: If a journal cannot be read.
    """
    if options.head and len(options.journals) > 1:
        parser.error("--head is the hash of one journal: check each journal with a separate command")
    from sar_compiler.reports.checked_journal import CheckedJournal

    verdicts = [CheckedJournal.check(place, options.head) for place in options.journals]
    if options.format == "json":
        print(as_json([verdict.data() for verdict in verdicts]))
    else:
        print_text("\n".join(map(CheckedJournal.text, verdicts)))
    return OK if all(verdict.is_good for verdict in verdicts) else FINDINGS
