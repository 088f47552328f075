"""The look at a mission's way before the flight, `sar-run --check`: which places the robot can reach, and how far it is."""

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from nav_msgs.msg import OccupancyGrid
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node

from sar_compiler.missions.mission import MissionRun
from sar_compiler.ros.leaves.leaf import qos_profile
from sar_compiler.ros.parameter_reader import RunParameters

if TYPE_CHECKING:
    from sar_compiler.sim.occupancy import OccupancyMap
    from sar_compiler.sim.planner import Leg
    from sar_compiler.sim.world import World

_MAP = "map"
# How long a map that somebody publishes may take to come, once everything else is there.
_MAP_DEADLINE_SEC = 5.0
_TURN_SEC = 0.05


class RouteReport:
    """What is to be said of a mission's way.

    Args:
        mission: The mission.
        parameters: The parameters of the run.
        occupancy: The map.

    Attributes:
        lines: The way with its distances and times, one line each; empty for a mission that drives nowhere.
        problems: What is wrong with it, in sentences.
    """

    def __init__(self, mission: MissionRun, parameters: RunParameters, occupancy: "OccupancyMap") -> None:
        from sar_compiler.sim.planner import plan_route

        x, y, _ = parameters.initial_pose
        self._radius, self._speed = parameters.robot_radius_m, parameters.cruise_speed_mps
        stops = mission.route()
        legs = plan_route(occupancy, self._radius, (x, y), stops, mission.allows) if stops else []
        self.lines = self._table(legs) if legs else []
        self.problems = [
            f"{leg.name} ({leg.x:.2f}, {leg.y:.2f}): {leg.trouble}." for leg in legs if leg.trouble
        ]
        if legs and not mission.allows(x, y):
            self.problems.insert(0, f"The start ({x:.2f}, {y:.2f}) is outside the geofence.")
        limit, seconds = parameters.time_limit_sec, _distance(legs) / self._speed
        if limit is not None and seconds > limit:
            self.problems.append(
                f"Driving takes {seconds:.0f} s (estimated), and time_limit_sec is {limit:g}."
            )

    def _table(self, legs: "Sequence[Leg]") -> list[str]:
        width = max(len(leg.name) for leg in legs)
        rows = [(leg.name, leg.distance) for leg in legs] + [("total", _distance(legs))]
        title = f"The way on the map (estimated; robot radius {self._radius:g} m, {self._speed:g} m/s):"
        return [title, *(f"  {name:{width}}  {self._way(far)}" for name, far in rows)]

    def _way(self, far: float | None) -> str:
        return "not reached" if far is None else f"{far:6.1f} m {far / self._speed:6.0f} s"


class RouteCheck:
    """Looks at the way on the simulated world's map, or on the one that is published.

    Args:
        node: The mission's node; it listens to the map from now on.
        mission: The mission.
        parameters: The parameters of the run.
        world: The world that is simulated; None for an existing robot.
    """

    def __init__(
        self, node: Node, mission: MissionRun, parameters: RunParameters, world: "World | None"
    ) -> None:
        self._node, self._mission, self._parameters, self._world = node, mission, parameters, world
        self._grid: OccupancyGrid | None = None
        if world is None:
            latched = qos_profile(type(self).__name__, "transient_local")
            node.create_subscription(OccupancyGrid, _MAP, self._take, latched)

    def tell(self, executor: Executor, say: Callable[[str], object]) -> int:
        """Print the way, and on standard error what is wrong with it; return the number of problems.

        Args:
            executor: The executor of the node.
            say: Is called with the text for standard output.
        """
        occupancy = self._map(executor)
        if occupancy is None:
            topic = self._node.resolve_topic_name(_MAP)
            self._node.get_logger().warning(f"No map has come on {topic}, so the way was not looked at.")
            return 0
        report = RouteReport(self._mission, self._parameters, occupancy)
        if report.lines:
            say("\n".join(report.lines))
        for problem in report.problems:
            print(f"sar-run: {problem}", file=sys.stderr)
        return len(report.problems)

    def _take(self, grid: OccupancyGrid) -> None:
        self._grid = grid

    def _map(self, executor: Executor) -> "OccupancyMap | None":
        if self._world is not None:
            from sar_compiler.sim.occupancy import read_map

            return read_map(self._world.map_path) if self._world.map_path is not None else None
        deadline = time.monotonic() + _MAP_DEADLINE_SEC
        while self._grid is None and self._node.count_publishers(_MAP) and time.monotonic() < deadline:
            with suppress(ExternalShutdownException):
                executor.spin_once(timeout_sec=_TURN_SEC)
        if self._grid is None:
            return None
        from sar_compiler.sim.messages import from_grid

        return from_grid(self._grid)


def _distance(legs: "Sequence[Leg]") -> float:
    """Return the metres of all legs that can be driven."""
    return sum(leg.distance or 0.0 for leg in legs)
