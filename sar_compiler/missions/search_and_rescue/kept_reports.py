"""Reports that the base station has not acknowledged, kept until it does."""

from collections.abc import Iterator
from dataclasses import dataclass

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.situation import position
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
    """The reports of one mission that are still to be delivered, the oldest first; one for each survivor. Facts of the mission make them."""

    def __init__(self) -> None:
        self._reports: dict[str, SurvivorReport] = {}
        self._places: dict[str, tuple[float, float]] = {}

    def __len__(self) -> int:
        """Return how many reports are kept."""
        return len(self._reports)

    def __iter__(self) -> Iterator[SurvivorReport]:
        """Yield the reports, from a snapshot taken at the start of the iteration."""
        return iter(list(self._reports.values()))

    def apply(self, fact: JournalEntry) -> None:
        """Change what is kept by a fact.

        Raises:
            LookupError, TypeError or ValueError: If there cannot be such a fact now.
        """
        data = fact.data
        if fact.kind == "survivor_named":
            self._places[data["survivor"]] = position(data["x"], data["y"])
        elif fact.kind == "report_kept":
            # Journals of before have the place with the name alone.
            place = position(data["x"], data["y"]) if "x" in data else self._places[data["survivor"]]
            self._reports.setdefault(data["survivor"], SurvivorReport(data["survivor"], *place))
        elif fact.kind == "report_acknowledged" or (
            fact.kind == "survivor_judged" and data["standing"] != "confirmed"
        ):
            self._reports.pop(data["survivor"], None)
