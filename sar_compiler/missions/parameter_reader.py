"""Reading the parameters of a mission and a run, without ROS. Errors are collected.

The keys are those of a ROS node, flat and relative: `points.yard.x`, `initial_pose.yaw`, `point_order`.
Lengths are in metres, angles in radians, in the frame `map`.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from sar_compiler.checks.configuration import enclosing_folder
from sar_compiler.errors import SarError
from sar_compiler.journal.georeference import GEOREFERENCE, Georeference
from sar_compiler.missions.json_files import JsonFile, MalformedJsonError
from sar_compiler.missions.parameter_file import ParameterLocations, sections_elsewhere
from sar_compiler.nodes.numbers import convert_with_unit, find_implausible_number, number_hint, unit_of_key
from sar_compiler.opener import (
    FileContent,
    FileKind,
    NamedPath,
    PathOutsideError,
    UnreadableFileError,
    read_file,
)
from sar_compiler.tree.guessing import did_you_mean, nearest

_POSE = ("x", "y", "yaw")

# The parameters of every ROS node.
_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")
# Similarity of two names, from 0 to 1, from which one is regarded as a typo of the other.
_ALIKE = 0.8


@dataclass(frozen=True)
class ParameterProblem:
    """An error in the parameters.

    Attributes:
        key: The parameter, such as `points.yard.x`.
        text: The description of the error.
        place: File, line and column of the parameter; empty if no file gives it.
    """

    key: str
    text: str
    place: str = ""

    def __str__(self) -> str:
        """Return the location, the key and the error."""
        return _with_place(self.place, f"{self.key}: {self.text}")


class ParameterError(SarError):
    """A mission cannot start with these parameters.

    Attributes:
        problems: All errors, in the order in which the keys were read.
    """

    def __init__(self, problems: Iterable[ParameterProblem]) -> None:
        self.problems = tuple(problems)
        if len(self.problems) == 1:
            [only] = self.problems
            message = _with_place(only.place, f"parameter {only.key}: {only.text}")
        else:
            lines = "".join(f"\n  {problem}" for problem in self.problems)
            message = f"{len(self.problems)} errors in the parameters:{lines}"
        super().__init__(message)


def lookalikes(
    given: Iterable[str], read: Iterable[str], place_of: Callable[[str], str] = lambda _name: ""
) -> list[str]:
    """Report unused parameters whose names are similar to used ones.

    Args:
        given: The flat names of a node's parameters. Names without a similar one are ignored.
        read: The names that are used, in addition to ROS's own; of a group, such as `points`, the first part.
        place_of: Returns file, line and column of a parameter; empty if no file gives it.

    Returns:
        A note for each probable typo, with the name that was probably meant.
    """
    known = sorted({*read, *_ROS})
    plain = [name for name in known if "." not in name]
    notes: dict[str, str] = {}
    for name in given:
        first = name.partition(".")[0]
        if name in known or first in known:
            continue
        for written, names in ((name, known), (first, plain)):
            near = get_close_matches(written.lower(), names, 1, _ALIKE)
            if near:
                note = f"parameter '{written}' is not used: did you mean '{near[0]}'?"
                notes.setdefault(note, _with_place(place_of(name), note))
                break
    return list(notes.values())


def report_unused_files(reader: "ParameterReader", read: Iterable[str]) -> list[str]:
    """Report if no parameter of the files is used.

    Args:
        reader: The parameters.
        read: The names that are used; see `lookalikes`.
    """
    if reader.elsewhere:
        return [f"no parameter of the file is used: {reader.elsewhere}. Write '/**:' above the section"]
    given = [name for name in reader.parameters if reader.place_of(name)]
    firsts = {name.partition(".")[0] for name in read}
    if not given or any(name.partition(".")[0] in {*firsts, *_ROS} for name in given):
        return []
    found = ", ".join(given[:_MOST_NAMED]) + (", …" if len(given) > _MOST_NAMED else "")
    known = ", ".join(sorted(firsts))
    text = f"no parameter of the file is used by the run: it has {found}, and the run uses {known}"
    return [_with_place(reader.place_of(given[0]), text)]


_MOST_NAMED = 5
MOST_PLACES = 1_000
"""Largest number of locations that a mission visits; this many are ordered within two seconds."""


class ParameterReader:
    """Reads values and collects errors in them; an invalid value is read as 0, and reading continues.

    Args:
        parameters: A node's parameters by flat name. Unused names are ignored.
        elsewhere: A note of the nodes that parameters were given for instead
            (`parameter_file.sections_elsewhere`), for the message about a missing list of locations.
        places: Locations of the parameters, if they come from files.

    Attributes:
        parameters: The parameters.
        elsewhere: The note.
        problems: All errors so far.
        notes: Notes on valid but surprising parameters, such as a point that is never visited.
        files: The files named by parameters, as they were read, by parameter name.
        places_elsewhere: Functions that return file, line and column of a parameter from such a file.
    """

    def __init__(
        self, parameters: Mapping[str, object], elsewhere: str = "", places: ParameterLocations | None = None
    ) -> None:
        self.parameters = parameters
        self._places = places
        self.problems: list[ParameterProblem] = []
        self.notes: list[str] = []
        self.files: dict[str, FileContent] = {}
        self.places_elsewhere: dict[str, Callable[[], str]] = {}
        self.elsewhere = elsewhere

    @classmethod
    def from_files(
        cls, parameters: Mapping[str, object], files: Sequence[Path | str], node: str
    ) -> "ParameterReader":
        """Return a reader of the files' parameters for a node, by its full name."""
        return cls(parameters, sections_elsewhere(files, node), ParameterLocations(files, node))

    def report_error(self, key: str, text: str, place: str = "") -> None:
        """Report an error in a parameter.

        Args:
            key: The parameter.
            text: The description of the error.
            place: File, line and column; by default those of the parameter.
        """
        problem = ParameterProblem(key, text, place or self.place_of(key))
        # A mission may read a parameter that every run reads.
        if problem not in self.problems:
            self.problems.append(problem)

    def place_of(self, key: str) -> str:
        """Return the file, line and column of a parameter or its parent; empty if no file contains it."""
        if key in self.places_elsewhere:
            return self.places_elsewhere[key]()
        return self._places.location_of(key, self.parameters) if self._places is not None else ""

    def group(self, prefix: str, allowed: tuple[str, ...]) -> dict[str, set[str]]:
        """Return the names of `<prefix>.<id>.<name>` by ID; report any other parameter with this prefix."""
        groups: dict[str, set[str]] = {}
        pattern = f"{prefix}.<id>.{{{','.join(allowed)}}}"
        for key in self.parameters:
            if key != prefix and not key.startswith(f"{prefix}."):
                continue
            member, _, name = key[len(prefix) + 1 :].rpartition(".")
            if not member or not name:
                self.report_error(key, f"is not of the form {pattern}")
                continue
            groups.setdefault(member, set()).add(name)
            if name not in allowed:
                self.report_error(key, f"is unknown; {_did_you_mean(name, allowed)}")
        return groups

    def places(self, noun: str, more: tuple[str, ...] = ()) -> list[dict[str, Any]]:
        """Read poses that are visited in order: for `point`, `point_order` and `points.<id>.{x,y,yaw}`.

        Args:
            noun: The noun for one of them.
            more: Further names beside a pose, which the caller reads.

        Returns:
            The poses, each with `id`, `x`, `y` (m) and `yaw` (rad), in the order of their visits.
        """
        groups = self.group(f"{noun}s", (*_POSE, *more))
        order = self._order(noun, groups)
        for key in [f"{noun}s.{name}" for name in groups if name not in order]:
            note = f"{key} is not in {noun}_order and is never visited"
            self.notes.append(_with_place(self.place_of(key), note))
        return [{"id": name, **self.point(f"{noun}s.{name}", _POSE)} for name in order]

    def point(self, prefix: str, names: Iterable[str]) -> dict[str, float]:
        """Read coordinates, all of which are required.

        Args:
            prefix: The prefix of their names.
            names: The coordinates, such as `x` and `y`.
        """
        return {name: self.number(f"{prefix}.{name}") for name in names}

    def _order(self, noun: str, known: Collection[str]) -> list[str]:
        """Return the IDs to visit, each known and listed once."""
        key, allowed = f"{noun}_order", f"must be a list of {noun} ids"
        example = f': list the {noun}s to visit, for example {key}: ["{noun}_a", "{noun}_b"]'
        if key not in self.parameters:
            near = get_close_matches(key, self.parameters, 1, 0.75)
            hint = f" (did you mean '{near[0]}'?)" if near else ""
            place = f" ({self.elsewhere})" if self.elsewhere else ""
            self.report_error(key, f"is missing{hint}{example}{place}")
            return []
        value = self.parameters[key]
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            self.report_error(key, f"{allowed}, but is {_describe(value)}")
            return []
        entries = list(value)
        if not entries:
            self.report_error(key, f"is empty{example}")
        if len(entries) > MOST_PLACES:
            text = f"names {len(entries):,} {noun}s, more than {MOST_PLACES:,}: move some to another mission"
            self.report_error(key, text)
            return []
        order: dict[str, None] = {}
        for entry in entries:
            if not isinstance(entry, str) or not entry:
                self.report_error(key, f"{allowed} (strings), but contains {_describe(entry)}")
            elif entry in order:
                self.report_error(key, f"names '{entry}' more than once")
            else:
                order[entry] = None
        return [name for name in order if self._has_pose(noun, name, known)]

    def _has_pose(self, noun: str, name: str, known: Collection[str]) -> bool:
        if name in known:
            return True
        hint = did_you_mean(nearest(name, known))
        missing = f"names '{name}', which has no pose: add {noun}s.{name}.x, .y and .yaw{hint}"
        self.report_error(f"{noun}_order", missing)
        return False

    def pose(self, prefix: str) -> dict[str, float]:
        """Return the pose `<prefix>.{x,y,yaw}`; missing coordinates are 0."""
        self.report_unknown_names(prefix, _POSE)
        keys = {name: f"{prefix}.{name}" for name in _POSE}
        return {name: self.number(key, 0.0) for name, key in keys.items()}

    def report_unknown_names(self, prefix: str, names: tuple[str, ...]) -> None:
        """Report parameters below a prefix that are not among the given names."""
        listed = f"{', '.join(names[:-1])} and {names[-1]}"
        for key in self.parameters:
            if key == prefix:
                self.report_error(key, f"must contain {listed}, but is {_describe(self.parameters[key])}")
            elif key.startswith(f"{prefix}.") and key.partition(".")[2] not in names:
                self.report_error(key, f"is unknown; {_did_you_mean(key.partition('.')[2], names)}")

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number; a missing one is the default, or an error without a default."""
        if key not in self.parameters:
            if default is None:
                self.report_error(key, "is missing: write a number")
            return default or 0.0
        return self._check_unit(key, self.parameters[key])

    def _check_unit(self, key: str, value: object, whose: str = "") -> float:
        """Check a number against its parameter's unit; report implausible ones.

        Args:
            key: The parameter.
            value: Its value, or one of them.
            whose: Text before the description of one of several values.
        """
        unit = unit_of_key(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            must = "must be a list of numbers, but contains" if whose else "must be a number, but is"
            self.report_error(key, f"{must} {_describe(value)}{_remedy(value, unit)}")
            return 0.0
        number = _as_float(value)
        if not math.isfinite(number):
            must = (
                "must be a list of finite numbers, but contains the number"
                if whose
                else "must be a finite number, but is"
            )
            self.report_error(key, f"{must} {number}")
            return 0.0
        oddity = find_implausible_number(number, unit)
        if oddity is not None and oddity.is_impossible:
            self.report_error(key, f"{whose}{oddity}")
            return 0.0
        if oddity is not None:
            note = _with_place(self.place_of(key), f"{key} {whose}{oddity}")
            self.notes += [] if note in self.notes else [note]
        return number

    def numbers(self, key: str) -> list[float]:
        """Return a list of finite numbers; a missing one is empty."""
        value = self.parameters.get(key, ())
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            self.report_error(key, f"must be a list of numbers, but is {_describe(value)}")
            return []
        before = len(self.problems)
        numbers = [self._check_unit(key, entry, "contains a number that ") for entry in value]
        return numbers if len(self.problems) == before else []

    def read_file(self, key: str, noun: str, most_bytes: int) -> str | None:
        """Return the text of the file that a parameter names, in UTF-8.

        The path is relative to the parameter file and must stay in its repository, or without a repository in its folder. A path on the
        command line may be anywhere. Goals of `sar-run --serve` cannot set such a parameter, so a mission lists it in its
        `path_parameters`.

        Args:
            key: The parameter, which must be set.
            noun: The kind of file, for messages.
            most_bytes: The largest size.

        Returns:
            The text; None if there is no such file, which is reported as an error of the parameter.
        """
        value = self.parameters[key]
        if not isinstance(value, str) or not value:
            self.report_error(key, f"must be the path of a {noun}, but is {value!r:.60}")
            return None
        given_in = self.place_of(key).rsplit(":", 2)[0]
        path = Path(given_in).parent / value
        if given_in:
            # An installation with links to its sources has two folders.
            folders = {enclosing_folder(Path(each).parent) for each in (given_in, Path(given_in).resolve())}
            path = NamedPath.confined_to(path, sorted(folders))
        try:
            content = read_file(path, FileKind(noun, most_bytes))
            text = content.decode()
        except PathOutsideError as error:
            there = f"move it next to {given_in}, or name it on the command line: -p {key}:=PATH"
            self.report_error(key, f"{path} cannot be read: {error.reason}. To fix this, {there}")
            return None
        except UnreadableFileError as error:
            self.report_error(key, f"{path} cannot be read: {error.reason}")
            return None
        self.files[key] = content
        return text

    def read_json_file(self, key: str, noun: str, most_bytes: int) -> JsonFile | None:
        """Return the content of a JSON file named by a parameter; report errors, and return None."""
        text = self.read_file(key, noun, most_bytes)
        if text is None:
            return None
        try:
            file = JsonFile(text, str(self.files[key].path))
        except MalformedJsonError as error:
            self.report_error(key, f"is not a valid {noun}: {error}", error.place)
            return None
        for name, place in file.duplicates():
            self.report_error(key, f"has the key '{name}' twice in one mapping: delete one of them", place)
        return file

    def complain(self) -> None:
        """Raise an error that lists all errors, if there are any.

        Raises:
            ParameterError: If there are errors; lists all of them.
        """
        if self.problems:
            raise ParameterError(self.problems)

    def positive(self, key: str, default: float, most: float = math.inf) -> float:
        """Return a positive number, at most *most*, in the unit of its key."""
        value = self.number(key, default)
        is_reported = any(problem.key == key for problem in self.problems)
        if not 0.0 < value <= most and key in self.parameters and not is_reported:
            limit = "" if most == math.inf else f" and at most {most:g}"
            self.report_error(key, f"must be above 0{limit}, but is {value:g}")
        return value

    def cruise_speed(self) -> float:
        """Return the robot's speed for estimates of time, m/s."""
        return self.positive("cruise_speed_mps", RunParameters.cruise_speed_mps)

    def switch(self, key: str, *, default: bool) -> bool:
        """Return a Boolean."""
        value = self.parameters.get(key, default)
        if isinstance(value, bool):
            return value
        self.report_error(key, f"must be true or false, but is {_describe(value)}")
        return default


def _with_place(place: str, text: str) -> str:
    return f"{place}: {text}" if place else text


def _describe(value: object) -> str:
    if isinstance(value, str):
        return f"the string '{value}'"
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "nothing"
    if isinstance(value, Iterable):
        return f"the list {list(value)}"
    return f"the number {value}" if isinstance(value, int | float) else repr(value)


def _as_float(value: float) -> float:
    """Return a number as a double, as in C."""
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        return math.inf


def _remedy(value: object, unit: str) -> str:
    """Return a suggestion for a value that is not a number; empty if there is none."""
    if isinstance(value, Iterable) and not isinstance(value, str | bytes):
        return f" (write {only[0]}, without brackets)" if len(only := list(value)) == 1 else ""
    if not isinstance(value, str):
        return ""
    meant = convert_with_unit(value, unit)
    if meant == value.strip():
        return " (write it without quotes)"
    hint = f"write {meant}" if meant is not None else number_hint(value, unit)
    return f" ({hint})" if hint else ""


def _did_you_mean(name: str, allowed: tuple[str, ...]) -> str:
    near = get_close_matches(name.lower(), allowed, 1, 0.5)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"expected one of {', '.join(allowed)}"


SETTLE_SEC = 5.0
"""Longest wait for the goals of a halted tree to end: Nav2 brakes, and responds late on a busy machine."""
BLOCKED_TICK_SEC = 10.0
"""How long a leaf may block the tick before the goals are cancelled; equal to a supervisor's limit."""

# The range that a timer and a tick can handle; other values are regarded as typos.
_FASTEST_TICK_HZ = 1000.0
_SLOWEST_TICK_HZ = 1e-6


@dataclass(frozen=True, kw_only=True)
class RunParameters:
    """The parameters of a run, the same for every tree.

    Attributes:
        tick_rate_hz: The lowest rate of ticks, in Hz.
        set_initial_pose: Whether the initial pose is sent to the localisation before the start.
        initial_pose: The initial pose: x, y (m), yaw (rad), in the frame `map`.
        startup_timeout_sec: The longest wait for the tree's requirements before the first tick, in seconds.
        time_limit_sec: The time limit of the run, in seconds of the node's clock; None for no limit.
        robot_radius_m: The radius of the robot's body, for planning before the run, in metres.
        cruise_speed_mps: The speed that estimates of time assume, in m/s.
        settle_timeout_sec: The longest wait for the goals to end when the run is stopped, in seconds.
        blocked_tick_timeout_sec: How long a leaf may block ticks before the goals are cancelled, in steady seconds.
        arrival_tolerance_m: Largest distance from its goal of a robot that has arrived, in metres; None for Nav2's tolerance and half a metre.
        georeference: The position of the frame `map` on the earth; None if not given.
    """

    tick_rate_hz: float = 2.0
    set_initial_pose: bool = True
    initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    startup_timeout_sec: float = 60.0
    time_limit_sec: float | None = None
    robot_radius_m: float = 0.22
    cruise_speed_mps: float = 0.4
    settle_timeout_sec: float = SETTLE_SEC
    blocked_tick_timeout_sec: float = BLOCKED_TICK_SEC
    arrival_tolerance_m: float | None = None
    georeference: Georeference | None = None


RUN_PARAMETER_NAMES = tuple(field.name for field in fields(RunParameters))


def read_run(reader: ParameterReader) -> RunParameters:
    """Read the parameters of a run; missing ones have their default, and the reader collects errors."""
    limit, start, tolerance = "time_limit_sec", reader.pose("initial_pose"), "arrival_tolerance_m"
    return RunParameters(
        tick_rate_hz=_rate(reader, "tick_rate_hz", RunParameters.tick_rate_hz),
        set_initial_pose=reader.switch("set_initial_pose", default=RunParameters.set_initial_pose),
        initial_pose=(start["x"], start["y"], start["yaw"]),
        startup_timeout_sec=reader.positive("startup_timeout_sec", RunParameters.startup_timeout_sec),
        time_limit_sec=reader.positive(limit, 0.0) if limit in reader.parameters else None,
        robot_radius_m=reader.positive("robot_radius_m", RunParameters.robot_radius_m),
        cruise_speed_mps=reader.cruise_speed(),
        settle_timeout_sec=reader.positive("settle_timeout_sec", RunParameters.settle_timeout_sec),
        blocked_tick_timeout_sec=reader.positive(
            "blocked_tick_timeout_sec", RunParameters.blocked_tick_timeout_sec
        ),
        arrival_tolerance_m=reader.positive(tolerance, 0.0) if tolerance in reader.parameters else None,
        georeference=_georeference(reader),
    )


def _georeference(reader: ParameterReader) -> Georeference | None:
    if not any(key == GEOREFERENCE or key.startswith(f"{GEOREFERENCE}.") for key in reader.parameters):
        return None
    before = len(reader.problems)
    reader.report_unknown_names(GEOREFERENCE, Georeference._fields)
    given = Georeference(**reader.point(GEOREFERENCE, Georeference._fields))
    if len(reader.problems) == before:
        for name, text in given.mistakes():
            reader.report_error(f"{GEOREFERENCE}.{name}", text)
    return given


def _rate(reader: ParameterReader, key: str, default: float) -> float:
    before = len(reader.problems)
    rate = reader.positive(key, default)
    if len(reader.problems) == before and not _SLOWEST_TICK_HZ <= rate <= _FASTEST_TICK_HZ:
        reader.report_error(
            key, f"must be between {_SLOWEST_TICK_HZ:g} and {_FASTEST_TICK_HZ:g}, but is {rate:g}"
        )
    return rate
