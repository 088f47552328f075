"""The interface of a mission: the base classes of your own missions.

Missions are found by the entry point group `sar_compiler.missions`, whose entries name an instance of a `Mission`.
Nothing here imports ROS, and neither may a module that an entry names: `sar-run` imports them before ROS is
initialised, and a laptop without ROS must be able to.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.situation import Display, LandmarkKind
from sar_compiler.ros.parameter_reader import ParameterReader

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.journal.journal import Journal
    from sar_compiler.missions.verbs import Verb
    from sar_compiler.ros.faults import FaultPlan


class MissionRun:
    """One run of a mission: the state that its leaves share, and its result.

    Attributes:
        context: The objects for its leaves, by their type (see `runtime.context.mission_context`).
        kinds: The kinds of landmarks that it shows on the map.
    """

    context: Mapping[type, Any] = {}
    kinds: Sequence[LandmarkKind] = ()

    def greeting(self) -> list[str]:
        """Return the lines to log before the start."""
        return []

    def facts(self) -> Mapping[str, bool | int | float | str]:
        """Return the facts that its parameters decide, as they are at the start: `{"zones_left": 4}`.

        They count in runs without a robot (`simulate`, `verify`), for leaves that know these facts.
        """
        return {}

    def identity(self) -> Mapping[str, object]:
        """Return the parameters that make it this mission, as JSON values: another one cannot go on with its journal."""
        return {}

    def keep_in(self, journal: "Journal") -> None:
        """Keep the mission's facts in a journal from now on; called once, before the tree is compiled.

        Whatever is to outlast the process is written with `journal.note` before anybody is told of it, and changes the run's state by `apply`:
        what earlier runs have written does so here. The leaves answer by that state what is finished, because the tree starts anew.
        Who keeps the journal, to note in it, says so in a method of this name, and calls this one.

        Raises:
            JournalError: If the facts of earlier runs are not those of such a mission.
        """
        journal.attach(self, self.kinds)

    def apply(self, fact: JournalEntry) -> None:
        """Change the run's state by a fact: of this run as it is noted, of earlier ones as it is taken over.

        It is told of the beginning and the end of a run as well, `run_began` and `run_ended`. Nothing else changes what is remembered.

        Raises:
            ArithmeticError, AttributeError, LookupError, TypeError or ValueError: If there cannot be such a fact now.
        """

    def display(self) -> Display:
        """Return what the mission shows of itself, as it is now: asked for after each fact, and what has changed is written behind it."""
        return Display()

    def sentence(self, fact: JournalEntry) -> str:  # noqa: ARG002 - for subclasses
        """Return a fact as a sentence, without a full stop; empty for its kind and its values."""
        return ""

    def verbs(self) -> "Sequence[Verb]":
        """Return what the operator can order while it runs, for pages with a button each; the tree's leaves offer the services."""
        return ()

    def places(self) -> Mapping[str, tuple[float, float]] | None:
        """Return the places that a fault may name: x and y in metres, frame `map`; None for the world's zones."""
        return None

    def route(self) -> Sequence[tuple[str, float, float]]:
        """Return the names and positions to which the robot will drive, in their order, for a check before the flight.

        x and y in metres, frame `map`; by default its `places`.
        """
        return [(name, *place) for name, place in (self.places() or {}).items()]

    def allows(self, x: float, y: float) -> bool:  # noqa: ARG002 - for subclasses
        """Return whether the robot may be at a position in the frame `map`, metres: whether it is inside its geofence."""
        return True

    def servers(self, faults: "FaultPlan", **options: Any) -> "list[Node]":  # noqa: ARG002
        """Create the nodes that a simulation must serve in addition to the world's own.

        Args:
            faults: The faults of their services (`faults.for_service`).
            options: Keyword arguments of `rclpy.node.Node` for each of them: its context, `use_sim_time`.
        """
        return []

    def shortfalls(self) -> list[str] | None:
        """Return in sentences what is missing for a complete mission; empty if it is complete.

        Returns:
            The sentences; None for a mission without an end of its own, whose tree's root decides.
        """
        return None

    def nothing_left(self) -> str:
        """Return in words that nothing is left to do ("No zone is left"); empty while something is.

        If the tree is then idle, the run ends, complete or not.
        """
        return ""

    def summary(self, elapsed_sec: float, ticks: int) -> str:  # noqa: ARG002
        """Return the text to print at the end; empty for none.

        Args:
            elapsed_sec: The duration of the run, in seconds of the node's clock.
            ticks: The number of ticks.
        """
        return ""


class Mission(ABC):
    """A kind of mission.

    Attributes:
        name: Its name, for `--mission` and for its node unless that is remapped.
        context_types: The types of its context objects; a tree with a leaf that requires one is a tree of this mission.
        parameter_names: The parameters that it reads, of a group the first part; used to detect misspellings.
        faults: The faults that `--fault` can inject into its servers, of `drop`, `delay` and `refuse`, by service.
        default_tree: A shipped tree's name, or a file; None if a tree must be named.
        is_resumable: Whether a run keeps facts in its journal (`MissionRun.keep_in`), so that another can go on with it. On
            a robot it then has one unless that is declined.
    """

    name: str
    context_types: Collection[type] = ()
    parameter_names: Collection[str] = ()
    faults: Mapping[str, Collection[str]] = {}
    default_tree: str | None = None
    is_resumable: bool = False

    def default_parameters(self) -> Path | None:
        """Return the parameter file to use if none is given."""
        return None

    def default_properties(self, leaves: Collection[type]) -> Path | None:  # noqa: ARG002
        """Return the properties to verify if no file of properties is given; None for none.

        Args:
            leaves: The classes of the tree's leaves.
        """
        return None

    @abstractmethod
    def begin(self, reader: ParameterReader) -> MissionRun:
        """Begin a run.

        Args:
            reader: The node's parameters. Mistakes are reported to it; it then returns placeholders, and the run is
                dropped before they are used.
        """
