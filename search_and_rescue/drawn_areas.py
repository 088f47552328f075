"""Areas that the operator draws while a mission is under way, and what is wrong with them."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sar_compiler.leaves import UnusableValueError, planar_outline
from search_and_rescue.areas import FARTHEST_SEEN_M, LEAST_CORNERS, outline_objection, pose_inside
from search_and_rescue.search_theory import COVERAGE, Area, Corners, Ground, pod_at_random, sweep_width_of
from search_and_rescue.sweep_record import Sweeps
from search_and_rescue.zone_manager import MAP_FRAME, Fence, Zone, ZoneManager

if TYPE_CHECKING:
    from collections.abc import Callable

# What a message in single precision has of a place, metres.
_DIGITS = 3


class DrawingError(ValueError):
    """An area cannot be taken; the text says why, and what would help."""


@dataclass(frozen=True)
class DrawnAreas:
    """Takes areas into the plan of a mission.

    Args:
        zones: The mission's zones.
        sweeps: The mission's sweeps.
        fence: The geofence.
        off_map: Returns why nothing can be at a position, metres in the frame `map`; empty if something can.
    """

    zones: ZoneManager
    sweeps: Sweeps
    fence: Fence
    off_map: "Callable[[float, float], str]"

    def take(self, request: Any) -> str:
        """Take an area that is new, or change one that nobody has begun to search.

        Args:
            request: A request of `sar_interfaces/srv/AddArea`.

        Returns:
            What has become of it, in words.

        Raises:
            DrawingError: If it cannot be taken.
            ImportError: If shapely is not installed.
        """
        name = request.zone_id
        if not name:
            raise DrawingError("the area has no name")
        if not self.zones.has_remaining():
            raise DrawingError("no zone is left, and the robot is on its way home")
        is_known = self.zones.knows(name)
        if is_known and not self._is_untouched(name):
            raise DrawingError(f"'{name}' is being searched, or was: draw another area")
        ground = self._ground(request, self.sweeps.grounds.get(name))
        area = self._area(request.poa, ground, self.zones.areas.get(name) if is_known else None)
        x, y = pose_inside(ground.polygon)
        shrunk = self.zones.draw(Zone(id=name, x=x, y=y, yaw=0.0), ground, area)
        told = f"'{name}' is changed" if is_known else f"'{name}' is searched as well"
        return f"{told}; the POA of the others counts {shrunk:.2f} times" if shrunk < 1.0 else told

    def _is_untouched(self, name: str) -> bool:
        behind = [zone["id"] for zone in self.zones.remaining_zones()[1:]]
        return name in behind and not self.sweeps.of(name).passes

    def _ground(self, request: Any, before: Ground | None) -> Ground:
        polygon = self._polygon(request.outline)
        if not polygon and before is None:
            raise DrawingError("it has no outline: draw three corners or more")
        like = before or next(iter(self.sweeps.grounds.values()), None)
        reach = request.detection_range
        if math.isnan(reach) and like is None:
            raise DrawingError("give a detection range: how far a survivor can be seen, metres")
        if reach <= 0.0 or reach > FARTHEST_SEEN_M:
            raise DrawingError(
                f"the detection range is {reach:g}, and must be above 0, metres, and at most {FARTHEST_SEEN_M:g}"
            )
        outline = polygon or before.polygon if before is not None else polygon
        if math.isnan(reach):
            assert like is not None  # noqa: S101 - else it is refused
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
            raise DrawingError(f"the outline has {len(corners)} corners, and needs three or more")
        off = next(filter(None, (self.off_map(*corner) for corner in corners)), "")
        objection = (
            f"has a corner where nothing can be: {off}" if off else outline_objection(corners, self.fence)
        )
        if objection:
            raise DrawingError(f"the outline {objection}")
        return corners

    def _area(self, poa: float, ground: Ground, before: Area | None) -> Area | None:
        if math.isnan(poa):
            if before is None and self.zones.areas:
                raise DrawingError("give a probability (poa), as the other zones have one")
            return before
        if not 0.0 <= poa <= 1.0:
            raise DrawingError(f"the probability is {poa:g}, and must be from 0 to 1")
        if not self.zones.areas:
            raise DrawingError("no zone of this mission has a probability (poa): leave it out")
        if before is not None:
            return before._replace(poa=poa)
        return Area(poa, pod_at_random(COVERAGE), ground.sweep_sec(self.zones.speed_mps))
