"""`sar-journal why`: why a mission has failed, and what would have succeeded."""

import argparse
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.cli.loading import add_project_options, workspace
from sar_compiler.commands import print_text
from sar_compiler.errors import SarError
from sar_compiler.tree.showing import in_one_line
from sar_compiler.views.plain import as_json

if TYPE_CHECKING:
    from sar_compiler.checks.verify.counterfactual import Counterfactual
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.project import Workspace
    from sar_compiler.views.why import Why

    Stream = list[JournalEntry]


def add_why(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `why`."""
    parser.add_argument("journal", type=Path, metavar="FILE", help="the journal; its last run counts")
    parser.add_argument(
        "--against",
        type=Path,
        metavar="OTHER",
        help="the journal of another run: show the first difference",
    )
    parser.add_argument(
        "--tree-file",
        type=Path,
        metavar="TREE",
        help="the tree's file, to look for what would have succeeded (default: where it was for that run)",
    )
    add_project_options(parser)
    parser.add_argument(
        "--format", choices=("text", "json"), default="text", help="for people, or for scripts"
    )


def tell_why(options: argparse.Namespace, stream: "Stream", other: "Stream | None") -> None:
    """Print why the last run of a mission has failed, what would have succeeded, and what another run did otherwise."""
    from sar_compiler.views import why as views

    reasons = views.why(stream)
    change = (
        what_would_have_succeeded(stream, workspace(options), options.tree_file)
        if reasons.chain
        else Otherwise()
    )
    difference = None if other is None else views.first_difference(stream, other)
    if options.format == "json":
        data = _data(reasons, change, stream)
        print(as_json(data if other is None else {**data, "difference": views.difference_data(difference)}))
        return
    otherwise = change.text(stream) if reasons.chain else ""
    print_text(views.why_text(reasons, otherwise))
    if other is not None:
        print_text(f"\n{views.difference_text(difference, (str(options.journal), str(options.against)))}")


def why_entry(stream: "Stream", projects: "Workspace | None" = None) -> "JournalEntry | None":
    """Return why the last run of a mission has failed, as an entry for a page at the end of it; None if it has not.

    Args:
        stream: The entries of the mission.
        projects: Loads the tree, if what would have succeeded is looked for.
    """
    from sar_compiler.views import why as views

    reasons = views.why(stream)
    if not reasons.chain or reasons.went_on or reasons.outcome == "complete":
        return None
    change = what_would_have_succeeded(stream, projects) if projects is not None else Otherwise()
    return stream[-1]._replace(kind="why", data=_data(reasons, change, stream))


def _data(reasons: "Why", change: "Otherwise", stream: "Stream") -> dict[str, Any]:
    from sar_compiler.views import why as views

    return {
        **views.why_data(reasons),
        "counterfactual": change.found and views.counterfactual_data(change.found, stream),
        "counterfactual_missing": change.reason,
    }


def read_stream(place: Path) -> "Stream":
    """Return the entries of a journal.

    Raises:
        JournalError: If it cannot be read.
    """
    from sar_compiler.journal.database import JournalFile

    with closing(JournalFile.read(place)) as file:
        return [*file.stream()]


class Otherwise(NamedTuple):
    """What would have succeeded.

    Attributes:
        found: The change that does it; None if none was found.
        reason: Why none was, in words.
    """

    found: "Counterfactual | None" = None
    reason: str = ""

    def text(self, stream: "Stream") -> str:
        """Return it in words."""
        from sar_compiler.views.why import counterfactual_text

        if self.found is not None:
            return counterfactual_text(self.found, stream)
        return in_one_line(f"What would have succeeded is not known: {self.reason}")


def what_would_have_succeeded(
    stream: "Stream", projects: "Workspace", tree_file: Path | None = None
) -> Otherwise:
    """Return what would have succeeded in place of the last run of a mission, whose root has failed.

    Args:
        stream: The entries of the mission.
        projects: Loads the tree.
        tree_file: Its file; by default the one that the run had.
    """
    from sar_compiler.checks.assumptions import StartValues
    from sar_compiler.checks.verify.counterfactual import OtherTreeError, counterfactual
    from sar_compiler.journal.mission_state import MissionState
    from sar_compiler.tree.diagnostic import TreeError
    from sar_compiler.views.why import recorded

    state = MissionState.of(stream)
    about: Mapping[str, Any] = state.runs[-1].about
    file, tree_id, facts = tree_file or about.get("tree_file"), about.get("tree_id"), about.get("facts") or {}
    if file is None:
        return Otherwise(reason="the journal does not say in which file the tree is; say --tree-file TREE")
    path = Path(str(file))
    if not path.is_file():
        return Otherwise(reason=f"{path} is not there; say --tree-file TREE")
    try:
        stage = projects.load_file(path).stage(tree_id, StartValues(state.parameters, facts))
        found = counterfactual(stage.play().simulated, recorded(stream), [each.name for each in state.nodes])
    except OtherTreeError:
        return Otherwise(reason=f"{path} has another tree now; say --tree-file TREE")
    except TreeError as error:
        return Otherwise(reason=f"{path} has mistakes now: {error.findings[0].message}")
    except SarError as error:
        return Otherwise(reason=str(error))
    return Otherwise(found, "" if found is not None else "no change of a few answers was found that does it")
