"""Extensions of a run, which store, show, record, publish or guard it."""

from typing import TYPE_CHECKING

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.ros.engine import Engine


class UnfitLeavesError(SarError):
    """An extension needs an ability that the leaves of the tree do not have."""


class RunExtension:
    """Called at each stage of a run, in the thread that ticks its tree; each method is optional.

    It is created before the mission restores the state in its journal. Whether the journal needs to prepare data for
    listeners, who have `on_entry`, is decided then.
    """

    def on_compiled(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Receive the tree and the engine that will tick it once all requirements are fulfilled.

        Raises:
            SarError: If the extension cannot be used. The run then ends before it starts.
        """

    def on_begin(self) -> None:
        """Allow ticking from now on; the journal is called first.

        Raises:
            JournalError: If the journal cannot be written.
        """

    def on_setup(self) -> None:
        """Handle the end of the setup of leaves and their services; the first tick comes next.

        Raises:
            UnfitLeavesError: If the run is impossible with these leaves. It then ends before the first tick.
        """

    def on_entry(self, entry: "JournalEntry") -> None:
        """Handle an entry of the run's journal, from `run_began` to `run_ended`; return at once."""

    def on_last_tick(self, *, is_over: bool) -> None:
        """Handle the end of ticking, before the tree is stopped. *is_over*: whether the run met its own end condition."""

    def cause_of_failure(self) -> str:
        """Return the likeliest cause of a failure in a line; empty if unknown."""
        return ""

    def on_end(self, *, has_begun: bool) -> None:
        """Close the extension. *has_begun*: whether the tree was ticked, so that there is a result to report."""
