"""`sar-journal watch`: show missions, and the trees of other programs, during their runs."""

import argparse
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import FILE, ArgumentKind, add_page_options, add_project_options, workspace
from sar_compiler.commands import interruptible, print_note
from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from sar_compiler.importing.live_run import RunSource

JOURNALS_HELP = "a journal for each robot"


def add_watch(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `watch`."""
    add = parser.add_argument
    add("journals", type=FILE, nargs="*", metavar="FILE", help=JOURNALS_HELP)
    text = "show the tree whose changes Nav2 publishes on TOPIC, such as behavior_tree_log; needs --tree"
    add("--topic", metavar="TOPIC", help=text)
    text = "show the tree of a program with BehaviorTree.CPP's Groot2Publisher"
    add("--groot2", metavar="HOST:PORT", help=text)
    text = "the file of the tree that runs (default: the tree that --groot2 reads); of several, the best fitting one is used"
    add("--tree", action="append", default=[], type=ArgumentKind("tree", Path), metavar="TREE", help=text)
    add_page_options(parser)
    add_project_options(parser)
    parser.set_defaults(run=_watch)


def _watch(options: argparse.Namespace) -> None:
    """Serve the page until Ctrl-C.

    Raises:
        SarError: If a journal, a tree or a source cannot be used.
    """
    given = [bool(options.journals), options.topic is not None, options.groot2 is not None]
    if given.count(True) != 1:
        raise SarError("name journals, or one of --topic and --groot2")
    if options.topic is not None and not options.tree:
        raise SarError("--topic needs --tree TREE, the file that bt_navigator has loaded")
    interruptible()
    with suppress(KeyboardInterrupt):  # the regular end
        if options.journals:
            from sar_compiler.web.run_page import watch_journals

            watch_journals(options.journals, options.web_port, opens=options.open)
        else:
            _watch_run(options)


def _watch_run(options: argparse.Namespace) -> None:
    from sar_compiler.importing.live_run import LiveRun
    from sar_compiler.web.run_page import watch_entries

    name = options.topic or options.groot2
    with (
        _run_source(options) as source,
        closing(LiveRun(source, name, workspace(options), options.tree, print_note)) as run,
    ):
        watch_entries(name, run.news, options.web_port, opens=options.open)


@contextmanager
def _run_source(options: argparse.Namespace) -> "Iterator[RunSource]":
    from sar_compiler.importing.live_run import Groot2Source, TopicSource

    if options.groot2 is not None:
        with closing(Groot2Source(options.groot2)) as source:
            yield source
        return
    from sar_compiler.ros.middleware import require_middleware
    from sar_compiler.ros.serving import spinning_node
    from sar_compiler.ros.tree_log_listener import TreeLogListener

    require_middleware()
    with spinning_node("sar_journal_watch") as node:
        yield TopicSource(TreeLogListener(node, options.topic).messages)
