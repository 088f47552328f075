"""The record of a mission's events, for its summary and its exit status."""

from dataclasses import dataclass, replace

from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager
from sar_compiler.runtime.context import mission_context


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
    """

    zone_id: str
    x: float
    y: float
    survivor_id: str | None = None
    acknowledged: bool = False
    kept: bool = False

    def __str__(self) -> str:
        name = self.survivor_id or "a survivor without a name"
        place = f" in {self.zone_id}" if self.zone_id else ""
        return f"{name}{place} at ({self.x:.2f}, {self.y:.2f})"


@mission_context
class MissionRecord:
    """The events of one mission as its leaves report them.

    It has no influence on the running mission. A survivor who is found again, in the same zone and at the same
    place, is the same survivor.
    """

    def __init__(self) -> None:
        self._zones_visited: list[str] = []
        self._attempts_on_abandoned: dict[str, int] = {}
        self._survivors: list[FoundSurvivor] = []
        self._home = False

    @property
    def zones_visited(self) -> tuple[str, ...]:
        """The visited zones, in the order of the visits."""
        return tuple(self._zones_visited)

    @property
    def zones_abandoned(self) -> tuple[str, ...]:
        """The abandoned zones, in the order in which they were abandoned."""
        return tuple(self._attempts_on_abandoned)

    @property
    def reports_kept(self) -> tuple[str, ...]:
        """The names of the survivors whose reports are kept, in the order in which they were found."""
        return tuple(known.survivor_id for known in self._survivors if known.kept and known.survivor_id)

    @property
    def survivors(self) -> tuple[FoundSurvivor, ...]:
        """The survivors in the order in which they were found."""
        return tuple(self._survivors)

    @property
    def home(self) -> bool:
        """Whether the robot has returned to the base station and not left it for a zone since."""
        return self._home

    def zone_started(self, zone_id: str) -> None:  # noqa: ARG002 - the zone is part of the event
        """Note that the robot sets out for a zone."""
        self._home = False

    def zone_visited(self, zone_id: str) -> None:
        """Note that a zone was visited."""
        self._zones_visited.append(zone_id)

    def zone_abandoned(self, zone_id: str, attempts: int) -> None:
        """Note that a zone was abandoned after a number of attempts."""
        self._attempts_on_abandoned[zone_id] = attempts

    def survivor_found(self, zone_id: str, x: float, y: float) -> None:
        """Note that a survivor was found; coordinates in the frame `map`, metres."""
        found = FoundSurvivor(zone_id, x, y)
        if not any((known.zone_id, known.x, known.y) == (zone_id, x, y) for known in self._survivors):
            self._survivors.append(found)

    def survivor_named(self, survivor_id: str, x: float, y: float) -> None:
        """Note the assigned name of the survivor at a position (replaces an earlier one)."""
        for index in reversed(range(len(self._survivors))):
            known = self._survivors[index]
            if (known.x, known.y) == (x, y):
                self._survivors[index] = replace(known, survivor_id=survivor_id)
                return
        self._survivors.append(FoundSurvivor("", x, y, survivor_id))

    def survivor_acknowledged(self, survivor_id: str) -> None:
        """Note that the base station has confirmed the report of a survivor, which need no longer be kept."""
        self._set(survivor_id, acknowledged=True, kept=False)

    def report_kept(self, survivor_id: str) -> None:
        """Note that the report of a survivor is kept, to be delivered later."""
        self._set(survivor_id, acknowledged=False, kept=True)

    def base_reached(self) -> None:
        """Note that the robot has arrived at the base station."""
        self._home = True

    def complete(self, zones: ZoneManager) -> bool:
        """Return whether the mission is done: no zone left, every survivor acknowledged, the robot home."""
        return not self.shortfalls(zones)

    def shortfalls(self, zones: ZoneManager) -> list[str]:
        """Return in sentences what is missing for a complete mission; empty if it is complete."""
        lacking = [f"{zone['id']} was not visited." for zone in zones.remaining_zones()]
        lacking += [
            f"{zone_id} was abandoned after attempt {attempts}."
            for zone_id, attempts in self._attempts_on_abandoned.items()
        ]
        lacking += [
            f"The base station did not acknowledge {survivor}."
            for survivor in self._survivors
            if not survivor.acknowledged
        ]
        if not self._home:
            lacking.append("The robot did not return to the base station.")
        return lacking

    def _set(self, survivor_id: str, *, acknowledged: bool, kept: bool) -> None:
        for index, known in enumerate(self._survivors):
            if known.survivor_id == survivor_id:
                self._survivors[index] = replace(known, acknowledged=acknowledged, kept=kept)
