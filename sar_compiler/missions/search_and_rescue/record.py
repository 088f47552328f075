"""The record of a mission's events, for its summary and its exit status."""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from sar_compiler.journal.journal import Journal
from sar_compiler.missions.search_and_rescue.done_before import DoneBefore
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager
from sar_compiler.runtime.context import mission_context

DUPLICATE_RADIUS_M = 3.0


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
    """

    zone_id: str
    x: float
    y: float
    survivor_id: str | None = None
    acknowledged: bool = False
    kept: bool = False
    possibly: str | None = None
    standing: Standing = Standing.CANDIDATE

    def __str__(self) -> str:
        name = self.survivor_id or "a survivor without a name"
        place = f" in {self.zone_id}" if self.zone_id else ""
        said = "" if self.standing is Standing.CANDIDATE else f", {self.standing.value}"
        if self.possibly is not None:
            said += (
                f" with {self.possibly}"
                if self.standing is Standing.MERGED
                else f", possibly {self.possibly}"
            )
        return f"{name}{place} at ({self.x:.2f}, {self.y:.2f}){said}"

    @property
    def counts(self) -> bool:
        """Whether base must know of it: unless the operator has said that it is nobody, or somebody known."""
        return self.standing in (Standing.CANDIDATE, Standing.CONFIRMED)


@mission_context
class MissionRecord:
    """The events of one mission as its leaves report them.

    It has no influence on the running mission, unless that was begun by an earlier run: then `before` says what need not
    be done again. A survivor who is found again, in the same zone and at the same place, is the same survivor. One found
    near another is kept apart and marked; only the operator merges.

    Args:
        duplicate_radius_m: Finds that are this near to each other may be the same survivor, metres.

    Attributes:
        journal: Where events are written, before anybody is told of them; those of the zones by the `ZoneManager`.
        before: What an earlier run has done of what this one begins with.
    """

    def __init__(self, duplicate_radius_m: float = DUPLICATE_RADIUS_M) -> None:
        self.journal = Journal()
        self.before = DoneBefore()
        self._duplicate_radius_m = duplicate_radius_m
        self._zones_visited: list[str] = []
        self._abandoned: dict[str, str] = {}
        self._unplaced: dict[str, str] = {}
        self._alarm = ""
        self._navigation_lost = ""
        self._survivors: list[FoundSurvivor] = []
        self._home = False

    @property
    def zones_visited(self) -> tuple[str, ...]:
        """The visited zones, in the order of the visits."""
        return tuple(self._zones_visited)

    @property
    def zones_abandoned(self) -> tuple[str, ...]:
        """The abandoned zones, in the order in which they were abandoned."""
        return tuple(self._abandoned)

    @property
    def survivors(self) -> tuple[FoundSurvivor, ...]:
        """The survivors in the order in which they were found."""
        return tuple(self._survivors)

    @property
    def home(self) -> bool:
        """Whether the robot has returned to the base station and not left it for a zone since."""
        return self._home

    def zone_started(self, zone_id: str) -> None:
        """Note that the robot sets out for a zone."""
        self.journal.note("zone_started", zone=zone_id)
        self.before.at_home(home=False)
        self._home = False

    def zone_searched(self, zone_id: str, survivor: tuple[float, float] | None) -> None:
        """Note that a zone was searched.

        Args:
            zone_id: The zone.
            survivor: x and y of the survivor that was found, in the frame `map`, metres; None if nobody was.
        """
        self.journal.note("zone_searched", zone=zone_id, survivor=survivor)
        self._unplaced.pop(zone_id, None)
        if survivor is not None:
            self.survivor_found(zone_id, *survivor)

    def survivor_unplaced(self, zone_id: str, reason: str) -> None:
        """Note that a search has found somebody where nobody can be; the next answer about the zone takes its place.

        Args:
            zone_id: The zone.
            reason: Why nobody can be there, in words.
        """
        if zone_id not in self._unplaced:
            self.journal.note("survivor_unplaced", zone=zone_id, reason=reason)
        self._unplaced[zone_id] = reason

    def zone_visited(self, zone_id: str) -> None:
        """Note that a zone was visited."""
        self._zones_visited.append(zone_id)

    def zone_abandoned(self, zone_id: str, attempts: int) -> None:
        """Note that a zone was abandoned after a number of attempts."""
        self._abandoned[zone_id] = f"was abandoned after attempt {attempts}."

    def zone_given_up(self, zone_id: str, reason: str) -> None:
        """Note that a zone was given up untried, with the reason in words."""
        self._abandoned[zone_id] = f"was given up: {reason}."

    @property
    def alarm(self) -> str:
        """The last reason to cut the mission short, in words; empty if there was none."""
        return self._alarm

    def alarmed(self, reason: str) -> None:
        """Note a reason to cut the mission short, in words."""
        self.journal.note("alarmed", reason=reason)
        self._alarm = reason

    @property
    def navigation_lost(self) -> str:
        """Why nobody can judge a drive, in words; empty while somebody can."""
        return self._navigation_lost

    def navigation_is_lost(self, reason: str) -> None:
        """Note that nobody can judge a drive, with the reason in words."""
        self._navigation_lost = reason

    def navigation_is_back(self) -> None:
        """Note that drives are judged."""
        self._navigation_lost = ""

    def survivor_found(self, zone_id: str, x: float, y: float) -> None:
        """Note that a survivor was found; coordinates in the frame `map`, metres."""
        found = FoundSurvivor(zone_id, x, y)
        if not any((known.zone_id, known.x, known.y) == (zone_id, x, y) for known in self._survivors):
            self._survivors.append(found)

    def survivor_named(self, survivor_id: str, x: float, y: float) -> None:
        """Note the assigned name of the survivor at a position (replaces an earlier one)."""
        found = [index for index, known in enumerate(self._survivors) if (known.x, known.y) == (x, y)]
        index = found[-1] if found else len(self._survivors)
        near = self._near(index, x, y)
        self.journal.note("survivor_named", survivor=survivor_id, x=x, y=y, possibly=near)
        known = self._survivors[index] if found else FoundSurvivor("", x, y)
        self._survivors[index : index + 1] = [replace(known, survivor_id=survivor_id, possibly=near)]

    def survivor(self, survivor_id: str) -> FoundSurvivor | None:
        """Return a survivor by the name; None if nobody has it."""
        return next((known for known in self._survivors if known.survivor_id == survivor_id), None)

    def survivor_judged(self, survivor_id: str, standing: Standing, same_as: str | None = None) -> None:
        """Note what the operator says of a find.

        Args:
            survivor_id: Its name.
            standing: What the operator says.
            same_as: The name of the survivor that it is merged with.
        """
        self.journal.note("survivor_judged", survivor=survivor_id, standing=standing.value, same_as=same_as)
        self._set(survivor_id, standing=standing, **({"possibly": same_as} if same_as else {}))

    def report_sent(self, survivor_id: str) -> None:
        """Note that the report of a survivor is about to be sent."""
        self.journal.note("report_sent", survivor=survivor_id)

    def survivor_acknowledged(self, survivor_id: str) -> None:
        """Note that the base station has confirmed the report of a survivor, which need no longer be kept."""
        self.journal.note("report_acknowledged", survivor=survivor_id)
        self._set(survivor_id, acknowledged=True, kept=False)

    def report_kept(self, survivor_id: str) -> None:
        """Note that the report of a survivor is kept, to be delivered later."""
        self.journal.note("report_kept", survivor=survivor_id)
        self._set(survivor_id, acknowledged=False, kept=True)

    def base_reached(self) -> None:
        """Note that the robot has arrived at the base station."""
        self.journal.note("base_reached")
        self._home = True

    def was_reported_before(self, survivor_id: str) -> bool:
        """Return whether a survivor was named by an earlier run, and base has confirmed the report."""
        found = self.survivor(survivor_id)
        return self.before.has_named(survivor_id) and found is not None and found.acknowledged

    def shortfalls(self, zones: ZoneManager) -> list[str]:
        """Return in sentences what is missing for a complete mission; empty if it is complete."""
        lacking = [f"{zone['id']} was not visited." for zone in zones.remaining_zones()]
        lacking += [f"{zone_id} {what}" for zone_id, what in self._abandoned.items()]
        lacking += [
            f"There is a survivor at no usable position in {zone_id}: {why}."
            for zone_id, why in self._unplaced.items()
        ]
        lacking += [
            f"The base station did not acknowledge {survivor}."
            for survivor in self._survivors
            if survivor.counts and not survivor.acknowledged
        ]
        if not self._home:
            lacking.append("The robot did not return to the base station.")
        return lacking

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
