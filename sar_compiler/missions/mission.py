"""The interface of a mission: the base classes of your own missions.

Missions are found through the entry point group `sar_compiler.missions`. Each entry of this group names an
instance of a `Mission`. Neither this module nor a module that an entry names may import ROS: `sar-run`
imports them before ROS is initialised, and other commands import them on computers without ROS.
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
"""The maximum length of a string in a command, in characters."""


_LEAST_CORNERS, _MOST_CORNERS = 3, 100
_EMPTY: Mapping[str, Any] = {"number": None, "polygon": ()}


class CommandError(SarError):
    """A command is unknown, has an invalid value, or cannot be sent."""


class CommandField(NamedTuple):
    """A field of a command.

    Attributes:
        name: The field's name. Two fields `x` and `y` together are a position on the map, in metres.
        label: The field's label on the page.
        kind: `text`; `number`; `choice`, one of `choices`; `found`, the name of a landmark that the robot has
            detected; `polygon`, the corners of an area on the map in order, each as x and y in metres.
        choices: Pairs of a value and its label, for `choice`.
        optional: Whether the field may be empty. An empty number is None, an empty polygon has no corners, and any other empty field is an
            empty string.
        landmark: The kind of the landmark that the value names. The command is refused if the landmark has
            changed since the author of the command saw the landmark. Empty if the value does not name a
            landmark.
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
        name: The name of the service on the mission's node, such as `pause` for `~/pause`. The response has the fields `success` and
                `message`.
        label: The text of the command's button.
        named: The button's text with `{}` for the name of the command's object, such as `Skip {}`; see `Display.objects`. Empty for a
                command without an object.
        help: The effect of the command, in a sentence.
        service_type: The service's type, `std_srvs/srv/Trigger` for a command without fields.
        fields: The command's fields.
        confirm: The warning that the operator must confirm; empty for a command without risk.
        fill: Fills the service's request with the values of the fields.
        role: The command's role on pages: `stop` ends the mission where the robot stands, `hold` pauses it, and `release` resumes it. Empty
                for other commands.
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
        """Check the given values of the command's fields, and return a value for every field.

        Raises:
            CommandError: If a value is missing or invalid, or if a value names an unknown field.
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
    """An area that the robot will search. The route check computes the reachable part of this area.

    Attributes:
        name: The area's name.
        corners: The corners of the area's polygon: x and y in metres, frame `map`.
        swath: The distance between adjacent legs of a sweep, in metres.
    """

    name: str
    corners: Sequence[tuple[float, float]]
    swath: float


class MissionRun:
    """Base class of one run of a mission: the state that its leaves share, and its result.

    Attributes:
        context: The context objects of the leaves, by type (see `runtime.context.mission_context`).
        kinds: The kinds of landmarks that the mission shows on the map.
    """

    context: Mapping[type, Any] = {}
    kinds: Sequence[LandmarkKind] = ()

    def start_lines(self) -> list[str]:
        """Return the lines to log at the start of the run."""
        return []

    def initial_facts(self) -> Mapping[str, bool | int | float | str]:
        """Return the initial values of the facts that depend on parameters, such as `{"zones_left": 4}`.

        `simulate` and `verify`, which need no robot, start with these values if the leaves of the tree have such facts.
        """
        return {}

    def added_facts(self) -> Mapping[str, int]:
        """Return the amounts by which commands have increased facts, such as `{"zones_left": 1}` after a zone was added.

        The outcomes of leaves do not include these changes, so the property monitor reads them here.
        """
        return {}

    def limits(self) -> Mapping[str, int]:
        """Return an upper limit for each fact whose initial value is unknown, such as `{"more_pieces": 10_000}`.

        The property monitor starts with the limit as the value of the fact. Outcomes may only decrease this fact.
        """
        return {}

    def identity(self) -> Mapping[str, object]:
        """Return the parameters that identify this mission, as JSON values. The mission can only be resumed with equal values."""
        return {}

    def use_journal(self, journal: "Journal") -> None:
        """Apply the events of earlier runs; from now on, record the mission's events in the given journal.

        This method is called once, before the tree is compiled. The mission records each event that must survive
        the process with `journal.record_event`, before it reports the event anywhere. The journal then calls
        `apply`, which changes the run's state. A resumed tree starts over; its leaves use the state to skip finished
        work. A subclass that needs the journal overrides this method, calls the base method and stores the journal.

        Raises:
            JournalError: If the mission cannot process the events of earlier runs.
        """
        journal.attach(self, self.kinds)

    def apply(self, fact: JournalEntry) -> None:
        """Update the run's state from an event of this run, or of an earlier run when the mission resumes.

        The events include the start and end of a run, `run_began` and `run_ended`. Only this method may change state that is restored when a
        mission resumes.

        Raises:
            ArithmeticError, AttributeError, LookupError, TypeError or ValueError: If the event contradicts the current state.
        """

    def display(self) -> Display:
        """Return the display of the current state; called after each event."""
        return Display()

    def sentence(self, fact: JournalEntry) -> str:  # noqa: ARG002 - for subclasses
        """Return a sentence without a full stop that describes an event.

        If the sentence is empty, the event's kind and values are shown instead.
        """
        return ""

    def verbs(self) -> Sequence[OperatorCommand]:
        """Return the operator's commands. Pages show a button for each command, and the tree's leaves provide the services."""
        return ()

    def places(self) -> Mapping[str, tuple[float, float]] | None:
        """Return the locations that faults can name, or None for the locations of the simulated world.

        Each location has the coordinates x and y in metres, frame `map`.
        """
        return None

    def route(self) -> Sequence[tuple[str, float, float]]:
        """Return the names and positions of the robot's targets, in order.

        The route check computes the path to each target from the previous one. Each position has the coordinates
        x and y in metres, frame `map`.

        By default, the targets are the locations of `places`.
        """
        return [(name, *place) for name, place in (self.places() or {}).items()]

    def optional_stops(self) -> Sequence[tuple[str, float, float]]:
        """Return the names and positions of optional stops, such as charging places.

        The route check computes the path from the start to each of them.
        """
        return []

    def searched_areas(self) -> Sequence[SearchedArea]:
        """Return the areas that the robot will search. The route check computes the reachable part of each area."""
        return ()

    def allows(self, x: float, y: float) -> bool:  # noqa: ARG002 - for subclasses
        """Return whether a position (frame `map`, metres) is inside the robot's geofence."""
        return True

    def servers(self, faults: "FaultPlan", **options: Any) -> "list[Node]":  # noqa: ARG002
        """Create the servers that a simulation of this mission needs in addition to the servers of the world.

        Args:
            faults: The faults of the services (`faults.for_service`), and the run's seed (`faults.seed`).
            options: Keyword arguments of `rclpy.node.Node` for each server, such as `context`.
        """
        return []

    def shortfalls(self) -> list[str] | None:
        """Return a sentence for each unfinished item, or an empty list if the mission is complete.

        Returns:
            The sentences; None for a mission without its own end condition, whose runs end with the tree's root.
        """
        return None

    def open_points(self) -> list[str]:
        """Return a sentence for each open point of a complete mission, to be shown after "Mission complete."."""
        return []

    def idle_reason(self) -> str:
        """Return a sentence, such as "No zone is left", if no work is left; otherwise return an empty string.

        If the tree's root then ends on two consecutive ticks, the run ends even if the mission is not complete.
        """
        return ""

    def summary(self, elapsed_sec: float, ticks: int) -> str:  # noqa: ARG002
        """Return the summary to print at the end of the run, or an empty string for the default summary.

        Args:
            elapsed_sec: The duration of the run, in seconds of the node's clock.
            ticks: The number of ticks.
        """
        return ""


class Mission(ABC):
    """Base class of a mission, which can be run many times.

    Attributes:
        name: The mission's name, which selects it with `--mission` and is the default name of its node.
        context_types: The types of the mission's context objects. A tree belongs to this mission if one of
            the tree's leaves requires such an object.
        parameter_names: The names of the parameters that the mission reads; for a group of parameters, the
            first part of their names. The names are used to detect typos.
        path_parameters: The names of parameters that are file paths (`ParameterReader.read_file`). A client of `sar-run --serve` cannot set
                them.
        faults: By service of the mission's servers, the faults that `--fault` can inject: `drop`, `delay` and
            `refuse`, or some of them.
        default_tree: The name of a shipped tree, or a file; None if the user must name a tree.
        is_resumable: Whether a run records events in its journal (`MissionRun.use_journal`), so that a later run can resume the mission. On
                a robot, such a run writes a journal by default.
    """

    name: str
    context_types: Collection[type] = ()
    parameter_names: Collection[str] = ()
    path_parameters: Collection[str] = ()
    faults: Mapping[str, Collection[str]] = {}
    default_tree: str | None = None
    is_resumable: bool = False

    def default_parameters(self) -> Path | None:
        """Return the default parameter file, or None if the mission has no such file."""
        return None

    def default_properties(self, leaves: Collection[type]) -> Path | None:  # noqa: ARG002
        """Return the file of the properties that are verified by default, or None if the mission has no such file.

        Args:
            leaves: The classes of the tree's leaves.
        """
        return None

    @abstractmethod
    def begin(self, reader: ParameterReader) -> MissionRun:
        """Return a new run of the mission with the node's parameters.

        Args:
            reader: Reads the node's parameters and collects their errors. An invalid parameter is read as a placeholder value, and the run
                    is discarded before this value is used.
        """
