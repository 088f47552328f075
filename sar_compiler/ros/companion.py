"""The companions of a run, which keep, show, record, publish or guard it."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.ros.engine import Engine


class Companion:
    """Goes along with a run, in the thread that ticks its tree; each method may be left out.

    It is made before the mission takes over the facts of its journal: what is done only for listeners, who have `take`, is decided then.
    """

    def begin(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Take the tree, and what will tick it once all that it needs is there.

        Raises:
            SarError: If this cannot be; then the run ends before it has begun.
        """

    def take(self, entry: "JournalEntry") -> None:
        """Take an entry of the run's journal, from `run_began` to `run_ended`; return at once."""

    def end(self, *, has_begun: bool) -> None:
        """Come to an end. *has_begun* says whether the tree was ticked, so that there is anything to tell of."""
