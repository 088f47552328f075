"""The interface of a mission: the base classes of your own missions.

Missions are found through the entry point group `sar_compiler.missions`, whose entries name an instance of a `Mission`. Neither this module
nor a module that an entry names may import ROS: `sar-run` imports them before ROS is initialised, and commands import them on computers
without ROS.
"""

import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.journal.display import Display, LandmarkKind
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.missions.parameter_reader import ParameterReader

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.journal.journal import Journal
    from sar_compiler.missions.faults import FaultPlan


LONGEST = 200
"""Largest number of characters in a text of a command."""


_LEAST_CORNERS, _MOST_CORNERS = 3, 100
_EMPTY: Mapping[str, Any] = {"number": None, "polygon": ()}


class CommandError(SarError):
    """A command is unknown or incomplete."""


class CommandField(NamedTuple):
    """A field of a command.

    Attributes:
        name: Its name. `x` and `y` together are a position on the map, in metres.
        label: Its label on the page.
        kind: `text`; `number`; `choice`, of `choices`; `found`, the name of a landmark that was found; `polygon` on the
            map: its corners in their order, each x and y in metres.
        choices: For `choice`: pairs of a value and its label.
        optional: Whether it may be empty: a number is then None, a polygon has no corners, and any other field is an empty string.
        landmark: The kind of the landmark that its value names, of which the command is refused if it has changed; empty for none.
    """

    name: str
    label: str
    kind: Literal["text", "number", "choice", "found", "polygon"] = "text"
    choices: Sequence[tuple[str, str]] = ()
    optional: bool = False
    landmark: str = ""


class OperatorCommand(NamedTuple):
    """A command of the operator.

    Attributes:
        name: The name of the service on the mission's node: `pause` for `~/pause`. The response has `success` and `message`.
        label: The text of its button.
        named: The same with the command's object, `Skip {}`; see `Display.objects`. Empty for a command without an object's name.
        help: Its effect, in a sentence.
        service_type: The service's type, `std_srvs/srv/Trigger` for a command without fields.
        fields: Its fields.
        confirm: The warning to confirm first; empty for a harmless command.
        fill: Fills the service's request with the values.
        role: Its place on pages: `stop` ends the mission where the robot stands, `hold` pauses and `release` resumes it. Empty for any
                other.
    """

    name: str
    label: str
    help: str
    service_type: str = "std_srvs/srv/Trigger"
    fields: Sequence[CommandField] = ()
    confirm: str = ""
    fill: Callable[[Any, Mapping[str, Any]], None] = lambda _request, _values: None
    role: Literal["", "stop", "hold", "release"] = ""
    named: str = ""

    def check(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Check and return the values of a command.

        Raises:
            CommandError: If a value is missing, wrong or unknown.
        """
        if unknown := set(values) - {field.name for field in self.fields}:
            raise CommandError(f"{self.name} has no field {min(unknown)!r:.60}")
        return {field.name: self._check_field(field, values.get(field.name)) for field in self.fields}

    def _check_field(self, field: CommandField, value: Any) -> Any:
        if field.optional and value in ("", None, []):
            return _EMPTY.get(field.kind, "")
        if field.kind == "polygon":
            return self._check_corners(field, value)
        if field.kind == "number":
            fits, wanted = _is_number(value), "a number"
        else:
            fits = isinstance(value, str) and 0 < len(value) <= LONGEST and value.isprintable()
            wanted = f"a string of at most {LONGEST} characters on one line"
            if field.kind == "choice":
                fits = fits and value in dict(field.choices)
                wanted = f"one of {', '.join(dict(field.choices))}"
        if not fits:
            raise CommandError(f"{self.name}: {field.name} is {value!r:.60}, but must be {wanted}")
        return float(value) if field.kind == "number" else value

    def _check_corners(self, field: CommandField, value: Any) -> list[tuple[float, float]]:
        corners = value if isinstance(value, list) else []
        are_places = all(
            isinstance(corner, list) and list(map(_is_number, corner)) == [True, True] for corner in corners
        )
        if not (are_places and _LEAST_CORNERS <= len(corners) <= _MOST_CORNERS):
            wanted = f"{_LEAST_CORNERS} to {_MOST_CORNERS} corners, each [x, y] in metres"
            raise CommandError(f"{self.name}: {field.name} is {value!r:.60}, but must be {wanted}")
        return [(float(x), float(y)) for x, y in corners]


def _is_number(value: Any) -> bool:
    # An integer may be larger than any finite float.
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


class SearchedArea(NamedTuple):
    """An area that the robot will search, for the route check.

    Attributes:
        name: Its name.
        corners: Its polygon: x and y in metres, frame `map`.
        swath: Distance between the legs of a sweep, metres.
    """

    name: str
    corners: Sequence[tuple[float, float]]
    swath: float


class MissionRun:
    """One run of a mission: its leaves' shared state, and its result.

    Attributes:
        context: The objects for its leaves, by their type (see `runtime.context.mission_context`).
        kinds: The kinds of landmarks that it shows on the map.
    """

    context: Mapping[type, Any] = {}
    kinds: Sequence[LandmarkKind] = ()

    def start_lines(self) -> list[str]:
        """Return the lines to log at the start."""
        return []

    def initial_facts(self) -> Mapping[str, bool | int | float | str]:
        """Return the initial facts that the parameters determine: `{"zones_left": 4}`.

        Runs without a robot (`simulate`, `verify`) use them for leaves that know these facts.
        """
        return {}

    def added_facts(self) -> Mapping[str, int]:
        """Return by how much commands have increased facts: `{"zones_left": 1}` after a zone was added.

        No outcome of a leaf includes these changes, so a run that is monitored for properties reads them here.
        """
        return {}

    def limits(self) -> Mapping[str, int]:
        """Return upper limits of facts for monitoring, if their values are unknown at the start: `{"more_pieces": 10_000}`.

        A limit is the largest number of occurrences: outcomes only lower it.
        """
        return {}

    def identity(self) -> Mapping[str, object]:
        """Return the parameters that identify this mission, as JSON values; resuming requires equal ones."""
        return {}

    def use_journal(self, journal: "Journal") -> None:
        """Record the mission's events in a journal from now on; called once, before the tree is compiled.

        Every event that must survive the process is written with `journal.note` before it is reported anywhere, and changes the run's state by
        `apply`. The events of earlier runs are applied here. A resumed tree starts over; its leaves use this state to skip finished work.
        A subclass that stores the journal overrides this method and calls it.

        Raises:
            JournalError: If the events of earlier runs are not those of such a mission.
        """
        journal.attach(self, self.kinds)

    def apply(self, fact: JournalEntry) -> None:
        """Update the run's state from an event of this run, or of an earlier run when it resumes.

        It also receives the start and the end of a run, `run_began` and `run_ended`. Nothing else may change persistent state.

        Raises:
            ArithmeticError, AttributeError, LookupError, TypeError or ValueError: If the event contradicts the current state.
        """

    def display(self) -> Display:
        """Return the current display; it is requested after each event."""
        return Display()

    def sentence(self, fact: JournalEntry) -> str:  # noqa: ARG002 - for subclasses
        """Return an event as a sentence without a full stop; empty to use its kind and values."""
        return ""

    def verbs(self) -> Sequence[OperatorCommand]:
        """Return the operator's commands; pages show a button for each, and leaves provide the services."""
        return ()

    def places(self) -> Mapping[str, tuple[float, float]] | None:
        """Return the positions that a fault may name: x and y in metres, frame `map`; None for the world's zones."""
        return None

    def route(self) -> Sequence[tuple[str, float, float]]:
        """Return the names and positions of the robot's targets, in order, for the route check.

        x and y in metres, frame `map`; by default its `places`.
        """
        return [(name, *place) for name, place in (self.places() or {}).items()]

    def optional_stops(self) -> Sequence[tuple[str, float, float]]:
        """Return the names and positions of optional stops, such as charging places, for the route check."""
        return []

    def searched_areas(self) -> Sequence[SearchedArea]:
        """Return the areas that the robot will search; the route check computes the reachable part of each."""
        return ()

    def allows(self, x: float, y: float) -> bool:  # noqa: ARG002 - for subclasses
        """Return whether a position (frame `map`, metres) is inside the robot's geofence."""
        return True

    def servers(self, faults: "FaultPlan", **options: Any) -> "list[Node]":  # noqa: ARG002
        """Create the servers that a simulation needs in addition to the world's.

        Args:
            faults: The faults of their services (`faults.for_service`), and the run's seed (`faults.seed`).
            options: Keyword arguments of `rclpy.node.Node` for each of them: its context, `use_sim_time`.
        """
        return []

    def shortfalls(self) -> list[str] | None:
        """Return a sentence for each unfinished item; empty if the mission is complete.

        Returns:
            The sentences; None for a mission whose end is decided by the tree's root.
        """
        return None

    def open_points(self) -> list[str]:
        """Return sentences about open points of a complete mission, which follow "Mission complete."."""
        return []

    def idle_reason(self) -> str:
        """Return a sentence if no work is left, such as "No zone is left", otherwise an empty string.

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
        parameter_names: The parameters that it reads; of a group, the first part. Used to detect typos.
        path_parameters: Those of its parameters that are file paths (`ParameterReader.read_file`). A client of `sar-run --serve`
                cannot set them.
        faults: The faults that `--fault` can inject into its servers, of `drop`, `delay` and `refuse`, by service.
        default_tree: The name of a shipped tree, or a file; None if the user must name a tree.
        is_resumable: Whether a run records events in its journal (`MissionRun.use_journal`), so that a later run can resume it. On
                a robot such a run has a journal by default.
    """

    name: str
    context_types: Collection[type] = ()
    parameter_names: Collection[str] = ()
    path_parameters: Collection[str] = ()
    faults: Mapping[str, Collection[str]] = {}
    default_tree: str | None = None
    is_resumable: bool = False

    def default_parameters(self) -> Path | None:
        """Return the default parameter file."""
        return None

    def default_properties(self, leaves: Collection[type]) -> Path | None:  # noqa: ARG002
        """Return the default properties to verify; None for none.

        Args:
            leaves: The classes of the tree's leaves.
        """
        return None

    @abstractmethod
    def begin(self, reader: ParameterReader) -> MissionRun:
        """Start a run.

        Args:
            reader: The node's parameters. Errors are reported to it; it then returns placeholders, and the run is
                    discarded before they are used.
        """
