"""`sar-compile conform`: check that a tree allows the recorded runs, and that they satisfy its properties."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.budget import BudgetSpentError
from sar_compiler.cli.arguments import FILE, INPUT_HELP, TREE_INPUT, YAML_FILE, budget_of, load_checked
from sar_compiler.cli.verify import add_search_options, parse_facts
from sar_compiler.commands import FINDINGS, OK, print_text
from sar_compiler.errors import UndecidableError
from sar_compiler.journal.journal_entries import OF_ROBOT, STATUS, Ending

if TYPE_CHECKING:
    from sar_compiler.analysis.conformance import Conformance
    from sar_compiler.budget import Budget
    from sar_compiler.journal.mission_state import MissionState
    from sar_compiler.project import ProjectTree
    from sar_compiler.reports.compared_runs import ComparedRun


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `conform`."""
    add = parser.add_argument
    add("file", type=TREE_INPUT, metavar="TREE", help=INPUT_HELP)
    add(
        "journals",
        type=FILE,
        nargs="+",
        metavar="JOURNAL",
        help="the journals; the last run in each journal is compared with the tree",
    )
    text = "a file with the properties to check in the recorded runs (default: the mission's own file)"
    add("--properties", type=YAML_FILE, metavar="P.yaml", help=text)
    add_search_options(parser, "compare with")
    parser.set_defaults(run=conform_runs)


def conform_runs(arguments: argparse.Namespace) -> int:
    """Compare recorded runs with all possible runs of a tree, and print the deviations.

    Returns:
        0 if every recorded run is a possible run of the tree and violates no property, otherwise 1; 130 after Ctrl-C.

    Raises:
        TreeError: If a file has errors.
        JournalError: If a journal cannot be read.
    """
    from sar_compiler.reports import compared_runs as views

    for journal in arguments.journals:
        arguments.model += _palettes_of(journal)
    (tree,) = load_checked(arguments, arguments.file)
    # The comparison does not check the budget, so it is abandoned without a grace period.
    budget = budget_of(arguments, patience_sec=0.0)
    runs = [_compared_run(place, tree, budget, arguments) for place in arguments.journals]
    show = views.runs_as_json if arguments.format == "json" else views.runs_as_text
    print_text(show(runs))
    if budget.is_interrupted:
        return budget.exit_status
    return OK if all(each.is_fine for each in runs) else FINDINGS


def _compared_run(
    place: Path, tree: "ProjectTree", budget: "Budget", arguments: argparse.Namespace
) -> "ComparedRun":
    """Compare the last run of a journal with the tree."""
    from sar_compiler.analysis.verify.recorded_runs import OtherTreeError
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.journal.mission_state import MissionState
    from sar_compiler.reports.compared_runs import ComparedRun
    from sar_compiler.reports.journals import journal_state

    with JournalFile.open_snapshot(place) as file:
        state = MissionState.from_stream(file.last_run(without=(*OF_ROBOT, STATUS)))
    state.update_process(is_gone=not file.is_written)
    compared = ComparedRun(place, state.runs[-1].number if state.runs else 0, journal_state(state), None)
    if not state.nodes:
        return compared._replace(problem="the journal contains no run of a tree")
    try:
        found = budget.run(lambda: _compare_run(tree, place, state, arguments))
        return compared._replace(found=found, changed=_describe_tree_changes(tree, state, arguments))
    except OtherTreeError as error:
        return compared._replace(
            problem=f"{error}. The journal records a run of {_tree_of(state)}, not of {tree.path}"
        )
    except BudgetSpentError as error:
        return compared._replace(problem=str(error))
    except UndecidableError as error:
        return compared._replace(problem=f"the run cannot be checked: {error}")


def _palettes_of(place: Path) -> list[Path]:
    """Return the installed palettes that were used in the last run of a journal."""
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.reports.explanation import palettes_of

    with JournalFile.open_snapshot(place) as file:
        runs = file.runs()
    return palettes_of(runs[-1].about) if runs else []


def _compare_run(
    tree: "ProjectTree", place: Path, state: "MissionState", arguments: argparse.Namespace
) -> "Conformance":
    from sar_compiler.analysis.assumptions import StartValues
    from sar_compiler.analysis.tree_analysis import conform_tree
    from sar_compiler.analysis.verify.recorded_runs import OtherTreeError
    from sar_compiler.journal.last_run import LastRunEvents
    from sar_compiler.nodes.binding.nesting import UnknownTreeError

    run = state.runs[-1]
    is_imported = "imported" in run.about
    earlier = (
        [LastRunEvents(place, number, state.nodes) for number in range(1, run.number)] if is_imported else []
    )
    try:
        return conform_tree(
            tree,
            LastRunEvents(place, run.number, state.nodes),
            [each.name for each in state.nodes],
            arguments.properties,
            is_over=run.ending == Ending.OVER.value,
            start=StartValues(state.parameters, run.about.get("facts") or {}),
            facts=parse_facts(arguments.set),
            params=arguments.params,
            tree_id=arguments.tree or run.about.get("tree_id"),
            is_imported=is_imported,
            earlier=earlier,
        )
    except UnknownTreeError as error:
        if arguments.tree is not None:
            raise
        raise OtherTreeError("the tree's nodes differ from the nodes of the run") from error


def _describe_tree_changes(tree: "ProjectTree", state: "MissionState", arguments: argparse.Namespace) -> str:
    """Describe the first difference between a tree and the tree of a recorded run; empty if they are equal."""
    from sar_compiler.cli.journal_stats import node_identities, nodes_difference
    from sar_compiler.compiler.outline import outline

    tree_id = arguments.tree or state.runs[-1].about.get("tree_id")
    before, now = map(node_identities, (state.about.get("tree"), outline(tree.preview(tree_id))))
    # Attributes in braces are not compared: the journal contains the entry that a parameter selected for the run.
    recorded = [
        (name, depth, kind, {**old, **{key: each for key, each in new.items() if "{" in str(each)}})
        for (name, depth, kind, old), (*_, new) in zip(before, now, strict=True)
    ]
    return nodes_difference(recorded, now) if recorded != now else ""


def _tree_of(state: "MissionState") -> str:
    about = state.runs[-1].about
    file, tree_id = about.get("tree_file"), about.get("tree_id")
    return f"'{tree_id or state.nodes[0].name}'{f' of {file}' if file else ''}"
