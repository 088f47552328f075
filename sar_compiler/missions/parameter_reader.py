"""Read the parameters of a mission and a run without ROS, and collect their errors.

The keys are flat names of ROS parameters, such as `points.yard.x`, `initial_pose.yaw` or `point_order`.
Lengths are in metres and angles in radians, in the frame `map`.
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
# The minimum similarity, from 0 to 1, at which a name is regarded as a typo of another name.
_SIMILARITY = 0.8


@dataclass(frozen=True)
class ParameterProblem:
    """An error in the parameters.

    Attributes:
        key: The flat name of the parameter, such as `points.yard.x`.
        text: The description of the error.
        place: File, line and column of the parameter; empty if no file contains the parameter.
    """

    key: str
    text: str
    place: str = ""

    def __str__(self) -> str:
        """Return the location, the key and the description of the error."""
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
    """Return notes about unused parameters whose names are similar to names of used parameters.

    Args:
        given: The flat names of a node's parameters.
        read: The names of the parameters that are used, in addition to the parameters of every ROS node. For a group, such as `points`, only the
            first part of the names.
        place_of: Returns file, line and column of a parameter; empty if no file contains the parameter.

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
            near = get_close_matches(written.lower(), names, 1, _SIMILARITY)
            if near:
                note = f"parameter '{written}' is not used: did you mean '{near[0]}'?"
                notes.setdefault(note, _with_place(place_of(name), note))
                break
    return list(notes.values())


def report_unused_files(reader: "ParameterReader", read: Iterable[str]) -> list[str]:
    """Return a list with a note if the run uses no parameter of the parameter files; otherwise an empty list.

    Args:
        reader: The reader of the parameters.
        read: The names of the parameters that are used; see `lookalikes`.
    """
    if reader.elsewhere:
        return [f"no parameter of the file is used: {reader.elsewhere}. Write '/**:' above the section"]
    given = [name for name in reader.parameters if reader.place_of(name)]
    firsts = {name.partition(".")[0] for name in read}
    if not given or any(name.partition(".")[0] in {*firsts, *_ROS} for name in given):
        return []
    found = ", ".join(given[:_MOST_NAMED]) + (", …" if len(given) > _MOST_NAMED else "")
    known = ", ".join(sorted(firsts))
    text = f"no parameter of the file is used by the run. The file has {found}, and the run uses {known}"
    return [_with_place(reader.place_of(given[0]), text)]


_MOST_NAMED = 5
MOST_PLACES = 1_000
"""The maximum number of locations that a mission visits. This many locations can be ordered within two seconds."""


class ParameterReader:
    """Reads parameters and collects their errors. An invalid number is read as 0, so that reading can continue.

    Args:
        parameters: A node's parameters by flat name. Unused parameters are ignored.
        elsewhere: A note that the parameter files only apply to other nodes
            (`parameter_file.sections_elsewhere`). The note is added to the message about a missing list of
            locations.
        places: The locations of the parameters in parameter files; None if there are no files.

    Attributes:
        parameters: The node's parameters by flat name.
        elsewhere: The note that the parameter files only apply to other nodes.
        problems: All errors so far.
        notes: Notes about valid but surprising parameters, such as a point that is never visited.
        files: The files that parameters name, with the content that was read, by parameter name.
        places_elsewhere: For each parameter that was read from such a file, a function that returns file,
            line and column.
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
        """Create a reader of a node's parameters, given the parameter files and the full name of the node."""
        return cls(parameters, sections_elsewhere(files, node), ParameterLocations(files, node))

    def report_error(self, key: str, text: str, place: str = "") -> None:
        """Report an error in a parameter.

        Args:
            key: The flat name of the parameter.
            text: The description of the error.
            place: File, line and column of the error; by default those of the parameter.
        """
        problem = ParameterProblem(key, text, place or self.place_of(key))
        # The mission and the run may both read a parameter. Its error is reported only once.
        if problem not in self.problems:
            self.problems.append(problem)

    def place_of(self, key: str) -> str:
        """Return the file, line and column of a parameter, or an empty string without parameter files.

        A missing parameter has the location of the nearest group.
        """
        if key in self.places_elsewhere:
            return self.places_elsewhere[key]()
        return self._places.location_of(key, self.parameters) if self._places is not None else ""

    def group(self, prefix: str, allowed: tuple[str, ...]) -> dict[str, set[str]]:
        """Return, for each ID, the names in the parameters `<prefix>.<id>.<name>`.

        All other parameters with this prefix are reported as errors.
        """
        groups: dict[str, set[str]] = {}
        pattern = f"{prefix}.<id>.{{{','.join(allowed)}}}"
        for key in self.parameters:
            if key != prefix and not key.startswith(f"{prefix}."):
                continue
            member, _, name = key[len(prefix) + 1 :].rpartition(".")
            if not member or not name:
                self.report_error(key, f"must have the form {pattern}")
                continue
            groups.setdefault(member, set()).add(name)
            if name not in allowed:
                self.report_error(key, f"is unknown, {_did_you_mean(name, allowed)}")
        return groups

    def places(self, noun: str, more: tuple[str, ...] = ()) -> list[dict[str, Any]]:
        """Read the poses to visit from `<noun>_order` and `<noun>s.<id>.{x,y,yaw}`.

        Args:
            noun: The noun in the names of the parameters, such as `point`.
            more: Further names that are allowed in `<noun>s.<id>`. The caller reads these parameters.

        Returns:
            The poses, each with `id`, `x`, `y` (m) and `yaw` (rad), in the order in which they are visited.
        """
        groups = self.group(f"{noun}s", (*_POSE, *more))
        order = self._order(noun, groups)
        for key in [f"{noun}s.{name}" for name in groups if name not in order]:
            note = f"{key} is not in {noun}_order, so it is never visited"
            self.notes.append(_with_place(self.place_of(key), note))
        return [{"id": name, **self.point(f"{noun}s.{name}", _POSE)} for name in order]

    def point(self, prefix: str, names: Iterable[str]) -> dict[str, float]:
        """Read the coordinates of a point, all of which are required.

        Args:
            prefix: The prefix of the parameters, such as `points.yard`.
            names: The names of the coordinates, such as `x` and `y`.
        """
        return {name: self.number(f"{prefix}.{name}") for name in names}

    def _order(self, noun: str, known: Collection[str]) -> list[str]:
        """Return each ID in `<noun>_order` that has a pose, once. Report all other entries as errors."""
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
            text = f"names {len(entries):,} {noun}s, but at most {MOST_PLACES:,} are allowed: move some {noun}s to another mission"
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
        """Report each parameter below a prefix if its name is not one of the given names."""
        listed = f"{', '.join(names[:-1])} and {names[-1]}"
        for key in self.parameters:
            if key == prefix:
                self.report_error(key, f"must contain {listed}, but is {_describe(self.parameters[key])}")
            elif key.startswith(f"{prefix}.") and key.partition(".")[2] not in names:
                self.report_error(key, f"is unknown, {_did_you_mean(key.partition('.')[2], names)}")

    def number(self, key: str, default: float | None = None) -> float:
        """Read a finite number, or return the default if the parameter is missing.

        Without a default, a missing parameter is reported as an error.
        """
        if key not in self.parameters:
            if default is None:
                self.report_error(key, "is missing: write a number")
            return default or 0.0
        return self._check_unit(key, self.parameters[key])

    def _check_unit(self, key: str, value: object, whose: str = "") -> float:
        """Return the value as a number. Report a value that is not a finite number or is implausible in its unit.

        Args:
            key: The flat name of the parameter.
            value: The value of the parameter, or an entry of its list.
            whose: The beginning of a message about an entry of a list; empty for a single value.
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
        """Read a list of finite numbers; return an empty list for a missing parameter."""
        value = self.parameters.get(key, ())
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            self.report_error(key, f"must be a list of numbers, but is {_describe(value)}")
            return []
        before = len(self.problems)
        numbers = [self._check_unit(key, entry, "contains a number that ") for entry in value]
        return numbers if len(self.problems) == before else []

    def read_file(self, key: str, noun: str, most_bytes: int) -> str | None:
        """Return the text of the UTF-8 file that a parameter names.

        The path is relative to the parameter file. The named file must be in the same repository or, without a repository, in the same folder. A
        path on the command line may lead to any file. Goals of `sar-run --serve` must not set such a parameter, so the mission must list it in
        `path_parameters`.

        Args:
            key: The flat name of the parameter, which must be set.
            noun: The noun for the kind of file in messages.
            most_bytes: The maximum size of the file.

        Returns:
            The text; None if the file cannot be read. In this case, an error of the parameter is reported.
        """
        value = self.parameters[key]
        if not isinstance(value, str) or not value:
            self.report_error(key, f"must be the path of a {noun}, but is {value!r:.60}")
            return None
        given_in = self.place_of(key).rsplit(":", 2)[0]
        path = Path(given_in).parent / value
        if given_in:
            # In an installation with symbolic links to the sources, the link and the parameter file are in different folders.
            folders = {enclosing_folder(Path(each).parent) for each in (given_in, Path(given_in).resolve())}
            path = NamedPath.confined_to(path, sorted(folders))
        try:
            content = read_file(path, FileKind(noun, most_bytes))
            text = content.decode()
        except PathOutsideError as error:
            remedy = (
                f"Move the file next to {given_in}, or pass its path on the command line with -p {key}:=PATH"
            )
            self.report_error(key, f"{path} cannot be read: {error.reason}. {remedy}")
            return None
        except UnreadableFileError as error:
            self.report_error(key, f"{path} cannot be read: {error.reason}")
            return None
        self.files[key] = content
        return text

    def read_json_file(self, key: str, noun: str, most_bytes: int) -> JsonFile | None:
        """Read the JSON file that a parameter names. If the file is malformed, report its errors and return None."""
        text = self.read_file(key, noun, most_bytes)
        if text is None:
            return None
        try:
            file = JsonFile(text, str(self.files[key].path))
        except MalformedJsonError as error:
            self.report_error(key, f"is not a valid {noun}: {error}", error.place)
            return None
        for name, place in file.duplicates():
            self.report_error(key, f"contains the key '{name}' twice in a mapping: delete one of them", place)
        return file

    def complain(self) -> None:
        """If errors were collected, raise one exception that lists all of them.

        Raises:
            ParameterError: If there are errors; lists all of them.
        """
        if self.problems:
            raise ParameterError(self.problems)

    def positive(self, key: str, default: float, most: float = math.inf) -> float:
        """Read a positive number in the unit of the parameter; report a number that is greater than *most*."""
        value = self.number(key, default)
        is_reported = any(problem.key == key for problem in self.problems)
        if not 0.0 < value <= most and key in self.parameters and not is_reported:
            limit = "" if most == math.inf else f" and at most {most:g}"
            self.report_error(key, f"must be above 0{limit}, but is {value:g}")
        return value

    def cruise_speed(self) -> float:
        """Return the robot's speed, in m/s, that is assumed in estimates of driving time."""
        return self.positive("cruise_speed_mps", RunParameters.cruise_speed_mps)

    def switch(self, key: str, *, default: bool) -> bool:
        """Read a Boolean; return the default for a missing parameter."""
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
    """Convert a number to a double; an integer that is too large becomes infinity."""
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        return math.inf


def _remedy(value: object, unit: str) -> str:
    """Return a suggestion, in parentheses, for a value that should be a number, or an empty string."""
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
"""The maximum time to wait until the goals of a halted tree have ended, in seconds. Nav2 needs time to brake the robot, and responds late on a busy machine."""
BLOCKED_TICK_SEC = 10.0
"""The time for which a leaf may block a tick before the goals are cancelled, in seconds. The supervisor has the same limit."""

# The range of tick rates that timers and ticks can handle. Other values are regarded as typos.
_FASTEST_TICK_HZ = 1000.0
_SLOWEST_TICK_HZ = 1e-6


@dataclass(frozen=True, kw_only=True)
class RunParameters:
    """The parameters that every run has, with or without a mission.

    Attributes:
        tick_rate_hz: The minimum tick rate, in Hz.
        set_initial_pose: Whether the initial pose is sent to the localisation before the start.
        initial_pose: The initial pose: x, y (m), yaw (rad), in the frame `map`.
        startup_timeout_sec: The maximum wait for the tree's requirements before the first tick, in seconds.
        time_limit_sec: The time limit of the run, in seconds of the node's clock; None for no limit.
        robot_radius_m: The radius of the robot's body, for planning before the run, in metres.
        cruise_speed_mps: The robot's speed that estimates of driving time assume, in m/s.
        settle_timeout_sec: The maximum wait until the goals have ended when the run is stopped, in seconds.
        blocked_tick_timeout_sec: The time for which a leaf may block a tick before the goals are cancelled, in seconds of the steady clock.
        arrival_tolerance_m: The distance from the goal within which the robot counts as arrived, in metres;
            None for Nav2's tolerance plus half a metre.
        georeference: The position and heading of the frame `map` on the earth; None if no parameter sets it.
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
    """Read the parameters that every run has. Missing parameters get default values, and the reader collects errors."""
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
