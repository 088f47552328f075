"""`sar-journal`: what a mission has left behind."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path

from sar_compiler.cli.arguments import REPORT_FORMS, Parser, port
from sar_compiler.cli.journal_why import add_why, tell_why
from sar_compiler.cli.loading import FORMAT_HELP
from sar_compiler.commands import OK, add_version, interruptible, run


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command `sar-journal`.

    Args:
        argv: The arguments without the command's name; by default the process's.

    Returns:
        The exit status: 0; 2 for wrong usage, or a file that is no journal or cannot be read.
    """
    return run(lambda: _command(_parser().parse_args(sys.argv[1:] if argv is None else argv)), "sar-journal")


def _command(options: argparse.Namespace) -> int:
    commands = {"show": _show, "report": _report, "why": _why, "replay": _serve, "watch": _serve}
    return commands[options.command](options)


def _parser() -> Parser:
    parser = Parser("sar-journal", "What a mission has left behind in its journal.")
    add_version(parser)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    text = "List the facts of a mission: its runs, what has happened, its goals."
    show = commands.add_parser("show", help=text, description=text)
    show.add_argument(
        "journal", type=Path, metavar="FILE", help="the journal; a mission may be writing to it"
    )
    show.add_argument("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)
    show.add_argument(
        "--all",
        action="store_true",
        help="list what was watched as well: nodes, log, pose, plan, ends of goals",
    )
    text = "Write a report of a mission, to be printed and handed on, or for maps and emergency services."
    report = commands.add_parser("report", help=text, description=text)
    report.add_argument(
        "journal", type=Path, metavar="FILE", help="the journal; a mission may be writing to it"
    )
    report.add_argument(
        "-o",
        "--output",
        nargs="+",
        required=True,
        type=Path,
        metavar="OUT",
        help=f"the files, each {REPORT_FORMS}",
    )
    report.rename("--to", "--output")
    text = "Explain why a mission has failed: from the root down to the answers that caused it, and what would have succeeded."
    add_why(commands.add_parser("why", help=text, description=text))
    for name, text in (
        ("replay", "Serve a page on this machine that shows missions again, back and forth through time."),
        (
            "watch",
            "Serve a page on this machine that shows missions while they run, from the journals they write.",
        ),
    ):
        page = commands.add_parser(name, help=text, description=text)
        page.add_argument("journals", type=Path, nargs="+", metavar="FILE", help="a journal for each robot")
        page.add_argument(
            "--web-port", type=port, metavar="N", help="the page's port (default 8043; 0 for any)"
        )
    return parser


def _why(options: argparse.Namespace) -> int:
    tell_why(options)
    return OK


def _report(options: argparse.Namespace) -> int:
    from sar_compiler.cli.run_report import report_journal

    report_journal(options.journal, options.output)
    return OK


def _serve(options: argparse.Namespace) -> int:
    from sar_compiler.cli.run_page import replay_journals, watch_journals

    interruptible()
    serve = replay_journals if options.command == "replay" else watch_journals
    with suppress(KeyboardInterrupt):  # which is how it ends
        serve(options.journals, options.web_port)
    return OK


def _show(options: argparse.Namespace) -> int:
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.views.journals import journal_json, journal_lines

    with closing(JournalFile.read(options.journal)) as file:
        lines = journal_json if options.format == "json" else journal_lines
        for line in lines(file, with_watched=options.all):
            print(line)
    return OK


if __name__ == "__main__":
    sys.exit(main())
