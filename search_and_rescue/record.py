"""The record of a mission. It determines the summary and the exit status."""

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
"""Two detections closer than this default distance, in metres, may be the same survivor."""
UNSEARCHED = "visited, not searched"
"""The state of a zone that the robot has visited without finishing a search."""


class DetectionVerdict(str, Enum):
    """The operator's verdict on a detection."""

    CANDIDATE = "candidate"
    """The operator has not reviewed the detection yet."""
    CONFIRMED = "confirmed"
    """The detection is a survivor."""
    REJECTED = "rejected"
    """The detection is not a survivor."""
    MERGED = "merged"
    """The detection is a survivor that already has another name."""


@dataclass(frozen=True)
class FoundSurvivor:
    """A detected survivor.

    Attributes:
        zone_id: The zone of the detection; empty if the zone is unknown.
        x: The x coordinate in the frame `map`, metres.
        y: The y coordinate in the frame `map`, metres.
        survivor_id: The survivor's name, which is also the TF frame; None until a name is assigned.
        acknowledged: Whether the base station has acknowledged the report.
        kept: Whether the report is stored for later delivery.
        possibly: The name of an earlier survivor who may be the same person; None if there is none.
        standing: The operator's review of the detection.
        found_at: Time of the detection.
        sent_at: Time of the last report; None if no report was sent.
        times_sent: Number of times the report was sent.
        acknowledged_at: Time of the base station's acknowledgement; None without an acknowledgement.
    """

    zone_id: str
    x: float
    y: float
    survivor_id: str | None = None
    acknowledged: bool = False
    kept: bool = False
    possibly: str | None = None
    standing: DetectionVerdict = DetectionVerdict.CANDIDATE
    found_at: EventTime | None = field(default=None, compare=False)
    sent_at: EventTime | None = field(default=None, compare=False)
    times_sent: int = field(default=0, compare=False)
    acknowledged_at: EventTime | None = field(default=None, compare=False)

    def __str__(self) -> str:
        name = self.survivor_id or "a survivor without a name"
        zone = f" in {self.zone_id}" if self.zone_id else ""
        review = "" if self.standing is DetectionVerdict.CANDIDATE else f", {self.standing.value}"
        if self.possibly is not None:
            relation = " with" if self.standing is DetectionVerdict.MERGED else ", possibly"
            review += f"{relation} {self.possibly}"
        return f"{name}{zone} at ({self.x:.2f}, {self.y:.2f}){review}"

    @property
    def counts(self) -> bool:
        """Whether the base station needs a report. Rejected and merged detections need no report."""
        return self.standing in (DetectionVerdict.CANDIDATE, DetectionVerdict.CONFIRMED)

    @property
    def is_unanswered(self) -> bool:
        """Whether the report was sent more than once, but the base station has not acknowledged the report."""
        return self.times_sent > 1 and self.counts and not self.acknowledged

    @property
    def report_state(self) -> str:
        """The state of the report: `acknowledged`, `kept`, `sent` or `not sent`."""
        if self.acknowledged:
            return "acknowledged"
        return "kept" if self.kept else "sent" if self.sent_at is not None else "not sent"


@dataclass(frozen=True)
class ZoneRecord:
    """The record of a zone.

    Attributes:
        attempts: Number of drives to the zone.
        started: Start of the last drive to the zone; None if there is none.
        searched: End of the last finished search of the zone; None if there is none.
        left: Time at which the zone was visited, postponed or abandoned; None if not yet.
        unplaced: Why the last search reported a survivor at an unusable position; empty if it did not.
        given_up: How and why the zone was abandoned, such as `abandoned after attempt 3`; empty if the zone was not abandoned.
    """

    attempts: int = 0
    started: EventTime | None = None
    searched: EventTime | None = None
    left: EventTime | None = None
    unplaced: str = ""
    given_up: str = ""


def describe_abandonment(attempts: int, reason: str) -> str:
    """Return how and why a zone was abandoned, as a phrase such as "abandoned after attempt 3"."""
    return f"abandoned: {reason}" if reason else f"abandoned after attempt {attempts}"


def _state_sentences(zones: Iterable[tuple[str, str]]) -> list[str]:
    """Return one sentence for each state. The sentence lists all zones that have this state."""
    names: dict[str, list[str]] = {}
    for zone, state in zones:
        names.setdefault(state, []).append(zone)
    return [
        f"{', '.join(others)} and {last} were {state}." if others else f"{last} was {state}."
        for state, (*others, last) in names.items()
    ]


@dataclass(frozen=True)
class SurvivorReport:
    """The report of a survivor to the base station.

    Attributes:
        survivor_id: The survivor's name, which is also the TF frame.
        x: The x coordinate in the frame `map`, metres.
        y: The y coordinate in the frame `map`, metres.
    """

    survivor_id: str
    x: float
    y: float


@mission_context
class StoredReports:
    """The undelivered reports of one mission, one for each survivor. The oldest report is first."""

    def __init__(self) -> None:
        self._reports: dict[str, SurvivorReport] = {}

    def __len__(self) -> int:
        """Return the number of undelivered reports."""
        return len(self._reports)

    def __iter__(self) -> Iterator[SurvivorReport]:
        """Iterate over a copy of the reports, so that a report can be delivered during the iteration."""
        return iter(list(self._reports.values()))

    def apply(self, fact: JournalEntry) -> None:
        """Update the reports from an event.

        Raises:
            LookupError, TypeError or ValueError: If the event contradicts the current state.
        """
        data = fact.data
        if fact.kind == search_events.REPORT_KEPT:
            report = SurvivorReport(data["survivor"], *position(data["x"], data["y"]))
            self._reports.setdefault(report.survivor_id, report)
        elif fact.kind == search_events.REPORT_ACKNOWLEDGED or (
            fact.kind == search_events.SURVIVOR_JUDGED and data["standing"] != "confirmed"
        ):
            self._reports.pop(data["survivor"], None)


class ResumedOutcomes:
    """The results of a mission's earlier runs. A resumed tree uses these results instead of repeating the work.

    The results are the searches and the survivor names since the robot last left a zone or finished a piece
    of a sweep. The results are returned in order, and each result only once. If the tree later repeats a
    search on purpose, the search is therefore executed.

    Attributes:
        home: Whether the robot was at the base station at the end of the earlier runs.
    """

    def __init__(self) -> None:
        self._searches: list[tuple[str, tuple[float, float] | None]] = []
        self._names: list[tuple[str, tuple[float, float]]] = []
        self._survivors: set[str] = set()
        self.home = False

    @classmethod
    def from_events(cls, facts: Iterable[JournalEntry]) -> "ResumedOutcomes":
        """Return the results recorded by the events of the mission's earlier runs."""
        before = cls()
        for fact in facts:
            before._add_event(fact)
        return before

    def _add_event(self, fact: JournalEntry) -> None:
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
        """Return whether an earlier run has searched a zone, and this result was not used yet."""
        return any(zone == zone_id for zone, _ in self._searches)

    def has_found(self, zone_id: str) -> bool:
        """Return whether the first unused search result for a zone contains a detected survivor."""
        return next((place is not None for zone, place in self._searches if zone == zone_id), False)

    def pop_search(self, zone_id: str) -> tuple[float, float] | None:
        """Remove the first search result of a zone. Return the survivor's position, or None if no one was detected."""
        index = next(index for index, (zone, _) in enumerate(self._searches) if zone == zone_id)
        return self._searches.pop(index)[1]

    def pop_name(self, x: float, y: float) -> str | None:
        """Remove and return the name of the survivor at a position, or return None if there is no name."""
        index = next((index for index, (_, place) in enumerate(self._names) if place == (x, y)), None)
        return None if index is None else self._names.pop(index)[0]

    def has_open_name(self, x: float, y: float) -> bool:
        """Return whether an earlier run has named the survivor at a position, and this name was not used yet."""
        return any(place == (x, y) for _, place in self._names)

    def has_named(self, survivor_id: str) -> bool:
        """Return whether an earlier run has assigned this name to a survivor, in any zone."""
        return survivor_id in self._survivors

    def pop_home(self) -> bool:
        """Return whether the robot was at the base station after the earlier runs. Later calls return False."""
        home, self.home = self.home, False
        return home


@mission_context
class MissionRecord:
    """The record of one mission, built from the events that leaves report.

    Each method that records something writes an event to the journal. The event updates the record (`apply`)
    immediately, and again when a later run resumes the mission. A survivor who is detected again in the same
    zone at the same position is the same survivor. A detection near another survivor is a separate survivor
    with a mark (`FoundSurvivor.possibly`), and only the operator can merge the two.

    Args:
        duplicate_radius_m: Distance below which two detections may be the same survivor, metres.

    Attributes:
        journal: Stores each event before any other object learns of it. The `ZoneManager` records the events
            of zones.
        before: Results of earlier runs. A resumed mission does not repeat the work.
        zones_visited: The visited zones, in the order of the visits.
        zone: The zone that the robot drives to or searches; empty if there is none.
        home: Whether the robot has returned to the base station and has not left for a zone since.
        alarms: The reasons to end the mission early, in words; the latest is last.
        homing_for: Why the robot goes home or to a charging place before the next zone; empty if the robot
            does not go there, and after a charge or an alarm.
        homing_to: The charging place where the robot charges; empty for the base station.
        charging_at: The charging place where the robot is; empty if the robot is elsewhere.
        navigation_lost: Why navigation was unavailable when the last drive ended; empty if available. Not part of the journal.
    """

    def __init__(self, duplicate_radius_m: float = DUPLICATE_RADIUS_M) -> None:
        self.journal = Journal(apply=self.apply)
        self.before = ResumedOutcomes()
        self._duplicate_radius_m = duplicate_radius_m
        self._zones: dict[str, ZoneRecord] = {}
        self._survivors: list[FoundSurvivor] = []
        self._began: EventTime | None = None
        self.zones_visited: tuple[str, ...] = ()
        self.alarms: tuple[str, ...] = ()
        self.zone = self.homing_for = self.homing_to = self.charging_at = self.navigation_lost = ""
        self.home = False

    def apply(self, fact: JournalEntry) -> None:
        """Update the record from an event.

        Raises:
            ArithmeticError, LookupError, TypeError or ValueError: If the event contradicts the current state.
        """
        if (handle := self._HANDLERS.get(fact.kind)) is not None:
            handle(self, EventTime(fact.run, fact.time, fact.wall), **fact.data)

    @property
    def is_searched(self) -> bool:
        """Whether the robot has searched the current zone since the start of the last drive to this zone."""
        zone = self.zone_record(self.zone)
        return zone.searched is not None and zone.started is not None and zone.searched >= zone.started

    def zone_record(self, zone_id: str) -> ZoneRecord:
        """Return the record of a zone."""
        return self._zones.get(zone_id, ZoneRecord())

    @property
    def survivors(self) -> tuple[FoundSurvivor, ...]:
        """The survivors, in the order of detection."""
        return tuple(self._survivors)

    @property
    def first_detection_sec(self) -> float | None:
        """The seconds from the start to the first detection that was not rejected or merged, or None."""
        found = next((each.found_at for each in self._survivors if each.counts), None)
        if found is None or self._began is None:
            return None
        # Two runs may use different clocks, so use wall time between runs.
        same = found.run == self._began.run
        return found.time - self._began.time if same else found.wall - self._began.wall

    @property
    def alarm(self) -> str:
        """The last reason to end the mission early, or an empty string if there is no such reason."""
        return self.alarms[-1] if self.alarms else ""

    def zone_started(self, zone_id: str) -> None:
        """Record the start of a drive to a zone."""
        self.journal.record_event(search_events.ZONE_STARTED, zone=zone_id)

    def zone_searched(self, zone_id: str, survivor: tuple[float, float] | None) -> None:
        """Record that a zone was searched.

        Args:
            zone_id: The zone.
            survivor: x and y of the detected survivor in the frame `map`, metres; None if none was detected.
        """
        self.journal.record_event(search_events.ZONE_SEARCHED, zone=zone_id, survivor=survivor)

    def survivor_unplaced(self, zone_id: str, reason: str) -> None:
        """Record that a search found a survivor at an unusable position. The next search removes this record.

        Args:
            zone_id: The zone.
            reason: Why the position is unusable, in words.
        """
        if reason != self.zone_record(zone_id).unplaced:
            self.journal.record_event(search_events.SURVIVOR_UNPLACED, zone=zone_id, reason=reason)

    def record_alarm(self, reason: str) -> None:
        """Record an alarm: a reason to end the mission early."""
        self.journal.record_event(search_events.ALARMED, reason=reason)

    def home_first(self, zone_id: str, reason: str, to: str = "", **figures: float | None) -> None:
        """Record that the robot goes home or to a charging place before the next zone.

        Args:
            zone_id: The next zone.
            reason: Why the robot cannot go to the next zone first, in words.
            to: The charging place; empty for the base station.
            figures: The estimates that led to the decision.
        """
        self.journal.record_event(
            search_events.HOME_FIRST, zone=zone_id, reason=reason, **figures, **({"to": to} if to else {})
        )

    def charging_reached(self, place: str) -> None:
        """Record the arrival at a charging place."""
        self.journal.record_event(search_events.CHARGING_REACHED, place=place)

    def record_charge(self, share: float) -> None:
        """Record that the battery suffices again. *share* is the battery's charge, 1 for a full battery."""
        self.journal.record_event(search_events.CHARGED, share=round(share, 4))

    def survivor_named(self, survivor_id: str, x: float, y: float) -> None:
        """Record the name assigned to the survivor at a position. The new name replaces an earlier name."""
        possibly = self._nearby_survivor(self._index_at(x, y), x, y)
        self.journal.record_event(
            search_events.SURVIVOR_NAMED, survivor=survivor_id, x=x, y=y, possibly=possibly
        )

    def survivor(self, survivor_id: str) -> FoundSurvivor | None:
        """Return the survivor with the given name, or None if there is no such survivor."""
        return next((known for known in self._survivors if known.survivor_id == survivor_id), None)

    def survivors_near(self, x: float, y: float, within: float) -> list[FoundSurvivor]:
        """Return the named survivors within a distance (metres) of a position (metres, frame `map`)."""
        return [
            each
            for each in self._survivors
            if each.survivor_id and math.dist((each.x, each.y), (x, y)) <= within
        ]

    def survivor_judged(
        self, survivor_id: str, standing: DetectionVerdict, same_as: str | None = None
    ) -> None:
        """Record the operator's verdict on a detection.

        Args:
            survivor_id: The name of the detection.
            standing: The operator's verdict.
            same_as: If the verdict is `MERGED`, the name of the survivor with which the detection is merged.
        """
        self.journal.record_event(
            search_events.SURVIVOR_JUDGED, survivor=survivor_id, standing=standing.value, same_as=same_as
        )

    def report_sent(self, survivor_id: str) -> None:
        """Record that the report of a survivor is about to be sent."""
        self.journal.record_event(search_events.REPORT_SENT, survivor=survivor_id)

    def record_acknowledgement(self, survivor_id: str) -> None:
        """Record that the base station acknowledged a report, which is then no longer stored for delivery."""
        self.journal.record_event(search_events.REPORT_ACKNOWLEDGED, survivor=survivor_id)

    def report_kept(self, report: SurvivorReport) -> None:
        """Record that the report of a survivor is stored for later delivery."""
        self.journal.record_event(
            search_events.REPORT_KEPT, survivor=report.survivor_id, x=report.x, y=report.y
        )

    def base_reached(self) -> None:
        """Record the arrival at the base station."""
        self.journal.record_event(search_events.BASE_REACHED)

    def was_reported(self, survivor_id: str) -> bool:
        """Return whether an earlier run named the survivor, and the base station acknowledged the report."""
        found = self.survivor(survivor_id)
        return self.before.has_named(survivor_id) and found is not None and found.acknowledged

    def unplaced_survivors(self) -> list[str]:
        """Return a sentence, without a full stop, for each survivor at an unusable position."""
        return [
            f"There is a survivor at an unusable position in {zone_id}: {zone.unplaced}"
            for zone_id, zone in self._zones.items()
            if zone.unplaced
        ]

    @property
    def unsearched_zones(self) -> list[str]:
        """The zones that the robot visited without finishing a search."""
        return [zone for zone in self.zones_visited if self.zone_record(zone).searched is None]

    def open_points(self) -> list[str]:
        """Return sentences about zones visited but not searched. They do not make the mission incomplete."""
        return _state_sentences((zone, UNSEARCHED) for zone in self.unsearched_zones)

    def shortfalls(self, zones: ZoneManager) -> list[str]:
        """Return a sentence for each unfinished part of the mission; empty if the mission is complete."""
        given_up = [(name, zone.given_up) for name, zone in self._zones.items() if zone.given_up]
        lacking = _state_sentences(
            [*((zone["id"], "not visited") for zone in zones.remaining_zones()), *given_up]
        )
        lacking += [f"{each}." for each in self.unplaced_survivors()]
        owed = (each for each in self._survivors if each.counts and not each.acknowledged)
        lacking += [f"The base station did not acknowledge {survivor}." for survivor in owed]
        if not self.home:
            lacking.append("The robot did not return to the base station.")
        return lacking

    def _on_zone_started(self, at: EventTime, zone: str) -> None:
        known = self.zone_record(zone)
        self._zones[zone] = replace(known, attempts=known.attempts + 1, started=at)
        self.zone, self.home, self.before.home, self.charging_at = zone, False, False, ""

    def _on_zone_searched(self, at: EventTime, zone: str, survivor: Any) -> None:
        found = None if survivor is None else FoundSurvivor(zone, *position(*survivor), found_at=at)
        self._zones[zone] = replace(self.zone_record(zone), searched=at, unplaced="")
        if found is not None and not any(
            (known.zone_id, known.x, known.y) == (zone, found.x, found.y) for known in self._survivors
        ):
            self._survivors.append(found)

    def _on_survivor_unplaced(self, _: EventTime, zone: str, reason: str) -> None:
        self._zones[zone] = replace(self.zone_record(zone), unplaced=str(reason))

    def _on_zone_visited(self, at: EventTime, zone: str) -> None:
        self.zones_visited = (*self.zones_visited, zone)
        self._on_zone_postponed(at, zone)

    def _on_zone_postponed(self, at: EventTime, zone: str, given_up: str = "") -> None:
        # Reinsert the zone at the end, so that abandoned zones are listed in the order of abandonment.
        self._zones[zone] = replace(self._zones.pop(zone, ZoneRecord()), left=at, given_up=given_up)
        self.zone = ""

    def _on_zone_abandoned(self, at: EventTime, zone: str, attempts: int, reason: str) -> None:
        self._on_zone_postponed(at, zone, describe_abandonment(int(attempts), reason))

    def _on_survivor_named(
        self, at: EventTime, survivor: str, x: Any, y: Any, possibly: str | None = None
    ) -> None:
        x, y = position(x, y)
        index = self._index_at(x, y)
        if index == len(self._survivors):
            self._survivors.append(FoundSurvivor("", x, y, found_at=at))
        self._survivors[index] = replace(self._survivors[index], survivor_id=survivor, possibly=possibly)

    def _on_survivor_judged(self, _: EventTime, survivor: str, standing: str, same_as: str | None) -> None:
        changes = {"possibly": same_as} if same_as else {}
        self._set(survivor, standing=DetectionVerdict(standing), **changes)

    def _on_report_sent(self, at: EventTime, survivor: str) -> None:
        sent = next((each.times_sent for each in self._survivors if each.survivor_id == survivor), 0)
        self._set(survivor, sent_at=at, times_sent=sent + 1)

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

    def _on_charged(self, _: EventTime, share: float) -> None:  # noqa: ARG002 - the event's key
        self.homing_for = ""

    def _on_alarmed(self, _: EventTime, reason: str) -> None:
        self.alarms, self.homing_for = (*self.alarms, str(reason)), ""

    # Events of other kinds do not change the record.
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

    def _index_at(self, x: float, y: float) -> int:
        """Return the index of the last survivor at a position, or the number of survivors if there is none."""
        found = [index for index, known in enumerate(self._survivors) if (known.x, known.y) == (x, y)]
        return found[-1] if found else len(self._survivors)

    def _nearby_survivor(self, before: int, x: float, y: float) -> str | None:
        """Return the name of the nearest earlier survivor who may be the same person, or None."""
        named = [known for known in self._survivors[:before] if known.survivor_id and known.counts]
        nearest = min(named, key=lambda known: math.hypot(known.x - x, known.y - y), default=None)
        if nearest is None or math.hypot(nearest.x - x, nearest.y - y) > self._duplicate_radius_m:
            return None
        return nearest.survivor_id

    def _set(self, survivor_id: str, **changes: Any) -> None:
        for index, known in enumerate(self._survivors):
            if known.survivor_id == survivor_id:
                self._survivors[index] = replace(known, **changes)
