"""Plan sweeps: compute stops for the search patterns of the IAMSAR manual (vol. II), and avoid obstacles."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal

from search_and_rescue.zone_manager import MapPose

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from search_and_rescue.coverage import ObstacleMap
    from search_and_rescue.search_theory import Corners

SweepPattern = Literal["parallel", "creeping_line", "expanding_square", "sector"]
"""The search patterns.

- `parallel`: legs along the long side of the ground.
- `creeping_line`: legs along the short side of the ground.
- `expanding_square`: a square spiral around the zone's pose.
- `sector`: three diameters through the zone's pose.
"""
MAX_PIECES = 2000
"""The maximum number of stops in a sweep."""
# Limits of the legs, map cells and stops that are computed, including those outside the ground. They bound time and memory.
_MAX_LEGS, _MAX_CELLS, _MAX_STOPS = 20_000, 16_000_000, 1_000_000
# Enlargement of cells that closes slivers between adjacent cells.
_ROUNDING_M = 1e-6
_Point = tuple[float, float]


class GroundError(ValueError):
    """The ground cannot be swept with the chosen pattern and spacing."""


def sweep(
    polygons: "Sequence[Corners]",
    pattern: SweepPattern,
    spacing: float,
    datum: MapPose,
    obstacles: "ObstacleMap | None" = None,
    clearance: float = 0.0,
) -> list[MapPose]:
    """Return the poses at which the robot stops in a sweep, in order.

    Args:
        polygons: The polygons of the ground, metres, frame `map`.
        pattern: The search pattern.
        spacing: Maximum distance between adjacent legs, and between the stops on a leg, metres.
        datum: The centre of the patterns `expanding_square` and `sector`. Legs start with the end that is nearest to this pose.
        obstacles: The map; None without a map.
        clearance: Minimum distance of stops from obstacles, metres.

    Raises:
        ImportError: If shapely is not installed.
        GroundError: If every stop is blocked, or the sweep is too large.
    """
    import shapely

    ground = shapely.union_all([shapely.Polygon(corners) for corners in polygons])
    if ground.area / spacing**2 > MAX_PIECES:
        raise GroundError(
            f"{ground.area:.0f} m² with a spacing of {spacing:.2f} m need more than {MAX_PIECES} stops: divide the zone"
        )
    here = (datum["x"], datum["y"])
    cell_m = obstacles.resolution if obstacles is not None else math.inf
    _require_small(ground, spacing, here, pattern, cell_m)
    free = ground if obstacles is None else ground.difference(_blocked_ground(ground, obstacles, clearance))
    if pattern in ("parallel", "creeping_line"):
        stops = _along_legs(free, spacing, here, along_long_side=pattern == "parallel")
    else:
        reach = shapely.hausdorff_distance(shapely.Point(here), ground)
        path = _square(spacing, reach) if pattern == "expanding_square" else _sectors(spacing, reach)
        stops = [(here[0] + x, here[1] + y) for x, y in path]
        stops = [stop for stop in stops if shapely.intersects_xy(free, *stop)]
    if not stops:
        raise GroundError("every stop is blocked, unknown or off the map")
    return _poses_towards_next(stops)


def _require_small(
    ground: "BaseGeometry", spacing: float, here: _Point, pattern: SweepPattern, cell_m: float
) -> None:
    """Check that the ground is not too large for the computation of a sweep.

    Raises:
        GroundError: If the ground has too many legs or map cells, or an expanding square would have too many stops.
    """
    import shapely

    left, low, right, high = ground.bounds
    wide, tall = right - left, high - low
    size = f"the ground spans {wide:.0f} x {tall:.0f} m"
    if math.hypot(wide, tall) / spacing > _MAX_LEGS:
        raise GroundError(
            f"{size}, which is too large for legs {spacing:.2f} m apart: divide the ground into smaller zones"
        )
    if wide * tall / cell_m**2 > _MAX_CELLS:
        raise GroundError(
            f"{size}, which has too many map cells of {cell_m:g} m: divide the ground into smaller zones"
        )
    reach = shapely.hausdorff_distance(shapely.Point(here), ground)
    if pattern == "expanding_square" and (2.0 * reach / spacing) ** 2 > _MAX_STOPS:
        raise GroundError(
            f"the ground extends {reach:.0f} m from the zone's pose: move the pose inside the ground, or divide the zone"
        )


def _blocked_ground(ground: "BaseGeometry", obstacles: "ObstacleMap", clearance: float) -> "BaseGeometry":
    """Return the area in which the robot is too close to a blocked cell: less than *clearance* away."""
    import numpy as np
    import shapely

    half, reach = obstacles.resolution / 2, clearance + obstacles.resolution
    left, low, right, high = ground.buffer(reach).bounds
    axes = (np.arange(left, right, 2 * half), np.arange(low, high, 2 * half))
    points = np.stack(np.meshgrid(*axes), axis=-1)
    rows, columns = np.nonzero(obstacles.are_blocked(points))
    boxes = [
        shapely.box(axes[0][first] - half, axes[1][row] - half, axes[0][last] + half, axes[1][row] + half)
        for row, first, last in _runs(rows.tolist(), columns.tolist())
    ]
    return shapely.union_all(boxes).buffer(clearance + _ROUNDING_M)


def _runs(rows: Sequence[int], columns: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """Yield each run of adjacent cells in a row, as the row, the first column and the last column."""
    cells = zip(rows, columns, strict=True)
    for _, run in itertools.groupby(enumerate(cells), lambda each: (each[1][0], each[1][1] - each[0])):
        (row, first), *rest = (cell for _, cell in run)
        yield row, first, rest[-1][1] if rest else first


def _along_legs(free: "BaseGeometry", spacing: float, here: _Point, *, along_long_side: bool) -> list[_Point]:
    """Return the stops on parallel legs over the free ground, in the order of the sweep."""
    import shapely

    if not free.area:
        return []
    angle = _long_side(free) + (0.0 if along_long_side else math.pi / 2)
    turned = shapely.affinity.rotate(free, -angle, origin=(0.0, 0.0), use_radians=True)
    parts = _legs(turned, spacing)
    # A separate part of the ground, such as a strip behind a wall, may be between two legs. Such a part gets legs of its own.
    apart = [piece for piece in shapely.get_parts(turned) if piece.area > (spacing / 2) ** 2]
    for piece in apart:
        if not any(shapely.intersects_xy(piece, *stop) for part in parts for stop in part):
            parts += _legs(piece, spacing)
    if len(parts) > MAX_PIECES:
        raise GroundError(
            f"obstacles cut the legs into {len(parts)} pieces, more than {MAX_PIECES}: divide the zone"
        )
    start = shapely.affinity.rotate(shapely.Point(here), -angle, origin=(0.0, 0.0), use_radians=True)
    path = shapely.MultiPoint(_nearest_first(parts, (start.x, start.y))) if parts else shapely.MultiPoint()
    back = shapely.affinity.rotate(path, angle, origin=(0.0, 0.0), use_radians=True)
    return [(point.x, point.y) for point in back.geoms]


def _legs(ground: "BaseGeometry", spacing: float) -> list[list[_Point]]:
    """Return the stops on legs parallel to the x axis, as one list for each uninterrupted part of a leg."""
    import shapely

    left, low, right, high = ground.bounds
    legs = math.ceil((high - low) / spacing)
    heights = [low + (leg + 0.5) * (high - low) / legs for leg in range(legs)]
    cuts = [shapely.LineString([(left, y), (right, y)]).intersection(ground) for y in heights]
    return [_stops(part, spacing) for cut in cuts for part in _lines(cut)]


def _long_side(free: "BaseGeometry") -> float:
    """Return the direction (radians) of the longer side of the smallest rectangle around a ground.

    If the rectangle is a square, the side closer to the x axis is used.
    """
    import shapely

    a, b, c = shapely.get_coordinates(free.minimum_rotated_rectangle)[:3].tolist()
    along, across = ((b[0] - a[0], b[1] - a[1]), (c[0] - b[0], c[1] - b[1]))
    if math.isclose(math.hypot(*along), math.hypot(*across), rel_tol=1e-6):
        return min(
            (math.atan2(y, x) % math.pi for x, y in (along, across)),
            key=lambda turn: min(turn, math.pi - turn),
        )
    x, y = max(along, across, key=lambda side: math.hypot(*side))
    return math.atan2(y, x) % math.pi


def _lines(cut: "BaseGeometry") -> "list[BaseGeometry]":
    return [part for part in getattr(cut, "geoms", [cut]) if part.length > 0.0]


def _stops(line: "BaseGeometry", spacing: float) -> list[_Point]:
    """Divide a line into equal parts that are not longer than the spacing, and return the centres."""
    count = max(1, math.ceil(line.length / spacing - 1e-9))
    points = [line.interpolate((at + 0.5) / count, normalized=True) for at in range(count)]
    return [(point.x, point.y) for point in points]


def _nearest_first(parts: Sequence[list[_Point]], here: _Point) -> list[_Point]:
    left, path = list(parts), list[_Point]()
    while left:
        end = path[-1] if path else here
        part, is_reversed = min(
            ((part, turned) for part in left for turned in (False, True)),
            key=lambda choice: math.dist(end, choice[0][-1 if choice[1] else 0]),
        )
        left.remove(part)
        path += part[::-1] if is_reversed else part
    return path


def _square(spacing: float, reach: float) -> Iterator[_Point]:
    """Yield the stops of an expanding square around (0, 0). With spacing S, the legs are S, S, 2 S, 2 S, … long."""
    x = y = 0.0
    yield x, y
    for leg in itertools.count():
        length = leg // 2 + 1
        if length * spacing > 2 * reach + spacing:
            return
        turn = leg * math.pi / 2
        for _ in range(length):
            x, y = x + spacing * round(math.cos(turn)), y + spacing * round(math.sin(turn))
            yield x, y


def _sectors(spacing: float, reach: float) -> Iterator[_Point]:
    """Yield the stops of a sector search around (0, 0). The path consists of three diameters."""
    count = max(1, math.ceil(reach / spacing))
    out, across = range(1, count + 1), [at for at in range(count, -count - 1, -1) if at]
    yield 0.0, 0.0
    for degrees, steps in ((0, out), (60, across), (300, across), (180, out[::-1])):
        turn = math.radians(degrees)
        for at in steps:
            distance = reach * at / count
            yield distance * math.cos(turn), distance * math.sin(turn)


def _poses_towards_next(stops: Sequence[_Point]) -> list[MapPose]:
    """Add directions to stops. Each pose faces the next stop; the last two poses have the same direction."""
    poses, yaw = list[MapPose](), 0.0
    for at, (x, y) in enumerate(stops):
        if at + 1 < len(stops):
            yaw = math.atan2(stops[at + 1][1] - y, stops[at + 1][0] - x)
        poses.append(MapPose(x=x, y=y, yaw=yaw))
    return poses
