"""What need not be done again when a mission is resumed."""


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

    def searched(self, zone_id: str, survivor: tuple[float, float] | None) -> None:
        """Take over a search."""
        self._searches.append((zone_id, survivor))

    def named(self, survivor_id: str, x: float, y: float) -> None:
        """Take over a survivor's name."""
        self._names.append((survivor_id, (x, y)))
        self._survivors.add(survivor_id)

    def at_home(self, *, home: bool) -> None:
        """Take over whether the robot is home."""
        self._home = home

    def zone_left(self) -> None:
        """Forget the searches and the names of a zone that was left."""
        self._searches.clear()
        self._names.clear()

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
