"""What there is of a run before its tree is compiled."""

from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.analysis.approval import ApprovalCheck
    from sar_compiler.execution.order_record import OrderRecord
    from sar_compiler.execution.run_options import RunOptions
    from sar_compiler.journal.journal import Journal
    from sar_compiler.missions.mission import MissionRun
    from sar_compiler.missions.parameter_reader import RunParameters
    from sar_compiler.project import ProjectTree
    from sar_compiler.ros.run_extension import RunExtension
    from sar_compiler.ros.signals import StopSignals
    from sar_compiler.terminal import RunOutput


class RunSetup(NamedTuple):
    """What there is of a run before its tree is compiled.

    Attributes:
        options: The options of the run.
        signals: The requests to stop.
        node: The run's node.
        journal: Its journal, which may be none.
        mission: The run of the mission.
        parameters: The parameters that any run has.
        loaded: The tree's file.
        values: What the node's parameters give to the tree, by their names.
        fixed_parameters: The names of those that are not set while it runs.
        output: Standard output.
        orders: Records by whom its orders are given.
        staying: What is to be called when the run has ended and ROS is taken down: who stays has its say there.
        approval: Whether the tree is approved; None if the options do not ask for that.
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
    orders: "OrderRecord"
    staying: list[Callable[[], object]]
    approval: "ApprovalCheck | None" = None


MakeExtension = Callable[[RunSetup], "RunExtension | None"]
"""Makes an extension of a run; None if there is none for this one."""
