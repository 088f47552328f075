"""Planning of paths and routes on the occupancy map."""

import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label, uniform_filter1d
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from sar_compiler.budget import Budget
from sar_compiler.errors import SarError
from sar_compiler.sim.follower import Path2D
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.occupancy import FREE, OccupancyMap
from sar_compiler.sim.world import Floats

# The cost of a cell into which the body just fits, relative to the cost of a cell far from obstacles.
_NEAR_COST = 8.0
# The distance over which the additional cost near an obstacle falls to 1/e, metres.
_FALL_OFF = 0.25
# A robot that touches a wall can start if its body fits at a position within this distance, metres.
_START_SLACK = 0.15
# The length of the path section over which positions are averaged to round corners, metres.
_SMOOTHING = 0.45
# The number of goals for which the paths from all cells are cached.
_CACHED_GOALS = 32
# The minimum size of a reported unreachable part, square metres. Smaller parts are room corners or floor behind furniture.
_MIN_REPORTED_M2 = 0.25
_TOUCHING = np.ones((3, 3), dtype=int)
# scipy's value for a node without a path.
_NO_PATH = -9999
_NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))


class NavCode(IntEnum):
    """The error codes of Nav2 that the substitute uses."""

    NONE = 0
    FAILED_TO_MAKE_PROGRESS = 105
    TF_ERROR = 202
    START_OUTSIDE_MAP = 203
    GOAL_OUTSIDE_MAP = 204
    START_OCCUPIED = 205
    GOAL_OCCUPIED = 206
    NO_VALID_PATH = 208


class PlanningError(SarError):
    """The planner has found no path.

    Attributes:
        code: Nav2's error code for the reason.
    """

    def __init__(self, code: NavCode, message: str) -> None:
        self.code = code
        super().__init__(message)


class Planner:
    """Plans paths for a round robot.

    All cells under the robot must be known to be free; unknown cells count as occupied.

    Args:
        occupancy: The map.
        robot_radius: The radius of the robot, metres.
    """

    def __init__(self, occupancy: OccupancyMap, robot_radius: float) -> None:
        self.occupancy = occupancy
        self._radius = robot_radius
        self.clearance = clearance(occupancy)
        # Half a cell is added, because the clearance is measured to the centre of the blocked cell.
        self.fits = self.clearance >= robot_radius + occupancy.resolution / 2
        near = np.exp(-(self.clearance - robot_radius) / _FALL_OFF)
        self._graph, self._node_of = _grid_graph(self.fits, 1.0 + (_NEAR_COST - 1.0) * near)
        self._cells = np.argwhere(self.fits)
        # The results are cached, because a comparison of locations requires many paths to each location.
        self._next_nodes_to = lru_cache(_CACHED_GOALS)(partial(_next_nodes, self._graph))

    def plan(self, start: Pose2D, goal: Pose2D, tolerance: float = 0.0) -> Path2D:
        """Plan a path between two positions in the frame `map`.

        Args:
            start: The start.
            goal: The goal.
            tolerance: The maximum distance between an occupied goal and the end of the path, metres. If there is no free position within
                    this distance, the error is `NO_VALID_PATH` instead of `GOAL_OCCUPIED`, as with Nav2's planner.

        Raises:
            PlanningError: If there is no path; the error's code is the reason.
        """
        goal = self._nearest_free(goal, tolerance) if tolerance else goal
        goal_node = self._goal_node(goal)
        start_node = self._start_node(start)
        next_to_goal = self._next_nodes_to(goal_node)
        if start_node != goal_node and next_to_goal[start_node] == _NO_PATH:
            message = f"no path leads from ({start.x:.2f}, {start.y:.2f}) to ({goal.x:.2f}, {goal.y:.2f})"
            raise PlanningError(NavCode.NO_VALID_PATH, message)
        nodes = [start_node]
        while nodes[-1] != goal_node:
            nodes.append(int(next_to_goal[nodes[-1]]))
        cells = self._cells[nodes]
        return Path2D(self._smooth(self.occupancy.centre_of(cells[:, 0], cells[:, 1]), goal))

    def ground_from(self, start: Pose2D) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which cells are free, and which cells the robot's body can cover from a start position.

        Raises:
            PlanningError: If the robot cannot start at the position.
        """
        parts, _ = label(self.fits, structure=_TOUCHING)
        reached = parts == parts[tuple(self._cells[self._start_node(start)])]
        # One cell is added, because a body does not consist of whole cells.
        near = distance_transform_edt(~reached) * self.occupancy.resolution
        return self.occupancy.cells == FREE, near <= self._radius + self.occupancy.resolution

    def _nearest_free(self, goal: Pose2D, tolerance: float) -> Pose2D:
        """Return the position nearest to a goal where the robot fits, within a maximum distance in metres."""
        cell = self.occupancy.cell_at(goal.x, goal.y)
        if cell is None or self.fits[cell]:
            return goal
        node = self._nearest_node(goal, tolerance)
        if node is None:
            message = f"no position within {tolerance:g} m of the goal ({goal.x:.2f}, {goal.y:.2f}) is free"
            raise PlanningError(NavCode.NO_VALID_PATH, message)
        ((x, y),) = self.occupancy.centre_of(*self._cells[[node]].T)
        return Pose2D(float(x), float(y), goal.yaw)

    def _goal_node(self, goal: Pose2D) -> int:
        cell = self.occupancy.cell_at(goal.x, goal.y)
        if cell is None:
            message = f"the goal ({goal.x:.2f}, {goal.y:.2f}) is outside the map"
            raise PlanningError(NavCode.GOAL_OUTSIDE_MAP, message)
        if not self.fits[cell]:
            message = (
                f"there is not enough free ground for the robot at the goal ({goal.x:.2f}, {goal.y:.2f})"
            )
            raise PlanningError(NavCode.GOAL_OCCUPIED, message)
        return int(self._node_of[cell])

    def _start_node(self, start: Pose2D) -> int:
        cell = self.occupancy.cell_at(start.x, start.y)
        if cell is None:
            message = f"the robot at ({start.x:.2f}, {start.y:.2f}) is outside the map"
            raise PlanningError(NavCode.START_OUTSIDE_MAP, message)
        if self.fits[cell]:
            return int(self._node_of[cell])
        node = self._nearest_node(start, _START_SLACK)
        if node is None:
            message = f"there is not enough free ground for the robot at its position ({start.x:.2f}, {start.y:.2f})"
            raise PlanningError(NavCode.START_OCCUPIED, message)
        return node

    def _nearest_node(self, place: Pose2D, within: float) -> int | None:
        """Return the node of the nearest cell at which the robot fits, or None if no such cell is near enough.

        The maximum distance of the cell is *within*, in metres.
        """
        centres = self.occupancy.centre_of(self._cells[:, 0], self._cells[:, 1])
        distance = np.hypot(centres[:, 0] - place.x, centres[:, 1] - place.y)
        return None if np.min(distance, initial=math.inf) > within else int(np.argmin(distance))

    def _smooth(self, points: Floats, goal: Pose2D) -> Floats:
        """Round the corners of a path if the clearance allows it."""
        width = 2 * round(_SMOOTHING / self.occupancy.resolution / 2) + 1
        smooth = uniform_filter1d(points, width, axis=0, mode="nearest")
        cells = [self.occupancy.cell_at(float(x), float(y)) for x, y in smooth]
        if all(cell is not None and self.fits[cell] for cell in cells):
            points = smooth
        points[-1] = goal.x, goal.y
        return points


def clearance(occupancy: OccupancyMap) -> Floats:
    """Return the distance in metres from each cell's centre to the nearest cell that is not known to be free.

    The area outside the map counts as unknown. The array has the shape of the map's cells.
    """
    free = np.pad(occupancy.cells == FREE, 1)
    distance: Floats = distance_transform_edt(free)[1:-1, 1:-1] * occupancy.resolution
    return distance


def _next_nodes(graph: csr_array, goal: int) -> NDArray[np.int32]:
    """Return, for each node, the next node on the path to a goal.

    The result is `_NO_PATH` for the goal itself and for nodes from which no path leads to the goal.
    """
    # The costs of the paths are not stored, because they would need twice as much memory.
    following: NDArray[np.int32] = dijkstra(graph, indices=goal, return_predecessors=True)[1]
    return following


def _grid_graph(passable: NDArray[np.bool_], cost: Floats) -> tuple[csr_array, NDArray[np.int32]]:
    """Return the graph that connects each passable cell to its passable neighbours (at most eight).

    Args:
        passable: Whether each cell is passable, shape (height, width).
        cost: The cost of each cell for a distance of one cell edge, same shape.

    Returns:
        The adjacency matrix with costs in cell edges, and the node number of each cell, -1 for impassable cells.
    """
    node_of = np.full(passable.shape, -1, dtype=np.int32)
    node_of[passable] = np.arange(np.count_nonzero(passable), dtype=np.int32)
    height, width = passable.shape
    tails, heads, prices = [], [], []
    for down, right in _NEIGHBOURS:
        near = np.s_[: height - down, max(0, -right) : width - max(0, right)]
        far = np.s_[down:, max(0, right) : width - max(0, -right)]
        both = passable[near] & passable[far]
        tails.append(node_of[near][both])
        heads.append(node_of[far][both])
        prices.append(math.hypot(down, right) * (cost[near][both] + cost[far][both]) / 2)
    tail, head, price = np.concatenate(tails), np.concatenate(heads), np.concatenate(prices)
    count = int(node_of.max()) + 1
    pairs = (np.concatenate((tail, head)), np.concatenate((head, tail)))
    return coo_array((np.concatenate((price, price)), pairs), shape=(count, count)).tocsr(), node_of


_PROBLEMS = {
    NavCode.START_OUTSIDE_MAP: "the robot's start is outside the map",
    NavCode.START_OCCUPIED: "there is not enough free ground for the robot at its start",
    NavCode.GOAL_OUTSIDE_MAP: "the position is outside the map",
    NavCode.GOAL_OCCUPIED: "there is not enough free ground for the robot at this position",
    NavCode.NO_VALID_PATH: "no path leads to this position",
}


class RouteLeg(NamedTuple):
    """The path to a stop of a route.

    Attributes:
        name: The name of the stop.
        x: Position of the stop in the frame `map`, metres.
        y: Position of the stop in the frame `map`, metres.
        distance: The length of the path from the previous reachable stop, metres; None if the stop is unreachable.
        trouble: The problem with the path; empty if there is none.
    """

    name: str
    x: float
    y: float
    distance: float | None
    trouble: str = ""


class ReachableArea(NamedTuple):
    """The reachable part of an area.

    Attributes:
        area_m2: The size of the area, square metres.
        reached_m2: The size of the reachable part: the free cells that the robot's body can cover, square metres.
        cut_off_m2: The size of the parts that are free but unreachable, square metres. Negligible parts are ignored.
        cut_off_at: A position in the largest unreachable part: x and y in metres, frame `map`; None if there is none.
        off_map_m2: The size of the part outside the map, square metres.
    """

    area_m2: float
    reached_m2: float
    cut_off_m2: float = 0.0
    cut_off_at: tuple[float, float] | None = None
    off_map_m2: float = 0.0


def reachable_areas(
    planner: Planner, start: tuple[float, float], outlines: Sequence[Sequence[tuple[float, float]]]
) -> list[ReachableArea]:
    """Return the reachable part of each area.

    Args:
        planner: The planner, with the map and the robot's size.
        start: The robot's start: x and y in metres, frame `map`.
        outlines: The corners of each area, metres, frame `map`.

    Raises:
        ImportError: If shapely is not installed.
        PlanningError: If the robot cannot start at *start*.
    """
    import shapely

    free, covered = planner.ground_from(Pose2D(*start))
    rows, columns = np.indices(free.shape)
    occupancy = planner.occupancy
    centres = occupancy.centre_of(rows.ravel(), columns.ravel())
    cell_m2 = occupancy.resolution**2
    height, width = (cells * occupancy.resolution for cells in free.shape)
    x, y = occupancy.origin_x, occupancy.origin_y
    whole = shapely.box(x, y, x + width, y + height)
    found = []
    for corners in outlines:
        outline = shapely.Polygon(corners)
        inside = free & shapely.contains_xy(outline, centres).reshape(free.shape)
        parts, count = label(inside & ~covered, structure=_TOUCHING)
        sizes = np.bincount(parts.ravel(), minlength=count + 1)[1:] * cell_m2
        reported = sizes[sizes >= _MIN_REPORTED_M2]
        at = _innermost_position(parts == 1 + int(sizes.argmax()), occupancy) if len(reported) else None
        reached = float(np.count_nonzero(inside & covered)) * cell_m2
        off_map = float(outline.difference(whole).area)
        found.append(ReachableArea(outline.area, reached, float(reported.sum()), at, off_map))
    return found


def _innermost_position(part: NDArray[np.bool_], occupancy: OccupancyMap) -> tuple[float, float]:
    """Return the position that is inside a part of the map and farthest from the edge of this part.

    The result is x and y in metres, frame `map`.
    """
    depth = distance_transform_edt(np.pad(part, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(int(depth.argmax()), depth.shape)
    ((x, y),) = occupancy.centre_of(np.array([row]), np.array([column]))
    return float(x), float(y)


def plan_route(
    planner: Planner,
    start: tuple[float, float],
    stops: Sequence[tuple[str, float, float]],
    allowed: Callable[[float, float], bool] = lambda _x, _y: True,
    budget: Budget | None = None,
) -> list[RouteLeg]:
    """Plan a route from stop to stop within a budget, and skip unreachable stops.

    Args:
        planner: The planner, with the map and the robot's size.
        start: The robot's start: x and y in metres, frame `map`.
        stops: The names and positions of the stops, in order.
        allowed: Returns whether the robot may be at a position.
        budget: The budget for the whole route.
    """
    here, legs, budget = Pose2D(*start), [], budget or Budget()
    for name, x, y in stops:
        if budget.is_spent():
            break
        there = Pose2D(x, y)
        try:
            path = planner.plan(here, there)
        except PlanningError as error:
            legs.append(RouteLeg(name, x, y, None, _PROBLEMS[error.code]))
            continue
        if not allowed(x, y):
            legs.append(RouteLeg(name, x, y, None, "the position is outside the geofence"))
            continue
        steps = np.hypot(*np.diff(np.vstack(([here.x, here.y], path.points)), axis=0).T)
        legs.append(RouteLeg(name, x, y, float(steps.sum()), _geofence_problem(path.points, allowed)))
        here = there
    return legs


def _geofence_problem(points: Floats, allowed: Callable[[float, float], bool]) -> str:
    """Return a message if a path leaves the allowed area; otherwise an empty string."""
    inside = all(allowed(float(x), float(y)) for x, y in points)
    return "" if inside else "the path to this position leaves the geofence"
