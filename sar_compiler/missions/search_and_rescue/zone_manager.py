"""Where the mission stands: which zone is next, where home is, how many survivors have a name."""

from collections import Counter
from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any, TypedDict, cast

from sar_compiler.runtime.context import mission_context


class Pose(TypedDict):
    """A place in the frame `map`: metres, and radians counterclockwise from the x axis."""

    x: float
    y: float
    yaw: float


class Zone(Pose):
    """A place to search, and its name."""

    id: str


def _preview() -> "ZoneManager":
    return ZoneManager([{"id": "zone_a", "x": 0.0, "y": 0.0, "yaw": 0.0}], {"x": 0.0, "y": 0.0, "yaw": 0.0})


@mission_context(preview=_preview)
class ZoneManager:
    """The zones of one mission in the order of their visits, shared by all of its leaves.

    It keeps copies of what it is given and hands out copies, so nobody changes the plan by accident.

    Args:
        zones: The zones, each with `id`, `x`, `y` (metres) and `yaw` (radians) in the frame `map`.
        base_station: Where to drive when every zone is visited: `x`, `y`, `yaw`.
    """

    def __init__(self, zones: Sequence[Mapping[str, Any]], base_station: Mapping[str, Any]) -> None:
        self._zones = [cast("Zone", deepcopy(dict(zone))) for zone in zones]
        self._base_station = cast("Pose", deepcopy(dict(base_station)))
        self._index = 0
        self._survivors = 0
        self._postponed: Counter[str] = Counter()
        self._abandoned: list[Zone] = []

    def current_zone(self) -> Zone:
        """Return the zone to be searched now.

        Raises:
            IndexError: If every zone is visited.
        """
        if not self.has_remaining():
            message = f"there is no current zone: all {self.total_zones()} zones are visited"
            raise IndexError(message)
        return deepcopy(self._zones[self._index])

    def has_remaining(self) -> bool:
        """Say whether a zone is left to be visited (the current one counts)."""
        return self._index < len(self._zones)

    def remaining_zones(self) -> list[Zone]:
        """Return the zones left to be visited, the current one first."""
        return deepcopy(self._zones[self._index :])

    def advance(self) -> None:
        """Move on to the next zone; past the last one, nothing happens."""
        if self.has_remaining():
            self._index += 1

    def postpone(self) -> None:
        """Put the current zone behind all others that are left; past the last one, nothing happens."""
        if self.has_remaining():
            zone = self._zones.pop(self._index)
            self._zones.append(zone)
            self._postponed[zone["id"]] += 1

    def times_postponed(self) -> int:
        """Return how often the current zone was postponed.

        Raises:
            IndexError: If every zone is visited.
        """
        return self._postponed[self.current_zone()["id"]]

    def abandon(self) -> None:
        """Take the current zone out of the plan, unvisited; past the last one, nothing happens."""
        if self.has_remaining():
            self._abandoned.append(self._zones.pop(self._index))

    def abandoned_zones(self) -> list[Zone]:
        """Return the zones that were taken out of the plan, in the order in which that happened."""
        return deepcopy(self._abandoned)

    def base_pose(self) -> Pose:
        """Return the pose of the base station."""
        return deepcopy(self._base_station)

    def next_survivor_id(self) -> str:
        """Return a name that no survivor of this mission has yet (`survivor_1`, `survivor_2`, …)."""
        self._survivors += 1
        return f"survivor_{self._survivors}"

    def current_index(self) -> int:
        """Return how many zones are visited, which is the current zone's place counted from 0."""
        return self._index

    def total_zones(self) -> int:
        """Return how many zones the mission has, those that were taken out of the plan included."""
        return len(self._zones) + len(self._abandoned)
