"""One run of `sar-run`, from the tree file to the exit status."""

import sys
import time
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from py_trees.common import Status
from py_trees.trees import BehaviourTree
from rclpy.clock import Clock as RosTime
from rclpy.clock import ClockType
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from sar_compiler.cli.companions import Companions, RunSetup, companions_asked_for
from sar_compiler.cli.loading import additions, tell_note
from sar_compiler.cli.output import RunOutput
from sar_compiler.cli.run_journal import RunJournal, open_run_journal
from sar_compiler.cli.run_mission_check import RouteCheck
from sar_compiler.cli.supervision import PERIOD_SEC
from sar_compiler.commands import FINDINGS, OK, print_error
from sar_compiler.compiler import CompiledTree, compile_tree, require_classes
from sar_compiler.errors import SarError
from sar_compiler.journal.json_values import json_text
from sar_compiler.missions.beginning import begin_run, fixed_parameters, node_name
from sar_compiler.missions.choosing import MissionError
from sar_compiler.missions.ending import EndCondition, RunResult, Until
from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.nodes.spec import Use
from sar_compiler.project import LoadedTree, Workspace
from sar_compiler.ros.arguments import (
    init_arguments,
    node_arguments,
    parameter_files,
    readable_ros_errors,
    security_arguments,
)
from sar_compiler.ros.clock import AWAKE, mission_clock
from sar_compiler.ros.engine import (
    Engine,
    SetupFailedError,
    error_text,
    failure_text,
    find_engine,
    send_cancels,
    show_tracebacks,
    tell,
)
from sar_compiler.ros.faults import NAVIGATION, NAVIGATION_FAULTS, Fault, FaultPlan, parse_fault
from sar_compiler.ros.guardian import Guardian
from sar_compiler.ros.leaves.goals_under_way import goals_under_way
from sar_compiler.ros.leaves.interfaces import declared_types
from sar_compiler.ros.middleware import ros_up
from sar_compiler.ros.parameter_file import ParameterPlaces, sections_elsewhere
from sar_compiler.ros.parameter_reader import ParameterReader, RunParameters
from sar_compiler.ros.parameters import DataNode, flat_parameters
from sar_compiler.ros.readiness import NotReadyError, Readiness, wait_until_ready
from sar_compiler.ros.robot_estimate import RobotEstimate, robot_estimate
from sar_compiler.ros.signals import StopSignals
from sar_compiler.ros.sole_mission import LOOK_SEC, SoleMission
from sar_compiler.ros.watch import Watch, refuse_parameters
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.tree.showing import in_one_line

if TYPE_CHECKING:
    from sar_compiler.cli.run import Options
    from sar_compiler.sim.simulation import Simulation
    from sar_compiler.sim.world import World

NOT_READY = 3
ADRIFT = 4

# A signal is noticed between two turns of the executor.
_TURN_SEC = 0.05

# A tree can swing between two things to do for ever; seconds of simulated time.
_SIMULATED_TIME_LIMIT_SEC = 900.0


def run_mission(options: "Options", signals: StopSignals, ros: ExitStack) -> int:
    """Check the tree, wait for its requirements, tick it to the end, and return the exit status.

    Args:
        options: The options of the command line.
        signals: The requests to stop.
        ros: Takes down what is native, in the end, when all that the run has to write is written.

    Raises:
        TreeError: If the tree is not valid; the robot has not moved.
        SarError: If the mission, the parameters, the world or the ROS arguments are wrong; the robot has not moved.
    """
    make_engine = find_engine(options.engine)
    asked_for = list(companions_asked_for(options))  # what they lack is said before anything starts
    loaded = _loaded(options)
    binding = loaded.binding(options.tree_id)
    require_classes(binding)
    mission = loaded.mission(binding)
    targets = {**(mission.faults if mission is not None else {}), **NAVIGATION_FAULTS}
    faults = [parse_fault(text, targets) for text in options.fault]
    world = _world(options)
    output = RunOutput()
    with ExitStack() as stack:
        context = ros.enter_context(_ros(options, signals, mission))
        if signals.came:
            return signals.exit_status
        node = DataNode(
            node_name(mission),
            context,
            cli_args=node_arguments(options.ros),
            parameter_overrides=_simulated_time(options),
        )
        ros.callback(node.destroy_node)
        if options.traceback:
            show_tracebacks(node)
        reader = _parameter_reader(options, node)
        begun, parameters, notes = begin_run(mission, reader, binding)
        fixed = fixed_parameters(mission, binding)
        journal = stack.enter_context(open_run_journal(options, mission, node))
        if options.supervision is not None:
            options.supervision.tell_journal(journal.journal.place)
        setup = RunSetup(options, node, journal.journal, begun, parameters, output)
        companions = Companions(setup, asked_for, stack)
        journal.keep_facts(begun, reader.parameters)
        if _wants_guardian(options, journal):
            guardian = stack.enter_context(closing(_guardian(options, node)))
            goals_under_way(node).listen(guardian.note)
        run = _TreeRun(
            options,
            signals,
            node,
            parameters,
            begun,
            fixed,
            journal,
            companions,
            output,
            world,
        )
        tree = compile_tree(binding, run.context, reader.parameters)
        journal.describe(tree, loaded.path)
        engine = make_engine(tree.root)
        companions.begin(tree, engine)
        for note in notes:
            node.get_logger().warning(in_one_line(note))
        try:
            if world is not None:
                _require_navigation(tree, world)
                run.simulation = ros.enter_context(_simulation(options, world, node, begun, faults))
            executor = SingleThreadedExecutor(context=context)
            ros.callback(executor.shutdown)
            return run.run(tree, engine, executor)
        except NotReadyError as error:
            print_error(f"sar-run: {error}")
            return NOT_READY


def _wants_guardian(options: "Options", journal: RunJournal) -> bool:
    # A simulation dies with the run.
    usual = journal.journal.is_kept and options.sim is None
    return usual if options.guardian is None else options.guardian


def _guardian(options: "Options", node: Node) -> Guardian:
    signs = options.supervision and options.supervision.signs
    return Guardian(security_arguments(options.ros), node.get_logger().warning, signs)


def _loaded(options: "Options") -> LoadedTree:
    return Workspace(additions(options), note=tell_note).load(options.tree)


def _world(options: "Options") -> "World | None":
    """Return the world to simulate, if any; a wrong name is reported before anything slow is done."""
    if options.sim is None:
        return None
    from sar_compiler.sim.world import find_world

    return find_world(options.sim)


def _require_navigation(tree: CompiledTree, world: "World") -> None:
    """Check that the simulation provides Nav2 if the tree needs it: no other node may, beside a simulation.

    Raises:
        NotReadyError: If it does not.
    """
    if world.map_path is None and not {Use.nav2(), Use.action(NAVIGATION)}.isdisjoint(tree.uses()):
        line = f"Nav2: the world '{world.name}' has no map, and without one nothing navigates in it"
        raise NotReadyError([line], None)


def _parameter_reader(options: "Options", node: Node) -> ParameterReader:
    files, name = parameter_files(options.ros, options.params), node.get_fully_qualified_name()
    return ParameterReader(
        flat_parameters(node), sections_elsewhere(files, name), ParameterPlaces(files, name)
    )


@contextmanager
def _ros(options: "Options", signals: StopSignals, mission: Mission | None) -> Iterator[Context]:
    """Initialise ROS; a run without parameters uses the mission's default ones."""
    arguments = init_arguments(options.ros, _parameter_file(options, mission))
    if options.sim is not None:
        from sar_compiler.cli.sim_isolation import look_around
        from sar_compiler.sim.isolation import stay_on_this_machine

        stay_on_this_machine()
    with ros_up(arguments) as context:
        if options.sim is not None:
            look_around(signals, context=context)
        yield context


def _parameter_file(options: "Options", mission: Mission | None) -> Path | None:
    if options.params is not None or mission is None or parameter_files(options.ros):
        return options.params
    return mission.default_parameters()


def _simulated_time(options: "Options") -> list[Parameter]:
    return [Parameter("use_sim_time", value=True)] if options.sim is not None else []


@contextmanager
def _simulation(
    options: "Options", world: "World", node: Node, mission: MissionRun | None, faults: Sequence[Fault]
) -> "Iterator[Simulation]":
    """Start the world, the stand-in for Nav2 and the mission's servers in this process."""
    from sar_compiler.sim.placement import Placement
    from sar_compiler.sim.simulation import Simulation

    plan = FaultPlan(faults, mission.places() if mission is not None else None)
    settings = {"context": node.context, "parameter_overrides": _simulated_time(options)}
    servers = mission.servers(plan, **settings) if mission is not None else []
    try:
        simulation = Simulation(
            world,
            [Placement("", like=options.like)],
            speed=options.speed,
            seed=options.seed,
            faults=plan,
            context=node.context,
            namespace=node.get_namespace(),
            extra_nodes=servers,
        )
        simulation.wait_for(node.get_clock())
        with simulation:
            yield simulation
    finally:
        for server in servers:
            server.destroy_node()


@dataclass
class _TreeRun:
    """A tree on its node, from the wait for its requirements to the summary.

    Attributes:
        context: The objects passed to the leaves, by type.
        fixed_parameters: The names of parameters that are not set while it runs.
        journal: The journal, which may be none.
        companions: Those who go along with it.
        output: What is printed.
        world: The world that is simulated, if one is.
        simulation: The simulation, if there is one.
    """

    options: "Options"
    signals: StopSignals
    node: Node
    parameters: RunParameters
    mission: MissionRun | None
    fixed_parameters: Collection[str]
    journal: RunJournal
    companions: Companions
    output: RunOutput
    world: "World | None" = None
    simulation: "Simulation | None" = None

    def __post_init__(self) -> None:
        self._clock = mission_clock(self.node)
        self._end = self._end_condition()
        self._result: RunResult | None = None
        self._reason = ""
        self._started = 0.0
        self._adrift = ""
        self._callback_failure: Exception | None = None
        self._sole: SoleMission | None = None
        self._watch: Watch | None = None
        self._robot: RobotEstimate | None = None
        own = self.mission.context if self.mission is not None else {}
        self.context: dict[type, object] = {Clock: self._clock, **own, **self.journal.context}

    def _end_condition(self) -> EndCondition:
        until = self.options.until
        simulated = self.options.sim is not None
        ends_itself = self.mission is not None and self.mission.shortfalls() is not None
        if not ends_itself and until is Until.COMPLETE:
            message = (
                "--until complete is for a mission with an end of its own; for this tree say end, success, "
                "failure or forever"
            )
            raise SarError(message)
        if until is None:
            until = Until.END if not ends_itself else Until.COMPLETE if simulated else Until.FOREVER
        limit = self.parameters.time_limit_sec
        if limit is None and simulated and until is not Until.FOREVER:
            limit = _SIMULATED_TIME_LIMIT_SEC
        return EndCondition(until, self.mission, limit, self.node.get_logger().info)

    def run(self, tree: CompiledTree, engine: Engine, executor: SingleThreadedExecutor) -> int:
        """Wait, tick, stop and sum up; returns the exit status.

        Args:
            tree: The tree.
            engine: What ticks it.
            executor: Gets the node.

        Raises:
            NotReadyError: If a requirement of the tree is not fulfilled in time.
        """
        for line in self.mission.greeting() if self.mission is not None else []:
            self.node.get_logger().info(in_one_line(line))
        executor.add_node(self.node)
        if self.options.supervision is not None:
            steady = RosTime(clock_type=ClockType.STEADY_TIME)
            self.node.create_timer(PERIOD_SEC, self.options.supervision.tell_alive, clock=steady)
            self.options.supervision.tell_alive()
        route = self._route_check(tree) if self.options.check else None
        try:
            self._wait(executor, tree)
            if self._over:
                return self._interrupted()
            if self.options.check:
                return self._checked(executor, route)
            return self._tick(executor, tree, engine)
        except NotReadyError:
            if route is not None:
                route.tell(executor, self.output.say)
            raise

    def _wait(self, executor: SingleThreadedExecutor, tree: CompiledTree) -> None:
        # A check changes nothing on an existing robot.
        # A mission that goes on has a robot somewhere on its way; but a simulated world begins anew.
        unmoved = self.options.check or self.journal.journal.is_resumed
        told = self.parameters.set_initial_pose and (not unmoved or self.simulation is not None)
        if self.journal.journal.is_resumed and not told and Use.nav2() in tree.uses():
            self.node.get_logger().info(
                "The localisation is not told where the robot is, which has driven since the start. If it was started anew, "
                "give it the pose (in RViz: 2D Pose Estimate)."
            )
        with readable_ros_errors():
            start = self.parameters.initial_pose if told else None
            actions = [use.name for use in tree.uses() if use.kind == "action"]
            # Beside a simulation nobody else is allowed, and that was looked for.
            look_sec = 0.0 if self.simulation is not None else LOOK_SEC
            self._sole = SoleMission(self.node, actions, look_sec=look_sec, claims=not self.options.check)
            types = declared_types(tree.root)
            left = self.journal.left_goals()
            readiness = Readiness(
                self.node,
                tree.uses(),
                initial_pose=start,
                begins_anew=self.simulation is not None,
                first=(*left, self._sole),
                types=types,
            )
        try:
            wait_until_ready(executor, readiness, self.parameters.startup_timeout_sec, lambda: self._over)
        finally:
            for each in left:
                each.close()
        if readiness.uses_nav2 and not self._over:
            self.node.get_logger().info("Nav2 is active.")

    def _route_check(self, tree: CompiledTree) -> RouteCheck | None:
        """Return the check of the mission's way; None for a run that does not navigate."""
        if self.mission is None or Use.nav2() not in tree.uses():
            return None
        return RouteCheck(self.node, self.mission, self.parameters, self.world)

    def _checked(self, executor: SingleThreadedExecutor, route: RouteCheck | None) -> int:
        """Conclude a check for which everything is there; returns the exit status."""
        if route is not None and (problems := route.tell(executor, self.output.say)):
            count = "one problem" if problems == 1 else f"{problems} problems"
            return self._failed(
                f"everything that the tree needs is there, and the way has {count} (see above)"
            )
        self.output.say("Everything that the tree needs is there.")
        return OK

    def _tick(self, executor: SingleThreadedExecutor, tree: CompiledTree, engine: Engine) -> int:
        engine.add_post_tick_handler(self._look_for_end)
        self.journal.begin(engine, tree)
        self.companions.has_begun = True
        try:
            engine.setup(node=self.node)
            self.signals.last_words = lambda: self._leave_at_once(tree)
            self._begin_watching(tree)
            self._started = self._clock.now()
            engine.tick_tock(1000.0 / self.parameters.tick_rate_hz)
            with AWAKE.turning(self.node.get_logger().warning):
                while self._result is None and engine.failure is None and not self._over:
                    AWAKE.now()
                    self._turn(executor)
                    self._give_way_where_deaf()
            elapsed = self._clock.now() - self._started
            self._come_to_rest(engine, executor)
        except SetupFailedError as error:
            tell(self.node, str(error), error.__cause__)
            status = self._failed(
                "the tree was not started, because one of its leaves failed in setup (see above)", str(error)
            )
            self.journal.end(status, self._reason)
            return status
        finally:
            self.signals.last_words = None
            if self.options.supervision is not None:
                self.options.supervision.tell_end()
            if self._watch is not None:
                self._watch.close()
            engine.shutdown()
            self.output.leave()
        try:
            status = self._conclude(engine, elapsed)
        except MissionError as error:
            status = self._failed(str(error))
        over = engine.failure is None and (self._result is not None or self._end.complete)
        reason = self._result.reason if self._result is not None else self._reason
        self.journal.end(status, reason, is_over=over, is_stopped=self.signals.came)
        return status

    def _give_way_where_deaf(self) -> None:
        if self.options.supervision is not None and self._watch is not None and self._watch.deafness:
            self.options.supervision.tell_deaf()

    def _come_to_rest(self, engine: Engine, executor: SingleThreadedExecutor) -> None:
        """Stop the tree, and wait until its goals have ended and, as far as the odometry says it, the robot stands."""
        limit_sec = self.parameters.settle_timeout_sec
        deadline = time.monotonic() + limit_sec
        names = engine.settle(executor, limit_sec)
        if names:
            self._adrift = (
                f"a goal may still be active, and the robot may still be moving: {', '.join(names)}"
            )
        robot = self._robot
        while robot is not None and robot.stands is False and time.monotonic() < deadline:
            if not self.node.context.ok():
                return
            self._turn(executor)
        if robot is not None and robot.moves and not names:
            self._adrift = (
                f"no goal of this mission is active, and the robot still moves ({robot.speed_in_words})"
            )

    def _turn(self, executor: SingleThreadedExecutor) -> None:
        try:
            executor.spin_once(timeout_sec=_TURN_SEC)
        except ExternalShutdownException:
            pass  # noticed by the enclosing loop
        except Exception as error:  # noqa: BLE001 - of a leaf's own callback, or of rclpy's: a clock before 0
            self._callback_failure = error
            tell(self.node, f"A callback failed: {error_text(error)}. The tree is stopped.", error)

    def _leave_at_once(self, tree: CompiledTree) -> int | None:
        active = len(goals_under_way(self.node)) or (self._robot is not None and self._robot.moves)
        # Before anything that may take its time, which there is little of.
        send_cancels(tree.root, self.node)
        self.output.leave()
        if not active:
            print_error("sar-run: ended at once, as asked twice")
            return None
        print_error(
            "sar-run: ended at once, as asked twice: what is under way was told to stop, the robot may still be moving"
        )
        return ADRIFT

    def _begin_watching(self, tree: CompiledTree) -> None:
        if self._sole is not None:
            self._sole.run()
        types = declared_types(tree.root)
        drives = [use.name for use, kind in types.items() if kind.startswith("nav2_msgs/action/")]
        self._watch = Watch(self.node, tree.uses(), sole=self._sole, drives=drives)
        self._robot = robot_estimate(self.node) if drives else None
        if self._robot is not None:
            self._robot.settle_timeout_sec = self.parameters.settle_timeout_sec
        refuse_parameters(self.node, self.fixed_parameters)

    @property
    def _over(self) -> bool:
        """Whether the run is ended by something other than the tree."""
        failed = self.simulation is not None and self.simulation.failure is not None
        troubled = self._watch is not None and bool(self._watch.trouble)
        failed = failed or self._callback_failure is not None
        return self.signals.came or failed or troubled or not self.node.context.ok()

    def _look_for_end(self, tree: BehaviourTree) -> None:
        status = Status.INVALID if was_skipped(tree.root) else tree.root.status
        self._result = self._end.after_tick(status, self._clock.now() - self._started)

    def _conclude(self, engine: Engine, elapsed_sec: float) -> int:
        mission = self.mission or MissionRun()
        as_json = self.options.summary == "json"
        if not as_json and (summary := mission.summary(elapsed_sec, engine.count)):
            self.output.say(summary)
        supervision = self.options.supervision
        if not as_json and supervision is not None and (words := supervision.in_words()):
            self.output.say(words)
        status = self._status(engine)
        if as_json:
            said = {"status": status, "reason": self._reason, "duration": elapsed_sec, "ticks": engine.count}
            if supervision is not None:
                said["deaths"] = list(supervision.deaths)
            figures = {each.name: each.value for each in mission.display().figures}
            self.output.say(json_text({**said, "figures": figures}))
        return status

    def _status(self, engine: Engine) -> int:
        status = self._status_of_run(engine)
        if not self._adrift or (self.simulation is not None and self.simulation.failure is not None):
            return status
        print(f"sar-run: {self._adrift}", file=sys.stderr)
        self._reason = " ".join([*filter(None, [self._reason]), self._adrift])
        return ADRIFT

    def _status_of_run(self, engine: Engine) -> int:
        if engine.failure is not None:
            return self._failed(
                "the tree was stopped, because one of its leaves failed (see above)",
                failure_text(engine.failure),
            )
        if self._callback_failure is not None:
            return self._failed(
                "the tree was stopped, because a callback failed (see above)",
                f"a callback failed: {error_text(self._callback_failure)}",
            )
        if self._result is None and not self._end.complete:
            return self._interrupted()
        if self._result is not None and not self._result.achieved:
            return self._failed(self._result.reason)
        if self._end.shortfalls():
            return self._failed("the run has ended as asked, and the mission is incomplete")
        return OK

    def _interrupted(self) -> int:
        """Return the exit status of a run that was ended by something other than its tree."""
        failure = self.simulation.failure if self.simulation is not None else None
        if failure is not None:
            words = str(failure) if isinstance(failure, SarError) else f"{type(failure).__name__}: {failure}"
            return self._failed(f"the simulation has ended: {words}")
        if self.signals.came:
            return self.signals.exit_status
        if self._watch is not None and self._watch.trouble:
            return self._failed(self._watch.trouble)
        return self._failed("ROS was shut down")

    def _failed(self, said: str, reason: str = "") -> int:
        """Report why the run has failed, and return the exit status.

        Args:
            said: The last line on the terminal, below what was said of it before.
            reason: The same for those who do not have the terminal; by default in the same words.
        """
        self._reason = reason or said
        print_error(f"sar-run: {said}")
        return FINDINGS
