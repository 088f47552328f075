"""One run of `sar-run`, from the tree file to the exit status."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.parameter import Parameter

from sar_compiler.analysis.approval import ApprovalCheck
from sar_compiler.commands import print_error, print_note
from sar_compiler.compiler import CompiledTree, compile_tree, require_classes
from sar_compiler.execution.command_authors import CommandAuthors
from sar_compiler.execution.extensions import RunExtensions
from sar_compiler.execution.run_journal import JournalStart, RunJournal
from sar_compiler.execution.run_options import RunOptions, RunOutcome
from sar_compiler.execution.run_setup import MakeExtension, RunSetup
from sar_compiler.execution.supervision import PERIOD_SEC
from sar_compiler.execution.tree_run import RouteCheck, TreeRun, end_condition
from sar_compiler.journal.journal import Journal
from sar_compiler.missions.faults import NAVIGATION, Fault, FaultPlan
from sar_compiler.missions.mission import Mission
from sar_compiler.missions.mission_choice import mission_of
from sar_compiler.missions.mission_start import begin_run, fixed_parameters, node_name, parse_faults
from sar_compiler.missions.parameter_reader import ParameterReader
from sar_compiler.missions.tree_check import check_mission
from sar_compiler.nodes.spec import Use
from sar_compiler.project import ProjectTree, Workspace
from sar_compiler.ros.arguments import init_arguments, node_arguments, parameter_files
from sar_compiler.ros.clock import mission_clock, steady_timer, trust_simulation
from sar_compiler.ros.engine import show_tracebacks
from sar_compiler.ros.engines import find_engine
from sar_compiler.ros.executors import make_executor
from sar_compiler.ros.middleware import ros_up
from sar_compiler.ros.parameters import DataNode, flat_parameters
from sar_compiler.ros.readiness import NotReadyError
from sar_compiler.ros.signals import StopSignals
from sar_compiler.runtime.clock import Clock
from sar_compiler.terminal import RunOutput, draws_in_place
from sar_compiler.tree.display_text import escape_to_one_line

if TYPE_CHECKING:
    from sar_compiler.sim.node_host import SteppedExecutor
    from sar_compiler.sim.simulation import Simulation
    from sar_compiler.sim.world import World


def run_mission(
    options: RunOptions,
    makes: Sequence[MakeExtension],
    signals: StopSignals,
    ros: ExitStack,
    staying: list[Callable[[], object]],
    output: RunOutput,
    report: Callable[[RunOutcome], object],
) -> RunOutcome:
    """Check the tree, wait for its requirements, tick it to the end, and return the outcome.

    Args:
        options: The options.
        makes: Create the extensions of the run.
        signals: The requests to stop.
        ros: Shuts down ROS at the end, after the run has written all of its output.
        staying: Collects functions to call after that.
        output: The run's output.
        report: Called with the result before the extensions close.

    Raises:
        TreeError: If the tree is not valid; the robot has not moved.
        NotReadyError: If a requirement of the tree is missing in the simulation, or does not appear in time; the robot has not moved.
        SarError: If the mission, the parameters, the world or the ROS arguments are wrong; the robot has not moved.
    """
    with JournalStart(options) as start, ExitStack() as stack:
        make_engine = find_engine(options.engine)
        loader = Workspace(options.additions, note=print_note, further_checks=[check_mission])
        loaded = loader.load(options.tree)
        binding = loaded.binding(options.tree_id)
        loader.report_use()
        approval = _approval(options, loaded) if options.approved else None
        require_classes(binding)
        mission = mission_of(loaded, binding)
        faults = parse_faults(options.fault, mission)
        world = _world(options)
        context = ros.enter_context(_ros(options, signals, mission))
        if signals.came:
            return RunOutcome(signals.exit_status)
        node = _node(options, mission, context)
        ros.callback(node.destroy_node)
        start.find_path(mission, node)
        files = parameter_files(options.ros, options.params)
        reader = ParameterReader.from_files(flat_parameters(node), files, node.get_fully_qualified_name())
        run, parameters, notes = begin_run(mission, reader, binding)
        if approval is not None:
            approval.require_parameters(reader.parameters, reader.files)
        run_journal = start.journal = RunJournal(options, mission, node, loaded.path)
        journal, fixed = run_journal.journal, fixed_parameters(mission, binding)
        options.supervision.send_journal_path(journal.path)
        orders = CommandAuthors(node, run.verbs(), journal)
        setup = RunSetup(
            options,
            signals,
            node,
            journal,
            run,
            parameters,
            loaded,
            reader.parameters,
            fixed,
            output,
            orders,
            staying,
            approval,
        )
        extensions = RunExtensions(setup, run_journal, makes, stack)
        run_journal.attach_mission(run, reader.parameters)
        end = end_condition(setup)
        leaves = {Clock: mission_clock(node), **run.context, Journal: journal}
        tree = compile_tree(binding, leaves, reader.parameters)
        engine = make_engine(tree.root)
        extensions.on_compiled(tree, engine)
        for note in notes:
            node.get_logger().warning(escape_to_one_line(note))
        if world is not None:
            _require_navigation(tree, world)
        executor = _executor(options, context)
        ros.callback(executor.shutdown)
        simulation = ros.enter_context(_simulation(setup, world, faults, executor))
        if options.supervision.is_there:
            options.supervision.send_heartbeat()
            steady_timer(node, PERIOD_SEC, options.supervision.send_heartbeat)
        route = _route_check(setup, tree, world)
        outcome = TreeRun(setup, end, extensions, tree, engine, executor, simulation).run(route)
        report(outcome)
        return outcome


def _approval(options: RunOptions, loaded: ProjectTree) -> ApprovalCheck:
    """Check that the tree is approved.

    Raises:
        ApprovalError: If this version of it is not approved.
    """
    # The option without a file selects the mission's own properties.
    properties = options.properties if isinstance(options.properties, Path) else None
    return ApprovalCheck(loaded, options.tree_id, options.params, properties)


def _executor(options: RunOptions, context: Context) -> "Executor | SteppedExecutor":
    """Return the executor of the mission's node, which may also step the world."""
    if options.stepped:
        from sar_compiler.sim.node_host import SteppedExecutor

        with suppress(ImportError):
            return SteppedExecutor(context)
    return make_executor(context, options.executor)


def _world(options: RunOptions) -> "World | None":
    """Return the world to simulate, if any; report a wrong name before slow steps."""
    if options.sim is None:
        return None
    from sar_compiler.sim.world import find_world

    world = find_world(options.sim)
    for finding in world.warnings:
        print_error(finding.render())
    return world


def _require_navigation(tree: CompiledTree, world: "World") -> None:
    """Check that the simulation provides Nav2 if the tree needs it.

    Raises:
        NotReadyError: If it does not provide Nav2.
    """
    if world.map_path is None and not {Use.nav2(), Use.action(NAVIGATION)}.isdisjoint(tree.uses()):
        line = f"Nav2: the world '{world.name}' has no map for navigation. Draw one with sar-sim map, and name it in the world's file"
        raise NotReadyError([line], None)


def _route_check(setup: RunSetup, tree: CompiledTree, world: "World | None") -> RouteCheck | None:
    """Return the requested check of the mission's route; None for a run that does not navigate."""
    if not setup.options.check or not setup.mission.route() or Use.nav2() not in tree.uses():
        return None
    return RouteCheck(setup.node, setup.mission, setup.parameters, world)


@contextmanager
def _ros(options: RunOptions, signals: StopSignals, mission: Mission | None) -> Iterator[Context]:
    """Initialise ROS; a run without parameters uses the mission's default ones."""
    arguments = init_arguments(options.ros, _parameter_file(options, mission))
    if options.sim is not None:
        from sar_compiler.execution.sim_isolation import look_around
        from sar_compiler.sim.isolation import stay_on_this_machine

        stay_on_this_machine()
        if draws_in_place(sys.stderr):  # wall time is meaningless in a simulation
            os.environ.setdefault("RCUTILS_CONSOLE_OUTPUT_FORMAT", "[{severity}] [{name}]: {message}")
    with ros_up(arguments) as context:
        if options.sim is not None:
            look_around(signals, context=context)
        yield context


def _parameter_file(options: RunOptions, mission: Mission | None) -> Path | None:
    given: Path | None = options.params
    if given is not None or mission is None or parameter_files(options.ros):
        return given
    return mission.default_parameters()


def _node(options: RunOptions, mission: Mission | None, context: Context) -> Node:
    own, simulated = node_arguments(options.ros), _simulated_time(options)
    node = DataNode(node_name(mission), context, cli_args=own, parameter_overrides=simulated)
    if options.traceback:
        show_tracebacks(node)
    if options.sim is not None:
        trust_simulation(node)
    return node


def _simulated_time(options: RunOptions) -> list[Parameter]:
    return [Parameter("use_sim_time", value=True)] if options.sim is not None else []


@contextmanager
def _simulation(
    setup: RunSetup, world: "World | None", faults: Sequence[Fault], executor: "Executor | SteppedExecutor"
) -> "Iterator[Simulation | None]":
    """Start the world, the Nav2 substitute and the mission's servers in this process, if a world is simulated."""
    if world is None:
        yield None
        return
    from sar_compiler.sim.node_host import SteppedExecutor
    from sar_compiler.sim.placement import Placement
    from sar_compiler.sim.simulation import Simulation

    stepped = executor if isinstance(executor, SteppedExecutor) else None
    options, node = setup.options, setup.node
    plan = FaultPlan(faults, setup.mission.places(), options.seed)
    settings = {"context": node.context, "parameter_overrides": _simulated_time(options)}
    servers = setup.mission.servers(plan, **settings)
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
            executor=stepped,
        )
        if stepped is None:
            simulation.wait_for(node.get_clock())
        with simulation:
            yield simulation
    finally:
        for server in servers:
            server.destroy_node()
