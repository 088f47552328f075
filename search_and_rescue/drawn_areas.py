"""Validate the areas that the operator draws during a mission, and add them to the plan."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sar_compiler.leaves import UnusableValueError, planar_outline
from search_and_rescue.areas import MAX_RANGE_M, MIN_CORNERS, outline_objection, pose_inside
from search_and_rescue.search_theory import (
    COVERAGE,
    Corners,
    Ground,
    SearchExpectation,
    random_search_pod,
    sweep_width_of,
)
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import MAP_FRAME, Geofence, Zone, ZoneManager

if TYPE_CHECKING:
    from collections.abc import Callable

# Decimal places of a corner, metres; the message has single precision.
_DIGITS = 3


class DrawingError(ValueError):
    """The operator's area is rejected. The message contains the reason and the remedy."""


@dataclass(frozen=True)
class DrawnAreas:
    """Validates the areas that the operator draws, and adds them to the plan of a mission.

    Args:
        zones: The mission's zones.
        sweeps: The mission's sweeps.
        fence: The geofence.
        off_map: Returns why a position (metres, frame `map`) is invalid; empty if the position is on the map.
    """

    zones: ZoneManager
    sweeps: SweepStates
    fence: Geofence
    off_map: "Callable[[float, float], str]"

    def add_area(self, request: Any) -> str:
        """Add an area to the plan, or replace an existing area if its search has not started yet.

        Args:
            request: A request of `sar_interfaces/srv/AddArea`.

        Returns:
            A description of the change.

        Raises:
            DrawingError: If the area is rejected.
            ImportError: If shapely is not installed.
        """
        name = request.zone_id
        if not name:
            raise DrawingError("the area has no name: write a name")
        if not self.zones.has_remaining():
            raise DrawingError("no zone is left, and the robot returns home")
        is_known = self.zones.has_zone(name)
        if is_known and not self._is_untouched(name):
            raise DrawingError(f"the search of '{name}' has already started: draw an area with another name")
        ground = self._ground(request, self.sweeps.grounds.get(name))
        area = self._area(request.poa, ground, self.zones.areas.get(name) if is_known else None)
        x, y = pose_inside(ground.polygon)
        shrunk = self.zones.draw(Zone(id=name, x=x, y=y, yaw=0.0), ground, area)
        change = f"'{name}' was changed" if is_known else f"'{name}' was added"
        return (
            f"{change}, and the POA of every other zone was multiplied by {shrunk:.2f}"
            if shrunk < 1.0
            else change
        )

    def _is_untouched(self, name: str) -> bool:
        behind = [zone["id"] for zone in self.zones.remaining_zones()[1:]]
        return name in behind and not self.sweeps.state_of(name).passes

    def _ground(self, request: Any, before: Ground | None) -> Ground:
        polygon = self._polygon(request.outline)
        if not polygon and before is None:
            raise DrawingError("the area has no polygon: draw at least three corners")
        like = before or next(iter(self.sweeps.grounds.values()), None)
        reach = request.detection_range
        if math.isnan(reach) and like is None:
            raise DrawingError(
                "the detection range is missing: write the maximum distance at which a survivor can be detected, metres"
            )
        if reach <= 0.0 or reach > MAX_RANGE_M:
            raise DrawingError(
                f"the detection range is {reach:g}: write metres above 0, at most {MAX_RANGE_M:g}"
            )
        outline = polygon or before.polygon if before is not None else polygon
        if math.isnan(reach):
            assert like is not None  # noqa: S101 - otherwise the area was rejected above
            return like._replace(polygon=outline)
        per_range = sweep_width_of(1.0) if like is None else like.sweep_width / like.detection_range
        return Ground(outline, reach * per_range, reach)

    def _polygon(self, outline: Any) -> Corners:
        try:
            drawn = planar_outline(outline, MAP_FRAME)
        except UnusableValueError as error:
            raise DrawingError(str(error)) from error
        corners = tuple((round(x, _DIGITS), round(y, _DIGITS)) for x, y in drawn)
        if not corners:
            return ()
        if len(corners) < MIN_CORNERS:
            raise DrawingError(f"the polygon has {len(corners)} corners: draw at least three")
        off = next(filter(None, (self.off_map(*corner) for corner in corners)), "")
        objection = f"has an invalid corner: {off}" if off else outline_objection(corners, self.fence)
        if objection:
            raise DrawingError(f"the outline {objection}")
        return corners

    def _area(self, poa: float, ground: Ground, before: SearchExpectation | None) -> SearchExpectation | None:
        if math.isnan(poa):
            if before is None and self.zones.areas:
                raise DrawingError(
                    "the probability (poa) is missing: write a number from 0 to 1, because every other zone has a poa"
                )
            return before
        if not 0.0 <= poa <= 1.0:
            raise DrawingError(f"the probability is {poa:g}: write a number from 0 to 1")
        if not self.zones.areas:
            raise DrawingError("no zone of this mission has a probability (poa): omit the poa")
        if before is not None:
            return before._replace(poa=poa)
        return SearchExpectation(poa, random_search_pod(COVERAGE), ground.sweep_sec(self.zones.speed_mps))
