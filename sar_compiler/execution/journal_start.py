"""The start of a run. If the start is refused, the reason is recorded in a file beside the journal."""

from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.errors import SarError
from sar_compiler.execution.run_options import RunOptions
from sar_compiler.journal.refused_start import record_refusal

if TYPE_CHECKING:
    from rclpy.node import Node
    from typing_extensions import Self

    from sar_compiler.missions.mission import Mission


class JournalStart:
    """Context manager for the start of a run. If the start is refused, the reason is stored for `sar-journal why`.

    Args:
        options: The options of the run.

    Attributes:
        has_begun: Whether the run has begun. A later error is not recorded as a refused start.
    """

    has_begun = False

    def __init__(self, options: RunOptions) -> None:
        self.options = options
        self._place: Path | None = options.journal

    def find_path(self, mission: "Mission | None", node: "Node") -> None:
        """Determine the path of the run's journal. Do nothing for a simulated run.

        A simulated run always has a new journal.
        """
        if self._place is None and self.options.sim is None and has_journal_by_default(self.options, mission):
            self._place = default_path(self.options, node.get_fully_qualified_name())

    def __enter__(self) -> "Self":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Store the reason for a refused start."""
        if not isinstance(error, SarError):
            return
        is_kept = not (self.options.check or self.options.no_journal)
        if self._place is not None and is_kept and not self.has_begun:
            record_refusal(self._place, error.exit_status, str(error))


def has_journal_by_default(options: RunOptions, mission: "Mission | None") -> bool:
    """Return whether a run writes a journal by default, without an option that requests or forbids it."""
    return options.sim is not None or (mission is not None and mission.is_resumable)


def default_path(options: RunOptions, name: str) -> Path:
    """Return the default path of the journal for a run whose ROS node has the full name *name*."""
    from sar_compiler.journal.journal_opening import default_place, delete_old_simulated, simulated_place

    if options.sim is None:
        return default_place(name)
    place = simulated_place(name, resume=options.resume)
    delete_old_simulated(place)
    return place
