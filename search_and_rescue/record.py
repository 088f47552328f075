"""The record of a mission's events, for its summary and its exit status."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, ClassVar

from sar_compiler.missions import (
    RUN_BEGAN,
    RUN_ENDED,
    EventTime,
    Journal,
    JournalEntry,
    mission_context,
    position,
)
from search_and_rescue import search_events
from search_and_rescue.zone_manager import ZoneManager

DUPLICATE_RADIUS_M = 3.0
UNSEARCHED = "visited, not searched"
"""The state of a zone where the robot was, and the tree has gone on without a finished search."""


class Standing(str, Enum):
    """What the operator says of a find."""

    CANDIDATE = "candidate"
    """Nothing yet."""
    CONFIRMED = "confirmed"
    """It is a survivor."""
    REJECTED = "rejected"
    """It is none."""
    MERGED = "merged"
    """It is a survivor who has another name already."""


@dataclass(frozen=True)
class FoundSurvivor:
    """A survivor that was found.

    Attributes:
        zone_id: The zone in which the survivor was found; empty if unknown.
        x: Position in the frame `map`, metres.
        y: Position in the frame `map`, metres.
        survivor_id: The survivor's name once there is one, which is also the name of the TF frame.
        acknowledged: Whether the base station has confirmed the report.
        kept: Whether the report is kept, to be delivered later.
        possibly: The name of a survivor found earlier, so near that it may be the same one.
        standing: What the operator says of it.
        found_at: When it was found.
        sent_at: When the report was sent last.
        acknowledged_at: When the base station has confirmed it.
    """

    zone_id: str
    x: float
    y: float
    survivor_id: str | None = None
    acknowledged: bool = False
    kept: bool = False
    possibly: str | None = None
    standing: Standing = Standing.CANDIDATE
    found_at: EventTime | None = field(default=None, compare=False)
    sent_at: EventTime | None = field(default=None, compare=False)
    acknowledged_at: EventTime | None = field(default=None, compare=False)

    def __str__(self) -> str:
        name = self.survivor_id or "a survivor without a name"
        place = f" in {self.zone_id}" if self.zone_id else ""
        said = "" if self.standing is Standing.CANDIDATE else f", {self.standing.value}"
        if self.possibly is not None:
            how = " with" if self.standing is Standing.MERGED else ", possibly"
            said += f"{how} {self.possibly}"
        return f"{name}{place} at ({self.x:.2f}, {self.y:.2f}){said}"

    @property
    def counts(self) -> bool:
        """Whether base must know of it: unless the operator has said that it is nobody, or somebody known."""
        return self.standing in (Standing.CANDIDATE, Standing.CONFIRMED)

    @property
    def report(self) -> str:
        """What has become of the report, in words."""
        if self.acknowledged:
            return "acknowledged"
        return "kept" if self.kept else "sent" if self.sent_at is not None else "not sent"


@dataclass(frozen=True)
class ZoneRecord:
    """What has become of a zone.

    Attributes:
        attempts: How often it was set out for.
        started: When it was set out for last.
        searched: When a search of it was finished; None if none was.
        left: When it was visited, postponed or given up.
        unplaced: Why somebody whom its last search has found cannot be where that says, in words; empty if there is nobody.
        given_up: How it was given up and why, as said behind its name and `was`; empty if it was not.
    """

    attempts: int = 0
    started: EventTime | None = None
    searched: EventTime | None = None
    left: EventTime | None = None
    unplaced: str = ""
    given_up: str = ""


def how_given_up(attempts: int, reason: str) -> str:
    """Return how a zone was given up and why, as said behind its name and `was`."""
    return f"given up: {reason}" if reason else f"abandoned after attempt {attempts}"


def _told(zones: Iterable[tuple[str, str]]) -> list[str]:
    """Return what zones were in sentences, one for all that were the same."""
    names: dict[str, list[str]] = {}
    for zone, what in zones:
        names.setdefault(what, []).append(zone)
    return [
        f"{', '.join(others)} and {last} were {what}." if others else f"{last} was {what}."
        for what, (*others, last) in names.items()
    ]


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
        if fact.kind == search_events.REPORT_KEPT:
            report = SurvivorReport(data["survivor"], *position(data["x"], data["y"]))
            self._reports.setdefault(report.survivor_id, report)
        elif fact.kind == search_events.REPORT_ACKNOWLEDGED or (
            fact.kind == search_events.SURVIVOR_JUDGED and data["standing"] != "confirmed"
        ):
            self._reports.pop(data["survivor"], None)


class DoneBefore:
    """What an earlier run has done of what a resumed one begins with: the tree starts anew, and this is not done again.

    Searches and names are those of the zone, or of the piece of its sweep, that was not left yet. Each is handed out once, in its order: what a tree does
    again on purpose is done again.

    Attributes:
        home: Whether the robot is home.
    """

    def __init__(self) -> None:
        self._searches: list[tuple[str, tuple[float, float] | None]] = []
        self._names: list[tuple[str, tuple[float, float]]] = []
        self._survivors: set[str] = set()
        self.home = False

    @classmethod
    def of(cls, facts: Iterable[JournalEntry]) -> "DoneBefore":
        """Return what the facts of earlier runs say, which fit their mission."""
        before = cls()
        for fact in facts:
            before._take(fact)
        return before

    def _take(self, fact: JournalEntry) -> None:
        data = fact.data
        if fact.kind == search_events.ZONE_SEARCHED:
            place = None if data["survivor"] is None else position(*data["survivor"])
            self._searches.append((data["zone"], place))
        elif fact.kind == search_events.SURVIVOR_NAMED:
            self._names.append((data["survivor"], position(data["x"], data["y"])))
            self._survivors.add(data["survivor"])
        elif fact.kind in (
            search_events.ZONE_VISITED,
            search_events.ZONE_POSTPONED,
            search_events.ZONE_ABANDONED,
            search_events.PIECE_SWEPT,
            search_events.PIECE_SKIPPED,
        ):
            self._searches.clear()
            self._names.clear()
        elif fact.kind in (search_events.ZONE_STARTED, search_events.BASE_REACHED):
            self.home = fact.kind == search_events.BASE_REACHED

    def has_searched(self, zone_id: str) -> bool:
        """Return whether there is a search of a zone."""
        return any(zone == zone_id for zone, _ in self._searches)

    def has_found(self, zone_id: str) -> bool:
        """Return whether the first search of a zone that there is has found a survivor."""
        return next((place is not None for zone, place in self._searches if zone == zone_id), False)

    def take_search(self, zone_id: str) -> tuple[float, float] | None:
        """Return where the first search of a zone has found a survivor, None if nobody; it is then not there any more."""
        index = next(index for index, (zone, _) in enumerate(self._searches) if zone == zone_id)
        return self._searches.pop(index)[1]

    def take_name(self, x: float, y: float) -> str | None:
        """Return the name of the survivor at a position; it is then not there any more."""
        index = next((index for index, (_, place) in enumerate(self._names) if place == (x, y)), None)
        return None if index is None else self._names.pop(index)[0]

    def has_open_name(self, x: float, y: float) -> bool:
        """Return whether there is a name of the survivor at a position."""
        return any(place == (x, y) for _, place in self._names)

    def has_named(self, survivor_id: str) -> bool:
        """Return whether an earlier run has named a survivor so, in whatever zone."""
        return survivor_id in self._survivors

    def take_home(self) -> bool:
        """Return whether the robot is home; afterwards it must be driven there."""
        home, self.home = self.home, False
        return home


@mission_context
class MissionRecord:
    """The events of one mission as its leaves report them.

    Each is noted as a fact, and the fact changes the record (`apply`), now and when a later run takes it over. The record has no influence
    on the running mission, unless that was begun by an earlier run: then `before` says what need not be done again. A
    survivor who is found again, in the same zone and at the same place, is the same survivor. One found near another is
    kept apart and marked; only the operator merges.

    Args:
        duplicate_radius_m: Finds that are this near to each other may be the same survivor, metres.

    Attributes:
        journal: Where events are written, before anybody is told of them; those of the zones by the `ZoneManager`.
        before: What an earlier run has done of what this one begins with.
        zones_visited: The visited zones, in the order of the visits.
        zone: The zone that was set out for and not left yet; empty if there is none.
        home: Whether the robot has returned to the base station and not left it for a zone since.
        alarms: The reasons to cut the mission short, in words, the latest last.
        homing_for: Why the robot comes home before it goes on, in words; empty if it does not, the battery was charged since, or the mission is cut short.
        homing_to: The charging place to which it goes then; empty for home.
        charging_at: The charging place at which the robot is; empty elsewhere.
        navigation_lost: Why nobody can judge a drive, in words; empty while somebody can. It is no fact.
    """

    def __init__(self, duplicate_radius_m: float = DUPLICATE_RADIUS_M) -> None:
        self.journal = Journal(apply=self.apply)
        self.before = DoneBefore()
        self._duplicate_radius_m = duplicate_radius_m
        self._zones: dict[str, ZoneRecord] = {}
        self._survivors: list[FoundSurvivor] = []
        self._began: EventTime | None = None
        self.zones_visited: tuple[str, ...] = ()
        self.alarms: tuple[str, ...] = ()
        self.zone = self.homing_for = self.homing_to = self.charging_at = self.navigation_lost = ""
        self.home = False

    def apply(self, fact: JournalEntry) -> None:
        """Change the record by a fact.

        Raises:
            ArithmeticError, LookupError, TypeError or ValueError: If there cannot be such a fact now.
        """
        if (handle := self._HANDLERS.get(fact.kind)) is not None:
            handle(self, EventTime(fact.run, fact.time, fact.wall), **fact.data)

    @property
    def is_searched(self) -> bool:
        """Whether the zone that was set out for was searched since."""
        zone = self.of_zone(self.zone)
        return zone.searched is not None and zone.started is not None and zone.searched >= zone.started

    def of_zone(self, zone_id: str) -> ZoneRecord:
        """Return what has become of a zone."""
        return self._zones.get(zone_id, ZoneRecord())

    @property
    def survivors(self) -> tuple[FoundSurvivor, ...]:
        """The survivors in the order in which they were found."""
        return tuple(self._survivors)

    @property
    def first_find_sec(self) -> float | None:
        """How long the mission had gone on when somebody was found first, seconds; None if nobody was."""
        found = next((each.found_at for each in self._survivors if each.counts), None)
        if found is None or self._began is None:
            return None
        # Each run may have a clock of its own.
        same = found.run == self._began.run
        return found.time - self._began.time if same else found.wall - self._began.wall

    @property
    def alarm(self) -> str:
        """The last reason to cut the mission short, in words; empty if there was none."""
        return self.alarms[-1] if self.alarms else ""

    def zone_started(self, zone_id: str) -> None:
        """Note that the robot sets out for a zone."""
        self.journal.note(search_events.ZONE_STARTED, zone=zone_id)

    def zone_searched(self, zone_id: str, survivor: tuple[float, float] | None) -> None:
        """Note that a zone was searched.

        Args:
            zone_id: The zone.
            survivor: x and y of the survivor that was found, in the frame `map`, metres; None if nobody was.
        """
        self.journal.note(search_events.ZONE_SEARCHED, zone=zone_id, survivor=survivor)

    def survivor_unplaced(self, zone_id: str, reason: str) -> None:
        """Note that a search has found somebody where nobody can be; the next answer about the zone takes its place.

        Args:
            zone_id: The zone.
            reason: Why nobody can be there, in words.
        """
        if reason != self.of_zone(zone_id).unplaced:
            self.journal.note(search_events.SURVIVOR_UNPLACED, zone=zone_id, reason=reason)

    def alarmed(self, reason: str) -> None:
        """Note a reason to cut the mission short, in words."""
        self.journal.note(search_events.ALARMED, reason=reason)

    def home_first(self, zone_id: str, reason: str, to: str = "", **figures: float | None) -> None:
        """Note that the robot comes home, or to a charging place, before it goes on to a zone.

        Args:
            zone_id: The zone.
            reason: Why, in words.
            to: The charging place; empty for home.
            figures: What was weighed.
        """
        self.journal.note(
            search_events.HOME_FIRST, zone=zone_id, reason=reason, **figures, **({"to": to} if to else {})
        )

    def charging_reached(self, place: str) -> None:
        """Note that the robot has arrived at a charging place."""
        self.journal.note(search_events.CHARGING_REACHED, place=place)

    def charged(self, share: float) -> None:
        """Note that the battery suffices again, at a share of a full one."""
        self.journal.note(search_events.CHARGED, share=round(share, 4))

    def survivor_named(self, survivor_id: str, x: float, y: float) -> None:
        """Note the assigned name of the survivor at a position (replaces an earlier one)."""
        possibly = self._near(self._place_of(x, y), x, y)
        self.journal.note(search_events.SURVIVOR_NAMED, survivor=survivor_id, x=x, y=y, possibly=possibly)

    def survivor(self, survivor_id: str) -> FoundSurvivor | None:
        """Return a survivor by the name; None if nobody has it."""
        return next((known for known in self._survivors if known.survivor_id == survivor_id), None)

    def named_near(self, x: float, y: float, within: float) -> list[FoundSurvivor]:
        """Return who has a name and was found at a position, or no more than so many metres away from it."""
        return [
            each
            for each in self._survivors
            if each.survivor_id and math.dist((each.x, each.y), (x, y)) <= within
        ]

    def survivor_judged(self, survivor_id: str, standing: Standing, same_as: str | None = None) -> None:
        """Note what the operator says of a find.

        Args:
            survivor_id: Its name.
            standing: What the operator says.
            same_as: The name of the survivor that it is merged with.
        """
        self.journal.note(
            search_events.SURVIVOR_JUDGED, survivor=survivor_id, standing=standing.value, same_as=same_as
        )

    def report_sent(self, survivor_id: str) -> None:
        """Note that the report of a survivor is about to be sent."""
        self.journal.note(search_events.REPORT_SENT, survivor=survivor_id)

    def survivor_acknowledged(self, survivor_id: str) -> None:
        """Note that the base station has confirmed the report of a survivor, which need no longer be kept."""
        self.journal.note(search_events.REPORT_ACKNOWLEDGED, survivor=survivor_id)

    def report_kept(self, report: SurvivorReport) -> None:
        """Note that the report of a survivor is kept, to be delivered later."""
        self.journal.note(search_events.REPORT_KEPT, survivor=report.survivor_id, x=report.x, y=report.y)

    def base_reached(self) -> None:
        """Note that the robot has arrived at the base station."""
        self.journal.note(search_events.BASE_REACHED)

    def was_reported_before(self, survivor_id: str) -> bool:
        """Return whether a survivor was named by an earlier run, and base has confirmed the report."""
        found = self.survivor(survivor_id)
        return self.before.has_named(survivor_id) and found is not None and found.acknowledged

    def unplaced(self) -> list[str]:
        """Return in words who was found at a position that cannot be used."""
        return [
            f"There is a survivor at no usable position in {zone_id}: {zone.unplaced}"
            for zone_id, zone in self._zones.items()
            if zone.unplaced
        ]

    @property
    def unsearched(self) -> list[str]:
        """The zones where the robot was, and no search has ended."""
        return [zone for zone in self.zones_visited if self.of_zone(zone).searched is None]

    def remarks(self) -> list[str]:
        """Return in sentences what a complete mission has left open: it is complete where every zone was visited."""
        return _told((zone, UNSEARCHED) for zone in self.unsearched)

    def shortfalls(self, zones: ZoneManager) -> list[str]:
        """Return in sentences what is missing for a complete mission; empty if it is complete."""
        given_up = [(name, zone.given_up) for name, zone in self._zones.items() if zone.given_up]
        lacking = _told([*((zone["id"], "not visited") for zone in zones.remaining_zones()), *given_up])
        lacking += [f"{each}." for each in self.unplaced()]
        owed = (each for each in self._survivors if each.counts and not each.acknowledged)
        lacking += [f"The base station did not acknowledge {survivor}." for survivor in owed]
        if not self.home:
            lacking.append("The robot did not return to the base station.")
        return lacking

    def _on_zone_started(self, at: EventTime, zone: str) -> None:
        known = self.of_zone(zone)
        self._zones[zone] = replace(known, attempts=known.attempts + 1, started=at)
        self.zone, self.home, self.before.home, self.charging_at = zone, False, False, ""

    def _on_zone_searched(self, at: EventTime, zone: str, survivor: Any) -> None:
        found = None if survivor is None else FoundSurvivor(zone, *position(*survivor), found_at=at)
        self._zones[zone] = replace(self.of_zone(zone), searched=at, unplaced="")
        if found is not None and not any(
            (known.zone_id, known.x, known.y) == (zone, found.x, found.y) for known in self._survivors
        ):
            self._survivors.append(found)

    def _on_survivor_unplaced(self, _: EventTime, zone: str, reason: str) -> None:
        self._zones[zone] = replace(self.of_zone(zone), unplaced=str(reason))

    def _on_zone_visited(self, at: EventTime, zone: str) -> None:
        self.zones_visited = (*self.zones_visited, zone)
        self._on_zone_postponed(at, zone)

    def _on_zone_postponed(self, at: EventTime, zone: str, given_up: str = "") -> None:
        # What is given up stands in the order in which it was.
        self._zones[zone] = replace(self._zones.pop(zone, ZoneRecord()), left=at, given_up=given_up)
        self.zone = ""

    def _on_zone_abandoned(self, at: EventTime, zone: str, attempts: int, reason: str) -> None:
        self._on_zone_postponed(at, zone, how_given_up(int(attempts), reason))

    def _on_survivor_named(
        self, at: EventTime, survivor: str, x: Any, y: Any, possibly: str | None = None
    ) -> None:
        x, y = position(x, y)
        index = self._place_of(x, y)
        if index == len(self._survivors):
            self._survivors.append(FoundSurvivor("", x, y, found_at=at))
        self._survivors[index] = replace(self._survivors[index], survivor_id=survivor, possibly=possibly)

    def _on_survivor_judged(self, _: EventTime, survivor: str, standing: str, same_as: str | None) -> None:
        said = {"possibly": same_as} if same_as else {}
        self._set(survivor, standing=Standing(standing), **said)

    def _on_report_sent(self, at: EventTime, survivor: str) -> None:
        self._set(survivor, sent_at=at)

    def _on_report_kept(self, _: EventTime, survivor: str, **_place: object) -> None:
        self._set(survivor, acknowledged=False, kept=True)

    def _on_report_acknowledged(self, at: EventTime, survivor: str) -> None:
        self._set(survivor, acknowledged=True, kept=False, acknowledged_at=at)

    def _on_base_reached(self, _: EventTime) -> None:
        self.home, self.zone, self.charging_at = True, "", ""

    def _on_run_began(self, at: EventTime, **_run: object) -> None:
        self._began, self.zone = self._began or at, ""

    def _on_run_ended(self, _: EventTime, **_run: object) -> None:
        self.zone = ""

    def _on_home_first(self, _: EventTime, reason: str, to: str = "", **_figures: object) -> None:
        self.homing_for, self.homing_to = str(reason), str(to)

    def _on_charging_reached(self, _: EventTime, place: str) -> None:
        self.charging_at, self.home, self.zone = str(place), False, ""

    def _on_charged(self, _: EventTime, share: float) -> None:  # noqa: ARG002 - as the fact has it
        self.homing_for = ""

    def _on_alarmed(self, _: EventTime, reason: str) -> None:
        self.alarms, self.homing_for = (*self.alarms, str(reason)), ""

    # Other kinds do not change the record.
    _HANDLERS: ClassVar[Mapping[str, Callable[..., None]]] = {
        RUN_BEGAN: _on_run_began,
        RUN_ENDED: _on_run_ended,
        search_events.ZONE_STARTED: _on_zone_started,
        search_events.ZONE_SEARCHED: _on_zone_searched,
        search_events.SURVIVOR_UNPLACED: _on_survivor_unplaced,
        search_events.ZONE_VISITED: _on_zone_visited,
        search_events.ZONE_POSTPONED: _on_zone_postponed,
        search_events.ZONE_ABANDONED: _on_zone_abandoned,
        search_events.SURVIVOR_NAMED: _on_survivor_named,
        search_events.SURVIVOR_JUDGED: _on_survivor_judged,
        search_events.REPORT_SENT: _on_report_sent,
        search_events.REPORT_KEPT: _on_report_kept,
        search_events.REPORT_ACKNOWLEDGED: _on_report_acknowledged,
        search_events.BASE_REACHED: _on_base_reached,
        search_events.HOME_FIRST: _on_home_first,
        search_events.CHARGING_REACHED: _on_charging_reached,
        search_events.CHARGED: _on_charged,
        search_events.ALARMED: _on_alarmed,
    }

    def _place_of(self, x: float, y: float) -> int:
        """Return the place in the list of who was found last at a position; behind the last one if nobody was."""
        found = [index for index, known in enumerate(self._survivors) if (known.x, known.y) == (x, y)]
        return found[-1] if found else len(self._survivors)

    def _near(self, before: int, x: float, y: float) -> str | None:
        """Return the name of the nearest survivor found before one that may be the same; None if there is none."""
        named = [known for known in self._survivors[:before] if known.survivor_id and known.counts]
        nearest = min(named, key=lambda known: math.hypot(known.x - x, known.y - y), default=None)
        if nearest is None or math.hypot(nearest.x - x, nearest.y - y) > self._duplicate_radius_m:
            return None
        return nearest.survivor_id

    def _set(self, survivor_id: str, **changes: Any) -> None:
        for index, known in enumerate(self._survivors):
            if known.survivor_id == survivor_id:
                self._survivors[index] = replace(known, **changes)
