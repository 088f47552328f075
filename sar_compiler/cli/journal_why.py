"""`sar-journal why`: why a mission has failed, and what would have succeeded."""

import argparse
import itertools
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from sar_compiler.budget import Budget, BudgetSpentError
from sar_compiler.cli.arguments import FILE, ArgumentKind, add_budget, budget_of
from sar_compiler.cli.loading import FORMAT_HELP, add_project_options, workspace
from sar_compiler.commands import OK, print_text
from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import OF_ROBOT, JournalEntry
from sar_compiler.journal.refused_start import read_refusal
from sar_compiler.nodes.palettes import is_palette_name
from sar_compiler.opener import is_file
from sar_compiler.tree.showing import in_one_line
from sar_compiler.views.plain import as_json

if TYPE_CHECKING:
    from sar_compiler.checks.verify.counterfactual import Counterfactual
    from sar_compiler.compiler.simulated_tree import SimulatedTree
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.journal.mission_state import MissionState, NodeState
    from sar_compiler.project import Workspace
    from sar_compiler.runtime.events import Event
    from sar_compiler.views.why import RunDifference, Why

T = TypeVar("T")
R = TypeVar("R")


def add_why(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `why`."""
    add = parser.add_argument
    add("journal", type=FILE, metavar="FILE", help="the journal; its last run counts")
    text = "the journal of another run: show the first difference"
    add("--against", type=FILE, metavar="OTHER", help=text)
    text = "the tree's file, to look for what would have succeeded (default: where it was for that run)"
    add("--tree-file", type=ArgumentKind("tree", Path), metavar="TREE", help=text)
    add_project_options(parser)
    add_budget(parser)
    add("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)
    parser.set_defaults(run=tell_why)


def tell_why(options: argparse.Namespace) -> int:
    """Print why the last run of a mission has failed, what would have succeeded, and what another run did otherwise.

    Returns:
        0; 130 if Ctrl-C has ended the search for what would have succeeded.

    Raises:
        JournalError: If a journal cannot be read.
    """
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.views.why import difference_data, difference_text

    refused = read_refusal(options.journal)
    if refused is not None and not is_file(options.journal):
        if options.format == "json":
            print(as_json({"refused_start": refused._asdict()}))
        else:
            print_text(refused.text)
        return OK
    with JournalFile.reading(options.journal) as file:
        # Nothing in it asks whether it has to end.
        budget = budget_of(options, patience_sec=0.0)
        explained = Explanation.of(
            file, workspace(options), options.tree_file, is_gone=not file.is_written, budget=budget
        )
    difference = None if options.against is None else _difference(options.journal, options.against)
    if options.format == "json":
        data = explained.data()
        more = {"difference": difference_data(difference)} if options.against is not None else {}
        more |= {"refused_start": refused._asdict()} if refused is not None else {}
        print(as_json({**data, **more}))
        return budget.exit_status if budget.is_interrupted else OK
    if refused is not None:
        print_text(f"{refused.text}\n\nThe run before:\n")
    print_text(explained.text())
    if options.against is not None:
        print_text(f"\n{difference_text(difference, (str(options.journal), str(options.against)))}")
    return budget.exit_status if budget.is_interrupted else OK


def _difference(place: Path, other_place: Path) -> "RunDifference | None":
    from sar_compiler.journal.database import JournalFile
    from sar_compiler.views.why import first_difference

    with JournalFile.reading(place) as file, JournalFile.reading(other_place) as other:
        return first_difference(_tree_entries(file), _tree_entries(other))


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
        from sar_compiler.views.why import Inquiry

        inquiry = Inquiry.of(_tree_entries(file))
        inquiry.state.look_at_process(is_gone=is_gone)
        reasons = inquiry.why()
        if not reasons.chain or projects is None:
            return cls(reasons, inquiry.state.nodes)

        def record() -> "Iterator[Event]":
            # It is read in the thread of the search, and SQLite serves no other than the one that has opened a file.
            with JournalFile.reading(file.path) as own:
                events = recorded_events(_tree_entries(own))
                yield from itertools.takewhile(lambda event: event.tick <= inquiry.failed_tick, events)

        search = partial(what_would_have_succeeded, inquiry.state, record, projects, tree_file)
        try:
            change = (budget or Budget()).run(search)
        except BudgetSpentError as error:
            change = Otherwise(reason=str(error))
        return cls(reasons, inquiry.state.nodes, change)

    def text(self) -> str:
        """Return it in words."""
        from sar_compiler.views.why import counterfactual_text, why_text

        change, reason = self.otherwise
        if change is not None:
            return why_text(self.reasons, counterfactual_text(change, self.nodes))
        unknown = in_one_line(f"What would have succeeded is not known: {reason}") if reason else ""
        return why_text(self.reasons, unknown)

    def data(self) -> dict[str, Any]:
        """Return it as JSON values."""
        from sar_compiler.views.why import counterfactual_data, why_data

        change, reason = self.otherwise
        return {
            **why_data(self.reasons),
            "counterfactual": change and counterfactual_data(change, self.nodes),
            "counterfactual_missing": reason,
        }


def _tree_entries(file: "JournalFile") -> Iterator[JournalEntry]:
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
    from sar_compiler.checks.verify.counterfactual import counterfactual
    from sar_compiler.checks.verify.recorded_runs import OtherTreeError
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
    from sar_compiler.checks.assumptions import StartValues
    from sar_compiler.checks.verify.limits import lift_limits

    about: Mapping[str, Any] = state.runs[-1].about
    file = tree_file or about.get("tree_file")
    if file is None:
        raise GoneTreeError("the journal does not say in which file the tree is")
    path = Path(str(file))
    if not is_file(path):
        raise GoneTreeError(f"{path} is not there")
    values = StartValues(state.parameters, about.get("facts") or {})
    loaded = _with_palettes_of(state, projects).load_file(path)
    yield loaded.stage(about.get("tree_id"), values).play().simulated
    unlimited = loaded.stage(about.get("tree_id"), values).play().simulated
    if lift_limits(unlimited, values.facts):
        yield unlimited


def first_that_fits(trees: Iterable[T], ask: Callable[[T], R]) -> R:
    """Return what is answered about the first of some trees that has a run as it was recorded.

    Raises:
        NotReplayedError: If none has.
    """
    from sar_compiler.checks.verify.recorded_runs import NotReplayedError

    first, *others = trees
    try:
        return ask(first)
    except NotReplayedError:
        if not others:
            raise
        return first_that_fits(others, ask)
