"""`sar-compile predict`: probability of success and duration of a tree."""

import argparse
import contextlib
import functools
import time

from sar_compiler.cli.arguments import (
    FILE,
    INPUT_HELP,
    TREE_INPUT,
    YAML_FILE,
    budget_of,
    count,
    load_checked,
    tick_period,
)
from sar_compiler.cli.verify import MAX_STATES, SearchProgress, add_search_options, parse_facts
from sar_compiler.commands import FINDINGS, OK, print_error, print_text
from sar_compiler.errors import UndecidableError


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `predict`."""
    add = parser.add_argument
    add("file", type=TREE_INPUT, metavar="FILE", help=INPUT_HELP)
    text = "a properties file with the probabilities (p) and times (sec) of outcomes (default: the mission's own)"
    add("--properties", type=YAML_FILE, metavar="P.yaml", help=text)
    text = "another file with probabilities and times, such as of sar-journal stats; may be repeated"
    add("--outcomes", action="append", default=[], type=YAML_FILE, metavar="A.yaml", help=text)
    text = "the tick period in seconds (default: the period in --params, or 0.5)"
    add("--period", type=tick_period, metavar="SEC", help=text)
    text = f"explore at most N states; the runs beyond them stay undecided (default {MAX_STATES})"
    add("--max-states", type=count, default=MAX_STATES, metavar="N", help=text)
    text = "write an SVG plot of the probabilities that a run has ended, and has succeeded, over time"
    add("--plot", type=FILE, metavar="OUT.svg", help=text)
    add_search_options(parser, "predict")
    parser.set_defaults(run=predict_file)


def predict_file(arguments: argparse.Namespace) -> int:
    """Predict the runs of a tree, and print the results.

    Returns:
        0; 1 if the runs cannot be explored completely, or if there is nothing to plot; 130 after Ctrl-C.

    Raises:
        TreeError: If a file has errors.
    """
    from sar_compiler.analysis import prediction_view as views
    from sar_compiler.analysis.tree_analysis import predict_tree
    from sar_compiler.writing import write_text

    started = time.monotonic()
    progress = SearchProgress()
    budget = budget_of(arguments, on_progress=progress.show)
    try:
        with contextlib.closing(progress):
            predict = functools.partial(
                predict_tree,
                load_checked(arguments, arguments.file)[0],
                arguments.properties,
                outcomes=arguments.outcomes,
                facts=parse_facts(arguments.set),
                params=arguments.params,
                tree_id=arguments.tree,
                period_sec=arguments.period,
                max_states=arguments.max_states,
                budget=budget,
            )
            found = budget.run(predict)
    except UndecidableError as error:
        print_error(f"sar-compile: no prediction is possible: {error}")
        return FINDINGS
    taken_sec = time.monotonic() - started
    show = views.prediction_as_json if arguments.format == "json" else views.prediction_as_text
    print_text(show(found, taken_sec))
    if budget.is_interrupted or found.stopped:
        print_error(f"sar-compile: {budget.reason}")
    if arguments.plot is not None and not found.distribution:
        print_error(
            f"sar-compile: {arguments.plot} was not written, because no run ends or the end times were not computed"
        )
        return FINDINGS
    if arguments.plot is not None:
        write_text(arguments.plot, views.prediction_as_svg(found))
    is_whole = found.complete and not found.stopped and not found.undecided and not budget.is_interrupted
    return OK if is_whole else budget.exit_status
