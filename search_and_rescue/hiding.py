"""Simulate a survivor at a random position. The probabilities of the areas determine position and detection.

In an area with a polygon, the survivor is at a random position inside the polygon, and is detected only within the detection range.
"""

import math
import random
from collections.abc import Mapping

from sar_compiler.missions import ParameterReader
from search_and_rescue.search_theory import Ground, SearchExpectation
from search_and_rescue.zone_manager import MapPose

HIDDEN = "hidden_survivor"
"""The parameter that makes the simulator hide a survivor at a random position."""
# The distance of the survivor ahead of the robot's search pose in an area without a polygon, metres.
_AHEAD_M = 1.0


class HiddenSurvivor:
    """A survivor in an area that is chosen at random by POA. A search of this area succeeds with the probability POD.

    The seed determines the survivor's position, and how many searches of the survivor's area are needed until
    the detection. Neither depends on the order of areas and searches.

    Args:
        poses: The pose from which the robot searches each area, by area name.
        areas: The probabilities of each area, by name.
        seed: The seed of the run.
        grounds: The polygon and detection range of areas that have a polygon, by area name.

    Attributes:
        area: The survivor's area; None if the survivor is outside all areas.
        ground: The ground of the survivor's area; None if the area has no polygon.

    Raises:
        ImportError: If the survivor's area has a polygon, and shapely is not installed.
    """

    def __init__(
        self,
        poses: Mapping[str, MapPose],
        areas: Mapping[str, SearchExpectation],
        seed: int,
        grounds: Mapping[str, Ground] | None = None,
    ) -> None:
        self._probability = random.Random(seed)  # noqa: S311 - nothing to guess
        self._areas = areas
        names = sorted(areas)
        shares = [areas[name].poa for name in names]
        elsewhere = max(0.0, 1.0 - math.fsum(shares))
        (self.area,) = self._probability.choices([*names, None], [*shares, elsewhere])
        self.ground = (grounds or {}).get(self.area or "")
        self._place = self._draw_position(poses)

    def _draw_position(self, poses: Mapping[str, MapPose]) -> tuple[float, float]:
        if self.area is None:
            return math.nan, math.nan
        if self.ground is None:
            pose = poses[self.area]
            return pose["x"] + _AHEAD_M * math.cos(pose["yaw"]), pose["y"] + _AHEAD_M * math.sin(pose["yaw"])
        import shapely

        outline = shapely.Polygon(self.ground.polygon)
        left, low, right, high = outline.bounds
        while True:
            x, y = self._probability.uniform(left, right), self._probability.uniform(low, high)
            if shapely.contains_xy(outline, x, y):
                return x, y

    def search(self, area: str, robot: tuple[float, float] | None = None) -> tuple[float, float] | None:
        """Search an area. Return the survivor's position (metres, frame `map`), or None if no survivor is detected.

        Args:
            area: The name of the area.
            robot: The robot's position, in metres, frame `map`; None if this position is unknown, in which case
                no survivor in a polygon is detected.
        """
        if area != self.area:
            return None
        if self.ground is not None and (
            robot is None or math.dist(robot, self._place) > self.ground.detection_range
        ):
            return None
        return self._place if self._probability.random() < self._areas[area].pod else None


def read_hidden_survivor(reader: ParameterReader, areas: Mapping[str, SearchExpectation]) -> bool:
    """Return whether the parameters let the simulator hide a survivor at a random position."""
    hides = reader.switch(HIDDEN, default=False)
    if hides and not areas:
        reader.report_error(HIDDEN, "needs probabilities to place the survivor: add poa and pod of each zone")
    if hides and any(key.partition(".")[0] == "survivors" for key in reader.parameters):
        reader.report_error(
            HIDDEN,
            f"places a survivor at random, but the group survivors contains fixed positions: remove {HIDDEN} or survivors",
        )
    return hides
