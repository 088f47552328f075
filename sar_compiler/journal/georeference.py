"""Where the frame `map` lies on the earth."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

GEOREFERENCE = "georeference"
"""The parameter, with `lat`, `lon` and `heading`."""
# How far each of its numbers may be from 0, degrees.
_MOST = (90, 180, 360)


class Georeference(NamedTuple):
    """The place of the frame `map` on the earth.

    Attributes:
        lat: Latitude of its origin, degrees north, WGS 84.
        lon: Longitude of its origin, degrees east, WGS 84.
        heading: Where its x axis points, degrees clockwise from true north: 90 if x is east and y north.
    """

    lat: float
    lon: float
    heading: float

    @classmethod
    def among(cls, parameters: Mapping[str, Any]) -> "Georeference | None":
        """Return that of a run by its parameters' flat names; None if it has none, or one that is nowhere."""
        try:
            place = cls(*(float(parameters[f"{GEOREFERENCE}.{name}"]) for name in cls._fields))
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return None
        return None if any(place.mistakes()) else place

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Yield the name of each number that is out of its range, with what is wrong with it in words."""
        for name, value, most in zip(self._fields, self, _MOST, strict=True):
            if not abs(value) <= most:  # so that NaN is a mistake
                yield name, f"must be degrees between -{most} and {most}, is {value:g}"

    def located(self, x: float, y: float) -> tuple[float, float]:
        """Return latitude and longitude of a position in the frame `map` (metres), along the ellipsoid.

        Raises:
            ImportError: If pyproj is not installed.
        """
        from pyproj import Geod

        bearing = self.heading - math.degrees(math.atan2(y, x))
        lon, lat, _ = Geod(ellps="WGS84").fwd(self.lon, self.lat, bearing, math.hypot(x, y))
        return float(lat), float(lon)
