"""Extensions of a run, which keep, show, record, publish or guard it."""

from typing import TYPE_CHECKING

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.ros.engine import Engine


class UnfitLeavesError(SarError):
    """An extension needs something that the leaves of the tree do not do."""


class RunExtension:
    """Is called at each stage of a run, in the thread that ticks its tree; each method may be left out.

    It is made before the mission takes over the facts of its journal: what is done only for listeners, who have `on_entry`, is decided then.
    """

    def on_compiled(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Take the tree, and what will tick it once all that it needs is there.

        Raises:
            SarError: If this cannot be; then the run ends before it has begun.
        """

    def on_begin(self) -> None:
        """Let the tree be ticked from here on; the journal is called first.

        Raises:
            JournalError: If the journal cannot be written.
        """

    def on_setup(self) -> None:
        """Note that the leaves are set up, with their services; the first tick comes next.

        Raises:
            UnfitLeavesError: If the run cannot be with these leaves; then it ends before that.
        """

    def on_entry(self, entry: "JournalEntry") -> None:
        """Take an entry of the run's journal, from `run_began` to `run_ended`; return at once."""

    def on_last_tick(self, *, is_over: bool) -> None:
        """Note that nothing is ticked any more, before the tree is stopped. *is_over* says whether the run is over by its own condition."""

    def cause_of_failure(self) -> str:
        """Return the likeliest cause of a failure in a line; empty where it does not know one."""
        return ""

    def on_end(self, *, has_begun: bool) -> None:
        """Come to an end. *has_begun* says whether the tree was ticked, so that there is anything to tell of."""
