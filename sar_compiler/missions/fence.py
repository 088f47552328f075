"""The geofence: the area that the robot must not leave."""

import itertools
from collections.abc import Sequence

from sar_compiler.ros.parameter_reader import ParameterReader
from sar_compiler.runtime.context import mission_context

PARAMETER = "geofence"
_LEAST_CORNERS = 3


@mission_context
class Fence:
    """A polygon in the frame `map`.

    Args:
        corners: Its corners in their order, x and y in metres; none for no fence, which allows everything.
    """

    def __init__(self, corners: Sequence[tuple[float, float]] = ()) -> None:
        self.corners = tuple(corners)

    def __bool__(self) -> bool:
        """Return whether there is a fence."""
        return bool(self.corners)

    def contains(self, x: float, y: float) -> bool:
        """Return whether a position is inside; with no fence every one is.

        Args:
            x: Metres, frame `map`.
            y: Metres, frame `map`.
        """
        inside = not self.corners
        for (ax, ay), (bx, by) in itertools.pairwise((*self.corners, *self.corners[:1])):
            # A ray to the right crosses the boundary an odd number of times from inside.
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside


def read_fence(reader: ParameterReader) -> Fence:
    """Read the parameter `geofence`: `[x1, y1, x2, y2, x3, y3, …]`; without one there is no fence."""
    numbers = reader.numbers(PARAMETER)
    corners = list(zip(numbers[::2], numbers[1::2], strict=False))
    if numbers and (len(numbers) % 2 or len(corners) < _LEAST_CORNERS):
        text = f"must hold x and y of three corners or more, [x1, y1, x2, y2, x3, y3], holds {len(numbers)} numbers"
        reader.report(PARAMETER, text)
        return Fence()
    return Fence(corners)
