"""`sar-journal`: evaluate the journal of a mission."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import suppress

from sar_compiler.cli.arguments import FILE, FORMAT_HELP, add_page_options, georeference, report_forms
from sar_compiler.cli.journal_check import add_check
from sar_compiler.cli.journal_import import add_import
from sar_compiler.cli.journal_stats import add_stats
from sar_compiler.cli.journal_watch import JOURNALS_HELP, add_watch
from sar_compiler.cli.journal_why import add_why
from sar_compiler.cli.parser import Parser
from sar_compiler.commands import OK, add_version, interruptible, run
from sar_compiler.journal.journal_entries import OF_ROBOT

_JOURNAL_HELP = "the journal; a running mission may be writing to it"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command `sar-journal`.

    Args:
        argv: The arguments without the command's name; by default those of the process.

    Returns:
        The exit status: 0; 1 if a report could not be written, or a journal was altered; 2 for wrong usage, or an unreadable or invalid file.
    """
    return run(lambda: _command(sys.argv[1:] if argv is None else argv), "sar-journal")


def _command(argv: Sequence[str]) -> int:
    options = _parser().parse_args(argv)
    status: int | None = options.run(options)
    return status or OK


def _parser() -> Parser:
    parser = Parser("sar-journal", "Evaluate the journal of a mission.")
    add_version(parser)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    text = "List the events of a mission: its runs, actions and goals."
    show = commands.add_parser("show", help=text, description=text)
    show.add_argument("journal", type=FILE, metavar="FILE", help=_JOURNAL_HELP)
    show.add_argument("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)
    text = "also list observations: statuses of nodes, log lines, poses, plans, and ends of goals"
    show.add_argument("--all", action="store_true", help=text)
    show.set_defaults(run=_show)
    text = "Write a report of a mission, for printing, for maps, or for emergency services."
    report = commands.add_parser("report", help=text, description=text)
    report.add_argument("journal", type=FILE, metavar="FILE", help=_JOURNAL_HELP)
    text = f"the files to write, each {report_forms()}"
    report.add_argument("-o", "--output", nargs="+", required=True, type=FILE, metavar="OUT", help=text)
    text = "latitude and longitude of the origin of the frame map, and heading of its x axis (clockwise from north), in degrees (default: recorded in the journal)"
    report.add_argument("--georeference", type=georeference, metavar="LAT,LON,HEADING", help=text)
    report.set_defaults(run=_report)
    text = "Explain why a mission failed: the outcomes that caused it, and the outcomes that would have made it succeed."
    add_why(commands.add_parser("why", help=text, description=text))
    text = "Check that journals were not altered, using the chained hashes of their entries."
    add_check(commands.add_parser("check", help=text, description=text))
    text = "Count the outcomes of the leaves in all runs of journals, and print frequencies, durations and intervals."
    add_stats(commands.add_parser("stats", help=text, description=text))
    text = "Convert another program's recording of a run to a journal that the other commands can read."
    add_import(commands.add_parser("import", help=text, description=text))
    text = "Serve a page on this machine that replays missions from their journals."
    page = commands.add_parser("replay", help=text, description=text)
    page.add_argument("journals", type=FILE, nargs="+", metavar="FILE", help=JOURNALS_HELP)
    add_page_options(page)
    page.set_defaults(run=_replay)
    text = "Serve a page on this machine that shows running missions from their journals, or the tree of another program from Nav2's log or Groot2's protocol."
    add_watch(commands.add_parser("watch", help=text, description=text))
    return parser


def _report(options: argparse.Namespace) -> int:
    from sar_compiler.reports.report_files import report_journal

    return report_journal(options.journal, options.output, options.georeference)


def _replay(options: argparse.Namespace) -> None:
    from sar_compiler.web.run_page import replay_journals

    interruptible()
    with suppress(KeyboardInterrupt):  # the usual end of the command
        replay_journals(options.journals, options.web_port, opens=options.open)


def _show(options: argparse.Namespace) -> None:
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.reports.journals import journal_json, journal_lines
    from sar_compiler.reports.why import FailureAnalysis, likeliest_cause

    # The journal is opened once, because opening it again would release the locks of the first reader in this process.
    with JournalFile.open_snapshot(options.journal) as file:
        analysis = FailureAnalysis.from_stream(file.last_run(without=OF_ROBOT, is_condensed=True))
        state, show_all = analysis.state, options.all
        state.update_process(is_gone=not file.is_written)
        if options.format == "json":
            lines = journal_json(file, state, with_watched=show_all)
        else:
            lines = journal_lines(file, state, likeliest_cause(analysis.find_cause()), with_watched=show_all)
        for line in lines:
            print(line)


if __name__ == "__main__":
    sys.exit(main())
