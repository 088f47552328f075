"""The plan of the mission: the remaining zones, the base station, the geofence, the names assigned to survivors."""

import itertools
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypedDict, cast

from sar_compiler.missions import (
    FACTS_LOST,
    Journal,
    JournalEntry,
    ParameterReader,
    mission_context,
    position,
)
from search_and_rescue import search_events
from search_and_rescue.search_theory import ROUNDING, Area, PoaMap, Tour

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from search_and_rescue.search_theory import Ground

_GEOFENCE = "geofence"
_LEAST_CORNERS = 3
_POINT = ("x", "y")

DETOUR = 1.5
"""How many times as long as the straight line a way is taken to be that nobody has planned."""
_LARGEST_RATIO, _MOST_TOGETHER = 1000.0, 1e9
MOST_PLANNED = 30
"""The most zones for which one choice asks the planner: 30 zones are 495 ways."""
_SHORTEST_SEC = 1e-3
VisitingOrder = Literal["listed", "nearest", "expected_find"]
"""How the next zone is chosen."""
MAP_FRAME = "map"
"""The frame of every position that the mission sends or receives."""


def is_ratio(value: float) -> bool:
    """Return whether a likelihood ratio is one that somebody can mean: a thousandth to a thousand."""
    return 1.0 / _LARGEST_RATIO <= value <= _LARGEST_RATIO


class MapPose(TypedDict):
    """A pose in the frame `map`: metres, and radians counterclockwise from the x axis."""

    x: float
    y: float
    yaw: float


class Zone(MapPose):
    """A place to search, and its name."""

    id: str


PosePair = tuple[MapPose, MapPose]
"""From where to where."""


def _preview() -> "ZoneManager":
    return ZoneManager([{"id": "zone_a", "x": 0.0, "y": 0.0, "yaw": 0.0}], {"x": 0.0, "y": 0.0, "yaw": 0.0})


@mission_context(preview=_preview)
class ZoneManager:
    """The zones of one mission in the order of their visits, shared by all of its leaves.

    It stores and returns copies, so that callers cannot change the plan by accident. What is done to it is noted as a fact, and the fact
    changes it (`apply`), now and when a later run takes it over.

    Args:
        zones: The zones, each with `id`, `x`, `y` (metres) and `yaw` (radians) in the frame `map`.
        base_station: The pose to return to: `x`, `y` (metres), `yaw` (radians).
        areas: What is expected of looks in the zones, by their ids; none where no probabilities are given.
        priorities: Which zones are chosen before others, by their ids: the higher ones; 0 where nothing is said.
        speed_mps: How fast the robot drives, for estimates of time, m/s.
        charging: The poses of charging places besides the base station, by their ids.

    Attributes:
        charging: The poses of charging places.
        journal: Where it is written what becomes of the zones: `zone_added`, `area_drawn`, `zone_chosen`, `zone_visited`,
            `zone_postponed`, `zone_abandoned`.
        areas: What is expected of looks in the zones.
        speed_mps: How fast the robot drives, for estimates of time, m/s.
        looks: How often it was looked in each zone; a sweep counts as what it has seen, and a look whose find is rejected as none.
        swept: How likely the sweep of each zone has found who is there, 0 to 1.
        hints: How many times likelier all hints on a zone are if somebody is there than if nobody is.
    """

    def __init__(
        self,
        zones: Sequence[Mapping[str, Any]],
        base_station: Mapping[str, Any],
        *,
        areas: Mapping[str, Area] | None = None,
        priorities: Mapping[str, float] | None = None,
        speed_mps: float = 1.0,
        charging: Mapping[str, MapPose] | None = None,
    ) -> None:
        self.charging = deepcopy(dict(charging or {}))
        self.areas = dict(areas or {})
        self.looks: Counter[str] = Counter()
        # Of looks that have found somebody: the zone, by the place and by the name of who was found; and what was no find.
        self._found_at: dict[tuple[float, float], str] = {}
        self._found_in: dict[str, str] = {}
        self._rejected: set[str] = set()
        self.swept: dict[str, float] = {}
        self._pieces: dict[str, list[Sequence[float]]] = {}
        self.hints: dict[str, float] = {}
        self._priorities = dict(priorities or {})
        self.speed_mps = speed_mps
        self.journal = Journal(apply=self.apply)
        self._zones = [cast("Zone", deepcopy(dict(zone))) for zone in zones]
        self._base_station = cast("MapPose", deepcopy(dict(base_station)))
        self._here: MapPose = self._base_station
        self._index = 0
        self._survivors = 0
        self._postponed: Counter[str] = Counter()
        self._abandoned: list[Zone] = []
        self._ways: dict[frozenset[tuple[float, float]], float] = {}

    def current_zone(self) -> Zone:
        """Return the zone to be searched now.

        Raises:
            IndexError: If every zone is visited.
        """
        if not self.has_remaining():
            raise IndexError(f"there is no current zone: all {self.total_zones()} zones are visited")
        return deepcopy(self._zones[self._index])

    def has_remaining(self) -> bool:
        """Return whether a zone is left to be visited (the current one counts)."""
        return self._index < len(self._zones)

    def remaining_zones(self) -> list[Zone]:
        """Return the zones left to be visited, the current one first."""
        return [zone.copy() for zone in self._zones[self._index :]]

    def knows(self, zone_id: str) -> bool:
        """Return whether there is, or was, a zone of this name."""
        return any(zone["id"] == zone_id for zone in (*self._zones, *self._abandoned))

    def eligible_zones(self) -> list[Zone]:
        """Return the zones among which the next one may be chosen: those left that were postponed least, of these the most urgent ones.

        So a zone that was postponed comes again only when all others have been tried as often. The current one is first.
        """
        return next(iter(self.by_urgency()), [])

    def by_urgency(self) -> list[list[Zone]]:
        """Return the zones that are left in groups, of which each is chosen from when the one before it is done."""
        groups: defaultdict[tuple[int, float], list[Zone]] = defaultdict(list)
        for zone in self.remaining_zones():
            groups[self._urgency(zone)].append(zone)
        return [groups[urgency] for urgency in sorted(groups)]

    def _urgency(self, zone: Zone) -> tuple[int, float]:
        return self._postponed[zone["id"]], -self._priorities.get(zone["id"], 0.0)

    def choose(self, zone_id: str) -> None:
        """Make one of the zones that are left the current one; the others keep their order."""
        self.journal.note(search_events.ZONE_CHOSEN, zone=zone_id)

    def poa_map(self) -> PoaMap:
        """Return where somebody may be, after the looks so far; with no areas where no probabilities are given."""
        return PoaMap.of(self.areas, self.looks, self.swept, self.hints)

    def hint(self, zone_id: str, ratio: float) -> None:
        """Note a hint on a zone: how many times likelier it is if somebody is there than if nobody is."""
        self.journal.note(search_events.HINT_GIVEN, zone=zone_id, ratio=ratio)

    def nearest(self, x: float, y: float, among: Collection[str] = ()) -> str:
        """Return the zone with probabilities whose pose is nearest to a position; empty if there is none.

        Args:
            x: Metres, frame `map`.
            y: Metres, frame `map`.
            among: The zones that come into question; all if there are none.
        """
        names = self.areas.keys() & (among or self.areas)
        zones = (zone for zone in (*self._zones, *self._abandoned) if zone["id"] in names)
        place = (x, y)
        return min(zones, key=lambda zone: math.dist((zone["x"], zone["y"]), place), default={"id": ""})["id"]

    def tour(self, zones: Sequence[Zone], start: MapPose | None = None) -> Tour:
        """Return what there is to choose an order of some zones by.

        Where no probabilities are given, zones count alike, and looks as nothing.

        Args:
            zones: The zones.
            start: Where it begins; where the robot has looked last, or the base station, if None.
        """
        return Tour(
            [self._travel_sec(start or self._here, zone) for zone in zones],
            self._travels_sec(zones),
            *self._expected(zones),
        )

    def _expected(self, zones: Sequence[Zone]) -> tuple[list[float], list[float]]:
        """Return how long a look in each zone takes, seconds, and how likely it finds somebody."""
        now = self.poa_map().now()
        areas = [self.areas.get(zone["id"], Area(0.0, 0.0)) for zone in zones]
        finds = [now.get(zone["id"], 0.0) * area.pod for zone, area in zip(zones, areas, strict=True)]
        return [area.look_sec for area in areas], finds

    def _travels_sec(self, zones: Sequence[Zone]) -> "npt.NDArray[np.float64]":
        """Return how long the way from each zone (row) to each other takes, seconds: of 1,000 zones, a million ways."""
        # A laptop that proves trees needs no NumPy.
        import numpy as np

        at = defaultdict[tuple[float, float], list[int]](list)
        for number, zone in enumerate(zones):
            at[zone["x"], zone["y"]].append(number)
        places = np.array([(zone["x"], zone["y"]) for zone in zones], dtype=float).reshape(-1, 2)
        metres = DETOUR * np.hypot(*(places[:, None] - places[None]).T)
        for ends, length in self._ways.items():
            if ends <= at.keys():
                one, other = (at[end] for end in (min(ends), max(ends)))
                metres[np.ix_(one, other)] = metres[np.ix_(other, one)] = length
        seconds: npt.NDArray[np.float64] = metres / self.speed_mps
        return seconds

    def most_rewarding(self, zones: Sequence[Zone]) -> list[Zone]:
        """Return the zones whose ways a planner is asked for, in their order: all up to `MOST_PLANNED`.

        Of more zones, those of the highest probability per second of way and look; where no probabilities are given, the nearest ones.
        """
        looks, finds = self._expected(zones)
        if not any(finds):
            finds = [1.0] * len(zones)
        seconds = [self._travel_sec(self._here, zone) + look for zone, look in zip(zones, looks, strict=True)]
        ranked = sorted(range(len(zones)), key=lambda at: -finds[at] / max(seconds[at], _SHORTEST_SEC))
        return [zones[at] for at in sorted(ranked[:MOST_PLANNED])]

    def ways(self, zones: Sequence[MapPose], *, between: bool = True) -> list[PosePair]:
        """Return the ways by which some zones are put in an order, and those home and to charging places, each in one direction.

        Args:
            zones: The zones, or pieces of a sweep. Between them are as many ways as the square of their number.
            between: Whether those from zone to zone are among them, or only those from where the robot has looked last.
        """
        places = list(self.charging.values())
        ways: list[PosePair] = [
            (start, zone) for start in (self._here, self._base_station, *places) for zone in zones
        ]
        ways += [(self._here, place) for place in places]
        ways += itertools.combinations(zones, 2) if between else ()
        by_ends = {_ends(*way): way for way in ways}
        return [way for ends, way in by_ends.items() if len(ends) > 1]

    def learn_way(self, start: MapPose, target: MapPose, metres: float) -> None:
        """Keep how long a way and the way back are, by a planner, metres; until a drive has failed, which may have changed them all."""
        self._ways[_ends(start, target)] = metres

    def knows_way(self, start: MapPose, target: MapPose) -> bool:
        """Return whether a planner has said how long a way is."""
        return _ends(start, target) in self._ways

    def way_m(self, start: MapPose, target: MapPose) -> float:
        """Return how long a way is, metres: by the planner if that is known, else the straight line times `DETOUR`."""
        line = math.dist((start["x"], start["y"]), (target["x"], target["y"]))
        return self._ways.get(_ends(start, target), DETOUR * line)

    def here(self) -> MapPose:
        """Return where the robot has looked last, or the base station if it was there since."""
        return deepcopy(self._here)

    def _travel_sec(self, start: MapPose, target: MapPose) -> float:
        return self.way_m(start, target) / self.speed_mps

    def add(self, zone: Zone) -> None:
        """Put a further zone behind all others."""
        self.journal.note(search_events.ZONE_ADDED, **zone)

    def draw(self, zone: Zone, ground: "Ground", area: Area | None) -> float:
        """Put a zone with an outline behind all others, or change one that is there.

        Args:
            zone: The zone.
            ground: Its outline, and how far one sees there.
            area: What is expected of a look there; None where no probabilities are given.

        Returns:
            How many times the POA of the others counts from now on: below 1 where all together would be above 1.
        """
        before = math.fsum(each.poa for name, each in self.areas.items() if name != zone["id"])
        room = 1.0 - area.poa if area is not None else 1.0
        shrunk = room / before if before > room + ROUNDING else 1.0
        places = [list(corner) for corner in ground.polygon]
        self.journal.note(
            search_events.AREA_DRAWN,
            zone=zone["id"],
            x=zone["x"],
            y=zone["y"],
            yaw=zone["yaw"],
            polygon=places,
            sweep_width=ground.sweep_width,
            detection_range=ground.detection_range,
            expected=list(area) if area is not None else None,
            shrunk=shrunk,
        )
        return shrunk

    def advance(self) -> None:
        """Advance to the next zone; past the last one, nothing happens."""
        if self.has_remaining():
            self.journal.note(search_events.ZONE_VISITED, zone=self._zones[self._index]["id"])

    def postpone(self) -> None:
        """Put the current zone after all other remaining ones; past the last one, nothing happens."""
        if self.has_remaining():
            self.journal.note(search_events.ZONE_POSTPONED, zone=self._zones[self._index]["id"])

    def times_postponed(self) -> int:
        """Return the number of times that the current zone was postponed.

        Raises:
            IndexError: If every zone is visited.
        """
        return self._postponed[self.current_zone()["id"]]

    def abandon(self, reason: str = "") -> None:
        """Remove the current zone from the plan, unvisited; past the last one, nothing happens.

        Args:
            reason: Why it is given up untried, in words; empty if its attempts have failed.
        """
        if self.has_remaining():
            zone_id, attempts = self._zones[self._index]["id"], self.times_postponed() + 1
            self.journal.note(search_events.ZONE_ABANDONED, zone=zone_id, attempts=attempts, reason=reason)

    def abandoned_zones(self) -> list[Zone]:
        """Return the abandoned zones, in the order in which they were abandoned."""
        return deepcopy(self._abandoned)

    def base_pose(self) -> MapPose:
        """Return the pose of the base station."""
        return deepcopy(self._base_station)

    def next_survivor_id(self) -> str:
        """Return a new name for a survivor, unique in this mission (`survivor_1`, `survivor_2`, …)."""
        self._survivors += 1
        self.journal.keep_number("survivor", self._survivors)
        return f"survivor_{self._survivors}"

    def current_index(self) -> int:
        """Return the number of visited zones, which is the current zone's index."""
        return self._index

    def total_zones(self) -> int:
        """Return the number of the mission's zones, including abandoned ones."""
        return len(self._zones) + len(self._abandoned)

    def apply(self, fact: JournalEntry) -> None:
        """Change the plan by a fact.

        Raises:
            LookupError, TypeError or ValueError: If there cannot be such a fact now.
        """
        if (handle := self._HANDLERS.get(fact.kind)) is not None:
            handle(self, fact.data)

    def _on_zone_chosen(self, data: Mapping[str, Any]) -> None:
        left = [zone["id"] for zone in self.remaining_zones()]
        if data["zone"] not in left:
            raise ValueError(f"{data['zone']} is not left then")
        self._zones.insert(self._index, self._zones.pop(self._index + left.index(data["zone"])))

    def _on_zone_searched(self, data: Mapping[str, Any]) -> None:
        if data["zone"] not in self.swept:
            self.looks[data["zone"]] += 1
            if data.get("survivor") is not None:
                self._found_at[position(*data["survivor"])] = data["zone"]
        places = (zone for zone in (*self._zones, *self._abandoned) if zone["id"] == data["zone"])
        self._here = next(places, self._here)

    def _on_sweep_planned(self, data: Mapping[str, Any]) -> None:
        self.swept.setdefault(data["zone"], 0.0)
        self._pieces[data["zone"]] = data["pieces"]

    def _on_piece_swept(self, data: Mapping[str, Any]) -> None:
        self.swept[data["zone"]] = float(data["pod"])
        x, y, yaw = self._pieces[data["zone"]][data["piece"]]
        self._here = MapPose(x=x, y=y, yaw=yaw)

    def _on_piece_skipped(self, _: Mapping[str, Any]) -> None:
        # It may be the way that has changed.
        self._ways.clear()

    def _on_hint_given(self, data: Mapping[str, Any]) -> None:
        zone, ratio = data["zone"], float(data["ratio"])
        if zone not in self.areas or not is_ratio(ratio):
            raise ValueError(f"there is no such hint on {zone}")
        # Many hints make no number so large that nothing can be said beside it.
        together = self.hints.get(zone, 1.0) * ratio
        self.hints[zone] = min(max(together, 1.0 / _MOST_TOGETHER), _MOST_TOGETHER)

    def _on_base_reached(self, _: Mapping[str, Any]) -> None:
        self._here = self._base_station

    def _on_charging_reached(self, data: Mapping[str, Any]) -> None:
        self._here = self.charging[data["place"]]

    def _on_zone_added(self, data: Mapping[str, Any]) -> None:
        x, y = position(data["x"], data["y"])
        self._zones.append(Zone(id=data["id"], x=x, y=y, yaw=position(data["yaw"], 0.0)[0]))

    def _on_area_drawn(self, data: Mapping[str, Any]) -> None:
        name, (x, y) = data["zone"], position(data["x"], data["y"])
        zone = Zone(id=name, x=x, y=y, yaw=position(data["yaw"], 0.0)[0])
        at = next((at for at, each in enumerate(self._zones) if each["id"] == name), None)
        if at is None:
            self._zones.append(zone)
        elif at < self._index:
            raise ValueError(f"{name} was visited then")
        else:
            self._zones[at] = zone
        if data["expected"] is None:
            return
        shrunk = position(data["shrunk"], 0.0)[0]
        others = {other: area._replace(poa=area.poa * shrunk) for other, area in self.areas.items()}
        self.areas = {**others, name: Area(*map(float, data["expected"]))}

    def _on_survivor_named(self, data: Mapping[str, Any]) -> None:
        number = data["survivor"].rpartition("_")[2]
        # A leaf of somebody's own may give other names.
        self._survivors = max(self._survivors, int(number) if number.isdecimal() else 0)
        if zone := self._found_at.get(position(data["x"], data["y"])):
            self._found_in[data["survivor"]] = zone

    def _on_survivor_judged(self, data: Mapping[str, Any]) -> None:
        name = data["survivor"]
        is_rejected = data["standing"] == "rejected"
        # The look has ended with what was no find: nobody knows whether it would have found somebody else.
        if name in self._found_in and is_rejected != (name in self._rejected):
            self.looks[self._found_in[name]] += -1 if is_rejected else 1
            self._rejected ^= {name}

    def _on_facts_lost(self, data: Mapping[str, Any]) -> None:
        self._survivors = max(self._survivors, int(data["numbers"].get("survivor", 0)))

    def _on_zone_visited(self, data: Mapping[str, Any]) -> None:
        self._check_current(data["zone"])
        self._index += 1

    def _on_zone_postponed(self, data: Mapping[str, Any]) -> None:
        self._check_current(data["zone"])
        self._zones.append(self._zones.pop(self._index))
        self._postponed[data["zone"]] += 1
        self._ways.clear()

    def _on_zone_abandoned(self, data: Mapping[str, Any]) -> None:
        self._check_current(data["zone"])
        self._abandoned.append(self._zones.pop(self._index))

    def _check_current(self, zone_id: str) -> None:
        if zone_id != (current := self.current_zone()["id"]):
            raise ValueError(f"the zone is then {current}")

    # Other kinds do not change the plan.
    _HANDLERS: ClassVar[Mapping[str, Callable[["ZoneManager", Mapping[str, Any]], None]]] = {
        search_events.ZONE_CHOSEN: _on_zone_chosen,
        search_events.ZONE_SEARCHED: _on_zone_searched,
        search_events.ZONE_VISITED: _on_zone_visited,
        search_events.ZONE_POSTPONED: _on_zone_postponed,
        search_events.ZONE_ABANDONED: _on_zone_abandoned,
        search_events.SWEEP_PLANNED: _on_sweep_planned,
        search_events.PIECE_SWEPT: _on_piece_swept,
        search_events.PIECE_SKIPPED: _on_piece_skipped,
        search_events.HINT_GIVEN: _on_hint_given,
        search_events.BASE_REACHED: _on_base_reached,
        search_events.CHARGING_REACHED: _on_charging_reached,
        search_events.ZONE_ADDED: _on_zone_added,
        search_events.AREA_DRAWN: _on_area_drawn,
        search_events.SURVIVOR_NAMED: _on_survivor_named,
        search_events.SURVIVOR_JUDGED: _on_survivor_judged,
        FACTS_LOST: _on_facts_lost,
    }


def _ends(start: MapPose, target: MapPose) -> frozenset[tuple[float, float]]:
    """Return what is the same of a way and the way back."""
    return frozenset({(start["x"], start["y"]), (target["x"], target["y"])})


@mission_context
class Fence:
    """A polygon in the frame `map`.

    Args:
        corners: Its corners in their order, x and y in metres; none for no fence, which allows everything.
    """

    def __init__(self, corners: Sequence[tuple[float, float]] = ()) -> None:
        self.corners = tuple(corners)

    def __bool__(self) -> bool:
        """Return whether there is a fence."""
        return bool(self.corners)

    def contains(self, x: float, y: float) -> bool:
        """Return whether a position is inside; with no fence every one is.

        Args:
            x: Metres, frame `map`.
            y: Metres, frame `map`.
        """
        inside = not self.corners
        for (ax, ay), (bx, by) in itertools.pairwise((*self.corners, *self.corners[:1])):
            # A ray to the right crosses the boundary an odd number of times from inside.
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside


def read_fence(reader: ParameterReader) -> Fence:
    """Read the parameter `geofence`: `[x1, y1, x2, y2, x3, y3, …]`; without one there is no fence."""
    numbers = reader.numbers(_GEOFENCE)
    corners = list(zip(numbers[::2], numbers[1::2], strict=False))
    if numbers and (len(numbers) % 2 or len(corners) < _LEAST_CORNERS):
        text = f"must hold x and y of three corners or more, [x1, y1, x2, y2, x3, y3], holds {len(numbers)} numbers"
        reader.report(_GEOFENCE, text)
        return Fence()
    return Fence(corners)


def read_survivors(
    parameters: Mapping[str, object], default: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Read the survivors' positions by zone from `survivors.<zone>.{x,y}`.

    Returns:
        The positions in metres in the frame `map`.

    Raises:
        ParameterError: If there are mistakes; has all of them.
    """
    reader = ParameterReader(parameters)
    points = {
        zone_id: reader.point(f"survivors.{zone_id}", _POINT) for zone_id in reader.group("survivors", _POINT)
    }
    reader.complain()
    return {zone_id: (point["x"], point["y"]) for zone_id, point in points.items()} or dict(default)
