"""`sar-journal watch`: show running missions, and the running trees of other programs."""

import argparse
import signal
from contextlib import suppress
from pathlib import Path

from sar_compiler.cli.arguments import FILE, ArgumentKind, add_page_options, add_project_options, workspace
from sar_compiler.commands import interruptible, print_note
from sar_compiler.errors import SarError

JOURNALS_HELP = "the journals, one for each robot"


def add_watch(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `watch`."""
    add = parser.add_argument
    add("journals", type=FILE, nargs="*", metavar="FILE", help=JOURNALS_HELP)
    text = (
        "show the tree whose status changes Nav2 publishes on TOPIC, such as behavior_tree_log; needs --tree"
    )
    add("--topic", metavar="TOPIC", help=text)
    text = "show the tree of a program that uses BehaviorTree.CPP's Groot2Publisher"
    add("--groot2", metavar="HOST:PORT", help=text)
    text = "the file of the running tree (default: the tree that --groot2 reads); if repeated, the best match is used"
    add("--tree", action="append", default=[], type=ArgumentKind("tree", Path), metavar="TREE", help=text)
    text = "write the run of --topic or --groot2 to a new journal, for sar-journal why"
    add("--journal", type=FILE, metavar="FILE", help=text)
    add_page_options(parser)
    add_project_options(parser)
    parser.set_defaults(run=_watch)


def _watch(options: argparse.Namespace) -> None:
    """Serve the page until Ctrl-C.

    Raises:
        SarError: If a journal, a tree or a source cannot be used.
    """
    if sum(map(bool, (options.journals, options.topic, options.groot2))) != 1:
        raise SarError("specify either journals, --topic or --groot2")
    if options.topic is not None and not options.tree:
        raise SarError("--topic needs the tree file that bt_navigator has loaded: add --tree TREE")
    if options.journal is not None and options.journals:
        raise SarError(
            "--journal needs --topic or --groot2, because a run that is shown from its journal already has a journal"
        )
    interruptible()
    with suppress(KeyboardInterrupt):  # the usual end of the command
        if options.journals:
            from sar_compiler.web.run_page import watch_journals

            watch_journals(options.journals, options.web_port, opens=options.open)
        else:
            _watch_run(options)


def _watch_run(options: argparse.Namespace) -> None:
    from sar_compiler.importing.live_run import open_live_run
    from sar_compiler.web.run_page import watch_entries

    if options.journal is not None:
        interruptible(signal.SIGTERM, signal.SIGHUP)  # the journal must contain the end of the run
    topic, groot2 = options.topic, options.groot2
    with open_live_run(topic, groot2, workspace(options), options.tree, print_note, options.journal) as run:
        watch_entries(topic or groot2, run.read_new, options.web_port, opens=options.open)
