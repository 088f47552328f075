"""The record of a mission's sweeps: open pieces, coverage of each ground, and gaps."""

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

from sar_compiler.missions import Journal, JournalEntry, RasterLayer, mission_context, position
from search_and_rescue import search_events
from search_and_rescue.search_theory import Corners, Ground, parallel_sweep_pod
from search_and_rescue.zone_manager import Geofence, MapPose

if TYPE_CHECKING:
    from search_and_rescue.coverage import CoverageRaster, ObstacleMap


_SEEN = ("area_m2", "coverage", "pod", "seen")


@dataclass(frozen=True)
class SweepState:
    """The state of a zone's sweep.

    Attributes:
        pieces: The poses of the last plan, in the order of the plan.
        done: Number of pieces of the last plan that were swept or skipped.
        skipped: Number of skipped pieces of all plans.
        passes: Number of plans so far.
        pattern: Pattern of the last plan.
        spacing: Distance between legs of the last plan, metres.
        metres: Distance driven inside the ground (L), metres.
        area_m2: Area of the searchable ground (A), square metres.
        coverage: The mean coverage of the ground (C).
        pod: Probability that the sweeps would have detected a person in the ground, 0 to 1.
        seen: Share of the searchable ground that was visible at least once, 0 to 1.
        cells: The coverage of each cell, as returned by `CoverageRaster.share_text`.
        layer: The display layer with the POD of each cell; None before the first swept piece.
        gaps: The polygons of the gaps, computed when the last piece of a plan is swept; empty until then.
    """

    pieces: tuple[MapPose, ...] = ()
    done: int = 0
    skipped: int = 0
    passes: int = 0
    pattern: str = ""
    spacing: float = 0.0
    metres: float = 0.0
    area_m2: float = 0.0
    coverage: float = 0.0
    pod: float = 0.0
    seen: float = 0.0
    cells: str = ""
    layer: RasterLayer | None = None
    gaps: tuple[Corners, ...] = ()

    @property
    def pod_of_legs(self) -> float | None:
        """The POD for exact parallel legs. None if the first plan had no legs or was not completely swept."""
        in_legs = self.pattern in ("parallel", "creeping_line") and self.passes == 1
        return (
            parallel_sweep_pod(self.coverage) if in_legs and not (self.open_count or self.skipped) else None
        )

    @property
    def open_count(self) -> int:
        """The number of pieces in the last plan that were neither swept nor skipped."""
        return len(self.pieces) - self.done

    def describe_piece(self, zone: str) -> str:
        """Return the number of the current piece in words, such as `piece 3/12 of zone_b`."""
        return f"piece {self.done + 1}/{len(self.pieces)} of {zone}"

    def result(self, zone: str) -> str:
        """Describe the result of the sweep in a sentence: the share seen, the POD, and the number of gaps."""
        return f"{zone}: {self.seen:.0%} seen, POD {self.pod:.0%}, {len(self.gaps)} gaps."


@mission_context
class SweepStates:
    """The sweeps of one mission, shared by the mission's leaves.

    Events update the state of the sweeps. Driven distances are added up until the next `piece_swept` event,
    which contains the sum.

    Args:
        grounds: The grounds by zone ID, for the zones with a polygon.

    Attributes:
        grounds: The grounds by zone ID, for the zones with a polygon.
        journal: Records the events of sweeps: `sweep_planned`, `piece_swept` and `piece_skipped`.
    """

    def __init__(self, grounds: Mapping[str, Ground] | None = None) -> None:
        self.grounds = dict(grounds or {})
        self.journal = Journal(apply=self.apply)
        self._sweeps: dict[str, SweepState] = {}
        self._rasters: dict[str, CoverageRaster] = {}
        self._driven: defaultdict[str, float] = defaultdict(float)

    def state_of(self, zone: str) -> SweepState:
        """Return the state of a zone's sweep."""
        return self._sweeps.get(zone, SweepState())

    def zones_at(self, x: float, y: float) -> list[str]:
        """Return the IDs of the zones whose polygons contain a position (metres, frame `map`)."""
        return [zone for zone, ground in self.grounds.items() if Geofence(ground.polygon).contains(x, y)]

    def seen_m2(self) -> tuple[float, float]:
        """Return the area seen so far and the total area of all grounds, in square metres.

        The total area of a ground includes obstacles until the zone's first piece is swept.
        """
        sweeps = {zone: self.state_of(zone) for zone in self.grounds}
        seen = math.fsum(sweep.seen * sweep.area_m2 for sweep in sweeps.values())
        sizes = [sweep.area_m2 or self.grounds[zone].area_m2 for zone, sweep in sweeps.items()]
        return seen, math.fsum(sizes)

    def layers(self) -> list[RasterLayer]:
        """Return the display layer of each ground in which a piece was swept."""
        return [sweep.layer for sweep in self._sweeps.values() if sweep.layer is not None]

    def raster(self, zone: str, obstacles: "ObstacleMap | None") -> "CoverageRaster":
        """Return the coverage raster of a zone's ground, with the obstacles of the current map.

        Raises:
            ImportError: If shapely is not installed.
        """
        from search_and_rescue.coverage import CoverageRaster

        if zone not in self._rasters:
            self._rasters[zone] = CoverageRaster(self.grounds[zone], obstacles, self.state_of(zone).cells)
        self._rasters[zone].obstacles = obstacles
        return self._rasters[zone]

    def drive(self, zone: str, path: Sequence[tuple[float, float]], obstacles: "ObstacleMap | None") -> None:
        """Add a drive along positions (metres, frame `map`) to a zone's coverage and driven distance."""
        self._driven[zone] += self.raster(zone, obstacles).drive(path)

    def plan(self, zone: str, pattern: str, spacing: float, pieces: Sequence[MapPose]) -> None:
        """Record the plan of a sweep. The plan replaces the open pieces of an earlier plan."""
        poses = [[round(pose[axis], 3) for axis in ("x", "y", "yaw")] for pose in pieces]
        self.journal.record_event(
            search_events.SWEEP_PLANNED, zone=zone, pattern=pattern, spacing=round(spacing, 3), pieces=poses
        )

    def finish_piece(self, zone: str, obstacles: "ObstacleMap | None", until_pod: float) -> None:
        """Record that the current piece was swept, and record the coverage of the ground so far.

        Args:
            zone: The zone.
            obstacles: The map; None without a map.
            until_pod: Cells with a POD below this value form the gaps. Gaps are computed after the last piece
                of a plan.
        """
        sweep, raster = self.state_of(zone), self.raster(zone, obstacles)
        gaps = [list(map(list, each)) for each in raster.gaps(until_pod)] if sweep.open_count <= 1 else []
        self.journal.record_event(
            search_events.PIECE_SWEPT,
            zone=zone,
            piece=sweep.done,
            metres=round(self._driven.pop(zone, 0.0), 2),
            area_m2=round(raster.area_m2(), 2),
            coverage=round(raster.mean_coverage(), 4),
            pod=round(raster.pod(), 4),
            seen=round(raster.seen_share(), 4),
            cells=raster.share_text(),
            gaps=gaps,
        )

    def skip(self, zone: str, reason: str) -> None:
        """Record that the current piece is skipped, and why."""
        self.journal.record_event(
            search_events.PIECE_SKIPPED, zone=zone, piece=self.state_of(zone).done, reason=reason
        )

    def apply(self, fact: JournalEntry) -> None:
        """Update the state of a sweep from an event. Ignore events of other kinds.

        Raises:
            ArithmeticError, LookupError, TypeError or ValueError: If the event contradicts the current state.
        """
        if (handle := self._HANDLERS.get(fact.kind)) is not None:
            zone = fact.data["zone"]
            self._sweeps[zone] = handle(self, self.state_of(zone), **{**fact.data, "zone": zone})

    def _on_area_drawn(
        self,
        sweep: SweepState,
        zone: str,
        polygon: Sequence[Any],
        sweep_width: Any,
        detection_range: Any,
        **_more: Any,
    ) -> SweepState:
        if sweep.passes:
            raise ValueError(f"{zone} is already being swept")
        corners = tuple(position(*corner) for corner in polygon)
        self.grounds[zone] = Ground(corners, _number(sweep_width), _number(detection_range))
        self._rasters.pop(zone, None)
        return sweep

    def _on_sweep_planned(
        self, sweep: SweepState, zone: str, pattern: str, spacing: Any, pieces: Sequence[Any]
    ) -> SweepState:
        if zone not in self.grounds:
            raise ValueError(f"{zone} has no polygon at the time of the event")
        poses = tuple(_pose(*piece) for piece in pieces)
        planned = replace(sweep, pattern=str(pattern), spacing=_number(spacing))
        return replace(planned, pieces=poses, done=0, passes=sweep.passes + 1, gaps=())

    def _on_piece_swept(
        self,
        sweep: SweepState,
        zone: str,
        piece: int,
        metres: Any,
        cells: str,
        gaps: Sequence[Any],
        **seen: Any,
    ) -> SweepState:
        from search_and_rescue.coverage import CoverageRaster

        outlines = tuple(tuple(position(*corner) for corner in outline) for outline in gaps)
        numbers: dict[str, Any] = {name: _number(seen[name]) for name in _SEEN}
        driven = sweep.metres + _number(metres)
        layer = CoverageRaster(self.grounds[zone], cells=str(cells)).layer(zone)
        swept = replace(_after_piece(sweep, zone, piece), metres=driven, cells=str(cells), gaps=outlines)
        return replace(swept, layer=layer, **numbers)

    def _on_piece_skipped(self, sweep: SweepState, zone: str, piece: int, reason: str) -> SweepState:  # noqa: ARG002 - the event's keys
        return replace(_after_piece(sweep, zone, piece), skipped=sweep.skipped + 1)

    # Events of other kinds do not change a sweep.
    _HANDLERS: ClassVar[Mapping[str, Callable[..., SweepState]]] = {
        search_events.AREA_DRAWN: _on_area_drawn,
        search_events.SWEEP_PLANNED: _on_sweep_planned,
        search_events.PIECE_SWEPT: _on_piece_swept,
        search_events.PIECE_SKIPPED: _on_piece_skipped,
    }


def _after_piece(sweep: SweepState, zone: str, piece: int) -> SweepState:
    if piece != sweep.done or not sweep.open_count:
        raise ValueError(
            f"the current piece of {zone} at the time of the event is {sweep.done} of {len(sweep.pieces)}"
        )
    return replace(sweep, done=sweep.done + 1)


def _pose(x: Any, y: Any, yaw: Any) -> MapPose:
    x, y = position(x, y)
    return MapPose(x=x, y=y, yaw=_number(yaw))


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value!r} is not a finite number")
    return number
