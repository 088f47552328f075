"""The plan of the mission: the remaining zones, the base station, the geofence, and the names assigned to survivors."""

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
from search_and_rescue.search_theory import ROUNDING, PoaMap, SearchExpectation, TourInputs

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from search_and_rescue.search_theory import Ground

_GEOFENCE = "geofence"
_LEAST_CORNERS = 3
_POINT = ("x", "y")

DETOUR = 1.5
"""Ratio of path length to straight line, assumed for paths without a plan."""
SAME_M = 0.1
"""Distance below which two zones are at the same position, metres."""
_LARGEST_RATIO, _MOST_TOGETHER = 1000.0, 1e9
MOST_PLANNED = 30
"""Largest number of zones for which one choice asks the planner: 30 zones have 495 paths."""
_SHORTEST_SEC = 1e-3
VisitingOrder = Literal["listed", "nearest", "expected_find"]
"""Rule for choosing the next zone."""
MAP_FRAME = "map"
"""The frame of every position that the mission sends or receives."""


def is_ratio(value: float) -> bool:
    """Return whether a likelihood ratio is plausible: 0.001 to 1000."""
    return 1.0 / _LARGEST_RATIO <= value <= _LARGEST_RATIO


class MapPose(TypedDict):
    """A pose in the frame `map`: metres, and radians counterclockwise from the x axis."""

    x: float
    y: float
    yaw: float


class Zone(MapPose):
    """A zone to search, with its name."""

    id: str


PosePair = tuple[MapPose, MapPose]
"""Start and target of a path."""


def _preview() -> "ZoneManager":
    return ZoneManager([{"id": "zone_a", "x": 0.0, "y": 0.0, "yaw": 0.0}], {"x": 0.0, "y": 0.0, "yaw": 0.0})


@mission_context(preview=_preview)
class ZoneManager:
    """The zones of one mission in the order of their visits, shared by all of its leaves.

    It stores and returns copies, so that callers cannot change the plan by accident. Each change is recorded as an event, and the event
    updates the plan (`apply`), both now and when a later run resumes.

    Args:
        zones: The zones, each with `id`, `x`, `y` (metres) and `yaw` (radians) in the frame `map`.
        base_station: The pose to return to: `x`, `y` (metres), `yaw` (radians).
        areas: Expectations of a search in each zone, by ID; empty without probabilities.
        priorities: Priority of zones by ID: higher ones are chosen first; default 0.
        speed_mps: The robot's speed for estimates of time, m/s.
        charging: The poses of charging places other than the base station, by ID.

    Attributes:
        charging: The poses of charging places.
        journal: Records the zones' events: `zone_added`, `area_drawn`, `zone_chosen`, `zone_visited`, `zone_postponed`,
                `zone_abandoned`.
        areas: Expectations of a search in each zone.
        speed_mps: The robot's speed for estimates of time, m/s.
        looks: Number of searches of each zone. A sweep enters by its coverage instead; a search with a rejected detection does not count.
        swept: Probability that the sweep of each zone detected a person who is there, 0 to 1.
        hints: Likelihood ratio of all hints on a zone: presence over absence.
    """

    def __init__(
        self,
        zones: Sequence[Mapping[str, Any]],
        base_station: Mapping[str, Any],
        *,
        areas: Mapping[str, SearchExpectation] | None = None,
        priorities: Mapping[str, float] | None = None,
        speed_mps: float = 1.0,
        charging: Mapping[str, MapPose] | None = None,
    ) -> None:
        self.charging = deepcopy(dict(charging or {}))
        self.areas = dict(areas or {})
        self.looks: Counter[str] = Counter()
        # For searches with a detection: the zone, by position and by the survivor's name; and the rejected detections.
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
        """Return the zone to search now.

        Raises:
            IndexError: If every zone is visited.
        """
        if not self.has_remaining():
            raise IndexError(f"there is no current zone: all {self.total_zones()} zones are visited")
        return deepcopy(self._zones[self._index])

    def has_remaining(self) -> bool:
        """Return whether a zone is left to visit (including the current one)."""
        return self._index < len(self._zones)

    def remaining_zones(self) -> list[Zone]:
        """Return the zones left to visit, the current one first."""
        return [zone.copy() for zone in self._zones[self._index :]]

    def has_zone(self, zone_id: str) -> bool:
        """Return whether a zone of this name exists or existed."""
        return any(zone["id"] == zone_id for zone in (*self._zones, *self._abandoned))

    def eligible_zones(self) -> list[Zone]:
        """Return the candidates for the next zone: of the least postponed zones, those with the highest priority.

        A postponed zone is therefore repeated only when all others have been tried equally often. The current zone is first.
        """
        return next(iter(self.zones_by_urgency()), [])

    def zones_by_urgency(self) -> list[list[Zone]]:
        """Return the remaining zones in groups of decreasing urgency."""
        groups: defaultdict[tuple[int, float], list[Zone]] = defaultdict(list)
        for zone in self.remaining_zones():
            groups[self._urgency(zone)].append(zone)
        return [groups[urgency] for urgency in sorted(groups)]

    def _urgency(self, zone: Zone) -> tuple[int, float]:
        return self._postponed[zone["id"]], -self._priorities.get(zone["id"], 0.0)

    def choose_zone(self, zone_id: str) -> None:
        """Choose the current zone; the other zones keep their order."""
        self.journal.record_event(search_events.ZONE_CHOSEN, zone=zone_id)

    def poa_map(self) -> PoaMap:
        """Return the probabilities after the searches so far; without areas if no probabilities are given."""
        return PoaMap.from_areas(self.areas, self.looks, self.swept, self.hints)

    def hint(self, zone_id: str, ratio: float) -> None:
        """Record a hint on a zone as a likelihood ratio."""
        self.journal.record_event(search_events.HINT_GIVEN, zone=zone_id, ratio=ratio)

    def nearest(self, x: float, y: float, among: Collection[str] = ()) -> str:
        """Return the zone with probabilities whose pose is nearest to a position; empty if there is none.

        Args:
            x: Metres, frame `map`.
            y: Metres, frame `map`.
            among: The candidates; empty for all zones.
        """
        names = self.areas.keys() & (among or self.areas)
        zones = (zone for zone in (*self._zones, *self._abandoned) if zone["id"] in names)
        place = (x, y)
        return min(zones, key=lambda zone: math.dist((zone["x"], zone["y"]), place), default={"id": ""})["id"]

    def zone_at(self, x: float, y: float) -> str | None:
        """Return the remaining zone whose pose is at a position (metres, frame `map`); None if there is none."""
        here = (
            zone["id"]
            for zone in self.remaining_zones()
            if math.dist((zone["x"], zone["y"]), (x, y)) < SAME_M
        )
        return next(here, None)

    def tour(self, zones: Sequence[Zone], start: MapPose | None = None) -> TourInputs:
        """Return the inputs for ordering the given zones: travel times, durations and probabilities.

        Without probabilities all zones have equal weight, and searches take no time.

        Args:
            zones: The zones.
            start: The start; if None, the pose of the last search, or the base station.
        """
        return TourInputs(
            [self._travel_sec(start or self._here, zone) for zone in zones],
            self._travels_sec(zones),
            *self._durations_and_probabilities(zones),
        )

    def _durations_and_probabilities(self, zones: Sequence[Zone]) -> tuple[list[float], list[float]]:
        """Return the duration of a search in each zone, seconds, and the probability of a detection."""
        now = self.poa_map().current_probabilities()
        areas = [self.areas.get(zone["id"], SearchExpectation(0.0, 0.0)) for zone in zones]
        finds = [now.get(zone["id"], 0.0) * area.pod for zone, area in zip(zones, areas, strict=True)]
        return [area.look_sec for area in areas], finds

    def _travels_sec(self, zones: Sequence[Zone]) -> "npt.NDArray[np.float64]":
        """Return the travel time from each zone (row) to each other, seconds; 1,000 zones have a million paths."""
        # A laptop that verifies trees needs no NumPy.
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

    def zones_to_plan(self, zones: Sequence[Zone]) -> list[Zone]:
        """Return the zones whose paths are requested from a planner, in order; at most `MOST_PLANNED`.

        Of more zones, those with the highest probability per second of drive and search are returned; without probabilities, the nearest.
        """
        looks, finds = self._durations_and_probabilities(zones)
        if not any(finds):
            finds = [1.0] * len(zones)
        seconds = [self._travel_sec(self._here, zone) + look for zone, look in zip(zones, looks, strict=True)]
        ranked = sorted(range(len(zones)), key=lambda at: -finds[at] / max(seconds[at], _SHORTEST_SEC))
        return [zones[at] for at in sorted(ranked[:MOST_PLANNED])]

    def required_paths(self, zones: Sequence[MapPose], *, between: bool = True) -> list[PosePair]:
        """Return the paths for ordering zones, returning home and charging, each in one direction.

        Args:
            zones: The zones, or pieces of a sweep. The number of paths between them grows with its square.
            between: Whether to include paths from zone to zone, and not only those from the pose of the last search.
        """
        places = list(self.charging.values())
        ways: list[PosePair] = [
            (start, zone) for start in (self._here, self._base_station, *places) for zone in zones
        ]
        ways += [(self._here, place) for place in places]
        ways += itertools.combinations(zones, 2) if between else ()
        by_ends = {_ends(*way): way for way in ways}
        return [way for ends, way in by_ends.items() if len(ends) > 1]

    def store_path_length(self, start: MapPose, target: MapPose, metres: float) -> None:
        """Store a path's length from a planner, metres, for both directions."""
        self._ways[_ends(start, target)] = metres

    def has_path_length(self, start: MapPose, target: MapPose) -> bool:
        """Return whether a planner has provided the length of a path."""
        return _ends(start, target) in self._ways

    def path_length_m(self, start: MapPose, target: MapPose) -> float:
        """Return the length of a path, metres: from the planner if known, otherwise the straight line times `DETOUR`."""
        line = math.dist((start["x"], start["y"]), (target["x"], target["y"]))
        return self._ways.get(_ends(start, target), DETOUR * line)

    def last_pose(self) -> MapPose:
        """Return the pose of the last search, or the base station if the robot has been there since."""
        return deepcopy(self._here)

    def _travel_sec(self, start: MapPose, target: MapPose) -> float:
        return self.path_length_m(start, target) / self.speed_mps

    def add(self, zone: Zone) -> None:
        """Add a zone at the end of the plan."""
        self.journal.record_event(search_events.ZONE_ADDED, **zone)

    def draw(self, zone: Zone, ground: "Ground", area: SearchExpectation | None) -> float:
        """Add a zone with a polygon at the end of the plan, or change an existing one.

        Args:
            zone: The zone.
            ground: Its polygon, and the range of the sensor there.
            area: Expectations of a search there; None without probabilities.

        Returns:
            The factor for the POA of the other zones: below 1 if the sum would otherwise exceed 1.
        """
        before = math.fsum(each.poa for name, each in self.areas.items() if name != zone["id"])
        room = 1.0 - area.poa if area is not None else 1.0
        shrunk = room / before if before > room + ROUNDING else 1.0
        places = [list(corner) for corner in ground.polygon]
        self.journal.record_event(
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

    def select_next_zone(self) -> None:
        """Advance to the next zone; past the last zone, do nothing."""
        if self.has_remaining():
            self.journal.record_event(search_events.ZONE_VISITED, zone=self._zones[self._index]["id"])

    def postpone(self) -> None:
        """Move the current zone to the end of the plan; past the last zone, do nothing."""
        if self.has_remaining():
            self.journal.record_event(search_events.ZONE_POSTPONED, zone=self._zones[self._index]["id"])

    def times_postponed(self) -> int:
        """Return how often the current zone was postponed.

        Raises:
            IndexError: If every zone is visited.
        """
        return self._postponed[self.current_zone()["id"]]

    def abandon(self, reason: str = "") -> None:
        """Remove the current zone from the plan, unvisited; past the last zone, do nothing.

        Args:
            reason: Why it is abandoned without an attempt; empty if its attempts have failed.
        """
        if self.has_remaining():
            zone_id, attempts = self._zones[self._index]["id"], self.times_postponed() + 1
            self.journal.record_event(
                search_events.ZONE_ABANDONED, zone=zone_id, attempts=attempts, reason=reason
            )

    def abandoned_zones(self) -> list[Zone]:
        """Return the abandoned zones in the order of abandonment."""
        return deepcopy(self._abandoned)

    def base_pose(self) -> MapPose:
        """Return the pose of the base station."""
        return deepcopy(self._base_station)

    def next_survivor_id(self) -> str:
        """Return a new name for a survivor, unique in this mission (`survivor_1`, `survivor_2`, …)."""
        self._survivors += 1
        self.journal.store_highest_number("survivor", self._survivors)
        return f"survivor_{self._survivors}"

    def current_index(self) -> int:
        """Return the number of visited zones, which is the current zone's index."""
        return self._index

    def total_zones(self) -> int:
        """Return the number of the mission's zones, including abandoned ones."""
        return len(self._zones) + len(self._abandoned)

    def apply(self, fact: JournalEntry) -> None:
        """Update the plan from an event.

        Raises:
            LookupError, TypeError or ValueError: If the event contradicts the current state.
        """
        if (handle := self._HANDLERS.get(fact.kind)) is not None:
            handle(self, fact.data)

    def _on_zone_chosen(self, data: Mapping[str, Any]) -> None:
        left = [zone["id"] for zone in self.remaining_zones()]
        if data["zone"] not in left:
            raise ValueError(f"{data['zone']} is not among the remaining zones at that time")
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
        # The paths may have changed.
        self._ways.clear()

    def _on_hint_given(self, data: Mapping[str, Any]) -> None:
        zone, ratio = data["zone"], float(data["ratio"])
        if zone not in self.areas or not is_ratio(ratio):
            raise ValueError(f"invalid hint on {zone}")
        # A bound keeps many hints from growing into a number that absorbs all others.
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
            raise ValueError(f"{name} is already visited at that time")
        else:
            self._zones[at] = zone
        if data["expected"] is None:
            return
        shrunk = position(data["shrunk"], 0.0)[0]
        others = {other: area._replace(poa=area.poa * shrunk) for other, area in self.areas.items()}
        self.areas = {**others, name: SearchExpectation(*map(float, data["expected"]))}

    def _on_survivor_named(self, data: Mapping[str, Any]) -> None:
        number = data["survivor"].rpartition("_")[2]
        # A user's leaf may assign other names.
        self._survivors = max(self._survivors, int(number) if number.isdecimal() else 0)
        if zone := self._found_at.get(position(data["x"], data["y"])):
            self._found_in[data["survivor"]] = zone

    def _on_survivor_judged(self, data: Mapping[str, Any]) -> None:
        name = data["survivor"]
        is_rejected = data["standing"] == "rejected"
        # The search ended with a false detection, so it does not show whether another person is there.
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
            raise ValueError(f"the current zone at that time is {current}")

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
    """Return a key that is equal for both directions of a path."""
    return frozenset({(start["x"], start["y"]), (target["x"], target["y"])})


@mission_context
class Geofence:
    """A polygon in the frame `map`.

    Args:
        corners: Its corners in order, x and y in metres; empty for no fence, which allows every position.
    """

    def __init__(self, corners: Sequence[tuple[float, float]] = ()) -> None:
        self.corners = tuple(corners)

    def __bool__(self) -> bool:
        """Return whether the fence has corners."""
        return bool(self.corners)

    def contains(self, x: float, y: float) -> bool:
        """Return whether a position is inside; without a fence always True.

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


def read_fence(reader: ParameterReader) -> Geofence:
    """Read the parameter `geofence`: `[x1, y1, x2, y2, x3, y3, …]`; without it there is no fence."""
    numbers = reader.numbers(_GEOFENCE)
    corners = list(zip(numbers[::2], numbers[1::2], strict=False))
    if numbers and (len(numbers) % 2 or len(corners) < _LEAST_CORNERS):
        text = f"must contain x and y of three or more corners, [x1, y1, x2, y2, x3, y3], but contains {len(numbers)} numbers"
        reader.report_error(_GEOFENCE, text)
        return Geofence()
    return Geofence(corners)


def read_survivors(
    parameters: Mapping[str, object], default: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Read the survivors' positions by zone from `survivors.<zone>.{x,y}`.

    Returns:
        The positions in metres in the frame `map`.

    Raises:
        ParameterError: If there are errors; lists all of them.
    """
    reader = ParameterReader(parameters)
    points = {
        zone_id: reader.point(f"survivors.{zone_id}", _POINT) for zone_id in reader.group("survivors", _POINT)
    }
    reader.complain()
    return {zone_id: (point["x"], point["y"]) for zone_id, point in points.items()} or dict(default)
