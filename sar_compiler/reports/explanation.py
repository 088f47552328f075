"""Explains a failed run: finds the cause, and the changes with which the run would have succeeded."""

import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from sar_compiler.budget import Budget, BudgetSpentError
from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import OF_ROBOT, JournalEntry
from sar_compiler.nodes.palettes import is_palette_name
from sar_compiler.opener import is_file
from sar_compiler.tree.display_text import escape_to_one_line

if TYPE_CHECKING:
    from sar_compiler.analysis.simulated_tree import SimulatedTree
    from sar_compiler.analysis.verify.counterfactual import Counterfactual
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.journal.mission_state import MissionState, NodeState
    from sar_compiler.journal.recorded_ticks import TickSource
    from sar_compiler.project import Workspace
    from sar_compiler.reports.why import CauseOfFailure

T = TypeVar("T")
R = TypeVar("R")


class GoneTreeError(SarError):
    """The tree file that a run has used is unknown or missing."""


class CounterfactualRun(NamedTuple):
    """The result of a search for changes that would have made a run succeed.

    Attributes:
        found: The changes that would have made the run succeed; None if no such changes were found.
        reason: The reason why no changes were found; empty if changes were found.
    """

    found: "Counterfactual | None" = None
    reason: str = ""


class Explanation(NamedTuple):
    """The explanation of why the last run of a mission failed.

    Attributes:
        reasons: The causes of the run's failure.
        nodes: The nodes of the run's tree.
        otherwise: The changes that would have made the run succeed, if requested.
    """

    reasons: "CauseOfFailure"
    nodes: "Sequence[NodeState]"
    otherwise: CounterfactualRun = CounterfactualRun()

    @classmethod
    def explain(
        cls,
        file: "JournalFile",
        projects: "Workspace | None" = None,
        tree_file: Path | None = None,
        *,
        is_gone: bool = True,
        budget: Budget | None = None,
    ) -> "Explanation":
        """Explain why the last run in a journal failed.

        Args:
            file: The journal, open as a snapshot.
            projects: Loads the tree; None if the changes that lead to success are not requested.
            tree_file: The tree file; by default the tree file of the run.
            is_gone: Whether the process that wrote the journal no longer exists.
            budget: The limits of the search for changes.

        Raises:
            JournalError: If the journal cannot be read.
        """
        from sar_compiler.journal.mission_state import tree_nodes
        from sar_compiler.journal.recorded_ticks import TickLog
        from sar_compiler.reports.why import FailureAnalysis

        log = None if projects is None else TickLog([*tree_nodes(file.description().get("tree"))])
        analysis = FailureAnalysis.from_stream(file.last_run(without=OF_ROBOT, is_condensed=True, log=log))
        analysis.state.update_process(is_gone=is_gone)
        reasons = analysis.find_cause()
        if not reasons.chain or projects is None or log is None:
            return cls(reasons, analysis.state.nodes)
        log.last = analysis.failed_tick
        search = partial(find_counterfactual, analysis.state, log, projects, tree_file)
        try:
            change = (budget or Budget()).run(search)
        except BudgetSpentError as error:
            change = CounterfactualRun(reason=str(error))
        if change.found is not None:
            reasons = analysis.with_decisive_leaf(reasons, change.found)
        return cls(reasons, analysis.state.nodes, change)

    def text(self) -> str:
        """Return the explanation as text."""
        from sar_compiler.reports.why import cause_text, counterfactual_text

        change, reason = self.otherwise
        if change is not None:
            return cause_text(self.reasons, counterfactual_text(change, self.nodes))
        unknown = (
            escape_to_one_line(f"It is unknown which changes would have led to success: {reason}")
            if reason
            else ""
        )
        return cause_text(self.reasons, unknown)

    def data(self) -> dict[str, Any]:
        """Return the explanation as a JSON object."""
        from sar_compiler.reports.why import cause_data, counterfactual_data

        change, reason = self.otherwise
        return {
            **cause_data(self.reasons),
            "counterfactual": change and counterfactual_data(change, self.nodes),
            "counterfactual_missing": reason,
        }


def tree_entries(file: "JournalFile") -> Iterator[JournalEntry]:
    """Yield the entries of the last run, except observations from the robot's topics."""
    return file.last_run(without=OF_ROBOT)


def find_counterfactual(
    state: "MissionState",
    record: "TickSource",
    projects: "Workspace",
    tree_file: Path | None = None,
) -> CounterfactualRun:
    """Find changes with which the failed last run of a mission would have succeeded.

    Args:
        state: The state of the mission after the run.
        record: The recorded ticks of the run.
        projects: Loads the tree.
        tree_file: The tree file; by default the tree file of the run.
    """
    from sar_compiler.analysis.verify.counterfactual import counterfactual
    from sar_compiler.analysis.verify.recorded_runs import OtherTreeError
    from sar_compiler.tree.diagnostic import TreeError

    try:
        names = [each.name for each in state.nodes]
        trees = candidate_trees(state, projects, tree_file)
        found = answer_for_matching_tree(trees, lambda tree: counterfactual(tree, record, names))
    except GoneTreeError as error:
        return CounterfactualRun(reason=f"{error}. Add --tree-file TREE")
    except OtherTreeError:
        path = tree_file or state.runs[-1].about.get("tree_file")
        return CounterfactualRun(reason=f"{path} now contains another tree. Add --tree-file TREE")
    except TreeError as error:
        path = tree_file or state.runs[-1].about.get("tree_file")
        missing = _missing_options(state, projects)
        if missing:
            return CounterfactualRun(
                reason=f"{path} cannot be loaded without the options of the run: {error.findings[0].message}. Add {shlex.join(missing)}"
            )
        return CounterfactualRun(reason=f"{path} now has errors: {error.findings[0].message}")
    except SarError as error:
        return CounterfactualRun(reason=str(error))
    return CounterfactualRun(
        found, "" if found is not None else "no small change of leaf outcomes makes the mission succeed"
    )


def _options_of(about: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the recorded options with which a run selected nodes, such as --nodes.

    Ignore malformed entries.
    """
    recorded = about.get("options")
    pairs = recorded if isinstance(recorded, list) else []
    return [(str(pair[0]), str(pair[1])) for pair in pairs if isinstance(pair, list) and len(pair) > 1]


def _missing_options(state: "MissionState", projects: "Workspace") -> list[str]:
    """Return the last run's node options that the user must repeat on the command line."""
    added = projects.additions
    given = {*map(str, added.nodes), *(str(each.resolve()) for each in (*added.models, *added.include_path))}
    return [
        word
        for option, value in _options_of(state.runs[-1].about)
        if value not in given and not is_palette_name(value)
        for word in (option, value)
    ]


def palettes_of(about: Mapping[str, Any]) -> list[Path]:
    """Return the installed palettes that a run has used according to the description of the run."""
    return [
        Path(value) for option, value in _options_of(about) if option == "--model" and is_palette_name(value)
    ]


def _add_palettes_of(state: "MissionState", projects: "Workspace") -> "Workspace":
    """Return a copy of the workspace that also has the installed palettes of the last run."""
    added = projects.additions
    models = tuple(dict.fromkeys((*added.models, *palettes_of(state.runs[-1].about))))
    return replace(projects, additions=added._replace(models=models))


def candidate_trees(
    state: "MissionState", projects: "Workspace", tree_file: Path | None = None
) -> "Iterator[SimulatedTree]":
    """Yield the last run's tree with stub leaves: first with assumed limits on how often events occur, then without.

    Raises:
        GoneTreeError: If the tree file is unknown or missing.
        TreeError: If the tree has errors.
    """
    from sar_compiler.analysis.assumptions import StartValues
    from sar_compiler.analysis.tree_analysis import stage_of
    from sar_compiler.analysis.verify.limits import remove_limits

    about: Mapping[str, Any] = state.runs[-1].about
    file = tree_file or about.get("tree_file")
    if file is None:
        raise GoneTreeError("the journal does not name the tree file")
    path = Path(str(file))
    if not is_file(path):
        raise GoneTreeError(f"{path} does not exist")
    values = StartValues(state.parameters, about.get("facts") or {})
    loaded = _add_palettes_of(state, projects).load_file(path)
    yield stage_of(loaded, about.get("tree_id"), values).play().simulated
    unlimited = stage_of(loaded, about.get("tree_id"), values).play().simulated
    if remove_limits(unlimited, values.facts):
        yield unlimited


def answer_for_matching_tree(trees: Iterable[T], ask: Callable[[T], R]) -> R:
    """Return the result of *ask* for the first tree that can reproduce the recorded run.

    Raises:
        NotReplayedError: If no tree reproduces the run.
    """
    from sar_compiler.analysis.verify.recorded_runs import NotReplayedError

    first, *others = trees
    try:
        return ask(first)
    except NotReplayedError:
        if not others:
            raise
        return answer_for_matching_tree(others, ask)
