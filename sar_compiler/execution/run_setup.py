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
        binding: The selected tree, whose tags are bound to nodes.
        mission: The mission; None for a tree without a mission.
        faults: The faults to inject into the simulation.
        world: The simulated world; None for an existing robot.
        node: The run's node.
        discovery: The wait for the discovery of other nodes. It began when the node was created.
        journal: The object that records the reason if the start is refused.
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
        journal: The run's journal, which may be inactive.
        mission: The run of the mission.
        parameters: The parameters that every run has, with or without a mission.
        loaded: The loaded tree file.
        values: The values of the node's parameters by name.
        fixed_parameters: The names of parameters that cannot be set during the run.
        output: The run's human-readable output.
        orders: Records the operator's commands with their authors.
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
"""Creates an extension of a run, or returns None if the run does not need it."""


def simulated_time(options: "RunOptions") -> "list[Parameter]":
    """Return the parameter overrides that make a node use simulated time. A run on a robot has no such overrides."""
    from rclpy.parameter import Parameter

    return [Parameter("use_sim_time", value=True)] if options.sim is not None else []
