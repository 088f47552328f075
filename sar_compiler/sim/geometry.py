"""Poses and obstacle shapes in the plane."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Pose2D:
    """A position and a heading.

    Attributes:
        x: Metres, in the frame `map` unless stated otherwise.
        y: Metres.
        yaw: Radians, counter-clockwise from the x axis.
    """

    x: float
    y: float
    yaw: float = 0.0

    def distance_to(self, other: "Pose2D") -> float:
        """Return the distance to the position of another pose, metres."""
        return math.hypot(other.x - self.x, other.y - self.y)

    def compose(self, local: "Pose2D") -> "Pose2D":
        """Convert a pose relative to this pose to the reference frame of this pose."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2D(
            self.x + cos * local.x - sin * local.y,
            self.y + sin * local.x + cos * local.y,
            normalise_angle(self.yaw + local.yaw),
        )

    def inverse(self) -> "Pose2D":
        """Return the inverse: the pose of the frame's origin relative to this pose."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2D(-cos * self.x - sin * self.y, sin * self.x - cos * self.y, normalise_angle(-self.yaw))

    @property
    def is_finite(self) -> bool:
        """Whether x, y and yaw are finite."""
        return math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.yaw)


ORIGIN = Pose2D(0.0, 0.0)


@dataclass(frozen=True)
class Box:
    """A solid rectangle.

    Attributes:
        x: Centre, metres, frame `map`.
        y: Centre, metres.
        size_x: Full length along the rectangle's own x axis, metres.
        size_y: Full length along the rectangle's own y axis, metres.
        yaw: Rotation of the rectangle's own axes, radians.
    """

    x: float
    y: float
    size_x: float
    size_y: float
    yaw: float = 0.0

    def corners(self) -> tuple[tuple[float, float], ...]:
        """Return the four corners in metres, counter-clockwise."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        half_x, half_y = self.size_x / 2, self.size_y / 2
        signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        return tuple(
            (self.x + cos * a * half_x - sin * b * half_y, self.y + sin * a * half_x + cos * b * half_y)
            for a, b in signs
        )


@dataclass(frozen=True)
class Cylinder:
    """A solid disc.

    Attributes:
        x: Centre, metres, frame `map`.
        y: Centre, metres.
        radius: Metres.
    """

    x: float
    y: float
    radius: float


def normalise_angle(angle: float) -> float:
    """Normalise an angle in radians to (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped
