"""The interface of run extensions, such as the journal, displays, recordings and the guardian."""

from typing import TYPE_CHECKING

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sar_compiler.compiler import CompiledTree
    from sar_compiler.journal.display import AwaitedItem
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.ros.engine import Engine


class UnfitLeavesError(SarError):
    """Raised if a run extension requires leaves that the tree does not have."""


class RunExtension:
    """Base class of run extensions, with optional callbacks that are called in the thread that ticks the tree.

    An extension is created before the mission restores its state from the journal. If the extension defines `on_entry`, it becomes a
    listener of the journal.
    """

    def on_compiled(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Called with the compiled tree and its engine, before the run waits for the tree's requirements.

        Raises:
            SarError: If the extension cannot be used. The start of the run is then refused.
        """

    def on_awaited(self, items: "Sequence[AwaitedItem]") -> None:
        """Handle a change of the requirements that the start of a run waits for.

        A requirement that is not fulfilled has a description of its problem.
        """

    def on_begin(self) -> None:
        """Handle the start of the run, before the leaves are set up. The journal is called first.

        Raises:
            JournalError: If the journal cannot be written.
        """

    def on_setup(self) -> None:
        """Handle the end of the leaves' setup; the first tick follows.

        Raises:
            UnfitLeavesError: If the extension requires leaves that the tree does not have. The run then ends before the first tick.
        """

    def on_entry(self, entry: "JournalEntry") -> None:
        """Handle an entry of the run's journal, from `run_began` to `run_ended`, without blocking."""

    def on_last_tick(self, *, is_over: bool) -> None:
        """Handle the last tick, before the tree is stopped; *is_over* is True if the run has met its end condition."""

    def cause_of_failure(self) -> str:
        """Return one line about the most likely cause of a failure, or an empty string if no cause is known."""
        return ""

    def on_end(self, *, has_begun: bool) -> None:
        """Close the extension; *has_begun* is True if the run has started and thus has a result to report."""
