"""The patrol as a mission for `sar-run`."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sar_compiler.missions import (
    Display,
    Figure,
    Journal,
    JournalEntry,
    Landmark,
    LandmarkKind,
    Level,
    Mission,
    MissionRun,
    ParameterReader,
)

from .patrol import Patrol

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.missions import FaultPlan

_HERE = Path(__file__).parent


class PhotoPatrol(Mission):
    """Visit points, and take a photo at each."""

    name = "photo_patrol"
    context_types = (Patrol,)
    parameter_names = ("point_order", "points")
    faults = {"take_photo": ("drop", "delay", "refuse")}  # noqa: RUF012 - not changed
    default_tree = str(_HERE / "patrol.xml")
    is_resumable = True

    def default_parameters(self) -> Path:
        """Return the path of the points."""
        return _HERE / "points.yaml"

    def default_properties(self, leaves: Collection[type]) -> Path:  # noqa: ARG002
        """Return the path of the properties."""
        return _HERE / "properties.yaml"

    def begin(self, reader: ParameterReader) -> "PatrolRun":
        """Start a patrol of the points in the parameters."""
        return PatrolRun(Patrol(reader.places("point")))


class PatrolRun(MissionRun):
    """One patrol.

    Args:
        patrol: The points and the photos.
    """

    kinds = (LandmarkKind("point", "points", "square"),)

    def __init__(self, patrol: Patrol) -> None:
        self._patrol = patrol
        self.context = {Patrol: patrol}

    def start_lines(self) -> list[str]:
        """Return the number of points."""
        return [f"{len(self._patrol.points)} points to photograph."]

    def identity(self) -> dict[str, object]:
        """Return the points. A journal with other points belongs to another mission."""
        return {"points": self._patrol.points}

    def use_journal(self, journal: Journal) -> None:
        """Continue after the events of earlier runs, and record the events of this run."""
        super().use_journal(journal)
        self._patrol.journal = journal

    def apply(self, fact: JournalEntry) -> None:
        """Apply an event to the patrol."""
        self._patrol.apply(fact)

    def display(self) -> Display:
        """Return the points with their states, and the number of photos."""
        photos, current = self._patrol.photos, self._patrol.point
        points = [
            Landmark("point", point["id"], point["x"], point["y"], *_state(point, current, photos))
            for point in self._patrol.points
        ]
        return Display(points, [Figure("photos", len(photos), len(points))])

    def sentence(self, fact: JournalEntry) -> str:
        """Return a sentence about an event."""
        return f"took {fact.data['photo']}" if fact.kind == "photo_taken" else ""

    def places(self) -> dict[str, tuple[float, float]]:
        """Return the positions of the points, for faults such as `navigate_to_pose:abort=yard`."""
        return {point["id"]: (point["x"], point["y"]) for point in self._patrol.points}

    def servers(self, faults: "FaultPlan", **options: Any) -> "list[Node]":
        """Create the camera, because the simulated world has none."""
        from .camera import Camera

        return [Camera(faults.for_service("take_photo"), **options)]

    def shortfalls(self) -> list[str]:
        """Return the points without a photo; the patrol is complete if there are none."""
        return [f"There is no photo of {name}." for name in self._patrol.without_photo()]

    def idle_reason(self) -> str:
        """Return a reason after every point was visited."""
        return "Every point was visited" if self._patrol.point is None else ""

    def summary(self, elapsed_sec: float, ticks: int) -> str:
        """Return the photo of each point, and the duration."""
        photos = self._patrol.photos
        lines = [f"  {point['id']}: {photos.get(point['id'], 'no photo')}" for point in self._patrol.points]
        title = f"Patrol: {len(photos)} of {len(lines)} photos"
        return "\n".join([title, *lines, f"  {elapsed_sec:.1f} s, {ticks} ticks"])


def _state(
    point: Mapping[str, Any], current: Mapping[str, Any] | None, photos: Mapping[str, str]
) -> tuple[str, Level]:
    if point["id"] in photos:
        return photos[point["id"]], Level.DONE
    return ("next", Level.IN_HAND) if point is current else ("to come", Level.TO_COME)


MISSION = PhotoPatrol()
