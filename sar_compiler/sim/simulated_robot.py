"""One robot of a simulation with all its nodes: its topics, its localiser, its navigator."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sar_compiler.ros.faults import Fault, NavigationFaults
from sar_compiler.sim.amcl import Amcl
from sar_compiler.sim.bt_navigator import BtNavigator
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.planner import Planner
from sar_compiler.sim.robot import Robot
from sar_compiler.sim.robot_interface import RobotInterface


@dataclass(frozen=True)
class NavigationSetup:
    """The data shared by all robots' stand-ins for Nav2.

    Attributes:
        occupancy: The map.
        planner: Plans the paths on it.
        zones: Zone positions, metres, frame `map`, for faults.
        faults: The faults of `navigate_to_pose`, the same for each robot.
    """

    occupancy: OccupancyMap
    planner: Planner
    zones: Mapping[str, tuple[float, float]]
    faults: Sequence[Fault]


class SimulatedRobot:
    """A robot with its node `rosbot` and, if there is a map, `amcl` and `bt_navigator`.

    Args:
        host: Creates the nodes, in the robot's namespace.
        robot: The robot.
        seed: Seed of its scanner's noise.
        navigation: The data of its stand-in for Nav2; None for no navigation.
        localised: Whether its localisation knows where it is without being told.
    """

    def __init__(
        self,
        host: NodeHost,
        robot: Robot,
        *,
        seed: int = 0,
        navigation: NavigationSetup | None = None,
        localised: bool = False,
    ) -> None:
        self._host, self._robot = host, robot
        self._interface = RobotInterface(host, robot, seed=seed)
        self._amcl: Amcl | None = None
        self._navigator: BtNavigator | None = None
        if navigation is not None:
            self._amcl = Amcl(host, robot, navigation.occupancy, localised=localised)
            self._navigator = BtNavigator(
                host,
                self._interface,
                navigation.planner,
                self._amcl.pose,
                zones=navigation.zones,
                faults=NavigationFaults(navigation.faults),
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

    def navigate(self, step: int, now_ns: int) -> None:
        """Localise, and continue with the current goal."""
        if self._amcl is not None:
            self._amcl.step(step, now_ns)
        if self._navigator is not None:
            self._navigator.step(step, now_ns)

    def stop(self) -> bool:
        """End the current goal; return whether there was one, whose client is still to be notified."""
        return self._navigator is not None and self._navigator.stop()

    def close(self) -> None:
        """Destroy the nodes."""
        if self._navigator is not None:
            self._navigator.close()
        self._host.destroy_all()
