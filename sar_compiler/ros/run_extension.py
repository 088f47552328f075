"""Extensions of a run, which store, show, record, publish or guard it."""

from typing import TYPE_CHECKING

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sar_compiler.compiler import CompiledTree
    from sar_compiler.journal.display import AwaitedItem
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.ros.engine import Engine


class UnfitLeavesError(SarError):
    """An extension requires leaves that the tree does not have."""


class RunExtension:
    """The callbacks of a run extension, called in the thread that ticks the tree; each is optional.

    It is created before the mission restores the state in its journal. Whether the journal needs to prepare data for
    listeners, who have `on_entry`, is decided then.
    """

    def on_compiled(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Handle the compiled tree and its engine; ticks start once all requirements are fulfilled.

        Raises:
            SarError: If the extension cannot be used. The run then ends before it starts.
        """

    def on_awaited(self, items: "Sequence[AwaitedItem]") -> None:
        """Handle a change of the items that the start needs; those with a problem are still awaited."""

    def on_begin(self) -> None:
        """Handle the start of the run, before the first tick; the journal is called first.

        Raises:
            JournalError: If the journal cannot be written.
        """

    def on_setup(self) -> None:
        """Handle the end of the leaves' setup; the first tick follows.

        Raises:
            UnfitLeavesError: If the run is impossible with these leaves. It then ends before the first tick.
        """

    def on_entry(self, entry: "JournalEntry") -> None:
        """Handle an entry of the run's journal, from `run_began` to `run_ended`; return at once."""

    def on_last_tick(self, *, is_over: bool) -> None:
        """Handle the end of ticking, before the tree is stopped. *is_over*: whether the run has met its end condition."""

    def cause_of_failure(self) -> str:
        """Return the likeliest cause of a failure in a line; empty if unknown."""
        return ""

    def on_end(self, *, has_begun: bool) -> None:
        """Close the extension. *has_begun*: whether the tree was ticked, so that there is a result to report."""
