"""Run a tree on a ROS node: wait for the tree's requirements, tick the tree, stop it and summarise the run."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from signal import Signals
from typing import TYPE_CHECKING

from nav_msgs.msg import OccupancyGrid
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future

from sar_compiler.budget import Budget
from sar_compiler.commands import FINDINGS, OK, ROBOT_MAY_MOVE, print_error
from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.execution.end_condition import EndCondition, RunResult, default_summary
from sar_compiler.execution.extensions import RunExtensions
from sar_compiler.execution.run_options import RunOutcome
from sar_compiler.execution.run_setup import RunSetup
from sar_compiler.execution.until import Until
from sar_compiler.journal.journal_entries import LEAF_RAISED, Ending
from sar_compiler.missions.mission import MissionRun, SearchedArea
from sar_compiler.missions.mission_choice import MissionError
from sar_compiler.missions.parameter_reader import RunParameters
from sar_compiler.nodes.spec import Use
from sar_compiler.ros.arguments import convert_ros_errors
from sar_compiler.ros.clock import AWAKE, mission_clock
from sar_compiler.ros.dependency_monitor import DependencyMonitor, refuse_parameters
from sar_compiler.ros.discovery_wait import DiscoveryWait
from sar_compiler.ros.engine import (
    Engine,
    SetupFailedError,
    error_text,
    failure_text,
    log_error,
    raising_behaviour,
)
from sar_compiler.ros.executors import suitable_executor
from sar_compiler.ros.forced_end import ForcedEnd
from sar_compiler.ros.graph_queries import declared_endpoints, ros_graph
from sar_compiler.ros.leaves.leaf import RosLeaf, qos_profile
from sar_compiler.ros.message_values import grid_geometry, value_reports
from sar_compiler.ros.nav2_parameters import nav2_parameters
from sar_compiler.ros.orphaned_goals import OrphanedGoals, make_separate_canceller
from sar_compiler.ros.readiness import NotReadyError, Readiness, wait_until_ready
from sar_compiler.ros.robot_estimate import RobotEstimate, robot_estimate
from sar_compiler.ros.robot_lease import RobotLease
from sar_compiler.ros.run_extension import UnfitLeavesError
from sar_compiler.ros.tick_watch import TickWatch
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.display_text import escape_to_one_line

if TYPE_CHECKING:
    from sar_compiler.sim.occupancy import OccupancyMap
    from sar_compiler.sim.planner import Planner, RouteLeg
    from sar_compiler.sim.simulation import Simulation
    from sar_compiler.sim.world import World

# Maximum duration of one turn of the executor, in seconds: the first while the tree is not ticked, the second while it is ticked. Signals are
# handled between two turns. In a stepped simulation, a turn includes all pending work.
_TURN_SEC, _TICKING_TURN_SEC = 0.05, 0.1

# A run that a signal has stopped exits with this status plus the signal's number.
_SIGNAL_STATUS = 128
# Default time limit of a simulated run, in seconds of simulated time, because a tree can alternate between two tasks forever.
_SIMULATED_TIME_LIMIT_SEC = 900.0


def end_condition(setup: RunSetup) -> EndCondition:
    """Return the end condition of a run from its options and its mission.

    Raises:
        SarError: If `--until complete` is set, and the mission has no end condition.
    """
    until, simulated = setup.options.until, setup.options.sim is not None
    ends_itself = setup.mission.shortfalls() is not None
    if not ends_itself and until is Until.COMPLETE:
        raise SarError(
            "--until complete requires a mission with an end condition. For this tree, use --until end, success, "
            "failure or forever"
        )
    if until is None:
        until = Until.END if not ends_itself else Until.COMPLETE if simulated else Until.FOREVER
    limit = setup.parameters.time_limit_sec
    if limit is None and simulated and until is not Until.FOREVER:
        limit = _SIMULATED_TIME_LIMIT_SEC
    return EndCondition(until, setup.mission, limit, setup.node.get_logger().info)


_MAP = "map"
# Maximum wait for a published map when all requirements are present, in seconds.
_MAP_DEADLINE_SEC = 5.0
# Maximum CPU time of planning, in seconds, because a route with a thousand stops on a large map would take minutes.
_MOST_PLANNING_SEC = 30.0
# Minimum size of a reported part of an area that is outside the map, in square metres.
_LEAST_REPORTED_M2 = 0.1


class RouteReport:
    """The report on a mission's route and areas.

    Args:
        mission: The run of the mission.
        parameters: The parameters of the run.
        occupancy: The map.

    Attributes:
        lines: A table of the stops with distances and driving times, then the areas; empty for a mission without a route and areas.
        problems: One sentence for each problem with the route or an area.
    """

    def __init__(self, mission: MissionRun, parameters: RunParameters, occupancy: "OccupancyMap") -> None:
        from sar_compiler.sim.planner import Planner, plan_route

        x, y, _ = parameters.initial_pose
        self._radius, self._speed = parameters.robot_radius_m, parameters.cruise_speed_mps
        stops = mission.route()
        planner = Planner(occupancy, self._radius) if stops else None
        budget = Budget(_MOST_PLANNING_SEC)
        legs = plan_route(planner, (x, y), stops, mission.allows, budget) if planner is not None else []
        self.lines = self._table(legs) if legs else []
        optional_legs = [
            leg
            for place in mission.optional_stops()
            if planner is not None
            for leg in plan_route(planner, (x, y), [place], mission.allows, budget)
        ]
        self.lines += [
            f"  {leg.name}, from the start: {self._length_text(leg.distance).strip()}"
            for leg in optional_legs
        ]
        self.problems = [
            f"{leg.name} ({leg.x:.2f}, {leg.y:.2f}): {leg.trouble}."
            for leg in (*legs, *optional_legs)
            if leg.trouble
        ]
        if unplanned := len(stops) - len(legs):
            reason = f"route planning has reached its limit of {_MOST_PLANNING_SEC:g} s of CPU time"
            self.problems.append(f"{unplanned} of {len(stops)} stops were not checked: {reason}.")
        if legs and not mission.allows(x, y):
            self.problems.insert(0, f"The start ({x:.2f}, {y:.2f}) is outside the geofence.")
        limit, seconds = parameters.time_limit_sec, _distance(legs) / self._speed
        if limit is not None and seconds > limit:
            self.problems.append(
                f"Driving takes {seconds:.0f} s (estimated), but time_limit_sec is {limit:g}."
            )
        if planner is not None and (areas := mission.searched_areas()):
            self._add_areas(planner, (x, y), areas)

    def _add_areas(
        self, planner: "Planner", start: tuple[float, float], areas: Sequence[SearchedArea]
    ) -> None:
        """Report the reachable part of each area, and how long the robot takes to sweep this part."""
        from sar_compiler.sim.planner import PlanningError, reachable_areas

        try:
            reaches = reachable_areas(planner, start, [area.corners for area in areas])
        except PlanningError:
            return  # already reported for every stop
        width = max(len(area.name) for area in areas)
        self.lines.append(
            "The areas on the map (driving time for one sweep of the reachable part, turns not included):"
        )
        for area, reach in zip(areas, reaches, strict=True):
            covered = f"{reach.reached_m2:.1f} of {reach.area_m2:.1f} m²"
            line = f"  {area.name:{width}}  {covered:>20}  {self._length_text(reach.reached_m2 / area.swath)}"
            if reach.cut_off_at is not None:
                x, y = reach.cut_off_at
                line += f"; {reach.cut_off_m2:.1f} m² are unreachable, such as ({x:.2f}, {y:.2f})"
            if reach.off_map_m2 >= _LEAST_REPORTED_M2:
                line += f"; {reach.off_map_m2:.1f} m² are outside the map"
            self.lines.append(line)
            if not reach.reached_m2:
                self.problems.append(f"{area.name}: no part of its area is reachable.")

    def _table(self, legs: "Sequence[RouteLeg]") -> list[str]:
        width = max(len(leg.name) for leg in legs)
        rows = [(leg.name, leg.distance) for leg in legs] + [("total", _distance(legs))]
        title = f"The route on the map (estimated; robot radius {self._radius:g} m, {self._speed:g} m/s):"
        return [title, *(f"  {name:{width}}  {self._length_text(length)}" for name, length in rows)]

    def _length_text(self, length: float | None) -> str:
        return "not reached" if length is None else f"{length:6.1f} m {length / self._speed:6.0f} s"


class RouteCheck:
    """Checks a mission's route on the map of the simulated world, or on the published map.

    Args:
        node: The mission's node, which subscribes to the map.
        mission: The run of the mission.
        parameters: The parameters of the run.
        world: The simulated world; None for an existing robot.
    """

    def __init__(
        self, node: Node, mission: MissionRun, parameters: RunParameters, world: "World | None"
    ) -> None:
        self._node, self._mission, self._parameters, self._world = node, mission, parameters, world
        self._grid: OccupancyGrid | None = None
        if world is None:
            latched = qos_profile(type(self).__name__, "transient_local")
            node.create_subscription(OccupancyGrid, _MAP, self._on_map, latched)

    def report(self, executor: Executor, say: Callable[[str], object]) -> int:
        """Print the route on standard output and its problems on standard error; return the number of problems.

        Args:
            executor: The executor of the mission's node.
            say: Prints a text on standard output.
        """
        occupancy = self._map(executor)
        if occupancy is None:
            topic = self._node.resolve_topic_name(_MAP)
            self._node.get_logger().warning(f"No map was received on {topic}, so the route was not checked.")
            return 0
        report = RouteReport(self._mission, self._parameters, occupancy)
        if report.lines:
            say("\n".join(report.lines))
        for problem in report.problems:
            print_error(f"sar-run: {problem}")
        return len(report.problems)

    def _on_map(self, grid: OccupancyGrid) -> None:
        self._grid = grid

    def _map(self, executor: Executor) -> "OccupancyMap | None":
        if self._world is not None:
            from sar_compiler.sim.occupancy import read_map

            return read_map(self._world.map_path) if self._world.map_path is not None else None
        deadline = time.monotonic() + _MAP_DEADLINE_SEC
        while self._grid is None and ros_graph(self._node).publishers(_MAP) and time.monotonic() < deadline:
            with suppress(ExternalShutdownException):
                executor.spin_once(timeout_sec=_TURN_SEC)
        grid = self._grid
        if (
            grid is None
            or value_reports(self._node).read(f"Topic '{_MAP}'", lambda: grid_geometry(grid)) is None
        ):
            return None
        from sar_compiler.sim.messages import from_grid

        return from_grid(grid)


def _distance(legs: "Sequence[RouteLeg]") -> float:
    """Return the total length of all reachable legs of the route, in metres."""
    return sum(leg.distance or 0.0 for leg in legs)


@dataclass
class TreeRun:
    """Runs a tree on a ROS node: waits for the tree's requirements, ticks it, stops it and summarises the run.

    Attributes:
        setup: The state of the run before compilation.
        discovery: The wait for the discovery of other nodes.
        end: The condition that ends the run.
        extensions: The extensions of the run.
        tree: The compiled tree.
        engine: Ticks the tree.
        executor: Spins the mission's node.
        simulation: The simulation in this process; None on a robot.
    """

    setup: RunSetup
    discovery: DiscoveryWait
    end: EndCondition
    extensions: RunExtensions
    tree: CompiledTree
    engine: Engine
    executor: Executor
    simulation: "Simulation | None"

    def __post_init__(self) -> None:
        self._options, self._node, self._output = self.setup.options, self.setup.node, self.setup.output
        self._parameters, self._signals = self.setup.parameters, self.setup.signals
        self._clock = mission_clock(self._node)
        self._result: RunResult | None = None
        self._turn_over = Future()
        self._reason = ""
        self._outcome = RunOutcome(OK)
        self._has_ticked = False
        self._messages: list[str] = []
        self._started = 0.0
        self._may_move = ""
        self._callback_failure: Exception | None = None
        self._sole: RobotLease | None = None
        self._watch: DependencyMonitor | None = None
        self._robot: RobotEstimate | None = None

    def run(self, route: RouteCheck | None) -> RunOutcome:
        """Wait for the tree's requirements, tick the tree, stop it and summarise the run.

        Args:
            route: The check of the mission's route for a run with `--check`, in which the tree is not ticked; None if there is no route to
                check.

        Raises:
            NotReadyError: If a requirement of the tree does not appear in time.
        """
        status = self._run(route)
        return replace(
            self._outcome,
            status=status,
            reason=self._reason,
            hint=self.extensions.replay_hint if self._has_ticked else "",
            head=self.setup.journal.head if self._has_ticked else "",
            cause=self.extensions.cause_of_failure() if status else "",
            messages=tuple(self._messages),
        )

    def _run(self, route: RouteCheck | None) -> int:
        for line in self.setup.mission.start_lines():
            self._node.get_logger().info(escape_to_one_line(line))
        self.executor.add_node(self._node)
        self.executor = suitable_executor(self.executor, self._node)
        try:
            self._wait()
        except NotReadyError:
            if route is not None:
                route.report(self.executor, self._output.print_important)
            raise
        if self._is_over:
            return self._interruption_status()
        return self._conclude_check(route) if self._options.check else self._tick()

    def _wait(self) -> None:
        for each in self.tree.root.iterate():
            if isinstance(each, RosLeaf):
                each.require_definition()
        # A check and a resumed mission send no initial pose to a robot: a check must not change anything, and the robot of a resumed mission is
        # somewhere on its route. A simulated world always starts over.
        is_resumed = self.setup.journal.is_resumed
        keeps_pose = self._options.check or is_resumed
        sends_pose = self._parameters.set_initial_pose and (not keeps_pose or self.simulation is not None)
        if is_resumed and not sends_pose and Use.nav2() in self.tree.uses():
            self._node.get_logger().info(
                "No initial pose is sent to the localisation, because the robot has driven since the start."
            )
        readiness = self._readiness(with_pose=sends_pose)
        limit_sec = self._parameters.startup_timeout_sec
        wait_until_ready(self.executor, readiness, limit_sec, lambda: self._is_over)
        if readiness.uses_nav2 and not self._is_over:
            self._node.get_logger().info("Nav2 is active.")
            for line in nav2_parameters(self._node).advice():
                self._node.get_logger().warning(f"Nav2's parameters: {line}.")

    @convert_ros_errors()
    def _readiness(self, *, with_pose: bool) -> Readiness:
        actions = [use.name for use in self.tree.uses() if use.kind == "action"]
        self._sole = RobotLease(self._node, actions, self.discovery, claims=not self._options.check)
        return Readiness(
            self._node,
            self.tree.uses(),
            initial_pose=self._parameters.initial_pose if with_pose else None,
            restarts=self.simulation is not None,
            can_resume=self.setup.journal.aside is not None,
            first=(OrphanedGoals(self._node, self.setup.journal), self._sole),
            endpoints=declared_endpoints(self.tree.root),
            report=self.extensions.on_awaited,
        )

    def _conclude_check(self, route: RouteCheck | None) -> int:
        """Check the route when all requirements of `--check` are present, and return the exit status."""
        if route is not None and (problems := route.report(self.executor, self._output.print_important)):
            count = "one problem" if problems == 1 else f"{problems} problems"
            return self._fail(f"all requirements are present, but the route has {count} (see above)")
        self._output.print_important("All requirements are present.")
        return OK

    def _tick(self) -> int:
        """Tick the tree until the run ends, and summarise; return the exit status."""
        self._has_ticked = True
        try:
            return self._execute_run()
        finally:
            self._output.leave()

    def _execute_run(self) -> int:
        """Tick the tree until the run ends, and record the end in the journal; return the exit status."""
        # The order of the last steps matters. Properties are evaluated before the tree is halted, because halting is not an event of the run. The
        # end is recorded in the journal last: the record states whether every goal was observed to end. After a crash before this step, the
        # mission can be resumed.
        engine = self.engine
        engine.add_post_tick_handler(self._check_end)
        self._signals.ends_unnoticed = False
        self.extensions.on_begin()
        try:
            with self._tick_watch():
                engine.setup(node=self._node)
                self.executor = suitable_executor(self.executor, self._node)
                self.setup.orders.begin()
                self.extensions.on_setup()
                self._signals.last_words = self._end.end_immediately
                self._begin_watching()
                self._started = self._clock.now()
                self._tick_until_over()
                elapsed = self._clock.now() - self._started
                is_over = engine.failure is None and (self._result is not None or self.end.complete)
                self.extensions.on_last_tick(is_over=is_over)
                self._stop_and_settle()
        except SetupFailedError as error:
            log_error(self._node, str(error), error.__cause__)
            status = self._fail(
                "the tree was not started, because one of its leaves failed in setup (see above)", str(error)
            )
            self._end_journal(Ending.FAILED, status, self._reason)
            return status
        except UnfitLeavesError as error:
            status = self._fail(str(error))
            self._end_journal(Ending.FAILED, status, self._reason)
            return status
        finally:
            self._signals.last_words = None
            self._options.supervision.send_end()
            engine.shutdown()
        try:
            status = self._conclude(elapsed)
        except MissionError as error:
            status = self._fail(str(error))
        self._report_verdicts()
        ending = Ending.OVER if is_over else Ending.STOPPED if self._signals.came else Ending.FAILED
        reason = self._result.reason if self._result is not None else self._reason
        self._end_journal(ending, status, reason)
        return status

    def _report_verdicts(self) -> None:
        """Add the verdicts of the monitored properties to the outcome."""
        watch = self.extensions.property_watch()
        if watch is not None:
            summary = (*self._outcome.summary, watch.summary_text())
            self._outcome = replace(self._outcome, verdicts=watch.verdicts(), summary=summary)

    def _end_journal(self, ending: Ending, status: int, reason: str) -> None:
        journal, failure = self.setup.journal, self.engine.failure
        if not journal.is_wanted:
            return
        if failure is not None:
            raised = raising_behaviour(failure)
            numbers = (number for number, each in enumerate(pre_order(self.tree.root)) if each is raised)
            journal.record_observation(LEAF_RAISED, node=next(numbers, None), text=failure_text(failure))
        journal.end_run(ending, status, reason)

    def _tick_until_over(self) -> None:
        self.engine.tick_tock(1000.0 / self._parameters.tick_rate_hz)
        with AWAKE.mark_polling(self._node.get_logger().warning):
            while self._result is None and self.engine.failure is None and not self._is_over:
                AWAKE.now()
                self._turn_over = Future()
                self._spin_once(
                    lambda: self.executor.spin_until_future_complete(self._turn_over, _TICKING_TURN_SEC)
                )
                if self._watch is not None and self._watch.lost_discovery:
                    self._options.supervision.send_discovery_lost()

    def _stop_and_settle(self) -> None:
        """Halt the tree, and wait until its goals have ended and the robot stands still."""
        limit_sec = self._parameters.settle_timeout_sec
        deadline = time.monotonic() + limit_sec
        names = self.engine.settle(self.executor, limit_sec)
        if names:
            self._may_move = (
                f"a goal may still be active, and the robot may still be moving: {', '.join(names)}"
            )
        robot = self._robot
        while robot is not None and robot.is_standing is False and time.monotonic() < deadline:
            if not self._node.context.ok():
                return
            self._spin_once(lambda: self.executor.spin_once(_TURN_SEC))
        if robot is not None and robot.moves and not names:
            self._may_move = (
                f"no goal of this mission is active, but the robot still moves ({robot.speed_text})"
            )

    def _spin_once(self, spin: Callable[[], object]) -> None:
        try:
            spin()
        except ExternalShutdownException:
            pass  # handled by the enclosing loop
        except Exception as error:  # noqa: BLE001 - raised by a leaf's own callback, or by rclpy, for example at a negative time
            self._callback_failure = error
            log_error(self._node, f"A callback failed: {error_text(error)}. The tree is stopped.", error)

    def _tick_watch(self) -> TickWatch:
        """Create the watchdog that reports a blocking leaf, and that lets a stop request end the blocked run."""
        cancel, parameters = None, self._parameters
        if self.simulation is None:
            cancel = make_separate_canceller(self._node)
        self._end = ForcedEnd(
            "sar-run",
            self._node,
            self.tree.root,
            self._signals,
            cancel,
            parameters.settle_timeout_sec,
            moves=lambda: self._robot is not None and bool(self._robot.moves),
            before_message=self._output.leave,
        )
        return TickWatch(
            self._node,
            self.tree.root,
            cancel=cancel,
            cancel_sec=parameters.blocked_tick_timeout_sec,
            signals=self._signals,
            end=self._end.end_blocked,
            settle_sec=parameters.settle_timeout_sec,
        )

    def _begin_watching(self) -> None:
        if self._sole is not None:
            self._sole.run()
        endpoints = declared_endpoints(self.tree.root)
        drives = [
            use.name for use, each in endpoints.items() if each.type_name.startswith("nav2_msgs/action/")
        ]
        self._watch = DependencyMonitor(self._node, self.tree.uses(), sole=self._sole, drives=drives)
        self._robot = robot_estimate(self._node) if drives else None
        if self._robot is not None:
            self._robot.settle_timeout_sec = self._parameters.settle_timeout_sec
            self._robot.arrival_tolerance_m = self._parameters.arrival_tolerance_m
        refuse_parameters(self._node, self.setup.fixed_parameters)

    @property
    def _is_over(self) -> bool:
        """Whether the run was ended by a signal, a failure, a lost dependency or a shutdown of ROS."""
        failed = self._callback_failure is not None or self._failure_of_simulation is not None
        troubled = self._watch is not None and bool(self._watch.trouble)
        return self._signals.came or failed or troubled or not self._node.context.ok()

    @property
    def _failure_of_simulation(self) -> BaseException | None:
        return self.simulation.failure if self.simulation is not None else None

    def _check_end(self, tree: BehaviourTree) -> None:
        status = Status.INVALID if was_skipped(tree.root) else tree.root.status
        self._result = self.end.after_tick(status, self._clock.now() - self._started)
        if self._result is not None:
            self._turn_over.set_result(None)

    def _conclude(self, elapsed_sec: float) -> int:
        """Store the summary in the outcome; return the exit status."""
        mission, supervision, ticks = self.setup.mission, self._options.supervision, self.engine.count
        status = self._status()
        summary = mission.summary(elapsed_sec, ticks) or default_summary(
            mission, self._outcome_text(status), elapsed_sec, ticks
        )
        self._outcome = RunOutcome(
            status,
            duration_sec=elapsed_sec,
            ticks=ticks,
            figures={each.name: each.value for each in mission.display().figures},
            deaths=tuple(supervision.deaths) if supervision.is_there else None,
            summary=tuple(filter(None, (summary, supervision.summary_text()))),
        )
        return status

    def _outcome_text(self, status: int) -> str:
        """Return a run's outcome in words, given the exit status."""
        if status > _SIGNAL_STATUS:
            return f"was stopped by {Signals(status - _SIGNAL_STATUS).name}"
        return "succeeded" if status == OK else "failed"

    def _status(self) -> int:
        status = self._status_of_run()
        if not self._may_move or self._failure_of_simulation is not None:
            return status
        self._messages.append(self._may_move)
        self._reason = " ".join([*filter(None, [self._reason]), self._may_move])
        return ROBOT_MAY_MOVE

    def _status_of_run(self) -> int:
        if self.engine.failure is not None:
            return self._fail(
                "the tree was stopped, because one of its leaves failed (see above)",
                failure_text(self.engine.failure),
            )
        if self._callback_failure is not None:
            return self._fail(
                "the tree was stopped, because a callback failed (see above)",
                f"a callback failed: {error_text(self._callback_failure)}",
            )
        if self._result is None and not self.end.complete:
            return self._interruption_status()
        if self._result is not None and not self._result.achieved:
            return self._fail(self._result.reason)
        if self.end.shortfalls():
            return self._fail("the run has ended as requested, but the mission is incomplete")
        return OK

    def _interruption_status(self) -> int:
        """Return the exit status of a run that was ended by something other than the tree; store the reason."""
        if (failure := self._failure_of_simulation) is not None:
            words = str(failure) if isinstance(failure, SarError) else f"{type(failure).__name__}: {failure}"
            return self._fail(f"the simulation has ended: {words}")
        if self._signals.came:
            return self._signals.exit_status
        if self._watch is not None and self._watch.trouble:
            return self._fail(self._watch.trouble)
        return self._fail("ROS was shut down")

    def _fail(self, message: str, reason: str = "") -> int:
        """Store why the run failed, and return the exit status.

        Args:
            message: The reason to print on the terminal. This text may refer to earlier messages.
            reason: The reason to record in the journal and to report to other programs; by default *message*.
        """
        self._reason = reason or message
        self._messages.append(message)
        return FINDINGS
