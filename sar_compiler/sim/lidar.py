"""A planar laser scanner: rays against the edges and discs of the world."""

import math
from dataclasses import dataclass

import numpy as np

from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.world import Floats, Solid


@dataclass(frozen=True)
class Lidar:
    """A scanner at the robot's centre with a field of view of 360 degrees.

    Attributes:
        beams: Rays in a full turn; the first points backward (-pi), the angles increase.
        range_min: Shortest distance it measures, metres.
        range_max: Longest distance it measures, metres.
        noise: Standard deviation of a range, metres.
    """

    beams: int = 360
    range_min: float = 0.15
    range_max: float = 12.0
    noise: float = 0.01

    @property
    def angles(self) -> Floats:
        """Angles of the rays in the robot's frame, radians, shape (beams,)."""
        return -math.pi + self.increment * np.arange(self.beams, dtype=np.float64)

    @property
    def increment(self) -> float:
        """Angle between neighbouring rays, radians."""
        return math.tau / self.beams

    def scan(self, solid: Solid, pose: Pose2D, random: np.random.Generator) -> Floats:
        """Return the ranges seen from *pose* (frame `map`), metres, shape (beams,); inf where nothing is in range."""
        ranges = cast(solid, pose.x, pose.y, self.angles + pose.yaw)
        ranges = ranges + random.normal(0.0, self.noise, self.beams)
        seen = np.where(ranges > self.range_max, np.inf, ranges)
        return np.where(np.isfinite(seen), np.maximum(seen, self.range_min), seen)


def cast(solid: Solid, x: float, y: float, angles: Floats) -> Floats:
    """Return the distance from (x, y) to the first surface along each of *angles*.

    Args:
        solid: The obstacles.
        x: Origin of the rays, metres, frame `map`.
        y: Origin of the rays, metres.
        angles: Directions in frame `map`, radians, shape (n,).

    Returns:
        Metres, shape (n,); inf where a ray hits nothing.
    """
    along = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    return np.minimum(_cast_segments(solid, x, y, along), _cast_discs(solid, x, y, along))


def _cast_segments(solid: Solid, x: float, y: float, along: Floats) -> Floats:
    edge_x, edge_y = solid.segments[:, 2], solid.segments[:, 3]
    to_x, to_y = solid.segments[:, 0] - x, solid.segments[:, 1] - y
    # p + t·d = a + u·e, solved by cross products for each pair of ray and edge.
    across = along[:, :1] * edge_y - along[:, 1:] * edge_x
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (to_x * edge_y - to_y * edge_x) / across
        part = (to_x * along[:, 1:] - to_y * along[:, :1]) / across
    hit = (distance >= 0.0) & (part >= 0.0) & (part <= 1.0)
    nearest: Floats = np.min(np.where(hit, distance, np.inf), axis=1, initial=np.inf)
    return nearest


def _cast_discs(solid: Solid, x: float, y: float, along: Floats) -> Floats:
    to_x, to_y, radius = solid.discs[:, 0] - x, solid.discs[:, 1] - y, solid.discs[:, 2]
    middle = along[:, :1] * to_x + along[:, 1:] * to_y
    square = middle**2 - (to_x**2 + to_y**2 - radius**2)
    distance = middle - np.sqrt(np.maximum(square, 0.0))
    hit = (square >= 0.0) & (distance >= 0.0)
    nearest: Floats = np.min(np.where(hit, distance, np.inf), axis=1, initial=np.inf)
    return nearest
