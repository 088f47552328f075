"""One run of `sar-run`, from the tree file to the exit status."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING

import rclpy
from py_trees.trees import BehaviourTree
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from sar_compiler.cli.arguments import FINDINGS, OK
from sar_compiler.cli.loading import tell_passed_over
from sar_compiler.cli.output import RunOutput
from sar_compiler.compiler import CompiledTree, compile_tree, context_types
from sar_compiler.errors import SarError
from sar_compiler.missions.search_and_rescue.ending import Ending, Until, Verdict
from sar_compiler.missions.search_and_rescue.kept_reports import KeptReports
from sar_compiler.missions.search_and_rescue.parameter_file import sections_elsewhere
from sar_compiler.missions.search_and_rescue.parameters import (
    MISSION_NAMES,
    MissionParameters,
    RunParameters,
    lookalikes,
    read_mission,
    read_run,
)
from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.project import Additions, Workspace
from sar_compiler.resources import shipped
from sar_compiler.ros.arguments import (
    init_arguments,
    names_parameter_file,
    node_arguments,
    parameter_files,
)
from sar_compiler.ros.blame import tell
from sar_compiler.ros.clock import RosClock
from sar_compiler.ros.engine import Engine, EngineFactory, find_engine
from sar_compiler.ros.errors import readable_ros_errors
from sar_compiler.ros.faults import FaultPlan
from sar_compiler.ros.parameters import flat_parameters, mission_node
from sar_compiler.ros.readiness import NotReadyError, Readiness, wait_until_ready
from sar_compiler.ros.setting_up import SetupFailedError
from sar_compiler.ros.signals import StopSignals
from sar_compiler.runtime.clock import Clock
from sar_compiler.views.summary import mission_summary
from sar_compiler.views.text import unicode_tree

if TYPE_CHECKING:
    from sar_compiler.cli.run import Options
    from sar_compiler.sim.simulation import Simulation
    from sar_compiler.sim.world import World

NODE_NAME = "search_and_rescue"
NOT_READY = 3

# A signal is noticed between two turns of the executor.
_TURN_SEC = 0.05

# The contract's tree can swing between a zone out of reach and base for ever; seconds of simulated time.
_SIMULATED_TIME_LIMIT_SEC = 900.0


def fly(options: "Options", signals: StopSignals) -> int:
    """Check the tree, wait for what it needs, and tick it to the end.

    Args:
        options: What was asked for.
        signals: Whether the process was asked to stop.

    Returns:
        The exit status.

    Raises:
        TreeError: If the tree is not valid; nothing has moved.
        SarError: If the parameters, the world or the ROS arguments are wrong; nothing has moved.
    """
    make_engine = find_engine(options.engine)
    binding = _checked_tree(options)
    is_mission = ZoneManager in context_types(binding)
    world = _world(options)
    with ExitStack() as stack:
        context = stack.enter_context(_ros(options, signals, is_mission))
        if signals.came:
            return signals.exit_status
        node = stack.enter_context(_mission_node(options, context))
        parameters = flat_parameters(node)
        mission = read_mission(parameters, _sections_elsewhere(options, node)) if is_mission else None
        run = mission or read_run(parameters)
        flight = _Flight(options, signals, node, run, mission, make_engine)
        tree = compile_tree(binding, flight.context, parameters)
        if world is not None:
            flight.simulation = stack.enter_context(_simulation(options, world, node, mission))
        try:
            return flight.run(tree)
        except NotReadyError as error:
            print(f"sar-run: {error}", file=sys.stderr)
            return NOT_READY


def _checked_tree(options: "Options") -> Binding:
    additions = Additions(options.nodes, (), options.include_path, getattr(options, "trust", False))
    return Workspace(additions, note=tell_passed_over).load(options.tree).binding()


def _world(options: "Options") -> "World | None":
    """Return the world to simulate, if one is; a wrong name is said before anything takes time."""
    if options.sim is None:
        return None
    from sar_compiler.sim.world_file import find_world

    return find_world(options.sim)


def _sections_elsewhere(options: "Options", node: Node) -> str:
    files = parameter_files(options.ros, options.params)
    return sections_elsewhere(files, node.get_fully_qualified_name())


@contextmanager
def _ros(options: "Options", signals: StopSignals, is_mission: bool) -> Iterator[Context]:
    """Bring ROS up; the shipped parameters serve a mission that is given none."""
    params = options.params
    if params is None and is_mission and not names_parameter_file(options.ros):
        params = shipped("config", "mission_params.yaml")
    context = Context()
    arguments = init_arguments(options.ros, params)
    if options.sim is not None:
        from sar_compiler.sim.isolation import LOOKING_AROUND, refuse_company, stay_on_this_machine

        stay_on_this_machine()
    with readable_ros_errors():
        # rclpy's own signal handlers would take ROS down before a goal in flight could be cancelled.
        rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        if options.sim is not None:
            print(LOOKING_AROUND, file=sys.stderr, flush=True)
            refuse_company(context=context, should_stop=lambda: signals.came)
        yield context
    finally:
        context.try_shutdown()


@contextmanager
def _mission_node(options: "Options", context: Context) -> Iterator[Node]:
    simulated = [Parameter("use_sim_time", value=True)] if options.sim is not None else []
    node = mission_node(
        NODE_NAME, context, cli_args=node_arguments(options.ros), parameter_overrides=simulated
    )
    try:
        yield node
    finally:
        node.destroy_node()


@contextmanager
def _simulation(
    options: "Options", world: "World", node: Node, mission: MissionParameters | None
) -> "Iterator[Simulation]":
    """Start the world, the stand-in for Nav2 and the two servers in this process."""
    from sar_compiler.ros.detect_survivor_server import DetectSurvivorServer
    from sar_compiler.ros.report_survivor_server import ReportSurvivorServer
    from sar_compiler.sim.simulation import Simulation

    zones = {zone["id"]: (zone["x"], zone["y"]) for zone in mission.zones} if mission else None
    faults = FaultPlan(options.faults, zones)
    servers: list[Node] = (
        [
            server(
                node.context,
                faults.for_service(name),
                parameter_overrides=[Parameter("use_sim_time", value=True)],
            )
            for server, name in (
                (DetectSurvivorServer, "detect_survivor"),
                (ReportSurvivorServer, "report_survivor"),
            )
        ]
        if mission
        else []
    )
    try:
        with Simulation(
            world,
            speed=options.speed,
            faults=faults,
            context=node.context,
            namespace=node.get_namespace(),
            extra_nodes=servers,
        ) as simulation:
            yield simulation
    finally:
        for server in servers:
            server.destroy_node()


class _Flight:
    """A tree on its node, from the wait for what it needs to the summary.

    Attributes:
        context: What is handed to the leaves, by type.
        simulation: The simulation, if there is one.
    """

    def __init__(
        self,
        options: "Options",
        signals: StopSignals,
        node: Node,
        run: RunParameters,
        mission: MissionParameters | None,
        make_engine: EngineFactory,
    ) -> None:
        self._options = options
        self._signals = signals
        self._node = node
        self._run = run
        self._make_engine = make_engine
        self._clock = RosClock(node)
        self._record = MissionRecord()
        self._zones = ZoneManager(mission.zones, mission.base_station) if mission else None
        self._ending = self._make_ending()
        self._output = RunOutput()
        self._verdict: Verdict | None = None
        self._started = 0.0
        self.context: dict[type, object] = {
            Clock: self._clock,
            MissionRecord: self._record,
            KeptReports: KeptReports(),
        }
        self.simulation: Simulation | None = None
        self._mission = mission
        if mission is not None:
            self.context[ZoneManager] = self._zones

    def _make_ending(self) -> Ending:
        until = self._options.until
        simulated = self._options.sim is not None
        if self._zones is None and until is Until.COMPLETE:
            message = (
                "--until complete is for a tree with zones; for this one say success, failure or forever"
            )
            raise SarError(message)
        if until is None:
            until = Until.COMPLETE if simulated and self._zones is not None else Until.FOREVER
        limit = self._run.time_limit_sec
        if limit is None and simulated and until is not Until.FOREVER:
            limit = _SIMULATED_TIME_LIMIT_SEC
        return Ending(until, self._record if self._zones else None, self._zones, limit)

    def run(self, tree: CompiledTree) -> int:
        """Wait, tick, stop and sum up; returns the exit status.

        Raises:
            NotReadyError: If something that the tree needs does not come in time.
        """
        self._warn_of_slips(tree)
        self._greet()
        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)
        try:
            self._wait(executor, tree)
            if self._over:
                return self._interrupted()
            if self._options.check:
                self._output.say("Everything that the tree needs is there.")
                return OK
            return self._tick(executor, tree)
        finally:
            executor.shutdown()

    def _warn_of_slips(self, tree: CompiledTree) -> None:
        """Warn of parameters that nobody reads and that are nearly what is read."""
        bound = [origin.bound for origin in tree.origins.values()]
        taken = [key.removeprefix("@") for each in bound for key in each.keys.values()]
        for note in lookalikes(flat_parameters(self._node), (*MISSION_NAMES, *taken)):
            self._node.get_logger().warning(note)

    def _greet(self) -> None:
        mission = self._mission
        if mission is None:
            return
        log, base = self._node.get_logger(), mission.base_station
        for note in mission.notes:
            log.warning(note)
        log.info(f"Loaded {len(mission.zones)} search zones from parameters.")
        log.info(f"Base station at ({base['x']:.2f}, {base['y']:.2f}, yaw={base['yaw']:.2f}).")

    def _wait(self, executor: SingleThreadedExecutor, tree: CompiledTree) -> None:
        # A check changes nothing on a robot of somebody else's.
        told = self._run.set_initial_pose and (not self._options.check or self.simulation is not None)
        with readable_ros_errors():
            start = self._run.initial_pose if told else None
            readiness = Readiness(self._node, tree.uses(), initial_pose=start)
        wait_until_ready(executor, readiness, self._run.startup_timeout_sec, lambda: self._over)
        if readiness.uses_nav2 and not self._over:
            self._node.get_logger().info("Nav2 is active.")

    def _tick(self, executor: SingleThreadedExecutor, tree: CompiledTree) -> int:
        engine = self._make_engine(tree.root)
        engine.add_post_tick_handler(self._look)
        try:
            engine.setup(node=self._node)
            self._started = self._clock.now()
            engine.tick_tock(1000.0 / self._run.tick_rate_hz)
            while self._verdict is None and engine.failure is None and not self._over:
                _turn(executor)
            elapsed = self._clock.now() - self._started
            self._say_what_is_left(engine.settle(executor))
        except SetupFailedError as error:
            tell(self._node, str(error), error)
            return self._failed(
                "the tree was not started, because one of its leaves failed in setup (see above)"
            )
        finally:
            engine.shutdown()
        return self._conclude(engine, elapsed)

    @property
    def _over(self) -> bool:
        """Whether something other than the tree ends the run."""
        failed = self.simulation is not None and self.simulation.failure is not None
        return self._signals.came or failed or not self._node.context.ok()

    def _look(self, tree: BehaviourTree) -> None:
        """Look at the tree after a tick."""
        if self._options.view == "text":
            self._output.show(unicode_tree(tree.root, statuses=True))
        self._verdict = self._ending.after_tick(tree.root.status, self._clock.now() - self._started)

    def _say_what_is_left(self, unsettled: list[str]) -> None:
        for name in unsettled:
            self._node.get_logger().warning(f"{name}: the cancel of its goal was not answered.")

    def _conclude(self, engine: Engine, elapsed_sec: float) -> int:
        if self._zones is not None:
            self._output.say(mission_summary(self._record, self._zones, elapsed_sec, engine.count))
        if engine.failure is not None:
            return self._failed("the tree was stopped, because one of its leaves failed (see above)")
        if self._verdict is None and not self._ending.complete:
            return self._interrupted()
        if self._verdict is not None and not self._verdict.achieved:
            return self._failed(self._verdict.reason)
        if self._zones is not None and not self._ending.complete:
            return self._failed("the run has ended as asked, and the mission is incomplete")
        return OK

    def _interrupted(self) -> int:
        """Return the exit status of a run that something other than its tree has ended."""
        failure = self.simulation.failure if self.simulation is not None else None
        if failure is not None:
            words = str(failure) if isinstance(failure, SarError) else f"{type(failure).__name__}: {failure}"
            return self._failed(f"the simulation has ended: {words}")
        if self._signals.came:
            return self._signals.exit_status
        return self._failed("ROS was shut down")

    def _failed(self, reason: str) -> int:
        print(f"sar-run: {reason}", file=sys.stderr)
        return FINDINGS


def _turn(executor: SingleThreadedExecutor) -> None:
    # When somebody has shut ROS down, the loop around this sees it.
    with suppress(ExternalShutdownException):
        executor.spin_once(timeout_sec=_TURN_SEC)
