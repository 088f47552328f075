"""The simulated world: world files, obstacles, and collision checks."""

import copy
import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sar_compiler import resources
from sar_compiler.checks.configuration import path_inside
from sar_compiler.documents.yaml_files import read_yaml
from sar_compiler.errors import SarError
from sar_compiler.opener import WORLD, is_there
from sar_compiler.sim.battery import BatteryKind
from sar_compiler.sim.geometry import Box, Cylinder, Pose2D
from sar_compiler.tree.diagnostic import Diagnostic

Floats = NDArray[np.float64]

# The distance below which a moving disc is in contact, metres: far below relevant distances, and far above rounding errors.
_TOUCH = 1e-6
_GRAIN = 1e-12
# The maximum number of passes of `free_travel`, which converges like Newton's method in a few passes; more passes count as contact.
_MAX_MARCH = 64


@dataclass(frozen=True)
class World:
    """The static objects of a world, and the robot's start pose, in metres and radians in the frame `map`.

    Attributes:
        name: The world's name in messages.
        start: The robot's pose at time zero.
        robot_radius: The radius of the robot's body.
        boxes: Walls and debris.
        cylinders: Round debris.
        places: The positions of marked locations, by their IDs; robots do not collide with the markers.
        survey: The waypoints of the route for mapping the world; empty if the world has no survey route.
        battery: The properties of the robots' batteries.
        map_path: The description (`.yaml`) of the world's occupancy map; None if the world has no map.
        warnings: Findings about the world file that do not prevent its use.
    """

    name: str
    start: Pose2D
    robot_radius: float
    boxes: tuple[Box, ...] = ()
    cylinders: tuple[Cylinder, ...] = ()
    places: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    survey: tuple[tuple[float, float], ...] = ()
    map_path: Path | None = None
    battery: BatteryKind = field(default_factory=BatteryKind)
    warnings: tuple[Diagnostic, ...] = ()

    @functools.cached_property
    def obstacle_arrays(self) -> "Solid":
        """The obstacles as arrays."""
        return Solid(self.boxes, self.cylinders)


class Solid:
    """The obstacles of a world. All obstacles are convex, so that the motion test is exact."""

    def __init__(self, boxes: Sequence[Box], cylinders: Sequence[Cylinder]) -> None:
        self._centre = np.array([(b.x, b.y) for b in boxes], dtype=np.float64).reshape(-1, 2)
        self._half = np.array([(b.size_x / 2, b.size_y / 2) for b in boxes], dtype=np.float64).reshape(-1, 2)
        self._cos = np.array([math.cos(b.yaw) for b in boxes], dtype=np.float64)
        self._sin = np.array([math.sin(b.yaw) for b in boxes], dtype=np.float64)
        self.discs = _discs(cylinders)
        self.segments = _segments(boxes)

    def with_cylinders(self, cylinders: Iterable[Cylinder]) -> "Solid":
        """Return a copy of these obstacles with further cylinders."""
        more = copy.copy(self)
        more.discs = np.concatenate((self.discs, _discs(cylinders)))
        return more

    def offsets(self, x: float, y: float) -> tuple[Floats, Floats]:
        """Return, for every obstacle, the vector from its nearest point to (x, y), metres.

        Returns:
            Unit vectors, shape (n, 2), and distances, shape (n,). Both are zero if the point is inside the obstacle.
        """
        away_x, away_y = x - self._centre[:, 0], y - self._centre[:, 1]
        own_x = self._cos * away_x + self._sin * away_y
        own_y = self._cos * away_y - self._sin * away_x
        own_x = own_x - np.clip(own_x, -self._half[:, 0], self._half[:, 0])
        own_y = own_y - np.clip(own_y, -self._half[:, 1], self._half[:, 1])
        disc = np.array([x, y]) - self.discs[:, :2]
        length = np.hypot(disc[:, 0], disc[:, 1])
        outside = np.maximum(length - self.discs[:, 2], 0.0)
        disc *= (outside / np.where(length > 0.0, length, 1.0))[:, None]
        vector = np.empty((len(own_x) + len(disc), 2))
        vector[: len(own_x), 0] = self._cos * own_x - self._sin * own_y
        vector[: len(own_x), 1] = self._sin * own_x + self._cos * own_y
        vector[len(own_x) :] = disc
        distance = np.hypot(vector[:, 0], vector[:, 1])
        return vector / np.where(distance > 0.0, distance, 1.0)[:, None], distance

    def clearance(self, x: float, y: float) -> float:
        """Return the distance in metres from (x, y) to the nearest obstacle: 0 inside an obstacle, inf without obstacles."""
        return float(np.min(self.offsets(x, y)[1], initial=math.inf))

    def free_travel(self, start: tuple[float, float], heading: float, length: float, radius: float) -> float:
        """Return the distance that a disc can move along a straight line before it touches an obstacle.

        The distance to a convex shape is a convex function of the position on a line. So this distance never decreases faster than at the
        beginning. The disc can therefore safely move until it would reach the nearest obstacle at that rate. No obstacle can be skipped,
        even on a long line.

        Args:
            start: The disc's centre at the start, metres. The disc must not touch an obstacle there.
            heading: Direction of the line, radians.
            length: The length of the line, metres, not negative.
            radius: The disc's radius, metres.

        Returns:
            Metres, at most *length*.
        """
        along_x, along_y = math.cos(heading), math.sin(heading)
        gone = 0.0
        for _ in range(_MAX_MARCH):
            normal, distance = self.offsets(start[0] + gone * along_x, start[1] + gone * along_y)
            nearing = -(normal[:, 0] * along_x + normal[:, 1] * along_y)
            gap = distance - radius
            # Rounding errors make a slide along a wall a very flat approach to the wall, so a tiny part of the gap stays unused.
            spare = np.where(gap > _TOUCH / 2, np.maximum(gap - _TOUCH, _GRAIN), 0.0)
            ahead = nearing > 0.0
            with np.errstate(over="ignore"):
                safe = float(np.min(spare[ahead] / nearing[ahead], initial=math.inf))
            if safe >= length - gone:
                return length
            if safe <= _TOUCH:
                return gone
            gone += safe
        return gone


def _discs(cylinders: Iterable[Cylinder]) -> Floats:
    """Convert cylinders to rows (x, y, radius), metres."""
    return np.array([(c.x, c.y, c.radius) for c in cylinders], dtype=np.float64).reshape(-1, 3)


def _segments(boxes: Sequence[Box]) -> Floats:
    """Convert boxes to their edges as rows (x, y, dx, dy), metres."""
    edges = [
        (ax, ay, bx - ax, by - ay)
        for corners in (box.corners() for box in boxes)
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    return np.array(edges, dtype=np.float64).reshape(-1, 4)


_EMPTY_HINT = "for example robot: {x: 0, y: 0, radius: 0.22}, and walls: with a list of rectangles"


class WorldError(SarError):
    """The world does not exist."""


def find_world(name: str) -> World:
    """Load a world by its name or path.

    Args:
        name: The path of a world file, or the name of a shipped world, such as `disaster_zone`.

    Raises:
        WorldError: If the file does not exist.
        TreeError: If the file has errors, or the robot starts inside an obstacle; the error contains all findings.
    """
    path = resources.find("worlds", name, ".yaml")
    if not is_there(path):
        raise WorldError(resources.not_found_message("worlds", name, ".yaml"))
    return load_world(path)


def load_world(path: Path) -> World:
    """Read a world file.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        TreeError: If the file has errors, or the robot starts inside an obstacle; the error contains all findings.
    """
    document = read_yaml(path, WORLD, _EMPTY_HINT)
    data = document.validate("world").data
    map_path = (
        path_inside(document, path.parent, document.root.mapping["map"], "map") if "map" in data else None
    )
    document.raise_findings()
    robot, debris = data["robot"], data.get("debris", ())
    world = World(
        name=path.stem,
        start=Pose2D(robot["x"], robot["y"], robot.get("yaw", 0.0)),
        robot_radius=robot["radius"],
        boxes=tuple(
            Box(**_sizes(each)) for each in (*data["walls"], *debris) if each.get("shape") != "cylinder"
        ),
        cylinders=tuple(Cylinder(**_sizes(each)) for each in debris if each["shape"] == "cylinder"),
        places=MappingProxyType(
            {name: (point["x"], point["y"]) for name, point in data.get("zones", {}).items()}
        ),
        survey=tuple((point["x"], point["y"]) for point in data.get("survey", ())),
        map_path=map_path,
        battery=_battery(data.get("battery", {})),
        warnings=document.warnings,
    )
    if world.obstacle_arrays.clearance(world.start.x, world.start.y) <= world.robot_radius:
        message = "the robot would start inside an obstacle"
        document.report("wrong-value", message, document.root.name_at(("robot",)))
    document.raise_findings()
    return world


def _sizes(obstacle: Mapping[str, Any]) -> dict[str, float]:
    return {name: size for name, size in obstacle.items() if name != "shape"}


@dataclass(frozen=True)
class Lidar:
    """A scanner at the robot's centre with a field of view of 360 degrees.

    Attributes:
        beams: The number of rays in a full turn; the first ray points backward (-pi), and the angles of the others increase.
        range_min: The minimum distance that the scanner measures, metres.
        range_max: The maximum distance that the scanner measures, metres.
        noise: The standard deviation of a range, metres.
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
        """Return the ranges measured at *pose* (frame `map`), metres, shape (beams,); inf if no obstacle is in range."""
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
        The distances, metres, shape (n,); inf for rays that hit no obstacle.
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


def _battery(data: Mapping[str, Any]) -> BatteryKind:
    places = tuple((point["x"], point["y"]) for point in data.get("places", ()))
    return BatteryKind(**{**data, "places": places})
