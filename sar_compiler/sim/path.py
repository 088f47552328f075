"""Paths in the plane, and the remaining distance along them."""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.world import Floats

# How far ahead on the path, in metres, the robot may have got between two looks.
_WINDOW = 1.0


@dataclass(frozen=True)
class Path2D:
    """A polyline.

    Attributes:
        points: Metres, frame `map`, shape (n, 2), n at least 1; the last is the goal.
    """

    points: Floats

    @cached_property
    def to_go(self) -> Floats:
        """Metres along the path from each point to the last, shape (n,)."""
        lengths = np.hypot(*np.diff(self.points, axis=0).T)
        return np.append(np.cumsum(lengths[::-1])[::-1], 0.0)

    def nearest(self, pose: Pose2D, since: int) -> int:
        """Return the index of the point nearest to *pose*, not before *since* and not much after it."""
        ahead = int(np.searchsorted(-self.to_go, _WINDOW - self.to_go[since], side="right"))
        part = self.points[since : max(ahead, since + 1)]
        return since + int(np.argmin(np.hypot(part[:, 0] - pose.x, part[:, 1] - pose.y)))

    def carrot(self, index: int, ahead: float) -> tuple[float, float]:
        """Return the point of the path *ahead* metres after point *index*, or its end."""
        target = int(np.searchsorted(-self.to_go, ahead - self.to_go[index]))
        x, y = self.points[min(target, len(self.points) - 1)]
        return float(x), float(y)

    @staticmethod
    def through(corners: Floats, spacing: float = 0.05) -> "Path2D":
        """Return the straight path from corner to corner, with a point at least every *spacing* metres."""
        pieces = []
        for start, end in itertools.pairwise(corners):
            count = max(1, int(np.ceil(np.hypot(*(end - start)) / spacing)))
            pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
        return Path2D(np.concatenate([*pieces, corners[-1:]]))
