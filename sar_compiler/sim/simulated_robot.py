"""One robot of a simulation with all its nodes: its topics, its localiser, its navigator."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sar_compiler.ros.faults import Fault, NavigationFaults
from sar_compiler.sim.amcl import Amcl
from sar_compiler.sim.bt_navigator import BtNavigator
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.manner import manner
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.placement import Placement
from sar_compiler.sim.planner import Planner
from sar_compiler.sim.remote_robot import TruePlaces
from sar_compiler.sim.robot import Robot
from sar_compiler.sim.robot_interface import RobotInterface

_ALONE = Placement("")


@dataclass(frozen=True)
class NavigationSetup:
    """The data shared by all robots' stand-ins for Nav2.

    Attributes:
        occupancy: The map.
        planner: Plans the paths on it.
        places: Positions of places, metres, frame `map`, for faults.
        faults: The faults of navigation, the same for each robot.
    """

    occupancy: OccupancyMap
    planner: Planner
    places: Mapping[str, tuple[float, float]]
    faults: Sequence[Fault]


class SimulatedRobot:
    """A robot with its node `rosbot` and, if there is a map, `amcl` and `bt_navigator`.

    Args:
        host: Creates the nodes, in the robot's namespace.
        robot: The robot.
        seed: Seed of its scanner's noise.
        navigation: The data of its stand-in for Nav2; None for no navigation.
        placement: What is said of its localisation and its drives.
    """

    def __init__(
        self,
        host: NodeHost,
        robot: Robot,
        *,
        seed: int = 0,
        navigation: NavigationSetup | None = None,
        placement: Placement = _ALONE,
    ) -> None:
        self._host, self._robot = host, robot
        self._interface = RobotInterface(host, robot, seed=seed)
        self._places = TruePlaces(host, robot) if placement.separate else None
        self._amcl: Amcl | None = None
        self._navigator: BtNavigator | None = None
        self._navigation, self._amcl_back_at = navigation, math.inf
        if navigation is not None and not placement.separate:
            self._amcl = Amcl(host, robot, navigation.occupancy, localised=placement.localised)
            self._navigator = BtNavigator(
                host,
                self._interface,
                navigation.planner,
                lambda: None if self._amcl is None else self._amcl.pose(),
                lose_localisation=self._lose_localisation,
                places=navigation.places,
                faults=NavigationFaults(navigation.faults),
                manner=manner(placement.like),
            )

    @property
    def pose(self) -> Pose2D:
        """The true pose, frame `map`."""
        return self._robot.state.pose

    @property
    def place(self) -> tuple[Pose2D, Pose2D]:
        """The true pose, frame `map`, and that by the odometry."""
        return self._robot.state.pose, self._robot.state.odometry

    def move(self, duration: float) -> None:
        """Move for *duration* seconds."""
        self._robot.step(duration)

    def sense(self, step: int, now_ns: int) -> None:
        """Publish the sensor data at the end of step number *step*, at *now_ns* nanoseconds."""
        self._interface.publish(step, now_ns)
        if self._places is not None:
            self._places.publish(now_ns)

    def navigate(self, step: int, now_ns: int) -> None:
        """Localise, and continue with the current goal."""
        if self._navigation is not None and now_ns / 1e9 >= self._amcl_back_at:
            self._amcl_back_at = math.inf
            self._amcl = Amcl(self._host, self._robot, self._navigation.occupancy)
        if self._amcl is not None:
            self._amcl.step(step, now_ns)
        if self._navigator is not None:
            self._navigator.step(step, now_ns)

    def stop(self) -> bool:
        """End the current goal; return whether there was one, whose client is still to be notified."""
        return self._navigator is not None and self._navigator.stop()

    def _lose_localisation(self, until: float | None) -> None:
        if self._amcl is not None:
            self._amcl.die()
            self._amcl = None
        self._amcl_back_at = math.inf if until is None else until

    def close(self) -> None:
        """Destroy the nodes."""
        if self._navigator is not None:
            self._navigator.close()
        self._host.destroy_all()
