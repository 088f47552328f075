"""Why the last run of a mission has failed, and what would have succeeded in its place."""

import itertools
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
from sar_compiler.tree.showing import in_one_line

if TYPE_CHECKING:
    from sar_compiler.analysis.simulated_tree import SimulatedTree
    from sar_compiler.analysis.verify.counterfactual import Counterfactual
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.journal.mission_state import MissionState, NodeState
    from sar_compiler.project import Workspace
    from sar_compiler.reports.why import Why
    from sar_compiler.runtime.events import Event

T = TypeVar("T")
R = TypeVar("R")


class GoneTreeError(SarError):
    """The tree that ran is not to be found."""


class Otherwise(NamedTuple):
    """What would have succeeded.

    Attributes:
        found: The change that does it; None if none was found.
        reason: Why none was, in words.
    """

    found: "Counterfactual | None" = None
    reason: str = ""


class Explanation(NamedTuple):
    """What was found out about the last run of a mission.

    Attributes:
        reasons: Why it has failed.
        nodes: The nodes of its tree.
        otherwise: What would have succeeded, if that was asked.
    """

    reasons: "Why"
    nodes: "Sequence[NodeState]"
    otherwise: Otherwise = Otherwise()

    @classmethod
    def of(
        cls,
        file: "JournalFile",
        projects: "Workspace | None" = None,
        tree_file: Path | None = None,
        *,
        is_gone: bool = True,
        budget: Budget | None = None,
    ) -> "Explanation":
        """Return what is found out by a journal, which is read entry by entry.

        Args:
            file: The journal, in a snapshot.
            projects: Loads the tree, if what would have succeeded is asked.
            tree_file: Its file; by default the one that the run had.
            is_gone: Whether the process that writes it is there no more.
            budget: What the search for what would have succeeded may take.

        Raises:
            JournalError: If the journal cannot be read.
        """
        from sar_compiler.journal.database import JournalFile
        from sar_compiler.journal.recorded_events import recorded_events
        from sar_compiler.reports.why import Inquiry

        inquiry = Inquiry.of(file.last_run(without=OF_ROBOT, is_condensed=True))
        inquiry.state.look_at_process(is_gone=is_gone)
        reasons = inquiry.why()
        if not reasons.chain or projects is None:
            return cls(reasons, inquiry.state.nodes)

        def record() -> "Iterator[Event]":
            # It is read in the thread of the search, and SQLite serves no other than the one that has opened a file.
            with JournalFile.reading(file.path) as own:
                events = recorded_events(tree_entries(own))
                yield from itertools.takewhile(lambda event: event.tick <= inquiry.failed_tick, events)

        search = partial(what_would_have_succeeded, inquiry.state, record, projects, tree_file)
        try:
            change = (budget or Budget()).run(search)
        except BudgetSpentError as error:
            change = Otherwise(reason=str(error))
        return cls(reasons, inquiry.state.nodes, change)

    def text(self) -> str:
        """Return it in words."""
        from sar_compiler.reports.why import counterfactual_text, why_text

        change, reason = self.otherwise
        if change is not None:
            return why_text(self.reasons, counterfactual_text(change, self.nodes))
        unknown = in_one_line(f"What would have succeeded is not known: {reason}") if reason else ""
        return why_text(self.reasons, unknown)

    def data(self) -> dict[str, Any]:
        """Return it as JSON values."""
        from sar_compiler.reports.why import counterfactual_data, why_data

        change, reason = self.otherwise
        return {
            **why_data(self.reasons),
            "counterfactual": change and counterfactual_data(change, self.nodes),
            "counterfactual_missing": reason,
        }


def tree_entries(file: "JournalFile") -> Iterator[JournalEntry]:
    """Yield the entries of the last run without those of the robot alone."""
    return file.last_run(without=OF_ROBOT)


def what_would_have_succeeded(
    state: "MissionState",
    record: "Callable[[], Iterable[Event]]",
    projects: "Workspace",
    tree_file: Path | None = None,
) -> Otherwise:
    """Return what would have succeeded in place of the last run of a mission, whose root has failed.

    Args:
        state: The state of the mission after that run.
        record: Returns what its leaves did.
        projects: Loads the tree.
        tree_file: Its file; by default the one that the run had.
    """
    from sar_compiler.analysis.verify.counterfactual import counterfactual
    from sar_compiler.analysis.verify.recorded_runs import OtherTreeError
    from sar_compiler.tree.diagnostic import TreeError

    try:
        names = [each.name for each in state.nodes]
        trees = trees_that_ran(state, projects, tree_file)
        found = first_that_fits(trees, lambda tree: counterfactual(tree, record(), names))
    except GoneTreeError as error:
        return Otherwise(reason=f"{error}; say --tree-file TREE")
    except OtherTreeError:
        path = tree_file or state.runs[-1].about.get("tree_file")
        return Otherwise(reason=f"{path} has another tree now; say --tree-file TREE")
    except TreeError as error:
        path = tree_file or state.runs[-1].about.get("tree_file")
        missing = _options_left_out(state, projects)
        if missing:
            return Otherwise(
                reason=f"{path} cannot be read without options of that run: {error.findings[0].message}; "
                f"give them as well: {shlex.join(missing)}"
            )
        return Otherwise(reason=f"{path} has mistakes now: {error.findings[0].message}")
    except SarError as error:
        return Otherwise(reason=str(error))
    return Otherwise(found, "" if found is not None else "no change of a few answers was found that does it")


def _options_of(state: "MissionState") -> list[tuple[str, str]]:
    """Return the options of the last run that decide which nodes its tree can have; a journal may say anything."""
    said = state.runs[-1].about.get("options")
    pairs = said if isinstance(said, list) else []
    return [(str(pair[0]), str(pair[1])) for pair in pairs if isinstance(pair, list) and len(pair) > 1]


def _options_left_out(state: "MissionState", projects: "Workspace") -> list[str]:
    """Return those options of the last run that this command was not given and cannot take from the journal."""
    added = projects.additions
    given = {*map(str, added.nodes), *(str(each.resolve()) for each in (*added.models, *added.include_path))}
    return [
        word
        for option, value in _options_of(state)
        if value not in given and not is_palette_name(value)
        for word in (option, value)
    ]


def _with_palettes_of(state: "MissionState", projects: "Workspace") -> "Workspace":
    """Return what loads trees with the installed palettes of the last run; a journal chooses no module and no file."""
    added = projects.additions
    named = (
        Path(value) for option, value in _options_of(state) if option == "--model" and is_palette_name(value)
    )
    models = tuple(dict.fromkeys((*added.models, *named)))
    return replace(projects, additions=added._replace(models=models))


def trees_that_ran(
    state: "MissionState", projects: "Workspace", tree_file: Path | None = None
) -> "Iterator[SimulatedTree]":
    """Yield the tree of the last run of a mission as it is now, with stub leaves; then without limits that are only assumed.

    Raises:
        GoneTreeError: If its file is not known, or not there.
        TreeError: If it has mistakes.
    """
    from sar_compiler.analysis.assumptions import StartValues
    from sar_compiler.analysis.tree_analysis import stage_of
    from sar_compiler.analysis.verify.limits import lift_limits

    about: Mapping[str, Any] = state.runs[-1].about
    file = tree_file or about.get("tree_file")
    if file is None:
        raise GoneTreeError("the journal does not say in which file the tree is")
    path = Path(str(file))
    if not is_file(path):
        raise GoneTreeError(f"{path} is not there")
    values = StartValues(state.parameters, about.get("facts") or {})
    loaded = _with_palettes_of(state, projects).load_file(path)
    yield stage_of(loaded, about.get("tree_id"), values).play().simulated
    unlimited = stage_of(loaded, about.get("tree_id"), values).play().simulated
    if lift_limits(unlimited, values.facts):
        yield unlimited


def first_that_fits(trees: Iterable[T], ask: Callable[[T], R]) -> R:
    """Return what is answered about the first of some trees that has a run as it was recorded.

    Raises:
        NotReplayedError: If none has.
    """
    from sar_compiler.analysis.verify.recorded_runs import NotReplayedError

    first, *others = trees
    try:
        return ask(first)
    except NotReplayedError:
        if not others:
            raise
        return first_that_fits(others, ask)
