"""The states of a run before its tree is compiled."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    from sar_compiler.analysis.approval import ApprovalCheck
    from sar_compiler.execution.command_authors import CommandAuthors
    from sar_compiler.execution.journal_start import JournalStart
    from sar_compiler.execution.run_options import RunOptions
    from sar_compiler.journal.journal import Journal
    from sar_compiler.missions.faults import Fault
    from sar_compiler.missions.mission import Mission, MissionRun
    from sar_compiler.missions.parameter_reader import RunParameters
    from sar_compiler.nodes.binding.bound import Binding
    from sar_compiler.project import ProjectTree
    from sar_compiler.ros.discovery_wait import DiscoveryWait
    from sar_compiler.ros.run_extension import RunExtension
    from sar_compiler.ros.signals import StopSignals
    from sar_compiler.sim.world import World
    from sar_compiler.terminal import RunOutput


class RunStart(NamedTuple):
    """The state of a run when its node has just been created.

    Attributes:
        options: The options of the run.
        signals: The requests to stop.
        loaded: The loaded tree file.
        binding: The tree.
        mission: The mission; None for a tree without one.
        faults: The faults of the simulation.
        world: The simulated world; None for an existing robot.
        node: The run's node.
        discovery: The wait for other nodes, which began with the node.
        journal: Records why the run does not start.
        approval: The approval of the tree; None if the options do not require it.
    """

    options: "RunOptions"
    signals: "StopSignals"
    loaded: "ProjectTree"
    binding: "Binding"
    mission: "Mission | None"
    faults: "Sequence[Fault]"
    world: "World | None"
    node: "Node"
    discovery: "DiscoveryWait"
    journal: "JournalStart"
    approval: "ApprovalCheck | None"


class RunSetup(NamedTuple):
    """The state of a run before its tree is compiled.

    Attributes:
        options: The options of the run.
        signals: The requests to stop.
        node: The run's node.
        journal: Its journal, which may be inactive.
        mission: The run of the mission.
        parameters: The parameters of every run.
        loaded: The loaded tree file.
        values: The tree's values from the node's parameters, by name.
        fixed_parameters: The parameters that cannot be set during the run.
        output: Standard output.
        orders: Records the authors of commands.
        staying: Functions to call when the run has ended and ROS is shut down.
        approval: The approval of the tree; None if the options do not require it.
    """

    options: "RunOptions"
    signals: "StopSignals"
    node: "Node"
    journal: "Journal"
    mission: "MissionRun"
    parameters: "RunParameters"
    loaded: "ProjectTree"
    values: Mapping[str, object]
    fixed_parameters: Collection[str]
    output: "RunOutput"
    orders: "CommandAuthors"
    staying: list[Callable[[], object]]
    approval: "ApprovalCheck | None" = None


MakeExtension = Callable[[RunSetup], "RunExtension | None"]
"""Creates an extension of a run; None if this run needs none."""


def simulated_time(options: "RunOptions") -> "list[Parameter]":
    """Return the parameters that make a node use the time of a run's simulation, if there is one."""
    from rclpy.parameter import Parameter

    return [Parameter("use_sim_time", value=True)] if options.sim is not None else []
