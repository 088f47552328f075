"""The interface of a mission: the base classes of your own missions.

Missions are found by the entry point group `sar_compiler.missions`, whose entries name an instance of a `Mission`.
Nothing here imports ROS, and neither may a module that an entry names: `sar-run` imports them before ROS is
initialised, and a laptop without ROS must be able to.
"""

import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.situation import Display, LandmarkKind
from sar_compiler.missions.parameter_reader import ParameterReader

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.journal.journal import Journal
    from sar_compiler.missions.faults import FaultPlan


LONGEST = 200
"""How many characters a text of an order has at most."""


_LEAST_CORNERS, _MOST_CORNERS = 3, 100
_EMPTY: Mapping[str, Any] = {"number": None, "polygon": ()}


class VerbError(SarError):
    """An order is not one of the mission's, or is not complete."""


class VerbField(NamedTuple):
    """A value that comes with an order.

    Attributes:
        name: Its name. `x` and `y` together are a place on the map, in metres.
        label: What people read.
        kind: `text`; `number`; `choice`, of `choices`; `found`, the name of a landmark that was found; `polygon`, an outline on the
            map: its corners in their order, each x and y in metres.
        choices: For `choice`: pairs of a value and what people read.
        optional: Whether it may be left empty: a number is None then, an outline has no corners, anything else is an empty text.
    """

    name: str
    label: str
    kind: Literal["text", "number", "choice", "found", "polygon"] = "text"
    choices: Sequence[tuple[str, str]] = ()
    optional: bool = False


class Verb(NamedTuple):
    """Something that the operator can order.

    Attributes:
        name: The service's, on the mission's node: `pause` for `~/pause`. The answer has `success` and `message`.
        label: What is on its button.
        help: What it does, in a sentence.
        service_type: The service's type, `std_srvs/srv/Trigger` for one without values.
        fields: The values that come with it.
        confirm: What is asked before it is carried out; empty for what does no harm.
        fill: Fills the service's request with the values.
        role: Where pages put it: `stop` ends the mission where the robot stands, `hold` has the robot stand and `release` has it go on.
            Empty for any other.
    """

    name: str
    label: str
    help: str
    service_type: str = "std_srvs/srv/Trigger"
    fields: Sequence[VerbField] = ()
    confirm: str = ""
    fill: Callable[[Any, Mapping[str, Any]], None] = lambda _request, _values: None
    role: Literal["", "stop", "hold", "release"] = ""

    def check(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of an order.

        Raises:
            VerbError: If one is missing or wrong, or there are others.
        """
        if unknown := set(values) - {field.name for field in self.fields}:
            raise VerbError(f"{self.name} takes no {min(unknown)!r:.60}")
        return {field.name: self._check_field(field, values.get(field.name)) for field in self.fields}

    def _check_field(self, field: VerbField, value: Any) -> Any:
        if field.optional and value in ("", None, []):
            return _EMPTY.get(field.kind, "")
        if field.kind == "polygon":
            return self._check_corners(field, value)
        if field.kind == "number":
            fits, wanted = _is_number(value), "a number"
        else:
            fits = isinstance(value, str) and 0 < len(value) <= LONGEST and value.isprintable()
            wanted = f"a text of at most {LONGEST} characters, in one line"
            if field.kind == "choice":
                fits = fits and value in dict(field.choices)
                wanted = f"one of {', '.join(dict(field.choices))}"
        if not fits:
            raise VerbError(f"{self.name}: {field.name} is {value!r:.60}, and must be {wanted}")
        return float(value) if field.kind == "number" else value

    def _check_corners(self, field: VerbField, value: Any) -> list[tuple[float, float]]:
        corners = value if isinstance(value, list) else []
        are_places = all(
            isinstance(corner, list) and list(map(_is_number, corner)) == [True, True] for corner in corners
        )
        if not (are_places and _LEAST_CORNERS <= len(corners) <= _MOST_CORNERS):
            wanted = f"{_LEAST_CORNERS} to {_MOST_CORNERS} corners, each [x, y] in metres"
            raise VerbError(f"{self.name}: {field.name} is {value!r:.60}, and must be {wanted}")
        return [(float(x), float(y)) for x, y in corners]


def _is_number(value: Any) -> bool:
    # A whole number may be greater than any that is finite as a float.
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


class SearchedArea(NamedTuple):
    """An area that the robot will search, for the check before the flight.

    Attributes:
        name: Its name.
        corners: Its outline: x and y in metres, frame `map`.
        swath: How far the ways of one sweep of it are apart, metres.
    """

    name: str
    corners: Sequence[tuple[float, float]]
    swath: float


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

    def facts_added(self) -> Mapping[str, int]:
        """Return by how much commands have raised facts since the run began: `{"zones_left": 1}` once a zone was added.

        No leaf's answer says so; a run that is watched for properties takes it from here.
        """
        return {}

    def limits(self) -> Mapping[str, int]:
        """Return what counts in a flight in place of facts that proofs need as limits, and that nobody knows before: `{"more_pieces": 10_000}`.

        A limit says how often something happens at most: answers only lower it.
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

    def verbs(self) -> Sequence[Verb]:
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

    def may_visit(self) -> Sequence[tuple[str, float, float]]:
        """Return the names and positions to which the robot may drive besides its route, such as charging places, for the same check."""
        return []

    def searched_areas(self) -> Sequence[SearchedArea]:
        """Return the areas that the robot will search, for the check before the flight: how much of each it can drive to."""
        return ()

    def allows(self, x: float, y: float) -> bool:  # noqa: ARG002 - for subclasses
        """Return whether the robot may be at a position in the frame `map`, metres: whether it is inside its geofence."""
        return True

    def servers(self, faults: "FaultPlan", **options: Any) -> "list[Node]":  # noqa: ARG002
        """Create the nodes that a simulation must serve in addition to the world's own.

        Args:
            faults: The faults of their services (`faults.for_service`), and the run's seed (`faults.seed`).
            options: Keyword arguments of `rclpy.node.Node` for each of them: its context, `use_sim_time`.
        """
        return []

    def shortfalls(self) -> list[str] | None:
        """Return in sentences what is missing for a complete mission; empty if it is complete.

        Returns:
            The sentences; None for a mission without an end of its own, whose tree's root decides.
        """
        return None

    def remarks(self) -> list[str]:
        """Return in sentences what a complete mission has left open all the same: they stand behind "Mission complete."."""
        return []

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
        path_parameters: Those of its parameters that are paths of files (`ParameterReader.read_file`): who gives a goal to
            `sar-run --serve` cannot set them.
        faults: The faults that `--fault` can inject into its servers, of `drop`, `delay` and `refuse`, by service.
        default_tree: A shipped tree's name, or a file; None if a tree must be named.
        is_resumable: Whether a run keeps facts in its journal (`MissionRun.keep_in`), so that another can go on with it. On
            a robot it then has one unless that is declined.
    """

    name: str
    context_types: Collection[type] = ()
    parameter_names: Collection[str] = ()
    path_parameters: Collection[str] = ()
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
