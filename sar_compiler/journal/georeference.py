"""The position of the frame `map` on the earth."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

GEOREFERENCE = "georeference"
"""The parameter, with `lat`, `lon` and `heading`."""
# Limits for the absolute value of its numbers, degrees.
_MOST = (90, 180, 360)


class Georeference(NamedTuple):
    """The position of the frame `map` on the earth.

    Attributes:
        lat: Latitude of its origin, degrees north, WGS 84.
        lon: Longitude of its origin, degrees east, WGS 84.
        heading: The direction of its x axis, degrees clockwise from true north: 90 if x is east and y north.
    """

    lat: float
    lon: float
    heading: float

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> "Georeference | None":
        """Return the georeference in a run's parameters (flat names); None if missing or out of range."""
        try:
            place = cls(*(float(parameters[f"{GEOREFERENCE}.{name}"]) for name in cls._fields))
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return None
        return None if any(place.mistakes()) else place

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Yield the name of each number out of range, with a description of the problem."""
        for name, value, most in zip(self._fields, self, _MOST, strict=True):
            if not abs(value) <= most:  # NaN is an error, too
                yield name, f"must be degrees between -{most} and {most}, not {value:g}"

    def to_coordinates(self, x: float, y: float) -> tuple[float, float]:
        """Return latitude and longitude of a position in the frame `map` (metres), along the ellipsoid.

        Raises:
            ImportError: If pyproj is not installed.
        """
        from pyproj import Geod

        bearing = self.heading - math.degrees(math.atan2(y, x))
        lon, lat, _ = Geod(ellps="WGS84").fwd(self.lon, self.lat, bearing, math.hypot(x, y))
        return float(lat), float(lon)
