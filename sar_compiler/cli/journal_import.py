"""`sar-journal import`: convert another program's recording of a run to a journal."""

import argparse
import shlex
from pathlib import Path

from sar_compiler.cli.arguments import FILE, ArgumentKind, add_project_options, run_number, workspace
from sar_compiler.commands import print_note, print_text


def add_import(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `import`."""
    add = parser.add_argument
    text = "the recorded run: a log of BehaviorTree.CPP's FileLogger2 (.btlog) or SqliteLogger (.db3), a bag with Nav2's behavior_tree_log (.mcap, .db3), or the name of a shipped recording"
    add("recording", type=ArgumentKind("file", _recording), metavar="RUN", help=text)
    text = "the journal to write, a new file"
    add("-o", "--output", type=FILE, required=True, metavar="JOURNAL", help=text)
    text = "the file of the tree that ran (default: the tree in RUN, which is written to JOURNAL.xml); if repeated, the best match is used"
    add("--tree", action="append", default=[], type=ArgumentKind("tree", Path), metavar="TREE", help=text)
    text = "import only the runs up to this number, so that sar-journal why explains this run (default: import all runs)"
    add("--run", type=run_number, dest="last_run", metavar="NUMBER", help=text)
    add_project_options(parser)
    parser.set_defaults(run=_import)


def _recording(name: str) -> Path:
    """Return the path of a recorded run, given its path or the name of a shipped recording."""
    from sar_compiler.resources import find

    return find("examples/recorded_runs", name, ".btlog")


def _import(options: argparse.Namespace) -> None:
    """Import a recorded run; print the run's size, and commands that explain the run.

    Raises:
        UnusableRecordingError: If the recording cannot be used.
        JournalError: If the journal cannot be written.
    """
    from sar_compiler.importing.import_run import import_run

    found = import_run(options.recording, options.output, workspace(options), options.tree, options.last_run)
    for flaw in found.flaws:
        print_note(f"{options.recording}: {flaw}")
    if found.unsure:
        print_note(
            f"{found.unsure} boundaries between ticks are uncertain, because only a short pause indicates each of them"
        )
    runs = f"{found.runs} runs" if found.runs != 1 else "1 run"
    print_text(
        f"{options.output}: {runs} of {found.nodes} nodes, {found.changes} status changes in {found.ticks} ticks"
    )
    if found.runs > 1:
        for number, end in enumerate(found.ends, 1):
            print_text(f"  run {number}: {end.seconds:.1f} s, {end.reason}")
        if options.last_run is None:
            print_text("To explain an earlier run: add --run NUMBER")
    journal = shlex.quote(str(options.output))
    print_text(f"To explain the run: sar-journal why {journal}")
    tree = shlex.join([str(found.tree), str(options.output), *found.options])
    print_text(f"To compare the run with its tree: sar-compile conform {tree}")
