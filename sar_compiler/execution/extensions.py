"""The extensions of one run, called in the order of their creation."""

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from sar_compiler.execution.run_setup import MakeExtension, RunSetup
from sar_compiler.ros.run_extension import RunExtension

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.execution.run_journal import RunJournal
    from sar_compiler.execution.run_watch import PropertyWatch
    from sar_compiler.journal.display import AwaitedItem
    from sar_compiler.ros.engine import Engine


def guardian_of(run: RunSetup) -> RunExtension | None:
    """Create the guardian that cancels a run's goals if the run crashes; return None if the run needs no guardian."""
    if not run.options.guardian and not (run.journal.is_kept and run.options.sim is None):
        return None
    from sar_compiler.ros.arguments import security_arguments
    from sar_compiler.ros.guardian import Guardian

    return Guardian(run.node, security_arguments(run.options.ros), run.options.supervision.signs)


class RunExtensions:
    """All extensions of one run.

    Args:
        run: The run before its tree is compiled.
        journal: The run's journal, which is closed last.
        makes: Functions that create the other extensions, which may listen to the journal.
        stack: Closes the extensions in reverse order, however the run ends.

    Raises:
        SarError: If an extension cannot be created.
        ImportError: If a library is not installed.
    """

    def __init__(
        self, run: RunSetup, journal: "RunJournal", makes: Iterable[MakeExtension], stack: ExitStack
    ) -> None:
        self._journal, self._has_begun, self._options = journal, False, run.options
        self._complain = run.node.get_logger().error
        self._extensions: list[RunExtension] = []
        for make in (lambda _: journal, *makes):
            extension = make(run)
            if extension is None:
                continue
            self._extensions.append(extension)
            stack.callback(self._end, extension)
            if type(extension).on_entry is not RunExtension.on_entry:
                run.journal.add_listener(extension.on_entry)

    def on_compiled(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Start each extension.

        Raises:
            SarError: If an extension cannot start.
        """
        for extension in self._extensions:
            extension.on_compiled(tree, engine)

    @property
    def replay_hint(self) -> str:
        """A sentence with the command that replays this simulation; empty if the run is not a simulation."""
        return self._journal.replay_hint

    def cause_of_failure(self) -> str:
        """Return one line about the most likely cause of a failure, or an empty string if no cause is known."""
        return next(filter(None, (each.cause_of_failure() for each in self._extensions)), "")

    def on_awaited(self, items: "Sequence[AwaitedItem]") -> None:
        """Notify each extension of the requirements that the start waits for."""
        for extension in self._extensions:
            extension.on_awaited(items)

    def on_begin(self) -> None:
        """Open the journal, and then notify each extension that the ticks begin.

        Raises:
            JournalError: If the journal cannot be written.
        """
        for extension in self._extensions:
            extension.on_begin()
        self._has_begun = True

    def on_setup(self) -> None:
        """Notify each extension that the leaves are set up.

        Raises:
            UnfitLeavesError: If an extension cannot work with the leaves of the tree.
        """
        for extension in self._extensions:
            extension.on_setup()

    def on_last_tick(self, *, is_over: bool) -> None:
        """Notify each extension after the last tick, before the tree is halted."""
        for extension in self._extensions:
            extension.on_last_tick(is_over=is_over)

    def property_watch(self) -> "PropertyWatch | None":
        """Return the extension that monitors properties, or None if no properties are monitored."""
        if not self._options.properties:
            return None
        from sar_compiler.execution.run_watch import PropertyWatch

        return next(each for each in self._extensions if isinstance(each, PropertyWatch))

    def _end(self, extension: RunExtension) -> None:
        try:
            extension.on_end(has_begun=self._has_begun)
        except Exception as error:  # noqa: BLE001 - a failing extension must not prevent the others from closing
            self._complain(f"{type(extension).__name__} could not be closed: {error!r}.")
