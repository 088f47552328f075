"""Computes what a mission displays: landmarks, figures, gauges, alarms and the phase.

This module does not need ROS.

Events change the state of a mission. After each event the mission's `Display` is computed, and its changes are written to the
journal as an entry of the kind `changed`. A reader of the journal can therefore show any mission without the mission's code.
"""

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from enum import IntEnum
from typing import Any, NamedTuple

from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT, RUN_ENDED, CommandAuthor, JournalEntry
from sar_compiler.json_values import json_text

_OPERATOR = "the operator"
# The characters for a cell's value in tenths, rounded up: `-` for 0, `a` for 1, `j` for 10.
_TENTHS = "-abcdefghij"
_RUNS = re.compile(r"(?:(?:[1-9][0-9]{0,5})?[-a-j])+")
_RUN = re.compile(r"([0-9]*)[-a-j]")
_MAX_CELLS = 100_000
# A landmark's identity contains at most this number of corners of its outline.
_IDENTIFYING_CORNERS = 8


class Level(IntEnum):
    """The progress of a mission at a landmark. It determines the colour of the landmark."""

    TO_COME = 0
    IN_HAND = 1
    DONE = 2
    GIVEN_UP = 3
    """The mission has abandoned the landmark, or an error has occurred."""


class LandmarkKind(NamedTuple):
    """A kind of landmark.

    Attributes:
        name: The singular, as one word, such as `point`; also the namespace of the kind's markers in RViz.
        plural: The plural, such as `points`.
        shape: The shape on the map: `circle`, `triangle`, `house` or `square`. A landmark with corners is drawn as a polygon instead.
        is_found: Whether landmarks of this kind are detections by the robot. A person must go to each
            detection that was not abandoned.
        event: The description of a detection in reports for emergency services.
        shaded_by: The meaning of the shade of outlines, such as `probability now`; empty for no shade.
        is_end: Whether the robot must end its mission at a landmark of this kind, so that no person has to
            fetch the robot.
        review: The name of the operator's command that reviews a detection; empty if there is no such command.
        remedy: The beginning of a person's task after the robot has abandoned a landmark, such as `Send people to`. The landmark's
            name follows.
    """

    name: str
    plural: str
    shape: str = "circle"
    is_found: bool = False
    event: str = ""
    shaded_by: str = ""
    is_end: bool = False
    review: str = ""
    remedy: str = ""


class EventTime(NamedTuple):
    """The time of an event.

    Attributes:
        run: The number of the run, from 1.
        time: The time of the mission's clock, in seconds; in a `MissionState`, relative to the start of the run.
        wall: The time of the system's clock, in seconds since 1970.
    """

    run: int
    time: float
    wall: float

    @property
    def utc(self) -> str | None:
        """The time of the system's clock in ISO 8601, or None if the time is out of range."""
        try:
            return datetime.fromtimestamp(self.wall, timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
        except (OSError, OverflowError, ValueError):
            return None


class Landmark(NamedTuple):
    """A position that a mission shows on the map.

    Attributes:
        kind: The name of the landmark's kind.
        name: The landmark's name, unique within its kind.
        x: Position in the frame `map`, metres.
        y: Position in the frame `map`, metres.
        state: The state in a word or two, such as `candidate`; may be empty.
        level: The progress, as a `Level`.
        reason: The reason for the state, in words; may be empty.
        within: The name of the landmark that contains this landmark; empty if there is none.
        is_certain: Whether a person has confirmed the landmark.
        details: Further numbers, strings or times, each with a name in words.
        corners: The corners of the outline in the frame `map`, metres; empty for a point.
        shade: The shade of the outline, from 0 to 1; `LandmarkKind.shaded_by` states its meaning. None for no shade.
        task: The task for a person, as a sentence without a full stop; empty if there is none.
    """

    kind: str
    name: str
    x: float
    y: float
    state: str = ""
    level: int = Level.TO_COME
    reason: str = ""
    within: str = ""
    is_certain: bool = False
    details: Mapping[str, Any] = {}
    corners: Sequence[tuple[float, float]] = ()
    shade: float | None = None
    task: str = ""

    @property
    def identity(self) -> str:
        """The state and position, such as `candidate at (1.00, 2.00)`.

        A change of either makes commands outdated.
        """
        outline = "".join(f" ({x:.2f}, {y:.2f})" for x, y in self.corners[:_IDENTIFYING_CORNERS])
        return f"{self.state or 'known'} at ({self.x:.2f}, {self.y:.2f}){outline and f', outline{outline}'}"


class RasterLayer(NamedTuple):
    """A layer of the map that consists of coloured cells.

    Attributes:
        name: The layer's name.
        meaning: The meaning of a cell's percentage, in words, such as `seen`.
        x: The left edge in the frame `map`, metres.
        y: The lower edge in the frame `map`, metres.
        cell_m: The side of a cell, metres.
        columns: The number of cells in a row.
        cells: The cells from left to right, row by row from the bottom: `-` for 0 %, `a` for up to 10 %, and so on to `j` for more than 90 %.
            A number before a character is the length of a run of equal cells in a row.
    """

    name: str
    meaning: str
    x: float
    y: float
    cell_m: float
    columns: int
    cells: str

    @classmethod
    def from_shares(
        cls, name: str, meaning: str, x: float, y: float, cell_m: float, rows: Sequence[Sequence[float]]
    ) -> "RasterLayer":
        """Create a layer from cell values between 0 and 1.

        The first row is at the bottom, and rows run left to right.
        """
        runs = (
            f"{count if count > 1 else ''}{_TENTHS[tenths]}"
            for row in rows
            for tenths, same in itertools.groupby(min(10, math.ceil(10 * share)) for share in row)
            for count in (sum(1 for _ in same),)
        )
        return cls(name, meaning, x, y, cell_m, len(rows[0]), "".join(runs))


class Figure(NamedTuple):
    """A number that shows the progress of a mission.

    Attributes:
        name: The counted or measured quantity, such as `points visited`.
        value: The count or amount.
        of: The total; None if the total is unknown.
        unit: The unit; empty if there is none.
        least: The required value: if the mission ends with a lower value, a person must decide what to do. None for no requirement.
    """

    name: str
    value: float
    of: float | None = None
    unit: str = ""
    least: float | None = None

    @property
    def text(self) -> str:
        """The figure as text, such as `points visited 3 of 4`."""
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.name} {self.value:g}{'' if self.of is None else f' of {self.of:g}'}{unit}"


class Gauge(NamedTuple):
    """A quantity that decreases during a mission, such as the battery's charge or the remaining time.

    Attributes:
        name: The name of the quantity, such as `battery`.
        value: The remaining amount, in *unit*.
        unit: The unit, such as `%` or `s`; empty if there is none.
        least: The value below which an alarm is raised; None for no limit.
    """

    name: str
    value: float
    unit: str = ""
    least: float | None = None

    @property
    def text(self) -> str:
        """The gauge as text, such as `battery 80 %`."""
        return f"{self.name} {self.value:g}{f' {self.unit}' if self.unit else ''}"


class Alarm(NamedTuple):
    """A message that requires a person's attention.

    Attributes:
        text: The message, which also identifies the alarm.
        level: The severity, as in the log: 30 for a warning, 40 for an error.
        is_over: Whether the cause has disappeared. The alarm is still shown until a person has seen it.
    """

    text: str
    level: int = 40
    is_over: bool = False


class MissionPhase(NamedTuple):
    """The current phase of a run, as the mission reports it.

    Attributes:
        name: The phase, such as `held`, `aborted` or `working`; empty if the run determines the phase (driving, waiting, over).
        reason: The reason for the phase, in words.
        place: The name of the landmark at which the robot is; empty if there is none.
    """

    name: str = ""
    reason: str = ""
    place: str = ""


class AwaitedItem(NamedTuple):
    """A resource that a run needs before its first tick.

    Attributes:
        name: The resource's name for operators, such as `navigation`.
        problem: Why the resource is not available, for engineers; empty if it is available.
    """

    name: str
    problem: str = ""


class Display(NamedTuple):
    """Everything that a mission displays at one time.

    Attributes:
        objects: The object of each command, by the command's name, such as the location that the operator can skip. A command is
            refused if its object has changed since the operator saw the object.
    """

    landmarks: Sequence[Landmark] = ()
    figures: Sequence[Figure] = ()
    gauges: Sequence[Gauge] = ()
    alarms: Sequence[Alarm] = ()
    phase: MissionPhase = MissionPhase()
    rasters: Sequence[RasterLayer] = ()
    objects: Mapping[str, str] = {}


def changes(before: Display, after: Display) -> dict[str, Any]:
    """Return the differences between two displays as JSON data of a `changed` entry.

    The result for equal displays is {}.
    """
    known = {(each.kind, each.name): each for each in before.landmarks}
    now = {(each.kind, each.name) for each in after.landmarks}
    parts = {
        "landmarks": [
            _to_json(each) for each in after.landmarks if known.get((each.kind, each.name)) != each
        ],
        "gone": [list(key) for key in known if key not in now],
        "figures": [_to_json(each) for each in after.figures if each not in before.figures],
        "gauges": [_to_json(each) for each in after.gauges if each not in before.gauges],
        "rasters": [_to_json(each) for each in after.rasters if each not in before.rasters],
        "alarms": [*map(_to_json, _changed_alarms(before.alarms, after.alarms))],
        "phase": _to_json(after.phase) if after.phase != before.phase else None,
        "objects": dict(after.objects) if after.objects != before.objects else None,
    }
    may_be_empty = ("phase", "objects")
    return {
        key: value for key, value in parts.items() if value or (key in may_be_empty and value is not None)
    }


def with_author(text: str, author: CommandAuthor) -> str:
    """Add a command's author, and the author's reason, to a sentence about the command."""
    by, reason = author
    if by and by not in text:
        text = text.replace(_OPERATOR, by, 1) if _OPERATOR in text else f"{by}: {text}"
    return f"{text}: {reason}" if reason and not text.endswith(reason) else text


def changes_of_event(fact: JournalEntry, sentence: str, before: Display, after: Display) -> dict[str, Any]:
    """Return the data of the `changed` entry for an event: display changes and a sentence on the event.

    No sentence is added for events about goals and for the end of a run, so the data may be empty.
    """
    changed = changes(before, after)
    if fact.kind in (GOAL_SENT, GOAL_ENDED, RUN_ENDED):
        return changed
    return {"said": sentence or default_sentence(fact.kind, fact.data), **changed}


def _changed_alarms(before: Sequence[Alarm], after: Sequence[Alarm]) -> Iterator[Alarm]:
    """Yield the alarms that have changed. Alarms that have disappeared are marked as over."""
    yield from (each for each in after if each not in before)
    texts = {each.text for each in after}
    yield from (each._replace(is_over=True) for each in before if each.text not in texts and not each.is_over)


def initial_display(kinds: Iterable[LandmarkKind], shown: Display) -> dict[str, Any]:
    """Return the whole display as JSON values, for the first `changed` entry of a run."""
    return {"kinds": [_to_json(each) for each in kinds], **changes(Display(), shown)}


def _to_json(value: Any) -> dict[str, Any]:
    """Convert a named tuple of this module to JSON values. Omit the fields that have default values."""
    defaults = value._field_defaults
    fields = {
        key: each for key, each in value._asdict().items() if key not in defaults or each != defaults[key]
    }
    if details := fields.get("details"):
        fields["details"] = {
            key: each._asdict() if isinstance(each, EventTime) else each
            for key, each in details.items()
            if each not in (None, "")
        }
    return fields


class DisplayState:
    """What a mission displays, computed from the `changed` entries of the mission's journal.

    Args:
        starts: The start of each run by its number, in seconds of the mission's clock. Times in the details of landmarks are converted
            to times since the start of their run.

    Attributes:
        kinds: The kinds of landmarks, by name.
        landmarks: The landmarks by kind and name, in order of appearance.
        figures: The figures by name.
        gauges: The gauges by name.
        rasters: The raster layers by name.
        alarms: The alarms by text.
        phase: The phase according to the mission.
        objects: The objects of commands, by the command's name.
    """

    def __init__(self, starts: Mapping[int, float] | None = None) -> None:
        self._starts = starts if starts is not None else {}
        self.kinds: dict[str, LandmarkKind] = {}
        self.landmarks: dict[tuple[str, str], Landmark] = {}
        self.figures: dict[str, Figure] = {}
        self.gauges: dict[str, Gauge] = {}
        self.rasters: dict[str, RasterLayer] = {}
        self.alarms: dict[str, Alarm] = {}
        self.phase = MissionPhase()
        self.objects: Mapping[str, str] = {}

    def _detail(self, value: Any) -> Any:
        if not isinstance(value, Mapping):
            return value
        at = EventTime(**value)
        return at._replace(time=at.time - self._starts.get(at.run, 0.0))

    def apply(
        self,
        kinds: Iterable[Mapping[str, Any]] = (),
        landmarks: Iterable[Mapping[str, Any]] = (),
        gone: Iterable[Sequence[str]] = (),
        figures: Iterable[Mapping[str, Any]] = (),
        gauges: Iterable[Mapping[str, Any]] = (),
        rasters: Iterable[Mapping[str, Any]] = (),
        alarms: Iterable[Mapping[str, Any]] = (),
        phase: Mapping[str, Any] | None = None,
        **more: Any,
    ) -> None:
        """Update the display with the data of a `changed` entry.

        Raises:
            ArithmeticError, AttributeError, LookupError, TypeError or ValueError: If the entry is invalid.
        """
        for each in kinds:
            kind = LandmarkKind(**each)
            self.kinds[kind.name] = kind
        for each in landmarks:
            landmark = _landmark(**each)
            details = {name: self._detail(value) for name, value in landmark.details.items()}
            landmark = landmark._replace(details=details)
            self.landmarks[landmark.kind, landmark.name] = landmark
        for name, of in gone:
            self.landmarks.pop((name, of), None)
        for each in figures:
            figure = Figure(**each)
            _check_numbers(figure.value, figure.of, figure.least)
            self.figures[figure.name] = figure
        for each in gauges:
            gauge = Gauge(**each)
            _check_numbers(gauge.value, gauge.least)
            self.gauges[gauge.name] = gauge
        for each in rasters:
            layer = _raster_layer(**each)
            self.rasters[layer.name] = layer
        self.alarms.update((each["text"], Alarm(**each)) for each in alarms)
        if phase is not None:
            self.phase = MissionPhase(**phase)
        if isinstance(objects := more.get("objects"), Mapping):
            self.objects = {str(command): str(text) for command, text in objects.items()}

    def of_kind(self, name: str) -> list[Landmark]:
        """Return all landmarks of the given kind."""
        return [each for each in self.landmarks.values() if each.kind == name]

    def detections(self) -> list[Landmark]:
        """Return the landmarks that the robot has detected, including detections to which no person must go."""
        return [each for each in self.landmarks.values() if self.kind_of(each).is_found]

    def kind_of(self, landmark: Landmark) -> LandmarkKind:
        """Return the kind of a landmark, or a default kind if the mission has not declared the kind."""
        return self.kinds.get(landmark.kind) or LandmarkKind(landmark.kind, f"{landmark.kind}s")


def _landmark(
    kind: str,
    name: str,
    x: float,
    y: float,
    details: Mapping[str, Any] | None = None,
    corners: Iterable[Sequence[float]] = (),
    level: int = 0,
    shade: float | None = None,
    **more: Any,
) -> Landmark:
    if shade is not None and not 0.0 <= shade <= 1.0:
        raise ValueError(f"the shade {shade!r} is not a number between 0 and 1")
    return Landmark(
        kind,
        name,
        *position(x, y),
        level=Level(level),
        details=details or {},
        corners=tuple(position(*each) for each in corners),
        shade=shade,
        **more,
    )


def _raster_layer(x: float, y: float, cell_m: float, columns: int, cells: str, **more: Any) -> RasterLayer:
    _check_numbers(cell_m, columns)
    if not _RUNS.fullmatch(cells):
        raise ValueError(f"the text {cells!r:.60} does not describe the cells of a raster")
    count = sum(int(each or 1) for each in _RUN.findall(cells))
    if count > _MAX_CELLS or columns < 1 or count % columns or not 0.0 < cell_m < math.inf:
        raise ValueError(
            f"a raster with {columns} columns of cells with a side of {cell_m} m cannot have {count} cells"
        )
    return RasterLayer(
        x=position(x, y)[0], y=position(x, y)[1], cell_m=cell_m, columns=columns, cells=cells, **more
    )


def _check_numbers(*values: object) -> None:
    """Raise a TypeError if a value is not a number."""
    for value in values:
        if not isinstance(value, int | float | None):
            raise TypeError(f"{value!r} is not a number")


def default_sentence(kind: str, data: Mapping[str, Any]) -> str:
    """Return the default sentence of an event, such as `photo taken: photo: photo_1`."""
    values = (
        f"{name}: {value if isinstance(value, str) else json_text(value, ensure_ascii=False)}"
        for name, value in data.items()
        if value not in (None, "")
    )
    return f"{kind.replace('_', ' ')}: {', '.join(values)}".removesuffix(": ")


def position(x: Any, y: Any) -> tuple[float, float]:
    """Convert two values from a journal to a position in the frame `map`, in metres.

    Raises:
        ValueError: If a number is not finite.
    """
    place = float(x), float(y)
    if not all(map(math.isfinite, place)):
        raise ValueError(f"({x}, {y}) is not a position")
    return place
