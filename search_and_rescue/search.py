"""A run of the search and rescue mission: its shared state, display, summary and event sentences."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from itertools import count
from typing import TYPE_CHECKING, Any

from sar_compiler.missions import (
    OF_EVERY_MISSION,
    Alarm,
    Display,
    Figure,
    Journal,
    JournalEntry,
    Landmark,
    LandmarkKind,
    Level,
    MissionPhase,
    MissionRun,
    OperatorCommand,
    SearchedArea,
    clock_text,
)
from search_and_rescue import search_events
from search_and_rescue.homing_estimates import HomingEstimator
from search_and_rescue.operator_commands import SENTENCES, VERBS, OperatorCommands
from search_and_rescue.record import (
    UNSEARCHED,
    DetectionVerdict,
    FoundSurvivor,
    MissionRecord,
    ResumedOutcomes,
    StoredReports,
    describe_abandonment,
)
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import DETOUR, Geofence, Zone, ZoneManager

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.missions import FaultPlan

KINDS = (
    LandmarkKind("zone", "zones", remedy="Send people to search"),
    LandmarkKind(
        "survivor",
        "survivors",
        "triangle",
        is_found=True,
        event="survivor found by a search robot",
        review="judge_survivor",
    ),
    LandmarkKind("base", "base", "house", is_end=True),
    LandmarkKind("geofence", "geofence"),
    LandmarkKind("area", "areas", shaded_by="probability now"),
    LandmarkKind("gap", "gaps", remedy="Send people to search"),
)
"""The kinds of landmarks that every search displays."""
CHARGING_KIND = LandmarkKind("charging place", "charging places", "square")
"""The kind of landmark that is displayed if there are charging places."""
# The order of visits has at most this number of lines in the log.
_MAX_LINES = 20
# The alarm level of a return home after which the mission continues: that of a warning in the log.
_WARNING = 30
BASE = "base station"
"""The name of the base station in the display."""


@dataclass(eq=False, repr=False)
class Search(MissionRun):
    """A run of the mission. All parts of the run share one journal, and each event updates the parts concerned.

    Args:
        zones: The plan of the mission.
        record: The record of the mission.
        orders: The operator's commands.
        fence: The geofence.
        homing: The estimator for the way home; None for an estimator with default rates.
        sweeps: The grounds of the zones that can be swept, and the coverage of the grounds.
        hides: Whether the simulator hides a survivor at random, instead of using the table of survivors.
        wanted_success: The required probability of success, 0 to 1. If a search ends with a lower
            probability, a person must decide whether to search again.
    """

    zones: ZoneManager
    record: MissionRecord = field(default_factory=MissionRecord)
    orders: OperatorCommands = field(default_factory=OperatorCommands)
    _: KW_ONLY
    fence: Geofence = field(default_factory=Geofence)
    homing: HomingEstimator | None = None
    sweeps: SweepStates = field(default_factory=SweepStates)
    hides: bool = False
    wanted_success: float = 0.0

    def __post_init__(self) -> None:
        self.kept = StoredReports()
        zones = self.zones
        self._home = self.homing or HomingEstimator(zones, sweeps=self.sweeps)
        parts = (zones, self.record, self.kept, self.orders, self.fence, self._home, self.sweeps)
        self.context = {type(part): part for part in parts}
        self.kinds = (
            *KINDS,
            *([CHARGING_KIND] if zones.charging else ()),
        )
        self._identity: dict[str, object] = {
            "zones": zones.remaining_zones(),
            "base_station": zones.base_pose(),
        }
        if zones.areas:
            self._identity["areas"] = {name: list(area) for name, area in zones.areas.items()}
        if zones.charging:
            self._identity["charging"] = dict(zones.charging)
        if self.sweeps.grounds:
            self._identity["grounds"] = {name: list(ground) for name, ground in self.sweeps.grounds.items()}
        self._plan = {zone["id"]: zone for zone in zones.remaining_zones()}
        self._zones_at_start = zones.total_zones()
        self._set_journal(Journal(apply=self.apply))

    def start_lines(self) -> list[str]:
        """Return log lines with the number of zones, the base station, and the expected order of visits."""
        base = self.zones.base_pose()
        return [
            f"Loaded {self.zones.total_zones()} search zones from parameters.",
            f"Base station at ({base['x']:.2f}, {base['y']:.2f}, yaw={base['yaw']:.2f}).",
            *(self._order_of_visits() if self.zones.areas else ()),
        ]

    def _order_of_visits(self) -> list[str]:
        """Return log lines with the order in which `ChooseZone order="expected_find"` would visit the zones."""
        # Import NumPy only if the zones have probabilities.
        from search_and_rescue.zone_order import approximation, order_areas

        zones, groups = list[Zone](), self.zones.zones_by_urgency()
        for group in groups:
            tour = self.zones.tour(group, zones[-1] if zones else None)
            zones += [group[area] for area in order_areas("expected_find", tour)]
        tour, order = self.zones.tour(zones), range(len(zones))
        pos, lines = 0.0, list[str]()
        for area, end in enumerate(tour.ends(order)):
            pos += tour.finds[area]
            lines.append(f"  {zones[area]['id']}: searched after {end:.0f} s, POS {pos:.0%}")
        if len(lines) > _MAX_LINES:
            lines[_MAX_LINES - 2 : -1] = [f"  … {len(lines) - _MAX_LINES + 1} more zones …"]
        largest = max(map(len, groups), default=0)
        method = f", approximated for {largest} zones by {name}" if (name := approximation(largest)) else ""
        estimate = f"first detection, if any, after {tour.expected_find(order):.0f} s"
        return [
            f"Order by expected_find{method} ({estimate} with paths of {DETOUR:g} times the straight line):",
            *lines,
        ]

    def identity(self) -> dict[str, object]:
        """Return the data that identify the mission, such as the zones in order and the base station."""
        return self._identity

    def use_journal(self, journal: Journal) -> None:
        """Apply the events that earlier runs have recorded in a journal. Record all later events in this journal.

        Raises:
            JournalError: If the events cannot be applied to this search.
        """
        journal.attach(self, self.kinds)
        self.record.before = ResumedOutcomes.from_events(journal.earlier_events())
        self._set_journal(journal)

    def _set_journal(self, journal: Journal) -> None:
        self.zones.journal = self.record.journal = self.orders.journal = self.sweeps.journal = journal

    def apply(self, fact: JournalEntry) -> None:
        """Update all parts of the run from an event.

        Raises:
            ArithmeticError, AttributeError, LookupError, TypeError or ValueError: If the event is unknown, or contradicts the current state.
        """
        if fact.kind not in _SENTENCES and fact.kind not in OF_EVERY_MISSION:
            # A newer version may have written the journal. Without the event, the resumed run would have a wrong state.
            raise ValueError(f"this version does not support the event '{fact.kind}'")
        for part in (self.zones, self.kept, self.record, self.orders, self.sweeps):
            part.apply(fact)
        if fact.kind in (search_events.ZONE_ADDED, search_events.AREA_DRAWN):
            self._plan |= {zone["id"]: zone for zone in self.zones.remaining_zones()}

    def display(self) -> Display:
        """Return the display state: landmarks, figures, alarms, phase, and coverage layers."""
        survivors, zones = self.record.survivors, self.zones
        found = map(_survivor, survivors, count(1))
        poa_map = zones.poa_map()
        likely = poa_map.current_probabilities()
        zones_shown = [self._zone(zone, likely) for zone in self._plan.values()]
        places = self._base(), *self._charging_landmarks(), *self._area()
        landmarks = [*zones_shown, *found, *places, *self._grounds(zones_shown, likely)]
        figures = [
            Figure("zones visited", len(self.record.zones_visited), zones.total_zones()),
            Figure("survivors found", len(survivors)),
            Figure("survivors reported", sum(each.acknowledged for each in survivors)),
        ]
        if zones.areas:
            success, wanted = round(100 * poa_map.pos(), 1), round(100 * self.wanted_success, 1)
            figures.append(Figure("probability of success", success, unit="%", least=wanted or None))
            if (first := self.record.first_detection_sec) is not None:
                figures.append(Figure("first detection after", round(first, 1), unit="s"))
        if self.sweeps.grounds:
            swept = sum(self.sweeps.state_of(zone).metres for zone in self.sweeps.grounds)
            figures.append(Figure("swept", round(swept, 1), unit="m"))
            seen, whole = self.sweeps.seen_m2()
            figures.append(Figure("seen", round(seen), round(whole), "m²"))
        figures += self._home.figures()
        alarms = [Alarm(text) for text in (*self.record.alarms, *self.record.unplaced_survivors())]
        if self.record.homing_for:
            alarms.append(Alarm(_home_first(self.record.homing_for, self.record.homing_to), level=_WARNING))
        phase = self._phase()
        return Display(
            landmarks,
            figures,
            alarms=alarms,
            phase=phase,
            rasters=self.sweeps.layers(),
            objects=self._objects(phase),
        )

    def _objects(self, phase: MissionPhase) -> dict[str, str]:
        """Return the object of each command, such as the current zone for `skip_zone`."""
        zones, plan = self.zones, ", ".join(self._plan)
        state = " ".join(filter(None, (phase.name or "active", phase.reason)))
        return {
            "resume": state,
            "go_home": f"{state}, zones {plan}",
            "add_hint": f"zones {plan}",
            **({"skip_zone": zones.current_zone()["id"]} if zones.has_remaining() else {}),
        }

    def _phase(self) -> MissionPhase:
        orders, at_base = self.orders, BASE if self.record.home else ""
        place = self.record.zone or self.record.charging_at or at_base
        name = "aborted" if "abort" in orders.given else "held" if orders.held else ""
        why = ""
        if name:
            why = f"by {orders.given['abort' if name == 'aborted' else 'pause']}"
        elif "go_home" in orders.given:
            why = orders.describe("go_home")
        if self.record.homing_for and place in (BASE, *self.zones.charging) and not name:
            name, why = "waiting", "for another battery"
        return MissionPhase(name, why, place)

    def _zone(self, zone: Zone, likely: Mapping[str, float]) -> Landmark:
        known, name = self.record.zone_record(zone["id"]), zone["id"]
        # The robot may have visited or left the zone without a finished search.
        is_searched = known.searched is not None
        if name in self.record.zones_visited:
            state = "visited" if is_searched else UNSEARCHED
            level = Level.DONE if is_searched else Level.GIVEN_UP
        elif known.given_up:
            state = "searched, abandoned" if is_searched else "abandoned"
            level = Level.DONE if is_searched else Level.GIVEN_UP
        elif name == self.record.zone:
            state, level = "searched" if self.record.is_searched else "under way", Level.IN_HAND
        else:
            state, level = "postponed" if known.attempts and known.left else "open", Level.TO_COME
        details = {
            "attempts": known.attempts,
            "started": known.started,
            "searched": known.searched,
            "left": known.left,
            "unplaced survivor": known.unplaced,
        }
        if name in likely:
            details["probability now"] = f"{likely[name]:.1%}"
        # The landmark's state already contains the word `abandoned`.
        reason = known.given_up.removeprefix("abandoned: ").removeprefix("abandoned ")
        return Landmark("zone", name, zone["x"], zone["y"], state, level, reason, details=details)

    def _base(self) -> Landmark:
        base, home = self.zones.base_pose(), self.record.home
        return Landmark(
            "base", BASE, base["x"], base["y"], "home" if home else "", Level.DONE if home else Level.TO_COME
        )

    def _charging_landmarks(self) -> Iterator[Landmark]:
        for name, pose in self.zones.charging.items():
            is_there = name == self.record.charging_at
            state, level = ("the robot is there", Level.IN_HAND) if is_there else ("", Level.TO_COME)
            yield Landmark("charging place", name, pose["x"], pose["y"], state, level)

    def _area(self) -> list[Landmark]:
        corners = self.fence.corners
        return [Landmark("geofence", "geofence", *corners[0], corners=corners)] if corners else []

    def _grounds(self, zones: Sequence[Landmark], likely: Mapping[str, float]) -> Iterator[Landmark]:
        """Yield a landmark with the sweep progress for each zone polygon, and a landmark for each gap."""
        for zone in zones:
            ground, sweep = self.sweeps.grounds.get(zone.name), self.sweeps.state_of(zone.name)
            if ground is None:
                continue
            state = f"{sweep.done} of {len(sweep.pieces)} pieces" if sweep.passes else ""
            yield zone._replace(
                kind="area",
                state=state,
                reason="",
                corners=ground.polygon,
                details=self._swept(zone.name, likely),
                shade=round(likely[zone.name], 4) if zone.name in likely else None,
            )
            for number, gap in enumerate(sweep.gaps, 1):
                name = f"{zone.name} gap {number}"
                yield Landmark("gap", name, *gap[0], level=Level.GIVEN_UP, within=zone.name, corners=gap)

    def _swept(self, zone: str, likely: Mapping[str, float]) -> dict[str, object]:
        """Return the figures of a zone's sweep. The labels are terms from search manuals."""
        ground, sweep = self.sweeps.grounds[zone], self.sweeps.state_of(zone)
        before = self.zones.areas.get(zone)
        return {
            "POA before": f"{before.poa:.1%}" if before else "",
            "POA now": f"{likely[zone]:.1%}" if before else "",
            "sweep width W": f"{ground.sweep_width:g} m",
            "track length L": f"{sweep.metres:.1f} m",
            "area A": f"{sweep.area_m2:.1f} m²" if sweep.area_m2 else "",
            "coverage C": f"{sweep.coverage:.2f}",
            "POD": f"{sweep.pod:.1%}",
            "POD with exact legs": "" if (of_legs := sweep.pod_of_legs) is None else f"{of_legs:.1%}",
            "seen": f"{sweep.seen:.1%}",
            "passes": sweep.passes,
            "pieces skipped": sweep.skipped,
            "gaps": len(sweep.gaps),
        }

    def sentence(self, fact: JournalEntry) -> str:
        """Describe an event of this mission in a sentence. Return an empty string for events of all missions."""
        say = _SENTENCES.get(fact.kind)
        return say(**fact.data) if say is not None else ""

    def initial_facts(self) -> dict[str, int]:
        """Return the initial facts for verification: the number of zones as `zones_left`."""
        return {"zones_left": self.zones.total_zones()}

    def added_facts(self) -> dict[str, int]:
        """Return the amounts to add to facts: the number of zones added by commands, as `zones_left`."""
        return {"zones_left": self.zones.total_zones() - self._zones_at_start}

    def limits(self) -> dict[str, int]:
        """Return upper limits of the facts with unknown initial values: the numbers of additional pieces and of commands."""
        return {"more_pieces": _ANY_NUMBER, "orders_left": _ANY_NUMBER}

    def verbs(self) -> Sequence[OperatorCommand]:
        """Return the operator commands that the leaves of this mission can execute."""
        return VERBS

    def places(self) -> dict[str, tuple[float, float]]:
        """Return the position of each remaining zone (metres, frame `map`), by ID."""
        return {zone["id"]: (zone["x"], zone["y"]) for zone in self.zones.remaining_zones()}

    def route(self) -> list[tuple[str, float, float]]:
        """Return the names and positions of the remaining zones and of the base station, in the order of the plan."""
        base = self.zones.base_pose()
        zones = [(zone["id"], zone["x"], zone["y"]) for zone in self.zones.remaining_zones()]
        return [*zones, ("base station", base["x"], base["y"])]

    def optional_stops(self) -> list[tuple[str, float, float]]:
        """Return the names and positions of the charging places."""
        return [(name, pose["x"], pose["y"]) for name, pose in self.zones.charging.items()]

    def searched_areas(self) -> list[SearchedArea]:
        """Return the ground and sweep width of each remaining zone, to estimate sweeps at coverage 1."""
        left = {zone["id"] for zone in self.zones.remaining_zones()}
        return [
            SearchedArea(zone, ground.polygon, ground.sweep_width)
            for zone, ground in self.sweeps.grounds.items()
            if zone in left
        ]

    def allows(self, x: float, y: float) -> bool:
        """Return whether a position is inside the geofence."""
        return self.fence.contains(x, y)

    def servers(self, faults: "FaultPlan", **options: Any) -> "list[Node]":
        """Create the simulated servers `detect_survivor` and `report_survivor`."""
        from search_and_rescue.hiding import HiddenSurvivor
        from search_and_rescue.servers import DetectSurvivorServer, ReportSurvivorServer

        areas, grounds = self.zones.areas, self.sweeps.grounds
        hiding = HiddenSurvivor(self._plan, areas, faults.seed, grounds) if self.hides else None
        return [
            DetectSurvivorServer(faults.for_service("detect_survivor"), hiding, **options),
            ReportSurvivorServer(faults=faults.for_service("report_survivor"), **options),
        ]

    def shortfalls(self) -> list[str]:
        """Return a sentence for each unfinished item of the mission."""
        return self.record.shortfalls(self.zones)

    def open_points(self) -> list[str]:
        """Return sentences about zones that were visited but not searched."""
        return self.record.open_points()

    def idle_reason(self) -> str:
        """Return why the run has nothing left to do, or an empty string if a zone is left."""
        return "" if self.zones.has_remaining() else "No zone is left"

    def summary(self, elapsed_sec: float, ticks: int) -> str:
        """Return the summary of the run: visited zones, survivors, return home, duration, and unfinished items."""
        record, visited = self.record, self.record.zones_visited
        shortfalls = self.shortfalls()
        names = f" ({', '.join(visited)})" if visited else ""
        return "\n".join(
            (
                f"Summary: the mission is {'incomplete' if shortfalls else 'complete'}.",
                f"  zones visited:   {len(visited)} of {self.zones.total_zones()}{names}",
                *(
                    [f"  {UNSEARCHED}: {', '.join(record.unsearched_zones)}"]
                    if record.unsearched_zones
                    else []
                ),
                *_survivor_lines(record),
                f"  back at base:    {'yes' if record.home else 'no'}",
                f"  duration:        {clock_text(elapsed_sec)}, {ticks} ticks",
                *(f"  missing:         {line}" for line in shortfalls),
            )
        )


def _survivor(survivor: FoundSurvivor, number: int) -> Landmark:
    given_up = Level.GIVEN_UP if not survivor.counts else None
    level = given_up or (Level.DONE if survivor.acknowledged else Level.IN_HAND)
    name, standing = survivor.survivor_id or f"find {number}", survivor.standing
    relation = f"{'the same as' if standing is DetectionVerdict.MERGED else 'possibly'} {survivor.possibly}"
    details = {
        "report": survivor.report_state,
        "found": survivor.found_at,
        "sent": survivor.sent_at,
        "acknowledged": survivor.acknowledged_at,
    }
    return Landmark(
        "survivor",
        name,
        survivor.x,
        survivor.y,
        standing.value,
        level,
        relation if survivor.possibly or standing is DetectionVerdict.MERGED else "",
        within=survivor.zone_id,
        is_certain=standing is DetectionVerdict.CONFIRMED,
        details=details,
        task=f"Report {name} yourself: the base station does not acknowledge the report"
        if survivor.is_unanswered
        else "",
    )


def _position_text(x: float, y: float) -> str:
    return f"({x:.2f}, {y:.2f})"


def _searched_text(zone: str, survivor: Sequence[float] | None) -> str:
    return f"searched {zone}: {'no survivor' if survivor is None else f'survivor at {_position_text(*survivor)}'}"


def _planned_text(zone: str, pattern: str, spacing: float, pieces: Sequence[object]) -> str:
    return f"planned to sweep {zone} in {len(pieces)} pieces ({pattern}, {spacing:g} m apart)"


def _piece_swept(zone: str, piece: int, pod: float, seen: float, **_more: object) -> str:
    return f"swept piece {piece + 1} of {zone}: {seen:.0%} seen, POD {pod:.0%}"


def _abandoned_text(zone: str, attempts: int, reason: str) -> str:
    return f"{zone} was {describe_abandonment(attempts, reason)}"


def _named_text(survivor: str, x: float, y: float, possibly: str | None = None) -> str:
    return f"named {survivor} at {_position_text(x, y)}{f', possibly {possibly}' if possibly else ''}"


def _home_first(reason: str, to: str) -> str:
    return f"{reason}: {to or 'home'} first"


# More than the pieces of any sweep, and more than the commands in any mission.
_ANY_NUMBER = 1_000_000_000

_SENTENCES: Mapping[str, Callable[..., str]] = {
    **SENTENCES,
    search_events.ZONE_CHOSEN: lambda zone: f"chose {zone}",
    search_events.SWEEP_PLANNED: _planned_text,
    search_events.PIECE_SWEPT: _piece_swept,
    search_events.PIECE_SKIPPED: lambda zone, piece, reason: f"skipped piece {piece + 1} of {zone}: {reason}",
    search_events.ZONE_STARTED: lambda zone: f"set out for {zone}",
    search_events.ZONE_SEARCHED: _searched_text,
    search_events.SURVIVOR_UNPLACED: lambda zone, reason: (
        f"survivor in {zone} at an unusable position: {reason}"
    ),
    search_events.ZONE_VISITED: lambda zone: f"{zone} was visited",
    search_events.ZONE_POSTPONED: lambda zone: f"{zone} was postponed",
    search_events.ZONE_ABANDONED: _abandoned_text,
    search_events.SURVIVOR_NAMED: _named_text,
    search_events.REPORT_SENT: lambda survivor: f"sent the report of {survivor} to base",
    search_events.REPORT_KEPT: lambda survivor, **_place: f"the report of {survivor} is stored",
    search_events.REPORT_ACKNOWLEDGED: lambda survivor: f"base has acknowledged {survivor}",
    search_events.HOME_FIRST: lambda zone, reason, to="", **_figures: _home_first(reason, to),  # noqa: ARG005
    search_events.CHARGING_REACHED: lambda place: f"reached charging place {place}",
    search_events.CHARGED: lambda share: f"the battery suffices ({share:.0%})",
    search_events.ALARMED: lambda reason: f"alarm: {reason}",
    search_events.BASE_REACHED: lambda: "reached the base station",
}


def _survivor_lines(record: MissionRecord) -> list[str]:
    label = "  survivors found: "
    if not record.survivors:
        return [f"{label}none"]
    lines = [
        f"{survivor}, {'acknowledged' if survivor.acknowledged else 'NOT acknowledged'}"
        for survivor in record.survivors
    ]
    return [f"{label}{lines[0]}", *(" " * len(label) + line for line in lines[1:])]
