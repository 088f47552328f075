"""The whole simulator on ROS 2: the world, its robots with their Nav2 substitutes, and the clock."""

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
    """Check that robots can start as they are placed.

    Raises:
        PlacementError: If two have the same name, or if one would start in contact with an obstacle or another
            robot, or outside the world's map.
        SarError: If the world's map cannot be read.
    """
    for name, count in Counter(placement.name for placement in placements).items():
        if count > 1:
            problem = f"{count} robots have this name: give each its own name, which is also its namespace"
            raise PlacementError(name, problem)
    radius = world.robot_radius
    starts = [(placement.name, placement.start or world.start) for placement in placements]
    for name, start in starts:
        if not world.obstacle_arrays.clearance(start.x, start.y) > radius:
            problem = (
                f"would start in an obstacle, or touching one, at {_place_text(start)}; "
                f"its centre needs more than {radius:g} m around it"
            )
            raise PlacementError(name, problem)
        # The localisation would reject it.
        if world.map_path is not None and read_map(world.map_path).cell_at(start.x, start.y) is None:
            problem = (
                f"would start at {_place_text(start)}, which is outside the world's map (metres, frame map)"
            )
            raise PlacementError(name, problem)
    for (one, here), (other, there) in itertools.combinations(starts, 2):
        if not here.distance_to(there) > 2 * radius:
            problem = (
                f"would start at {_place_text(there)}, touching robot '{one}' at {_place_text(here)}; their centres "
                f"need more than {2 * radius:g} m between them: write a start, {other}:X,Y"
            )
            raise PlacementError(other, problem)


def make_robots(world: World, placements: Sequence[Placement], *, seed: int = 0) -> list[Robot]:
    """Return robots that are obstacles for each other, in the order of their steps.

    Raises:
        PlacementError: If they cannot start as placed.
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
    """Return the noise seed of a robot; robot 0 uses `seed` unchanged."""
    if number == 0:
        return seed
    return int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def _place_text(start: Pose2D) -> str:
    return f"({start.x:.2f}, {start.y:.2f})"


class SimulatedRobot:
    """A robot with its node `rosbot` and, if there is a map, `amcl` and `bt_navigator`.

    Args:
        host: Creates the nodes, in the robot's namespace.
        robot: The robot.
        battery: The properties of its battery.
        seed: Seed of its scanner's noise.
        navigation: The data of its Nav2 substitute; None for no navigation.
        placement: Its localisation and manner of driving.
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
        """The true pose, frame `map`, and the odometry pose."""
        return self._robot.state.pose, self._robot.state.odometry

    def move(self, duration: float) -> None:
        """Move for *duration* seconds."""
        state = self._robot.step(duration)
        self._battery.step(state.pose, state.velocity.v, duration)

    def publish_sensors(self, step: int, now_ns: int) -> None:
        """Publish the sensor data at the end of step number *step*, at *now_ns* nanoseconds."""
        self._interface.publish(step, now_ns)

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
        """End the current goal; return whether there was one, whose client must be notified."""
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
# Longest delay of the machine that the simulation catches up with, seconds of wall time.
_CATCH_UP_SEC = 0.05
# Number of executor rounds, and their minimum duration in seconds of wall time, in which the end of a goal reaches its client when the simulation has stopped.
_FAREWELL_ROUNDS = 5
_FAREWELL_SEC = 0.01
# How long the thread may take for its step after a stop request, seconds of wall time: a busy machine needs much more than usual, and
# clients wait for the end of their goals.
_JOIN_SEC = 30.0
# Largest lag of the listener in steps: without any, the two threads would only work in turns.
_LEAD_STEPS = 2
# The robots' poses are written in one of this many steps.
_KEEP_EVERY = 4
# Interval of checks that this is still the only simulation, seconds of wall time.
_LOOK_EVERY_SEC = 1.0

_log = logging.getLogger(__name__)


class SimulationError(SarError):
    """The simulation cannot run as requested."""


class Simulation:
    """Runs a world, in its own thread or in the thread of an executor that steps it.

    Simulated time advances in steps of 0.05 s, and no step is skipped. *speed* is an upper bound: simulated time
    slows down if the machine cannot keep up.

    Args:
        world: The world. If it names no map, there is no Nav2 substitute, only the robots' own topics.
        robots: The robots in it, in the order of their steps. Each is in the namespace of its name, including `/tf`
            and `/tf_static`. By default there is one robot without a name, at the world's start.
        speed: Simulated seconds per second.
        faults: The faults of navigation, the same for every robot; each robot consumes its own copy.
        seed: Seed of all noise. The same seed and commands give the same states, bit for bit.
        context: The nodes' context, already initialised; the default context if None.
        namespace: The namespace of the other nodes; that of the command line if None. `/clock` stays global.
        extra_nodes: Nodes of the caller that the same thread serves; the caller destroys them.
        executor: Serves the nodes and steps the world; by default a thread does.

    Attributes:
        failure: The exception that ended it, if any.

    Raises:
        SimulationError: If the speed is not above 0.
        PlacementError: If the robots cannot be placed as requested.
        FaultError: If a fault names an unknown place.
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
            raise SimulationError(f"the speed is {speed:g}: write a number above 0")
        self.failure: BaseException | None = None
        self._period = STEP_SEC / speed
        self._kept: PoseFile | None = None
        bodies = make_robots(world, robots, seed=seed)
        navigation = navigation_in(world, faults or FaultPlan())
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)
        self._step_count = 0
        self._due = self._look_at = 0.0
        context = context or get_default_context()
        self._stepped = executor
        self._own = PacedExecutor(context=context, interrupted=self._stopping.is_set)
        self._executor = executor or self._own
        self._host = NodeHost(self._executor, context, namespace)
        self._clock_node = self._host.create("simulator")
        self._clock = self._clock_node.create_publisher(Clock, "/clock", 10)
        self._listener: ROSClock | None = None
        self._jumps: JumpHandle | None = None
        # Without a map another process drives; its server may restart while the graph still has the old one.
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

    def store_poses(self, kept: PoseFile) -> None:
        """Write the robots' poses from the start on; a write error ends the simulation."""
        self._kept = kept

    def wait_for(self, listener: ROSClock) -> None:
        """Limit the speed so that the simulated clock of another thread's node can follow.

        Otherwise time limits in simulated seconds would expire when the machine, or a leaf, is slower than requested.
        """
        every = JumpThreshold(min_forward=Duration(nanoseconds=1), min_backward=None)
        self._listener = listener
        self._jumps = listener.create_jump_callback(every, post_callback=lambda _: self._own.wake())

    def start(self) -> None:
        """Start simulated time; may be called only once."""
        self._due = self._look_at = time.monotonic()
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
            _log.error("the simulation's thread does not end: kill the process")
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
        """Make a step when it is due, unless something has ended the simulation."""
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
        """Make a step and compute the time of the next one."""
        self._step()
        now = time.monotonic()
        self._due = max(self._due + self._period, now - _CATCH_UP_SEC)
        if now > self._look_at:
            self._look_at = now + _LOOK_EVERY_SEC
            require_no_rival_servers(self._clock_node, self._actions)

    def _step(self) -> None:
        self._step_count += 1
        now_ns = self._step_count * STEP_NS
        robots = self._robots.values()
        # All robots have moved before the first of them scans.
        for robot in robots:
            robot.move(STEP_SEC)
        for robot in robots:
            robot.publish_sensors(self._step_count, now_ns)
        self._clock.publish(Clock(clock=to_stamp(now_ns)))
        for robot in robots:
            robot.navigate(self._step_count, now_ns)
        if self._kept is not None and self._step_count % _KEEP_EVERY == 0:
            self._kept.write({name: robot.poses for name, robot in self._robots.items()})

    def _has_listener_caught_up(self) -> bool:
        """Return whether the listener has almost reached the time of this step, or does not need to."""
        listener = self._listener
        if listener is None or not listener.ros_time_is_active:
            return True
        return bool(listener.now().nanoseconds >= (self._step_count - _LEAD_STEPS) * STEP_NS)

    def _notify_clients(self) -> None:
        """Notify the clients of current goals of the end."""
        if self._stop_robots():
            for _ in range(_FAREWELL_ROUNDS):
                self._own.serve_until(time.monotonic() + _FAREWELL_SEC, to_the_end=True)

    def _stop_robots(self) -> bool:
        """End all goals; return whether there were any, whose clients must be notified."""
        return any([robot.stop() for robot in self._robots.values()])  # noqa: C419 - all have to stop


def navigation_in(world: World, faults: FaultPlan) -> NavigationSetup | None:
    """Return the data of the Nav2 substitutes, or None if the world has no map."""
    places = world.places if faults.places is None else faults.places
    faults.for_navigation().check_places(places)
    if world.map_path is None:
        return None
    occupancy = read_map(world.map_path)
    return NavigationSetup(occupancy, Planner(occupancy, world.robot_radius), places, faults)
