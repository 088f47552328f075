"""The shared state of the patrol's leaves: its points, and the photos that were taken."""

from collections.abc import Mapping, Sequence
from typing import Any

from sar_compiler.missions import Journal, JournalEntry, mission_context


def _preview() -> "Patrol":
    return Patrol([{"id": "gate", "x": 0.0, "y": 0.0, "yaw": 0.0}])


@mission_context(preview=_preview)
class Patrol:
    """The points of one patrol in the order of their visits.

    Args:
        points: Each with `id`, `x`, `y` (metres) and `yaw` (radians) in the frame `map`.

    Attributes:
        points: The points.
        photos: The photos' names, by the point's id.
        journal: The journal that records the events of the patrol.
    """

    def __init__(self, points: Sequence[Mapping[str, Any]]) -> None:
        self.points = tuple(points)
        self.photos: dict[str, str] = {}
        self.journal = Journal(apply=self.apply)
        self._left = list(points)

    @property
    def point(self) -> Mapping[str, Any] | None:
        """The current point; None once all points were visited."""
        return self._left[0] if self._left else None

    def record_photo(self, photo: str) -> None:
        """Record the photo of the current point."""
        if self.point is not None:
            self.journal.record_event("photo_taken", photo=photo)

    def leave(self) -> None:
        """Advance to the next point, with or without a photo of this one."""
        self.journal.record_event("point_left")

    def apply(self, fact: JournalEntry) -> None:
        """Apply an event, both when it is recorded and when a later run resumes the patrol."""
        if fact.kind == "photo_taken" and self.point is not None:
            self.photos[self.point["id"]] = fact.data["photo"]
        elif fact.kind == "point_left":
            self._left = self._left[1:]

    def without_photo(self) -> list[str]:
        """Return the ids of the points without a photo."""
        return [point["id"] for point in self.points if point["id"] not in self.photos]
