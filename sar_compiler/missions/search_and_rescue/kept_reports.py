"""Reports that the base station has not acknowledged, kept until it does."""

from collections.abc import Iterator
from dataclasses import dataclass

from sar_compiler.runtime.context import mission_context


@dataclass(frozen=True)
class SurvivorReport:
    """The report of a survivor to the base station.

    Attributes:
        survivor_id: The survivor's name, which is also the name of the TF frame.
        x: Position in the frame `map`, metres.
        y: Position in the frame `map`, metres.
    """

    survivor_id: str
    x: float
    y: float


@mission_context
class KeptReports:
    """The reports of one mission that are still to be delivered, the oldest first; one for each survivor."""

    def __init__(self) -> None:
        self._reports: dict[str, SurvivorReport] = {}

    def __len__(self) -> int:
        """Return how many reports are kept."""
        return len(self._reports)

    def __iter__(self) -> Iterator[SurvivorReport]:
        """Yield the reports, from a snapshot taken at the start of the iteration."""
        return iter(list(self._reports.values()))

    def keep(self, report: SurvivorReport) -> None:
        """Keep a report until it is delivered."""
        self._reports[report.survivor_id] = report

    def delivered(self, survivor_id: str) -> None:
        """Remove the report of a survivor, if there is one."""
        self._reports.pop(survivor_id, None)
