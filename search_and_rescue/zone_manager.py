"""The plan of the mission: zones, probabilities, the base station, the geofence, and survivor names."""

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
_MIN_CORNERS = 3
_POINT = ("x", "y")

DETOUR = 1.5
"""If no path is planned between two poses, its length is assumed to be this factor times the straight line."""
SAME_M = 0.1
"""Two positions closer than this distance, in metres, are regarded as equal."""
_MAX_RATIO, _MAX_PRODUCT = 1000.0, 1e9
MAX_PLANNED = 30
"""Before each choice, the planner is queried for at most this number of zones. 30 zones have 495 paths."""
_MIN_SEC = 1e-3
VisitingOrder = Literal["listed", "nearest", "expected_find"]
"""The rules by which `ChooseZone` can order the zones."""
MAP_FRAME = "map"
"""The TF frame in which the mission sends and receives all positions."""


def is_ratio(value: float) -> bool:
    """Return whether the likelihood ratio of a hint is from 0.001 to 1000."""
    return 1.0 / _MAX_RATIO <= value <= _MAX_RATIO


class MapPose(TypedDict):
    """A pose in the frame `map`: `x` and `y` in metres, and `yaw` in radians counterclockwise from the x axis."""

    x: float
    y: float
    yaw: float


class Zone(MapPose):
    """A zone to search: its ID, and the pose from which the robot searches."""

    id: str


PosePair = tuple[MapPose, MapPose]
"""The start and the target of a path."""


def _preview() -> "ZoneManager":
    return ZoneManager([{"id": "zone_a", "x": 0.0, "y": 0.0, "yaw": 0.0}], {"x": 0.0, "y": 0.0, "yaw": 0.0})


@mission_context(preview=_preview)
class ZoneManager:
    """The plan of one mission: the zones in the order of visits. All leaves share this plan.

    The plan stores and returns copies, so that callers cannot change the plan by accident. Each change is
    recorded as an event. The event updates the plan (`apply`) immediately, and again when a later run resumes
    the mission.

    Args:
        zones: The zones, each with `id`, `x`, `y` (metres) and `yaw` (radians) in the frame `map`.
        base_station: The pose of the base station: `x`, `y` (metres) and `yaw` (radians) in the frame `map`.
        areas: The probabilities and the search duration of each zone, by ID; empty without probabilities.
        priorities: The priorities of zones by ID; zones with a higher priority are chosen first. The default is 0.
        speed_mps: The robot's speed for estimates of time, m/s.
        charging: The poses of charging places other than the base station, by ID.

    Attributes:
        charging: The poses of charging places other than the base station, by ID.
        journal: Records the events of zones: `zone_added`, `area_drawn`, `zone_chosen`, `hint_given`, `zone_visited`, `zone_postponed`,
            `zone_abandoned`.
        areas: The probabilities and the search duration of each zone, by ID.
        speed_mps: The robot's speed for estimates of time, m/s.
        looks: Number of searches of each zone, except searches whose detection was rejected. Swept zones have
            `swept` instead.
        swept: Probability that the sweeps of each zone have detected a person in the zone, 0 to 1.
        hints: Likelihood ratio (presence to absence) of all hints on each zone.
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
        # The zones in which searches detected a survivor, by the survivor's position and by name. Then the names of rejected detections.
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
        self._path_lengths: dict[frozenset[tuple[float, float]], float] = {}

    def current_zone(self) -> Zone:
        """Return the current zone, which is the first zone that is left to visit.

        Raises:
            IndexError: If every zone is visited.
        """
        if not self.has_remaining():
            raise IndexError(
                f"there is no current zone: all {self.total_zones()} zones have already been visited"
            )
        return deepcopy(self._zones[self._index])

    def has_remaining(self) -> bool:
        """Return whether a zone is left to visit, including the current zone."""
        return self._index < len(self._zones)

    def remaining_zones(self) -> list[Zone]:
        """Return the zones that are left to visit, beginning with the current zone."""
        return [zone.copy() for zone in self._zones[self._index :]]

    def has_zone(self, zone_id: str) -> bool:
        """Return whether the mission has or had a zone with this ID, including visited and abandoned zones."""
        return any(zone["id"] == zone_id for zone in (*self._zones, *self._abandoned))

    def eligible_zones(self) -> list[Zone]:
        """Return the next candidates: the zones of highest priority among the least often postponed zones.

        A postponed zone is therefore repeated only after all other zones have been tried equally often. The
        candidates are in the order of the plan.
        """
        return next(iter(self.zones_by_urgency()), [])

    def zones_by_urgency(self) -> list[list[Zone]]:
        """Return groups of remaining zones, ordered by number of postponements and then by descending priority."""
        groups: defaultdict[tuple[int, float], list[Zone]] = defaultdict(list)
        for zone in self.remaining_zones():
            groups[self._urgency(zone)].append(zone)
        return [groups[urgency] for urgency in sorted(groups)]

    def _urgency(self, zone: Zone) -> tuple[int, float]:
        return self._postponed[zone["id"]], -self._priorities.get(zone["id"], 0.0)

    def choose_zone(self, zone_id: str) -> None:
        """Make a zone the current zone. The order of the other zones does not change."""
        self.journal.record_event(search_events.ZONE_CHOSEN, zone=zone_id)

    def poa_map(self) -> PoaMap:
        """Return the map of zone probabilities after all searches so far; empty without probabilities."""
        return PoaMap.from_areas(self.areas, self.looks, self.swept, self.hints)

    def hint(self, zone_id: str, ratio: float) -> None:
        """Record a hint on a zone. *ratio* is the likelihood ratio of presence to absence."""
        self.journal.record_event(search_events.HINT_GIVEN, zone=zone_id, ratio=ratio)

    def nearest(self, x: float, y: float, among: Collection[str] = ()) -> str:
        """Return the ID of the zone nearest to a position, among zones with probabilities; empty without such zones.

        Args:
            x: The x coordinate of the position, metres, frame `map`.
            y: The y coordinate of the position, metres, frame `map`.
            among: The IDs of the zones to consider; empty for all zones.
        """
        names = self.areas.keys() & (among or self.areas)
        zones = (zone for zone in (*self._zones, *self._abandoned) if zone["id"] in names)
        point = (x, y)
        return min(zones, key=lambda zone: math.dist((zone["x"], zone["y"]), point), default={"id": ""})["id"]

    def zone_at(self, x: float, y: float) -> str | None:
        """Return the ID of the remaining zone with its pose at a position (metres, frame `map`), or None."""
        found = (
            zone["id"]
            for zone in self.remaining_zones()
            if math.dist((zone["x"], zone["y"]), (x, y)) < SAME_M
        )
        return next(found, None)

    def tour(self, zones: Sequence[Zone], start: MapPose | None = None) -> TourInputs:
        """Return the inputs for ordering zones: travel times, search durations and detection probabilities.

        Zones without probabilities have the duration 0 and the probability 0.

        Args:
            zones: The zones.
            start: The start of the tour; None for `last_pose`.
        """
        return TourInputs(
            [self._travel_sec(start or self._here, zone) for zone in zones],
            self._travels_sec(zones),
            *self._durations_and_probabilities(zones),
        )

    def _durations_and_probabilities(self, zones: Sequence[Zone]) -> tuple[list[float], list[float]]:
        """Return each zone's search duration in seconds, and the probability that the search detects the person."""
        now = self.poa_map().current_probabilities()
        areas = [self.areas.get(zone["id"], SearchExpectation(0.0, 0.0)) for zone in zones]
        finds = [now.get(zone["id"], 0.0) * area.pod for zone, area in zip(zones, areas, strict=True)]
        return [area.look_sec for area in areas], finds

    def _travels_sec(self, zones: Sequence[Zone]) -> "npt.NDArray[np.float64]":
        """Return a table of the travel times in seconds from each zone (row) to each zone (column)."""
        # Import NumPy only for this computation, because the verification of trees does not need NumPy.
        import numpy as np

        at = defaultdict[tuple[float, float], list[int]](list)
        for number, zone in enumerate(zones):
            at[zone["x"], zone["y"]].append(number)
        places = np.array([(zone["x"], zone["y"]) for zone in zones], dtype=float).reshape(-1, 2)
        metres = DETOUR * np.hypot(*(places[:, None] - places[None]).T)
        for ends, length in self._path_lengths.items():
            if ends <= at.keys():
                one, other = (at[end] for end in (min(ends), max(ends)))
                metres[np.ix_(one, other)] = metres[np.ix_(other, one)] = length
        seconds: npt.NDArray[np.float64] = metres / self.speed_mps
        return seconds

    def zones_to_plan(self, zones: Sequence[Zone]) -> list[Zone]:
        """Return at most `MAX_PLANNED` zones for which the planner computes paths, in the order of `zones`.

        If there are more zones, the zones with the highest probability per second of drive and search are
        chosen. Without probabilities, the nearest zones are chosen.
        """
        looks, finds = self._durations_and_probabilities(zones)
        if not any(finds):
            finds = [1.0] * len(zones)
        seconds = [self._travel_sec(self._here, zone) + look for zone, look in zip(zones, looks, strict=True)]
        ranked = sorted(range(len(zones)), key=lambda at: -finds[at] / max(seconds[at], _MIN_SEC))
        return [zones[at] for at in sorted(ranked[:MAX_PLANNED])]

    def required_paths(self, zones: Sequence[MapPose], *, between: bool = True) -> list[PosePair]:
        """Return the pairs of poses for which the path length is needed to order zones, return home and charge.

        Each pair is listed in only one direction.

        Args:
            zones: The zones, or pieces of a sweep.
            between: Whether to include the pairs of two zones. The number of these pairs grows with the
                square of the number of zones.
        """
        places = list(self.charging.values())
        pairs: list[PosePair] = [
            (start, zone) for start in (self._here, self._base_station, *places) for zone in zones
        ]
        pairs += [(self._here, place) for place in places]
        pairs += itertools.combinations(zones, 2) if between else ()
        by_ends = {_ends(*pair): pair for pair in pairs}
        return [pair for ends, pair in by_ends.items() if len(ends) > 1]

    def store_path_length(self, start: MapPose, target: MapPose, metres: float) -> None:
        """Store the length in metres of a planned path. It applies to both directions."""
        self._path_lengths[_ends(start, target)] = metres

    def has_path_length(self, start: MapPose, target: MapPose) -> bool:
        """Return whether the length of a planned path is stored for a pair of poses."""
        return _ends(start, target) in self._path_lengths

    def path_length_m(self, start: MapPose, target: MapPose) -> float:
        """Return the length of a path in metres. If no planned length is stored, estimate it with `DETOUR`."""
        line = math.dist((start["x"], start["y"]), (target["x"], target["y"]))
        return self._path_lengths.get(_ends(start, target), DETOUR * line)

    def last_pose(self) -> MapPose:
        """Return the pose of the last search, or of the base station or charging place if reached later."""
        return deepcopy(self._here)

    def _travel_sec(self, start: MapPose, target: MapPose) -> float:
        return self.path_length_m(start, target) / self.speed_mps

    def add(self, zone: Zone) -> None:
        """Add a zone at the end of the plan."""
        self.journal.record_event(search_events.ZONE_ADDED, **zone)

    def draw(self, zone: Zone, ground: "Ground", area: SearchExpectation | None) -> float:
        """Add a zone with a polygon at the end of the plan, or replace an existing zone.

        Args:
            zone: The zone.
            ground: The polygon of the zone, and the ranges of the sensor in the zone.
            area: The probabilities and the duration of a search of the zone; None without probabilities.

        Returns:
            The factor by which the POA of every other zone is multiplied; below 1 if the sum of all POA would otherwise exceed 1.
        """
        before = math.fsum(each.poa for name, each in self.areas.items() if name != zone["id"])
        room = 1.0 - area.poa if area is not None else 1.0
        shrunk = room / before if before > room + ROUNDING else 1.0
        polygon = [list(corner) for corner in ground.polygon]
        self.journal.record_event(
            search_events.AREA_DRAWN,
            zone=zone["id"],
            x=zone["x"],
            y=zone["y"],
            yaw=zone["yaw"],
            polygon=polygon,
            sweep_width=ground.sweep_width,
            detection_range=ground.detection_range,
            expected=list(area) if area is not None else None,
            shrunk=shrunk,
        )
        return shrunk

    def select_next_zone(self) -> None:
        """Record that the current zone was visited, and go to the next zone. Do nothing if no zone is left."""
        if self.has_remaining():
            self.journal.record_event(search_events.ZONE_VISITED, zone=self._zones[self._index]["id"])

    def postpone(self) -> None:
        """Move the current zone to the end of the plan. Do nothing if no zone is left."""
        if self.has_remaining():
            self.journal.record_event(search_events.ZONE_POSTPONED, zone=self._zones[self._index]["id"])

    def times_postponed(self) -> int:
        """Return the number of times that the current zone was postponed.

        Raises:
            IndexError: If every zone is visited.
        """
        return self._postponed[self.current_zone()["id"]]

    def abandon(self, reason: str = "") -> None:
        """Remove the current zone from the plan without a visit. Do nothing if no zone is left.

        Args:
            reason: Why the zone is abandoned; empty if the attempts to search the zone have failed.
        """
        if self.has_remaining():
            zone_id, attempts = self._zones[self._index]["id"], self.times_postponed() + 1
            self.journal.record_event(
                search_events.ZONE_ABANDONED, zone=zone_id, attempts=attempts, reason=reason
            )

    def abandoned_zones(self) -> list[Zone]:
        """Return the abandoned zones in the order in which they were abandoned."""
        return deepcopy(self._abandoned)

    def base_pose(self) -> MapPose:
        """Return the pose of the base station."""
        return deepcopy(self._base_station)

    def next_survivor_id(self) -> str:
        """Return a new survivor name, which is unique in this mission: `survivor_1`, `survivor_2` and so on."""
        self._survivors += 1
        self.journal.store_highest_number("survivor", self._survivors)
        return f"survivor_{self._survivors}"

    def current_index(self) -> int:
        """Return the number of visited zones, which is also the index of the current zone."""
        return self._index

    def total_zones(self) -> int:
        """Return the number of all zones of the mission, including abandoned zones."""
        return len(self._zones) + len(self._abandoned)

    def apply(self, fact: JournalEntry) -> None:
        """Update the plan from an event. Ignore events of other kinds.

        Raises:
            LookupError, TypeError or ValueError: If the event contradicts the current state.
        """
        if (handle := self._HANDLERS.get(fact.kind)) is not None:
            handle(self, fact.data)

    def _on_zone_chosen(self, data: Mapping[str, Any]) -> None:
        left = [zone["id"] for zone in self.remaining_zones()]
        if data["zone"] not in left:
            raise ValueError(f"{data['zone']} is not among the remaining zones at the time of the event")
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
        # A skipped piece shows that the planned paths may be outdated.
        self._path_lengths.clear()

    def _on_hint_given(self, data: Mapping[str, Any]) -> None:
        zone, ratio = data["zone"], float(data["ratio"])
        if zone not in self.areas or not is_ratio(ratio):
            raise ValueError(f"invalid hint on {zone}")
        # Bound the product, so that many hints cannot make all other probabilities vanish by rounding.
        product = self.hints.get(zone, 1.0) * ratio
        self.hints[zone] = min(max(product, 1.0 / _MAX_PRODUCT), _MAX_PRODUCT)

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
            raise ValueError(f"{name} is already visited at the time of the event")
        else:
            self._zones[at] = zone
        if data["expected"] is None:
            return
        shrunk = position(data["shrunk"], 0.0)[0]
        others = {other: area._replace(poa=area.poa * shrunk) for other, area in self.areas.items()}
        self.areas = {**others, name: SearchExpectation(*map(float, data["expected"]))}

    def _on_survivor_named(self, data: Mapping[str, Any]) -> None:
        number = data["survivor"].rpartition("_")[2]
        # Leaves of users may assign names that are not of the form `survivor_1`.
        self._survivors = max(self._survivors, int(number) if number.isdecimal() else 0)
        if zone := self._found_at.get(position(data["x"], data["y"])):
            self._found_in[data["survivor"]] = zone

    def _on_survivor_judged(self, data: Mapping[str, Any]) -> None:
        name = data["survivor"]
        is_rejected = data["standing"] == "rejected"
        # A search that ended with a false detection does not show whether a person is in the zone, so the search does not count.
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
        self._path_lengths.clear()

    def _on_zone_abandoned(self, data: Mapping[str, Any]) -> None:
        self._check_current(data["zone"])
        self._abandoned.append(self._zones.pop(self._index))

    def _check_current(self, zone_id: str) -> None:
        if zone_id != (current := self.current_zone()["id"]):
            raise ValueError(f"the current zone at the time of the event is {current}")

    # Events of other kinds do not change the plan.
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
    """Return the key under which the path length between two poses is stored, in either direction."""
    return frozenset({(start["x"], start["y"]), (target["x"], target["y"])})


@mission_context
class Geofence:
    """The geofence of a mission: a polygon in the frame `map`.

    Args:
        corners: The corners in order, x and y in metres; empty if there is no geofence, so that every position is inside.
    """

    def __init__(self, corners: Sequence[tuple[float, float]] = ()) -> None:
        self.corners = tuple(corners)

    def __bool__(self) -> bool:
        """Return whether there is a geofence."""
        return bool(self.corners)

    def contains(self, x: float, y: float) -> bool:
        """Return whether a position is inside the geofence. If there is no geofence, return True.

        Args:
            x: The x coordinate of the position, metres, frame `map`.
            y: The y coordinate of the position, metres, frame `map`.
        """
        inside = not self.corners
        for (ax, ay), (bx, by) in itertools.pairwise((*self.corners, *self.corners[:1])):
            # A ray from an inside position to the right crosses the boundary an odd number of times.
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside


def read_fence(reader: ParameterReader) -> Geofence:
    """Read the parameter `geofence`, such as `[x1, y1, x2, y2, x3, y3]`. Without it, the geofence has no corners."""
    numbers = reader.numbers(_GEOFENCE)
    corners = list(zip(numbers[::2], numbers[1::2], strict=False))
    if numbers and (len(numbers) % 2 or len(corners) < _MIN_CORNERS):
        text = f"must contain x and y of three or more corners, [x1, y1, x2, y2, x3, y3], but contains {len(numbers)} numbers"
        reader.report_error(_GEOFENCE, text)
        return Geofence()
    return Geofence(corners)


def read_survivors(
    parameters: Mapping[str, object], default: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Read survivor positions from the parameters `survivors.<zone>.{x,y}`, or return the default without them.

    Returns:
        The positions by zone, metres, frame `map`.

    Raises:
        ParameterError: If any of these parameters is invalid; the exception lists all errors.
    """
    reader = ParameterReader(parameters)
    points = {
        zone_id: reader.point(f"survivors.{zone_id}", _POINT) for zone_id in reader.group("survivors", _POINT)
    }
    reader.complain()
    return {zone_id: (point["x"], point["y"]) for zone_id, point in points.items()} or dict(default)
