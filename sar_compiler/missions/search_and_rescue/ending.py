"""When a run is over, and how it ended."""

from dataclasses import dataclass
from enum import Enum

from py_trees.common import Status

from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager


class Until(str, Enum):
    """What a run goes on until."""

    COMPLETE = "complete"
    """The mission is complete, or can no longer become so."""
    SUCCESS = "success"
    """The root succeeds."""
    FAILURE = "failure"
    """The root fails."""
    FOREVER = "forever"
    """Somebody stops it."""


@dataclass(frozen=True)
class Verdict:
    """How a run ended.

    Attributes:
        achieved: Whether what it was for has been achieved.
        reason: A sentence about it.
    """

    achieved: bool
    reason: str


class Ending:
    """Looks at a run after every tick.

    Args:
        until: What the run goes on until.
        record: What has happened in the mission; None for a tree of another kind.
        zones: The mission's zones; None for a tree of another kind.
        time_limit_sec: How long the run may take, in seconds of the mission's clock; None for ever.
    """

    def __init__(
        self,
        until: Until,
        record: MissionRecord | None = None,
        zones: ZoneManager | None = None,
        time_limit_sec: float | None = None,
    ) -> None:
        self._until = until
        self._record = record
        self._zones = zones
        self._time_limit_sec = time_limit_sec
        self._idle_ticks = 0

    @property
    def complete(self) -> bool:
        """Whether there is a mission and it is complete."""
        return self._record is not None and self._zones is not None and self._record.complete(self._zones)

    def shortfalls(self) -> list[str]:
        """Say in sentences what a complete mission still lacks; nothing for a tree of another kind."""
        if self._record is None or self._zones is None:
            return []
        return self._record.shortfalls(self._zones)

    def after_tick(self, status: Status, elapsed_sec: float) -> Verdict | None:
        """Say whether the run is over.

        Args:
            status: The root's status after the tick.
            elapsed_sec: Time since the first tick, in seconds of the mission's clock.

        Returns:
            How it ended, or None if it goes on.
        """
        verdict = self._verdict(status)
        late = self._time_limit_sec is not None and elapsed_sec > self._time_limit_sec
        if verdict is None and late:
            return Verdict(
                achieved=False, reason=f"The time limit of {self._time_limit_sec:g} s was reached."
            )
        return verdict

    def _verdict(self, status: Status) -> Verdict | None:
        if self._until is Until.COMPLETE:
            return self._mission_verdict(status)
        wanted = {Until.SUCCESS: Status.SUCCESS, Until.FAILURE: Status.FAILURE}.get(self._until)
        if status == wanted:
            return Verdict(achieved=True, reason=f"The root of the tree ended with {status.name}.")
        return None

    def _mission_verdict(self, status: Status) -> Verdict | None:
        if self.complete:
            return Verdict(achieved=True, reason="Mission complete.")
        # Without a zone left, a tree that ends twice in a row has nothing more to do. Once is not enough:
        # the tick that leaves the last zone succeeds before the way home was looked at.
        over = self._zones is not None and not self._zones.has_remaining() and status != Status.RUNNING
        self._idle_ticks = self._idle_ticks + 1 if over else 0
        if self._idle_ticks > 1:
            idles = f"No zone is left, and the tree idles at {status.name}."
            return Verdict(achieved=False, reason=" ".join([idles, *self.shortfalls()]))
        return None
