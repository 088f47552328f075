"""What need not be done again when a mission is resumed."""

from collections.abc import Iterable

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.situation import position


class DoneBefore:
    """What an earlier run has done of what a resumed one begins with: the tree starts anew, and this is not done again.

    Searches and names are those of the zone that was not left yet. Each is handed out once, in its order: what a tree does
    again on purpose is done again.
    """

    def __init__(self) -> None:
        self._searches: list[tuple[str, tuple[float, float] | None]] = []
        self._names: list[tuple[str, tuple[float, float]]] = []
        self._survivors: set[str] = set()
        self._home = False

    @classmethod
    def of(cls, facts: Iterable[JournalEntry]) -> "DoneBefore":
        """Return what the facts of earlier runs say, which fit their mission."""
        before = cls()
        for fact in facts:
            before._take(fact)
        return before

    def _take(self, fact: JournalEntry) -> None:
        data = fact.data
        if fact.kind == "zone_searched":
            place = None if data["survivor"] is None else position(*data["survivor"])
            self._searches.append((data["zone"], place))
        elif fact.kind == "survivor_named":
            self._names.append((data["survivor"], position(data["x"], data["y"])))
            self._survivors.add(data["survivor"])
        elif fact.kind in ("zone_visited", "zone_postponed", "zone_abandoned"):
            self._searches.clear()
            self._names.clear()
        elif fact.kind in ("zone_started", "base_reached"):
            self._home = fact.kind == "base_reached"

    def at_home(self, *, home: bool) -> None:
        """Note whether the robot is home."""
        self._home = home

    def has_searched(self, zone_id: str) -> bool:
        """Return whether there is a search of a zone."""
        return any(zone == zone_id for zone, _ in self._searches)

    def take_search(self, zone_id: str) -> tuple[float, float] | None:
        """Return where the first search of a zone has found a survivor, None if nobody; it is then not there any more."""
        index = next(index for index, (zone, _) in enumerate(self._searches) if zone == zone_id)
        return self._searches.pop(index)[1]

    def take_name(self, x: float, y: float) -> str | None:
        """Return the name of the survivor at a position; it is then not there any more."""
        index = next((index for index, (_, place) in enumerate(self._names) if place == (x, y)), None)
        return None if index is None else self._names.pop(index)[0]

    def has_named(self, survivor_id: str) -> bool:
        """Return whether an earlier run has named a survivor so, in whatever zone."""
        return survivor_id in self._survivors

    def take_home(self) -> bool:
        """Return whether the robot is home; afterwards it must be driven there."""
        home, self._home = self._home, False
        return home
