"""Areas that the operator draws during a mission, and their validation."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sar_compiler.leaves import UnusableValueError, planar_outline
from search_and_rescue.areas import FARTHEST_SEEN_M, LEAST_CORNERS, outline_objection, pose_inside
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

# Precision of a position in a single-precision message, metres.
_DIGITS = 3


class DrawingError(ValueError):
    """An area is rejected; the text gives the reason and the remedy."""


@dataclass(frozen=True)
class DrawnAreas:
    """Adds areas to the plan of a mission.

    Args:
        zones: The mission's zones.
        sweeps: The mission's sweeps.
        fence: The geofence.
        off_map: Returns why a position (metres, frame `map`) is impossible; empty if it is possible.
    """

    zones: ZoneManager
    sweeps: SweepStates
    fence: Geofence
    off_map: "Callable[[float, float], str]"

    def add_area(self, request: Any) -> str:
        """Add an area, or change one whose search has not started.

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
            raise DrawingError("the area has no name: write one")
        if not self.zones.has_remaining():
            raise DrawingError("no zone is left, and the robot is on its way home")
        is_known = self.zones.has_zone(name)
        if is_known and not self._is_untouched(name):
            raise DrawingError(f"the search of '{name}' has already started: draw another area")
        ground = self._ground(request, self.sweeps.grounds.get(name))
        area = self._area(request.poa, ground, self.zones.areas.get(name) if is_known else None)
        x, y = pose_inside(ground.polygon)
        shrunk = self.zones.draw(Zone(id=name, x=x, y=y, yaw=0.0), ground, area)
        told = f"'{name}' was changed" if is_known else f"'{name}' was added"
        return f"{told}; the POA of the other zones was multiplied by {shrunk:.2f}" if shrunk < 1.0 else told

    def _is_untouched(self, name: str) -> bool:
        behind = [zone["id"] for zone in self.zones.remaining_zones()[1:]]
        return name in behind and not self.sweeps.state_of(name).passes

    def _ground(self, request: Any, before: Ground | None) -> Ground:
        polygon = self._polygon(request.outline)
        if not polygon and before is None:
            raise DrawingError("the area has no polygon: draw three corners or more")
        like = before or next(iter(self.sweeps.grounds.values()), None)
        reach = request.detection_range
        if math.isnan(reach) and like is None:
            raise DrawingError(
                "the detection range is missing: write the distance at which a survivor is seen, metres"
            )
        if reach <= 0.0 or reach > FARTHEST_SEEN_M:
            raise DrawingError(
                f"the detection range is {reach:g}: write metres above 0, at most {FARTHEST_SEEN_M:g}"
            )
        outline = polygon or before.polygon if before is not None else polygon
        if math.isnan(reach):
            assert like is not None  # noqa: S101 - otherwise it was rejected
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
        if len(corners) < LEAST_CORNERS:
            raise DrawingError(f"the polygon has {len(corners)} corners: draw three or more")
        off = next(filter(None, (self.off_map(*corner) for corner in corners)), "")
        objection = f"has an impossible corner: {off}" if off else outline_objection(corners, self.fence)
        if objection:
            raise DrawingError(f"the outline {objection}")
        return corners

    def _area(self, poa: float, ground: Ground, before: SearchExpectation | None) -> SearchExpectation | None:
        if math.isnan(poa):
            if before is None and self.zones.areas:
                raise DrawingError(
                    "the probability (poa) is missing: write one, because the other zones have one"
                )
            return before
        if not 0.0 <= poa <= 1.0:
            raise DrawingError(f"the probability is {poa:g}: write a number from 0 to 1")
        if not self.zones.areas:
            raise DrawingError("no zone of this mission has a probability (poa): omit it")
        if before is not None:
            return before._replace(poa=poa)
        return SearchExpectation(poa, random_search_pod(COVERAGE), ground.sweep_sec(self.zones.speed_mps))
