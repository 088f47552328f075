"""The complete simulator on ROS 2: the world, the robots with their Nav2 substitutes, and the clock."""

import itertools
import logging
import math
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from rclpy.clock import JumpHandle, JumpThreshold, ROSClock
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.utilities import get_default_context
from rosgraph_msgs.msg import Clock

from sar_compiler.errors import SarError
from sar_compiler.missions.faults import FaultPlan
from sar_compiler.sim.amcl import Amcl
from sar_compiler.sim.battery import Battery, BatteryKind
from sar_compiler.sim.bt_navigator import BtNavigator, NavigationSetup
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.isolation import require_no_rival_servers
from sar_compiler.sim.messages import to_stamp
from sar_compiler.sim.navigator import manner
from sar_compiler.sim.node_host import NodeHost, PacedExecutor, SteppedExecutor
from sar_compiler.sim.occupancy import read_map
from sar_compiler.sim.placement import Placement, PlacementError, PoseFile
from sar_compiler.sim.planner import Planner
from sar_compiler.sim.robot import Robot
from sar_compiler.sim.robot_interface import RobotInterface
from sar_compiler.sim.world import World

if TYPE_CHECKING:
    from typing_extensions import Self


def check_placements(world: World, placements: Sequence[Placement]) -> None:
    """Check that robots can start at their placements.

    Raises:
        PlacementError: If two robots have the same name, or if a robot would start in contact with an obstacle or another
            robot, or outside the world's map.
        SarError: If the world's map cannot be read.
    """
    for name, count in Counter(placement.name for placement in placements).items():
        if count > 1:
            problem = (
                f"{count} robots have this name. Give each robot a unique name, which is also its namespace"
            )
            raise PlacementError(name, problem)
    radius = world.robot_radius
    starts = [(placement.name, placement.start or world.start) for placement in placements]
    for name, start in starts:
        if not world.obstacle_arrays.clearance(start.x, start.y) > radius:
            problem = (
                f"would start in contact with an obstacle at {_position_text(start)}. "
                f"Choose a position with more than {radius:g} m to the nearest obstacle"
            )
            raise PlacementError(name, problem)
        # The localisation would reject a pose outside the map.
        if world.map_path is not None and read_map(world.map_path).cell_at(start.x, start.y) is None:
            problem = f"would start at {_position_text(start)}, which is outside the world's map (metres, frame map)"
            raise PlacementError(name, problem)
    for (one, here), (other, there) in itertools.combinations(starts, 2):
        if not here.distance_to(there) > 2 * radius:
            problem = (
                f"would start at {_position_text(there)}, in contact with robot '{one}' at {_position_text(here)}. "
                f"Write {other}:X,Y with a position more than {2 * radius:g} m away"
            )
            raise PlacementError(other, problem)


def make_robots(world: World, placements: Sequence[Placement], *, seed: int = 0) -> list[Robot]:
    """Create the robots of a world in the order of their steps. Each robot is an obstacle for the others.

    Raises:
        PlacementError: If the robots cannot start at their placements.
    """
    check_placements(world, placements)
    robots = [
        Robot(world, start=placement.start, odometry=placement.odometry, seed=seed_of(seed, number))
        for number, placement in enumerate(placements)
    ]
    for robot in robots:
        robot.add_robots(other for other in robots if other is not robot)
    return robots


def seed_of(seed: int, number: int) -> int:
    """Return the noise seed of the robot with the given number. Robot 0 has *seed* itself."""
    if number == 0:
        return seed
    return int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def _position_text(start: Pose2D) -> str:
    return f"({start.x:.2f}, {start.y:.2f})"


class SimulatedRobot:
    """A robot with its node `rosbot` and, if there is a map, with the nodes `amcl` and `bt_navigator`.

    Args:
        host: Creates the nodes, in the robot's namespace.
        robot: The robot.
        battery: The properties of the robot's battery.
        seed: The seed of the scanner's noise.
        navigation: The data of the robot's Nav2 substitute; None for no navigation.
        placement: The placement, which determines the localisation and the manner of driving.
    """

    def __init__(
        self,
        host: NodeHost,
        robot: Robot,
        battery: BatteryKind,
        *,
        seed: int,
        navigation: NavigationSetup | None,
        placement: Placement,
    ) -> None:
        self._host, self._robot = host, robot
        self._battery = Battery(battery, robot.state.pose)
        self._interface = RobotInterface(host, robot, self._battery, seed=seed)
        self._amcl: Amcl | None = None
        self._navigator: BtNavigator | None = None
        self._navigation, self._amcl_back_at = navigation, math.inf
        if navigation is not None:
            self._amcl = Amcl(host, robot, navigation.occupancy, localised=placement.localised)
            self._navigator = BtNavigator(
                host,
                self._interface,
                navigation,
                lambda: None if self._amcl is None else self._amcl.pose(),
                lose_localisation=self._lose_localisation,
                manner=manner(placement.like),
            )

    @property
    def poses(self) -> tuple[Pose2D, Pose2D]:
        """The robot's true pose, frame `map`, and the pose according to its odometry."""
        return self._robot.state.pose, self._robot.state.odometry

    def move(self, duration: float) -> None:
        """Move for *duration* seconds."""
        state = self._robot.step(duration)
        self._battery.step(state.pose, state.velocity.v, duration)

    def publish_sensors(self, step: int, now_ns: int) -> None:
        """Publish the sensor data at the end of step number *step*, at *now_ns* nanoseconds."""
        self._interface.publish(step, now_ns)

    def navigate(self, step: int, now_ns: int) -> None:
        """Update the localisation and continue with the current goal at the end of a step, at *now_ns* nanoseconds."""
        if self._navigation is not None and now_ns / 1e9 >= self._amcl_back_at:
            self._amcl_back_at = math.inf
            self._amcl = Amcl(self._host, self._robot, self._navigation.occupancy)
        if self._amcl is not None:
            self._amcl.step(step, now_ns)
        if self._navigator is not None:
            self._navigator.step(step, now_ns)

    def stop(self) -> bool:
        """End the current goal; return whether there was a goal. The client of this goal must still be notified."""
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


STEP_NS = 50_000_000
STEP_SEC = STEP_NS / 1e9
# The maximum delay for which the simulation catches up, seconds of wall time.
_CATCH_UP_SEC = 0.05
# After the simulation has ended, the executor runs this number of rounds of at least this duration (seconds of wall time), so that clients
# receive the results of their goals.
_FAREWELL_ROUNDS = 5
_FAREWELL_SEC = 0.01
# The time limit for the thread to end after a stop request, seconds of wall time. On a busy machine a step takes much longer than usual, and
# clients wait for the end of their goals.
_JOIN_SEC = 30.0
# The maximum lag of the listener in steps; without a lag, the two threads could only work alternately.
_LEAD_STEPS = 2
# The number of steps between two writes of the robots' poses.
_WRITE_EVERY = 4
# The interval between checks for other simulations, seconds of wall time.
_CHECK_SEC = 1.0

_log = logging.getLogger(__name__)


class SimulationError(SarError):
    """The simulation cannot run as requested."""


class Simulation:
    """Runs a world, in its own thread or in the thread of an executor that steps it.

    Simulated time advances in steps of 0.05 s, and no step is skipped. *speed* is an upper limit: simulated time
    slows down if the machine cannot keep up.

    Args:
        world: The world. If the world has no map, the robots have no Nav2 substitute, but only their own topics.
        robots: The robots in the order of their steps. A robot's nodes and its topics `tf` and `tf_static` are in the namespace with the
            robot's name. By default there is one robot without a name, at the world's start.
        speed: Simulated seconds per second.
        faults: The faults to inject in the navigation. The faults of each robot are counted separately.
        seed: The seed of all noise. The same seed and commands result in the same states, bit for bit.
        context: The nodes' context, already initialised; the default context if None.
        namespace: The namespace of the nodes except those of robots with a name; None for the namespace of the command line. The topic
            `/clock` is global.
        extra_nodes: Nodes of the caller that the same thread serves; the caller destroys them.
        executor: Serves the nodes and steps the world; by default, a separate thread does.

    Attributes:
        failure: The exception that ended the simulation; None if there is none.

    Raises:
        SimulationError: If the speed is not above 0.
        PlacementError: If the robots cannot be placed as requested.
        FaultError: If a fault names an unknown location.
        SarError: If the world's map cannot be read.
    """

    def __init__(  # noqa: PLR0913 - each has its default
        self,
        world: World,
        robots: Sequence[Placement] = (Placement(""),),
        *,
        speed: float = 1.0,
        faults: FaultPlan | None = None,
        seed: int = 0,
        context: Context | None = None,
        namespace: str | None = None,
        extra_nodes: Sequence[Node] = (),
        executor: SteppedExecutor | None = None,
    ) -> None:
        if not speed > 0.0:
            raise SimulationError(f"the speed is {speed:g}, but must be above 0")
        self.failure: BaseException | None = None
        self._period = STEP_SEC / speed
        self._pose_file: PoseFile | None = None
        bodies = make_robots(world, robots, seed=seed)
        navigation = navigation_in(world, faults or FaultPlan())
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)
        self._step_count = 0
        self._due = self._next_check = 0.0
        context = context or get_default_context()
        self._stepped = executor
        self._own = PacedExecutor(context=context, interrupted=self._stopping.is_set)
        self._executor = executor or self._own
        self._host = NodeHost(self._executor, context, namespace)
        self._clock_node = self._host.create("simulator")
        self._clock = self._clock_node.create_publisher(Clock, "/clock", 10)
        self._listener: ROSClock | None = None
        self._jumps: JumpHandle | None = None
        # Without a map, another process serves the navigation. After its restart, its old server must not be reported as a rival.
        self._actions = [robot.action for robot in robots if navigation is not None]
        self._robots: dict[str, SimulatedRobot] = {}
        for number, (robot, body) in enumerate(zip(robots, bodies, strict=True)):
            host = NodeHost(self._executor, context, namespace, robot.ros_arguments)
            self._robots[robot.name] = SimulatedRobot(
                host, body, world.battery, seed=seed_of(seed, number), navigation=navigation, placement=robot
            )
        for node in extra_nodes:
            self._executor.add_node(node)

    @property
    def sim_time(self) -> float:
        """Simulated seconds since the start."""
        return self._step_count * STEP_SEC

    def robot_pose(self, name: str = "") -> Pose2D:
        """Return the true pose of the robot called *name*, frame `map`."""
        return self._robots[name].poses[0]

    def store_poses(self, pose_file: PoseFile) -> None:
        """Write the robots' poses to a file during the simulation; a write error ends the simulation."""
        self._pose_file = pose_file

    def wait_for(self, listener: ROSClock) -> None:
        """Limit the speed, so that the simulated clock of a node in another thread can keep up.

        Without this limit, time limits in simulated seconds would expire too early if the machine or a leaf is slower than the requested
        speed.
        """
        every = JumpThreshold(min_forward=Duration(nanoseconds=1), min_backward=None)
        self._listener = listener
        self._jumps = listener.create_jump_callback(every, post_callback=lambda _: self._own.wake())

    def start(self) -> None:
        """Start simulated time; may be called only once."""
        self._due = self._next_check = time.monotonic()
        if self._stepped is None:
            self._thread.start()
        else:
            self._stepped.step = self._advance

    def stop(self) -> None:
        """Stop simulated time, abort current goals, and destroy the nodes. Further calls do nothing."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        self._own.wake()
        if self._thread.ident is not None:
            self._thread.join(_JOIN_SEC)
        if self._thread.is_alive():
            _log.error("the simulation's thread does not end. Kill the process")
            return
        if self._stepped is not None:
            self._stepped.step = None
            if self._stop_robots():
                for _ in range(_FAREWELL_ROUNDS):
                    self._stepped.spin_once()
        for robot in self._robots.values():
            robot.close()
        if self._jumps is not None:
            self._jumps.unregister()
        self._host.destroy_all()
        self._own.shutdown()

    def __enter__(self) -> "Self":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _run(self) -> None:
        with self._store_exception():
            while not self._stopping.is_set():
                began = time.monotonic()
                self._make_step()
                self._own.serve_until(self._due)
                if self._listener is not None:
                    self._own.serve_until(began + STEP_SEC, enough=self._has_listener_caught_up)
            self._notify_clients()

    def _advance(self) -> None:
        """Make the next step when it is due, unless an exception has ended the simulation."""
        if self.failure is None:
            with self._store_exception():
                if (early_sec := self._due - time.monotonic()) > 0.0:
                    time.sleep(early_sec)
                self._make_step()

    @contextmanager
    def _store_exception(self) -> Iterator[None]:
        """Store the exception that ends the simulation."""
        try:
            yield
        except ExternalShutdownException:
            pass  # the context was shut down to end this thread
        except Exception as error:  # noqa: BLE001 - reported by `failure`
            self.failure = error

    def _make_step(self) -> None:
        """Make a step, and compute the time of the next step."""
        self._step()
        now = time.monotonic()
        self._due = max(self._due + self._period, now - _CATCH_UP_SEC)
        if now > self._next_check:
            self._next_check = now + _CHECK_SEC
            require_no_rival_servers(self._clock_node, self._actions)

    def _step(self) -> None:
        self._step_count += 1
        now_ns = self._step_count * STEP_NS
        robots = self._robots.values()
        # All robots move before the first robot scans.
        for robot in robots:
            robot.move(STEP_SEC)
        for robot in robots:
            robot.publish_sensors(self._step_count, now_ns)
        self._clock.publish(Clock(clock=to_stamp(now_ns)))
        for robot in robots:
            robot.navigate(self._step_count, now_ns)
        if self._pose_file is not None and self._step_count % _WRITE_EVERY == 0:
            self._pose_file.write({name: robot.poses for name, robot in self._robots.items()})

    def _has_listener_caught_up(self) -> bool:
        """Return whether the listener's clock has almost reached this step, or does not use simulated time."""
        listener = self._listener
        if listener is None or not listener.ros_time_is_active:
            return True
        return bool(listener.now().nanoseconds >= (self._step_count - _LEAD_STEPS) * STEP_NS)

    def _notify_clients(self) -> None:
        """End all goals, and serve the executor until the clients have been notified."""
        if self._stop_robots():
            for _ in range(_FAREWELL_ROUNDS):
                self._own.serve_until(time.monotonic() + _FAREWELL_SEC, to_the_end=True)

    def _stop_robots(self) -> bool:
        """End all goals; return whether there were goals. The clients of these goals must still be notified."""
        return any([robot.stop() for robot in self._robots.values()])  # noqa: C419 - every robot has to stop


def navigation_in(world: World, faults: FaultPlan) -> NavigationSetup | None:
    """Return the data that the Nav2 substitutes share; None if the world has no map."""
    places = world.places if faults.places is None else faults.places
    faults.for_navigation().check_places(places)
    if world.map_path is None:
        return None
    occupancy = read_map(world.map_path)
    return NavigationSetup(occupancy, Planner(occupancy, world.robot_radius), places, faults)
