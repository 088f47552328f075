"""Compute the coverage of an area from the robot's path and the map.

Driving one metre with a sensor of sweep width W is an effort of W square metres. The effort is spread evenly over the circle of the detection
range R: each metre adds W / (π R²) to the coverage of every cell within the range and in sight. The coverage
of an area is the mean over the cells. For a track of length L in an area A, the coverage is W · L / A if the robot
sees only cells of the area, and no cell is hidden. The POD of a cell with coverage c is 1 - exp(-c). This is
Koopman's law of random search, a lower bound. The coverages of several passes are added.
"""

import base64
import binascii
import itertools
import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from sar_compiler.missions import RasterLayer
from search_and_rescue.search_theory import Corners, Ground

Points = npt.NDArray[np.float64]

_CELL_M = 0.25
_MAX_CELLS = 20_000
# Gaps of at most this number of cells are not worth a drive.
_MIN_CELLS = 4
# Resolution of the coverage in the text of a raster.
_STEP = 0.001
_MAX_COUNT = np.iinfo(np.uint16).max


@dataclass(frozen=True, eq=False)
class ObstacleMap:
    """The obstacles that block sight and driving: occupied or unknown cells, and all positions outside the map.

    Args:
        blocked: Whether each cell is occupied or unknown, by row (y) and column (x).
        resolution: The side length of a cell, metres.
        origin: x, y (metres) and yaw (radians) of the corner of the first cell, in the frame `map`.
    """

    blocked: npt.NDArray[np.bool_]
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def are_blocked(self, points: Points) -> npt.NDArray[np.bool_]:
        """Return for each position (metres, frame `map`) whether it is blocked. The last axis of `points` is x and y."""
        cells = np.floor(self._to_cells(points)).astype(int)
        column, row = cells[..., 0], cells[..., 1]
        rows, columns = self.blocked.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        blocked: npt.NDArray[np.bool_] = ~inside
        blocked[inside] = self.blocked[row[inside], column[inside]]
        return blocked

    def hides(self, eye: Points, points: Points, reach: float) -> npt.NDArray[np.bool_]:
        """Return for each position whether it is blocked, or whether a blocked cell hides it from the sensor.

        Args:
            eye: The position of the sensor, metres, frame `map`.
            points: The positions, one per row, metres, frame `map`.
            reach: The maximum distance of a position from the sensor, metres.
        """
        if self.are_blocked(eye[None]).any():
            return np.ones(len(points), bool)
        here = self._to_cells(eye)
        most = reach / self.resolution
        # At the maximum distance, the sector of each direction is half a cell wide.
        count = math.ceil(4 * math.pi * most)
        first_wall = np.full(count, np.inf)
        directions, distances = self._walls_around(here, most, count)
        np.minimum.at(first_wall, directions, distances)
        away = self._to_cells(points) - here
        towards = np.rint(np.arctan2(away[:, 1], away[:, 0]) * count / math.tau).astype(int) % count
        behind: npt.NDArray[np.bool_] = np.hypot(*away.T) > first_wall[towards]
        return behind | self.are_blocked(points)

    def _to_cells(self, points: Points) -> Points:
        """Convert positions (metres, frame `map`) to columns and rows of the map, which may be fractions."""
        x, y, yaw = self.origin
        right, up = points[..., 0] - x, points[..., 1] - y
        along, across = right * math.cos(yaw) + up * math.sin(yaw), up * math.cos(yaw) - right * math.sin(yaw)
        return np.stack([along, across], axis=-1) / self.resolution

    @cached_property
    def _walls(self) -> npt.NDArray[np.bool_]:
        """The walls: blocked cells next to a free cell. Other blocked cells can be ignored, because walls hide them."""
        around = np.pad(self.blocked, 1, constant_values=True)
        within = around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:]
        walls: npt.NDArray[np.bool_] = self.blocked & ~within
        return walls

    def _walls_around(
        self, here: Points, most: float, count: int
    ) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]:
        """Return the index of each direction in which there is a wall, and the distance of this wall in cells."""
        left, low = np.maximum(np.floor(here - most).astype(int), 0)
        right, high = np.maximum(np.ceil(here + most).astype(int), 0)
        rows, columns = np.nonzero(self._walls[low:high, left:right])
        x, y = columns + left + 0.5 - here[0], rows + low + 0.5 - here[1]
        distances, bearings = np.hypot(x, y), np.arctan2(y, x)
        # The shadow of a cell is as wide as the cell appears: a side if seen straight on, a diagonal if seen from a corner.
        half = np.arctan((abs(x) + abs(y)) / (2.0 * distances**2))
        first = np.ceil((bearings - half) * count / math.tau).astype(int)
        each = np.floor((bearings + half) * count / math.tau).astype(int) - first + 1
        begins = np.repeat(first - (each.cumsum() - each), each)
        return (begins + np.arange(len(begins))) % count, np.repeat(distances, each)


class CoverageRaster:
    """The coverage of each cell in the ground of a zone.

    Args:
        ground: The ground of a zone.
        obstacles: The map; None if there is no map, in which case nothing blocks sight.
        cells: The result of `share_text` of an earlier raster of the same ground; empty for coverage 0.

    Raises:
        ImportError: If shapely is not installed.
        ValueError: If `cells` is invalid, or belongs to a ground with another number of cells.
    """

    def __init__(self, ground: Ground, obstacles: ObstacleMap | None = None, cells: str = "") -> None:
        import shapely

        self.ground, self.obstacles = ground, obstacles
        corners = np.array(ground.polygon)
        low, high = corners.min(axis=0), corners.max(axis=0)
        self.cell_m = max(_CELL_M, math.sqrt(float(np.prod(high - low)) / _MAX_CELLS))
        axes = [np.arange(low[axis] + self.cell_m / 2, high[axis], self.cell_m) for axis in (0, 1)]
        everywhere = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        self._outline = shapely.Polygon(ground.polygon)
        self._inside = shapely.contains_xy(self._outline, everywhere)
        self._low, self._columns = low, len(axes[0])
        self.centres: Points = everywhere[self._inside]
        self.coverage = _read(cells, len(self.centres)) if cells else np.zeros(len(self.centres))

    @property
    def searchable(self) -> npt.NDArray[np.bool_]:
        """For each cell, whether it can be searched. A cell with an obstacle at its centre cannot be searched."""
        return (
            np.ones(len(self.centres), bool)
            if self.obstacles is None
            else ~self.obstacles.are_blocked(self.centres)
        )

    def drive(self, path: Sequence[tuple[float, float]]) -> float:
        """Add the coverage of a drive along a path of positions (metres, frame `map`).

        Returns:
            The distance driven inside the ground, metres.
        """
        inside = 0.0
        for start, end in itertools.pairwise(path):
            length = math.dist(start, end)
            steps = math.ceil(length / self.cell_m)
            for step in range(steps):
                share = (step + 0.5) / steps
                point = tuple(a + share * (b - a) for a, b in zip(start, end, strict=True))
                self._add_view(point[0], point[1], length / steps)
                inside += length / steps * self._contains(point)
        return inside

    def _contains(self, point: tuple[float, ...]) -> bool:
        import shapely

        return bool(shapely.contains_xy(self._outline, *point))

    def _add_view(self, x: float, y: float, metres: float) -> None:
        reach = self.ground.detection_range
        cells = self.seen_from(x, y, reach + self.cell_m / 2)
        distances = np.hypot(*(self.centres[cells] - (x, y)).T)
        # Weight cells at the border by the share within the range, so that the effort does not depend on the offset of the grid.
        within = np.clip((reach - distances) / self.cell_m + 0.5, 0.0, 1.0)
        self.coverage[cells] += within * self.ground.sweep_width * metres / (math.pi * reach**2)

    def seen_from(self, x: float, y: float, reach: float) -> npt.NDArray[np.intp]:
        """Return the indices of the cells whose centre is within reach of a position and visible from there.

        Args:
            x: The x coordinate of the position, metres, frame `map`.
            y: The y coordinate of the position, metres, frame `map`.
            reach: The maximum distance from the position to a cell's centre, metres.
        """
        eye = np.array((x, y))
        [near] = np.nonzero(np.hypot(*(self.centres - eye).T) <= reach)
        if self.obstacles is None or not len(near):
            return near
        return near[~self.obstacles.hides(eye, self.centres[near], reach)]

    def pod(self) -> float:
        """Return the probability, 0 to 1, that the drives so far would have detected a survivor in the ground."""
        found = 1.0 - np.exp(-self.coverage[self.searchable])
        return float(found.mean()) if len(found) else 0.0

    def mean_coverage(self) -> float:
        """Return the mean coverage C of the searchable cells in the ground."""
        searched = self.coverage[self.searchable]
        return float(searched.mean()) if len(searched) else 0.0

    def seen_share(self) -> float:
        """Return the share (0 to 1) of the searchable cells that the sensor has seen at least once."""
        seen = self.coverage[self.searchable] > 0.0
        return float(seen.mean()) if len(seen) else 0.0

    def area_m2(self) -> float:
        """Return the area A of the searchable ground, square metres."""
        return float(self.searchable.sum()) * self.cell_m**2

    def gaps(self, until_pod: float) -> list[Corners]:
        """Return the gaps: polygons around searchable cells with a POD below `until_pod`, the largest first.

        Corners are in the frame `map`, metres. A gap with a hole is cut into several polygons; gaps of a few cells are omitted.
        """
        import shapely

        missed = np.zeros(len(self._inside), np.int8)
        missed[self._inside] = self.searchable & (1.0 - np.exp(-self.coverage) < until_pod)
        # Adjacent cells of a row are joined to one box, because the union of single cells takes fifty times as long.
        edges = np.diff(missed.reshape(-1, self._columns), axis=1, prepend=0, append=0)
        (rows, begins), (_, ends) = np.nonzero(edges > 0), np.nonzero(edges < 0)
        x, y = self._low
        left, right, low = x + begins * self.cell_m, x + ends * self.cell_m, y + rows * self.cell_m
        joined = shapely.union_all(shapely.box(left, low, right, y + (rows + 1) * self.cell_m))
        parts = [part for part in _cut_holes(joined) if part.area > _MIN_CELLS * self.cell_m**2]
        parts.sort(key=lambda part: -part.area)
        return [tuple(map(tuple, part.exterior.simplify(0.0).coords[:-1])) for part in parts]

    def layer(self, name: str) -> RasterLayer:
        """Return the display layer with the POD of each cell."""
        pods = np.zeros(len(self._inside))
        pods[self._inside] = 1.0 - np.exp(-self.coverage)
        x, y = self._low.tolist()
        return RasterLayer.from_shares(
            name, "searched, POD", x, y, self.cell_m, pods.reshape(-1, self._columns).tolist()
        )

    def share_text(self) -> str:
        """Return the coverage of all cells, rounded to thousandths, as compressed text."""
        counted = np.minimum(np.rint(self.coverage / _STEP), _MAX_COUNT).astype("<u2")
        return base64.b64encode(zlib.compress(counted.tobytes(), 9)).decode("ascii")


def _cut_holes(shape: Any) -> Iterator[Any]:
    """Yield the polygons of a shape. A polygon with holes is split into polygons without holes."""
    import shapely

    for part in shapely.get_parts(shape):
        if shapely.get_type_id(part) != shapely.GeometryType.POLYGON:
            continue
        if not part.interiors:
            yield part
            continue
        left, low, right, high = part.bounds
        cut = part.interiors[0].centroid.x
        for half in (shapely.box(left, low, cut, high), shapely.box(cut, low, right, high)):
            yield from _cut_holes(part.intersection(half))


def _read(cells: str, count: int) -> npt.NDArray[np.float64]:
    try:
        inflater = zlib.decompressobj()
        data = inflater.decompress(base64.b64decode(cells, validate=True), 2 * count + 1)
    except (binascii.Error, ValueError, zlib.error) as error:
        raise ValueError(f"the text of the raster is invalid: {error}") from error
    if len(data) != 2 * count:
        raise ValueError(f"the raster belongs to another area: {count} cells were expected")
    return np.frombuffer(data, "<u2") * _STEP
