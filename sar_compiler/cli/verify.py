"""`sar-compile verify`: check properties in all possible runs of a tree."""

import argparse
import contextlib
import functools
import re
import sys
import time
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import (
    FORMAT_HELP,
    INPUT_HELP,
    TREE_INPUT,
    YAML_FILE,
    add_budget,
    add_mission,
    add_params,
    add_project_options,
    add_tree_id,
    budget_of,
    count,
    load_checked,
)
from sar_compiler.commands import FINDINGS, OK, CommandParser, print_error
from sar_compiler.errors import UndecidableError
from sar_compiler.terminal import ProgressLine, painter

if TYPE_CHECKING:
    from sar_compiler.analysis.verify.verdicts import Verification
    from sar_compiler.budget import Budget, Progress
    from sar_compiler.documents.located import Document

MAX_STATES = 1_000_000
_COLOURS = {"proved": "advice", "does not hold": "error", "not decided": "warning"}
_VERDICT = re.compile(f"(?<= )({'|'.join(_COLOURS)})(?=$|[:;])", re.MULTILINE)


def add_options(parser: CommandParser) -> None:
    """Add the arguments of `verify`."""
    add = parser.add_argument
    add("file", type=TREE_INPUT, metavar="FILE", help=INPUT_HELP)
    text = "another version of the tree, such as the file before a change, or a shipped tree; the verdicts that differ are reported"
    add("--against", type=TREE_INPUT, metavar="OTHER", help=text)
    text = "a file with the properties to prove (default: the mission's own)"
    add("--properties", type=YAML_FILE, metavar="P.yaml", help=text)
    text = f"explore at most N states; the runs beyond them stay undecided (default {MAX_STATES})"
    add("--max-states", type=count, default=MAX_STATES, metavar="N", help=text)
    add_search_options(parser, "verify")
    parser.set_defaults(run=verify_file)


def add_search_options(parser: argparse.ArgumentParser, use: str) -> None:
    """Add the options of commands that search all runs of a tree.

    The options select the tree, the initial state and the output format.

    Args:
        parser: The command's parser.
        use: The verb in the help of `--tree`, such as `verify`.
    """
    add_tree_id(parser, use)
    text = "the initial value of a fact, such as points_left=4; may be repeated"
    add = parser.add_argument
    add("--set", action="append", default=[], type=_assignment, metavar="FACT=VALUE", help=text)
    add_params(parser)
    add_project_options(parser)
    add_mission(parser)
    add_budget(parser)
    parser.add_argument("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)


def verify_file(arguments: argparse.Namespace) -> int:
    """Verify a tree or compare its verdicts with another tree's, and print the results, even after Ctrl-C.

    Returns:
        0 if all properties are proved, 1 if a property does not hold or is undecided, 130 after Ctrl-C. With `--against`:
            0 if no verdict is worse than the other tree's; 1 if one is worse, or the budget was too small for both trees.

    Raises:
        TreeError: If a file has errors.
    """
    from sar_compiler.analysis.simulated_tree import UnknownBehaviourError
    from sar_compiler.tree.diagnostic import TreeError

    started = time.monotonic()
    files = [file for file in (arguments.file, arguments.against) if file is not None]
    done: list[Verification] = []
    progress = SearchProgress()
    budget = budget_of(arguments, on_progress=progress.show)
    try:
        with contextlib.closing(progress):
            _verify_into(done, files, budget, progress, arguments)
    except TreeError:
        if done:
            print_error(f"sar-compile: {files[1]} cannot be verified with these options")
        raise
    except UnknownBehaviourError as error:
        print_error(str(error))
        return FINDINGS
    except UndecidableError as error:
        prefix = f"{files[len(done)]}: " if len(files) > 1 else ""
        print_error(f"sar-compile: {prefix}verification is impossible: {error}")
        return FINDINGS
    status = _print(done, files, time.monotonic() - started, arguments.format)
    if budget.is_interrupted or done[-1].stopped:
        print_error(f"sar-compile: {budget.reason}")
        status = budget.exit_status
    return status


def _verify_into(
    done: "list[Verification]",
    files: "list[str]",
    budget: "Budget",
    progress: "SearchProgress",
    arguments: argparse.Namespace,
) -> None:
    """Verify the trees one after the other with the same properties, until the budget is spent."""
    from sar_compiler.analysis.proofs import default_properties
    from sar_compiler.analysis.tree_analysis import verify_tree

    trees = load_checked(arguments, *files)
    properties = arguments.properties
    if properties is None and len(trees) > 1:
        defaults = (default_properties(tree, tree.binding(arguments.tree)) for tree in trees)
        properties = next((path for path in defaults if path is not None), None)
    for tree, file in zip(trees, files, strict=True):
        progress.begin(f"{file}: " if len(files) > 1 else "")
        verify = functools.partial(
            verify_tree,
            tree,
            properties,
            facts=parse_facts(arguments.set),
            params=arguments.params,
            tree_id=arguments.tree,
            max_states=arguments.max_states,
            budget=budget,
        )
        done.append(budget.run(verify))
        if budget.is_interrupted or done[-1].stopped:
            return


def _print(done: "list[Verification]", files: "list[str]", seconds: float, form: str) -> int:
    """Print the verification of one tree, or the comparison of two verifications, and return the exit status."""
    from sar_compiler.analysis import verification_view as views
    from sar_compiler.analysis.verify.verdicts import VerificationComparison

    if len(done) == 1:
        show = views.verification_as_json if form == "json" else views.verification_as_text
        _print_verdicts(show(done[0], seconds), form)
        fine = done[0].is_proved
    else:
        now, before = done
        comparison = VerificationComparison(before, now)
        compare = views.comparison_as_json if form == "json" else views.comparison_as_text
        _print_verdicts(compare(comparison, (files[1], files[0]), seconds), form)
        fine = not comparison.is_worse
    return OK if fine else FINDINGS


def _print_verdicts(text: str, form: str) -> None:
    """Print a result; colour its verdicts in the text format if standard output supports colours."""
    from sar_compiler.tree.display_text import visible

    paint = painter(sys.stdout)
    text = visible(text)
    print(text if form == "json" else _VERDICT.sub(lambda found: paint(found[0], _COLOURS[found[0]]), text))


def parse_facts(pairs: "list[tuple[str, str]]") -> "Document | None":
    """Parse the facts given with `--set`; None if no facts are given."""
    if not pairs:
        return None
    from sar_compiler.documents.yaml_files import parse_yaml

    # Each fact has its own line, so that an error shows only the line of the wrong fact.
    text = "".join(f"{name}: {value}\n" for name, value in pairs)
    return parse_yaml(text, "--set", "write FACT=VALUE")


def _assignment(text: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not (name.strip() and sign and value.strip()):
        raise argparse.ArgumentTypeError(f"'{text}' is not FACT=VALUE, such as points_left=4")
    return name.strip(), value.strip()


class SearchProgress:
    """Shows a search's progress and violated properties on standard error."""

    _PATIENCE_SEC = 1.0  # a violation found sooner is shown only in the result

    def __init__(self) -> None:
        self._line = ProgressLine()
        self._is_closed = False
        self.begin("")

    def begin(self, prefix: str) -> None:
        """Start the search of a tree; *prefix* precedes each line about the tree, to tell trees apart."""
        self._prefix, self._started, self._broken = prefix, time.monotonic(), 0

    def close(self) -> None:
        """Remove the progress line, and show no further progress."""
        self._is_closed = True
        self._line.clear()

    def show(self, progress: "Progress") -> None:
        """Update the progress line if an update is due.

        Report the properties violated since the last call.
        """
        if self._is_closed:
            return
        is_new = self._line.is_possible and len(progress.broken) > self._broken
        if is_new and time.monotonic() - self._started > self._PATIENCE_SEC:
            self._line.clear()
            for name in progress.broken[self._broken :]:
                message = f"{self._prefix}{name}: does not hold (press Ctrl-C to stop the search and see a counterexample)"
                print_error(f"sar-compile: {message}")
            self._broken = len(progress.broken)
        self._line.show(lambda: self._numbers(progress))

    def _numbers(self, progress: "Progress") -> str:
        rate = progress.states / (time.monotonic() - self._started)
        return (
            f"{self._prefix}{progress.states:,} states, {progress.states - progress.expanded:,} of them unexplored, "
            f"{progress.depth} ticks deep, {rate:,.0f} states/s"
        )
