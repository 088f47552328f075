"""The steps of a run after its node is created: parameters, journal, compiled tree and ticks."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING

from rclpy.context import Context
from rclpy.executors import Executor

from sar_compiler.compiler import CompiledTree, compile_tree, require_classes
from sar_compiler.execution.command_authors import CommandAuthors
from sar_compiler.execution.extensions import RunExtensions
from sar_compiler.execution.run_journal import RunJournal
from sar_compiler.execution.run_options import RunOptions, RunOutcome
from sar_compiler.execution.run_setup import MakeExtension, RunSetup, RunStart, simulated_time
from sar_compiler.execution.supervision import PERIOD_SEC
from sar_compiler.execution.tree_run import RouteCheck, TreeRun, end_condition
from sar_compiler.journal.journal import Journal
from sar_compiler.missions.faults import NAVIGATION, Fault, FaultPlan
from sar_compiler.missions.mission_start import begin_run, fixed_parameters
from sar_compiler.missions.parameter_reader import ParameterReader
from sar_compiler.nodes.spec import Use
from sar_compiler.ros.arguments import parameter_files
from sar_compiler.ros.clock import mission_clock, steady_timer
from sar_compiler.ros.engines import find_engine
from sar_compiler.ros.executors import make_executor
from sar_compiler.ros.parameters import flat_parameters
from sar_compiler.ros.readiness import NotReadyError
from sar_compiler.runtime.clock import Clock
from sar_compiler.terminal import RunOutput
from sar_compiler.tree.display_text import escape_to_one_line

if TYPE_CHECKING:
    from sar_compiler.sim.node_host import SteppedExecutor
    from sar_compiler.sim.simulation import Simulation
    from sar_compiler.sim.world import World


def run_on_node(
    start: RunStart,
    makes: Sequence[MakeExtension],
    ros: ExitStack,
    stack: ExitStack,
    staying: list[Callable[[], object]],
    output: RunOutput,
) -> RunOutcome:
    """Compile the tree, wait for its requirements, tick it to the end, and return the outcome.

    Args:
        start: The state of the run when its node has just been created.
        makes: Functions that create the extensions of the run.
        ros: Shuts down ROS at the end.
        stack: Closes the extensions before ROS is shut down.
        staying: A list to which functions are added that must be called after ROS is shut down.
        output: The run's output.

    Raises:
        TreeError, NotReadyError, SarError: See `mission_run.run_mission`.
    """
    options, mission, binding, node = start.options, start.mission, start.binding, start.node
    make_engine = find_engine(options.engine)
    require_classes(binding)
    start.journal.find_path(mission, node)
    files = parameter_files(options.ros, options.params)
    reader = ParameterReader.from_files(flat_parameters(node), files, node.get_fully_qualified_name())
    run, parameters, notes = begin_run(mission, reader, binding)
    if start.approval is not None:
        start.approval.require_parameters(reader.parameters, reader.files)
    run_journal = RunJournal(start.journal, mission, node, start.loaded.path)
    journal, fixed = run_journal.journal, fixed_parameters(mission, binding)
    options.supervision.send_journal_path(journal.path)
    orders = CommandAuthors(node, run.verbs(), journal)
    setup = RunSetup(
        options,
        start.signals,
        node,
        journal,
        run,
        parameters,
        start.loaded,
        reader.parameters,
        fixed,
        output,
        orders,
        staying,
        start.approval,
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
    if start.world is not None:
        _require_navigation(tree, start.world)
    executor = _executor(options, node.context)
    ros.callback(executor.shutdown)
    simulation = ros.enter_context(_simulation(setup, start.world, start.faults, executor))
    if options.supervision.is_there:
        options.supervision.send_heartbeat()
        steady_timer(node, PERIOD_SEC, options.supervision.send_heartbeat)
    route = _route_check(setup, tree, start.world)
    return TreeRun(setup, start.discovery, end, extensions, tree, engine, executor, simulation).run(route)


def _executor(options: RunOptions, context: Context) -> "Executor | SteppedExecutor":
    """Create the executor of the mission's node, which may also step the simulated world."""
    if options.stepped:
        from sar_compiler.sim.node_host import SteppedExecutor

        with suppress(ImportError):
            return SteppedExecutor(context)
    return make_executor(context, options.executor)


def _require_navigation(tree: CompiledTree, world: "World") -> None:
    """Check that the simulation can provide Nav2 when the tree needs Nav2.

    Raises:
        NotReadyError: If the tree needs Nav2 and the simulated world has no map.
    """
    if world.map_path is None and not {Use.nav2(), Use.action(NAVIGATION)}.isdisjoint(tree.uses()):
        line = (
            f"Nav2: the world '{world.name}' has no map for navigation. Draw a map with sar-sim map, "
            "and name the map in the world's file"
        )
        raise NotReadyError([line], None)


def _route_check(setup: RunSetup, tree: CompiledTree, world: "World | None") -> RouteCheck | None:
    """Create the check of the mission's route, or return None if this run needs no such check.

    The route is checked only with `--check`, and only if the tree navigates.
    """
    if not setup.options.check or not setup.mission.route() or Use.nav2() not in tree.uses():
        return None
    return RouteCheck(setup.node, setup.mission, setup.parameters, world)


@contextmanager
def _simulation(
    setup: RunSetup, world: "World | None", faults: Sequence[Fault], executor: "Executor | SteppedExecutor"
) -> "Iterator[Simulation | None]":
    """Start the simulated world, if there is one, with the Nav2 substitute and the mission's servers in this process."""
    if world is None:
        yield None
        return
    from sar_compiler.sim.node_host import SteppedExecutor
    from sar_compiler.sim.placement import Placement
    from sar_compiler.sim.simulation import Simulation

    stepped = executor if isinstance(executor, SteppedExecutor) else None
    options, node = setup.options, setup.node
    plan = FaultPlan(faults, setup.mission.places(), options.seed)
    settings = {"context": node.context, "parameter_overrides": simulated_time(options)}
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
