"""One run of `sar-run`, from the tree file to the exit status.

Discovery of other ROS nodes takes longer than all other steps before the first tick. So the mission's node is created as soon as its name
is known, and modules that are not needed earlier are imported afterwards.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rclpy.context import Context
from rclpy.node import Node

from sar_compiler.commands import print_error, print_note
from sar_compiler.execution.journal_start import JournalStart
from sar_compiler.execution.run_options import RunOptions, RunOutcome
from sar_compiler.execution.run_setup import MakeExtension, RunStart, simulated_time
from sar_compiler.gc_pause import gc_paused
from sar_compiler.missions.mission import Mission
from sar_compiler.missions.mission_choice import mission_of
from sar_compiler.missions.mission_start import node_name, parse_faults
from sar_compiler.missions.tree_check import check_mission
from sar_compiler.project import ProjectTree, Workspace
from sar_compiler.ros.arguments import init_arguments, node_arguments, parameter_files
from sar_compiler.ros.discovery_wait import SETTLING_SEC, DiscoveryWait
from sar_compiler.ros.middleware import ros_up
from sar_compiler.ros.parameters import DataNode
from sar_compiler.ros.signals import StopSignals
from sar_compiler.terminal import RunOutput, draws_in_place

if TYPE_CHECKING:
    from sar_compiler.analysis.approval import ApprovalCheck
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
        options: The options of the run.
        makes: Functions that create the extensions of the run.
        signals: The requests to stop.
        ros: Shuts down ROS at the end, after the run has written all of its output.
        staying: A list to which functions are added that must be called after ROS is shut down.
        output: The run's output.
        report: Called with the outcome before the extensions close.

    Raises:
        TreeError: If the tree is not valid; the robot has not moved.
        NotReadyError: If a requirement of the tree is missing in the simulation, or does not appear in time; the robot has not moved.
        SarError: If the mission, the parameters, the world or the ROS arguments are wrong; the robot has not moved.
    """
    with JournalStart(options) as journal, ExitStack() as stack:
        loader = Workspace(options.additions, note=print_note, further_checks=[check_mission])
        loaded = loader.load(options.tree)
        binding = loaded.binding(options.tree_id)
        loader.report_use()
        approval = _approval(options, loaded) if options.approved else None
        mission = mission_of(loaded, binding)
        faults = parse_faults(options.fault, mission)
        world = _world(options)
        context = ros.enter_context(_ros(options, signals, mission))
        if signals.came:
            return RunOutcome(signals.exit_status)
        node = _node(options, mission, context)
        ros.callback(node.destroy_node)
        # A simulation need not wait: `require_isolation` has already checked that there are no other nodes.
        discovery = DiscoveryWait(node, SETTLING_SEC if options.sim is None else 0.0)
        with gc_paused():
            from sar_compiler.execution.node_run import run_on_node

        start = RunStart(
            options, signals, loaded, binding, mission, faults, world, node, discovery, journal, approval
        )
        outcome = run_on_node(start, makes, ros, stack, staying, output)
        report(outcome)
        return outcome


def _approval(options: RunOptions, loaded: ProjectTree) -> "ApprovalCheck":
    """Check that the tree is approved.

    Raises:
        ApprovalError: If this version of the tree is not approved.
    """
    from sar_compiler.analysis.approval import ApprovalCheck

    # The option without a file selects the mission's own properties.
    properties = options.properties if isinstance(options.properties, Path) else None
    return ApprovalCheck(loaded, options.tree_id, options.params, properties)


def _world(options: RunOptions) -> "World | None":
    """Return the world to simulate, or None for a run on a robot.

    Call this function early, so that a wrong name is reported before slow steps.
    """
    if options.sim is None:
        return None
    from sar_compiler.sim.world import find_world

    world = find_world(options.sim)
    for finding in world.warnings:
        print_error(finding.render())
    return world


@contextmanager
def _ros(options: RunOptions, signals: StopSignals, mission: Mission | None) -> Iterator[Context]:
    """Initialise ROS; if the run has no parameter file, use the mission's default file."""
    arguments = init_arguments(options.ros, _parameter_file(options, mission))
    if options.sim is not None:
        from sar_compiler.execution.sim_isolation import require_isolation
        from sar_compiler.sim.isolation import stay_on_this_machine

        stay_on_this_machine()
        if draws_in_place(sys.stderr):  # wall time is meaningless in a simulation
            os.environ.setdefault("RCUTILS_CONSOLE_OUTPUT_FORMAT", "[{severity}] [{name}]: {message}")
    with ros_up(arguments) as context:
        if options.sim is not None:
            require_isolation(signals, context=context)
        yield context


def _parameter_file(options: RunOptions, mission: Mission | None) -> Path | None:
    given: Path | None = options.params
    if given is not None or mission is None or parameter_files(options.ros):
        return given
    return mission.default_parameters()


def _node(options: RunOptions, mission: Mission | None, context: Context) -> Node:
    own, simulated = node_arguments(options.ros), simulated_time(options)
    node = DataNode(node_name(mission), context, cli_args=own, parameter_overrides=simulated)
    if options.traceback:
        from sar_compiler.ros.engine import show_tracebacks

        show_tracebacks(node)
    if options.sim is not None:
        from sar_compiler.ros.clock import trust_simulation

        trust_simulation(node)
    return node
