"""Defines the position of the frame `map` on the earth."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

GEOREFERENCE = "georeference"
"""The name that precedes the parameters `lat`, `lon` and `heading`, such as in `georeference.lat`."""
# The maximum absolute values of `lat`, `lon` and `heading`, degrees.
_MAX = (90, 180, 360)


class Georeference(NamedTuple):
    """The position of the frame `map` on the earth.

    Attributes:
        lat: Latitude of the frame's origin, degrees north, WGS 84.
        lon: Longitude of the frame's origin, degrees east, WGS 84.
        heading: The direction of the frame's x axis, degrees clockwise from true north: 90 if x points east and y north.
    """

    lat: float
    lon: float
    heading: float

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> "Georeference | None":
        """Return the georeference that a run's parameters contain, or None if it is missing or out of range."""
        try:
            found = cls(*(float(parameters[f"{GEOREFERENCE}.{name}"]) for name in cls._fields))
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return None
        return None if any(found.mistakes()) else found

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Yield the name of each attribute that is out of range, and a description of the problem."""
        for name, value, limit in zip(self._fields, self, _MAX, strict=True):
            if not abs(value) <= limit:  # NaN is an error, too
                yield name, f"must be degrees between -{limit} and {limit}, not {value:g}"

    def to_coordinates(self, x: float, y: float) -> tuple[float, float]:
        """Convert a position in the frame `map`, in metres, to latitude and longitude on the WGS 84 ellipsoid.

        Raises:
            ImportError: If pyproj is not installed.
        """
        from pyproj import Geod

        bearing = self.heading - math.degrees(math.atan2(y, x))
        lon, lat, _ = Geod(ellps="WGS84").fwd(self.lon, self.lat, bearing, math.hypot(x, y))
        return float(lat), float(lon)
