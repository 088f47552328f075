"""What a mission is to whoever runs trees; a mission of one's own derives from these two classes.

It comes by the entry point group `sar_compiler.missions`, whose entries name an object of a `Mission`. Nothing
here imports ROS, and neither does a module that an entry names: `sar-run` reads them before ROS is up, and a
laptop without ROS must be able to.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.parameter_reader import ParameterReader

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.ros.faults import FaultPlan


class MissionRun:
    """One run of a mission: what its leaves share, and what becomes of it.

    Attributes:
        context: The objects for its leaves, by their type (see `runtime.context.mission_context`).
    """

    context: Mapping[type, object] = {}

    def greeting(self) -> list[str]:
        """Return what is logged before the start, a line each."""
        return []

    def places(self) -> Mapping[str, tuple[float, float]] | None:
        """Return the places that a fault may name: x and y in metres, frame `map`; None for the world's."""
        return None

    def servers(self, faults: "FaultPlan", **options: Any) -> "list[Node]":  # noqa: ARG002
        """Make the nodes that a simulation must serve, because the world itself does not have them.

        Args:
            faults: How they misbehave (`faults.for_service`).
            options: Keyword arguments of `rclpy.node.Node` for each of them: its context, `use_sim_time`.
        """
        return []

    def shortfalls(self) -> list[str] | None:
        """Return in sentences what a complete mission still lacks; none left means that it is complete.

        Returns:
            None for a mission without an end of its own: its tree's root decides.
        """
        return None

    def nothing_left(self) -> str:
        """Return in words that nothing is left to do ("No zone is left"); empty while something is.

        Where the tree then idles, the run ends, complete or not.
        """
        return ""

    def summary(self, elapsed_sec: float, ticks: int) -> str:  # noqa: ARG002
        """Return what is printed at the end; empty for nothing.

        Args:
            elapsed_sec: How long the run took, in seconds of the node's clock.
            ticks: How often the tree was ticked.
        """
        return ""


class Mission(ABC):
    """A kind of mission.

    Attributes:
        name: Its name: for `--mission`, and its node's unless that is remapped.
        context_types: The types of its context objects; a tree with a leaf that asks for one is its.
        parameter_names: The parameters that it reads, of a group the first part; slips are told by them.
        faults: What `--fault` can do to its servers: of `drop`, `delay` and `refuse`, by service.
        default_tree: A shipped tree's name, or a file; None if a tree must be named.
    """

    name: str
    context_types: Collection[type]
    parameter_names: Collection[str] = ()
    faults: Mapping[str, Collection[str]] = {}
    default_tree: str | None = None

    def default_parameters(self) -> Path | None:
        """Return the parameter file that counts where none is given."""
        return None

    def default_properties(self, leaves: Collection[type]) -> Path | None:  # noqa: ARG002
        """Return what must hold in all runs of a tree where no file of properties is given; None for nothing.

        Args:
            leaves: The classes of the tree's leaves.
        """
        return None

    @abstractmethod
    def begin(self, reader: ParameterReader) -> MissionRun:
        """Begin a run.

        Args:
            reader: The node's parameters. Mistakes are reported to it; it then reads a stand-in, and the run is
                dropped before anything uses it.
        """
