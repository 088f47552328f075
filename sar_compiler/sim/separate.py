"""The stand-ins for Nav2 in processes of their own, each of which can die alone; the world is in another one, and has the clock."""

import time
from collections.abc import Callable, Sequence
from typing import Protocol

from rclpy.context import Context
from rosgraph_msgs.msg import Clock

from sar_compiler.ros.faults import NavigationFaults
from sar_compiler.sim.amcl import Amcl
from sar_compiler.sim.bt_navigator import ControllerServer
from sar_compiler.sim.manner import manner
from sar_compiler.sim.messages import NANOSECONDS
from sar_compiler.sim.node_host import NodeHost, PacedExecutor
from sar_compiler.sim.occupancy import OccupancyMap, read_map
from sar_compiler.sim.placement import AMCL, CONTROLLER, Placement, PlacementError
from sar_compiler.sim.planner import Planner
from sar_compiler.sim.remote_robot import RemoteRobot
from sar_compiler.sim.separate_navigator import SeparateNavigator
from sar_compiler.sim.simulation import STEP_NS
from sar_compiler.sim.world import World

# How often it is looked whether the process is to end, and how long the ends of goals have to reach their clients, seconds.
_TURN_SEC, _FAREWELL_SEC = 0.1, 0.05


class _StandIn(Protocol):
    """A stand-in of one robot."""

    def step(self, step: int, now_ns: int) -> None:
        """Do the work due at a simulated time, nanoseconds."""

    def stop(self) -> bool:
        """End the current goal; return whether there was one."""

    def close(self) -> None:
        """Destroy what is served."""


class _Localiser:
    """A localisation that begins when it has heard of its robot."""

    def __init__(
        self, host: NodeHost, robot: RemoteRobot, occupancy: OccupancyMap, *, localised: bool
    ) -> None:
        self._robot = robot
        self._make: Callable[[], Amcl] = lambda: Amcl(host, robot, occupancy, localised=localised)
        self._amcl: Amcl | None = None

    def step(self, step: int, now_ns: int) -> None:
        if self._amcl is None and self._robot.is_known:
            self._amcl = self._make()
        if self._amcl is not None:
            self._amcl.step(step, now_ns)

    def stop(self) -> bool:
        return False

    def close(self) -> None:
        pass


class SeparatePart:
    """One part of the stand-in for Nav2, for all robots of a world that another process simulates.

    Args:
        part: Which, one of `placement.PARTS` but the first.
        world: The world; its map is needed.
        robots: The robots in it.
        context: The nodes' context.
        interrupted: Returns whether the process is to end.

    Raises:
        PlacementError: If the world has no map.
    """

    def __init__(
        self,
        part: str,
        world: World,
        robots: Sequence[Placement],
        *,
        context: Context,
        interrupted: Callable[[], bool],
    ) -> None:
        if world.map_path is None:
            raise PlacementError(
                robots[0].name, f"has no {part} in the world '{world.name}', which has no map"
            )
        self._interrupted = interrupted
        self._executor = PacedExecutor(context=context, interrupted=interrupted)
        self._host = NodeHost(self._executor, context)
        self._host.create(f"{part}_clock").create_subscription(Clock, "/clock", self._on_clock, 10)
        occupancy = read_map(world.map_path)
        planner = Planner(occupancy, world.robot_radius)
        self._robots: list[RemoteRobot] = []
        self._parts: list[_StandIn] = []
        for placement in robots:
            host = NodeHost(self._executor, context, cli_args=placement.ros_arguments)
            robot = RemoteRobot(host, f"{part}_robot", knows_truth=part == AMCL)
            self._robots.append(robot)
            self._parts.append(_made(part, host, robot, occupancy, planner, placement))

    def run(self) -> None:
        """Serve until the process is to end; then end current goals."""
        while not self._interrupted():
            self._executor.serve_until(time.monotonic() + _TURN_SEC)
        if any([part.stop() for part in self._parts]):  # noqa: C419 - all have to stop
            self._executor.serve_until(time.monotonic() + _FAREWELL_SEC, to_the_end=True)
        for part in self._parts:
            part.close()

    def _on_clock(self, message: Clock) -> None:
        now_ns = message.clock.sec * NANOSECONDS + message.clock.nanosec
        for robot, part in zip(self._robots, self._parts, strict=True):
            robot.step(now_ns)
            part.step(now_ns // STEP_NS, now_ns)


def _made(
    part: str,
    host: NodeHost,
    robot: RemoteRobot,
    occupancy: OccupancyMap,
    planner: Planner,
    placement: Placement,
) -> _StandIn:
    if part == AMCL:
        return _Localiser(host, robot, occupancy, localised=placement.localised)
    if part == CONTROLLER:
        return ControllerServer(
            host,
            robot,
            planner,
            robot.place,
            lose_localisation=lambda _: None,
            places={},
            faults=NavigationFaults(),
            manner=manner(placement.like),
        )
    return SeparateNavigator(host, robot, manner(placement.like))
