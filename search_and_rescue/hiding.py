"""Somebody who hides in a simulated search: where, and which looks find who is there, by the probabilities of the areas.

Of an area with an outline somebody is anywhere in it, and is found by looks from within the detection range alone.
"""

import math
import random
from collections.abc import Mapping

from sar_compiler.missions import ParameterReader
from search_and_rescue.search_theory import Area, Ground
from search_and_rescue.zone_manager import MapPose

HIDDEN = "hidden_survivor"
"""The parameter that has somebody hide."""
# How far ahead of the robot somebody is found, metres: what is seen does not stand where the robot stands.
_AHEAD_M = 1.0


class Hiding:
    """Somebody who is in each area as likely as its POA says, and is found by a look there as likely as its POD says.

    A seed has somebody in the same place whatever the order of the areas, and found by the same look there whatever the
    order of the looks.

    Args:
        poses: From where the robot looks into each area.
        areas: What is expected of looks there.
        seed: The seed of the flight.
        grounds: Outlines of areas, with the range in which somebody is found there.

    Attributes:
        area: Where somebody is; None if that is elsewhere.
        ground: The ground of that area; None if it has none.

    Raises:
        ImportError: If somebody is in an outline, and shapely is not installed.
    """

    def __init__(
        self,
        poses: Mapping[str, MapPose],
        areas: Mapping[str, Area],
        seed: int,
        grounds: Mapping[str, Ground] | None = None,
    ) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - nothing to guess
        self._areas = areas
        names = sorted(areas)
        shares = [areas[name].poa for name in names]
        elsewhere = max(0.0, 1.0 - math.fsum(shares))
        (self.area,) = self._chance.choices([*names, None], [*shares, elsewhere])
        self.ground = (grounds or {}).get(self.area or "")
        self._place = self._somewhere(poses)

    def _somewhere(self, poses: Mapping[str, MapPose]) -> tuple[float, float]:
        if self.area is None:
            return math.nan, math.nan
        if self.ground is None:
            pose = poses[self.area]
            return pose["x"] + _AHEAD_M * math.cos(pose["yaw"]), pose["y"] + _AHEAD_M * math.sin(pose["yaw"])
        import shapely

        outline = shapely.Polygon(self.ground.polygon)
        left, low, right, high = outline.bounds
        while True:
            x, y = self._chance.uniform(left, right), self._chance.uniform(low, high)
            if shapely.contains_xy(outline, x, y):
                return x, y

    def look(self, area: str, robot: tuple[float, float] | None = None) -> tuple[float, float] | None:
        """Return where a look in an area finds somebody, metres, frame `map`; None if nobody is found.

        Args:
            area: The area.
            robot: From where it is looked, metres, frame `map`; where that is not known, nobody is found in an outline.
        """
        if area != self.area:
            return None
        if self.ground is not None and (
            robot is None or math.dist(robot, self._place) > self.ground.detection_range
        ):
            return None
        return self._place if self._chance.random() < self._areas[area].pod else None


def read_hiding(reader: ParameterReader, areas: Mapping[str, Area]) -> bool:
    """Read `hidden_survivor`: whether somebody hides in the simulator, by what is expected of looks in the areas."""
    hides = reader.switch(HIDDEN, default=False)
    if hides and not areas:
        reader.report(HIDDEN, "needs poa and pod beside the zones, which say where somebody hides")
    if hides and any(key.partition(".")[0] == "survivors" for key in reader.parameters):
        reader.report(
            HIDDEN, "has somebody hide by chance, and survivors says where somebody is: leave one out"
        )
    return hides
