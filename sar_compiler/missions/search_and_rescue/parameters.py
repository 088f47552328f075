"""What a mission is told by its parameters, read and checked in one go, without ROS.

The keys are those of a ROS node, flat and relative: `zones.zone_a.x`, `base_station.yaw`,
`zone_order`. Lengths are in metres, angles in radians, in the frame `map`.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from sar_compiler.errors import SarError
from sar_compiler.missions.search_and_rescue.parameter_file import ParameterFileError, check_parameter_file

__all__ = [
    "DEFAULT_STARTUP_TIMEOUT_SEC",
    "DEFAULT_TICK_RATE_HZ",
    "MISSION_NAMES",
    "MissionParameters",
    "ParameterError",
    "ParameterFileError",
    "Problem",
    "RunParameters",
    "check_parameter_file",
    "lookalikes",
    "read_mission",
    "read_run",
    "read_survivors",
]

DEFAULT_TICK_RATE_HZ = 2.0
DEFAULT_STARTUP_TIMEOUT_SEC = 60.0

# What a timer can do and a tick can keep up with; outside of it is a slip of the pen.
_FASTEST_TICK_HZ = 1000.0
_SLOWEST_TICK_HZ = 1e-6

_POSE = ("x", "y", "yaw")
_POINT = ("x", "y")

MISSION_NAMES = (
    *("tick_rate_hz", "set_initial_pose", "initial_pose", "startup_timeout_sec", "time_limit_sec"),
    *("zone_order", "zones", "base_station", "survivors"),
)
"""What may stand in a mission's file, also for the detection server; of a group its first part."""

# What every node of ROS has.
_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")
# How alike two names must be, from 0 to 1, for one to be a slip of the other.
_ALIKE = 0.8

_HOW_TO_ORDER = 'give the zones to visit, for instance zone_order: ["zone_a", "zone_b"]'


@dataclass(frozen=True)
class Problem:
    """One mistake in the parameters.

    Attributes:
        key: The parameter, such as `zones.zone_a.x`.
        text: What is wrong with it.
    """

    key: str
    text: str

    def __str__(self) -> str:
        """Return the key and what is wrong."""
        return f"{self.key}: {self.text}"


class ParameterError(SarError):
    """Parameters that a mission cannot start with.

    Attributes:
        problems: Every mistake that was found, in the order of the keys' reading.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        if len(self.problems) == 1:
            message = f"parameter {self.problems[0]}"
        else:
            lines = "".join(f"\n  {problem}" for problem in self.problems)
            message = f"{len(self.problems)} mistakes in the parameters:{lines}"
        super().__init__(message)


@dataclass(frozen=True, kw_only=True)
class RunParameters:
    """How a tree of any kind is run.

    Attributes:
        tick_rate_hz: How often the tree is ticked at least.
        set_initial_pose: Whether the localisation is told where the robot stands before the start.
        initial_pose: Where that is: x, y (m), yaw (rad), in the frame `map`.
        startup_timeout_sec: How long to wait before the first tick for what the tree needs.
        time_limit_sec: How long the run may take, on the node's clock; None for as long as it takes.
    """

    tick_rate_hz: float = DEFAULT_TICK_RATE_HZ
    set_initial_pose: bool = True
    initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    startup_timeout_sec: float = DEFAULT_STARTUP_TIMEOUT_SEC
    time_limit_sec: float | None = None


@dataclass(frozen=True, kw_only=True)
class MissionParameters(RunParameters):
    """A mission as its parameters describe it.

    Attributes:
        zones: The zones in the order of their visit, each with `id`, `x`, `y` (m) and `yaw` (rad).
        base_station: Where the robot returns to: `x`, `y` (m) and `yaw` (rad).
        notes: What is no mistake but may surprise, such as a zone that is never visited.
    """

    zones: list[dict[str, Any]]
    base_station: dict[str, float]
    notes: tuple[str, ...] = ()


def read_run(parameters: Mapping[str, object]) -> RunParameters:
    """Read how a tree is run from a node's parameters.

    Args:
        parameters: Values by flat name. Names that mean nothing here are others' business.

    Returns:
        What is given, and defaults for the rest.

    Raises:
        ParameterError: With every mistake there is, if there is any.
    """
    reader = _Reader(parameters)
    run = RunParameters(**reader.run())
    reader.complain()
    return run


def read_mission(parameters: Mapping[str, object], elsewhere: str = "") -> MissionParameters:
    """Read a mission from a node's parameters.

    Args:
        parameters: Values by flat name. Names that mean nothing here are others' business.
        elsewhere: Where parameters were given that have not come here
            (`parameter_file.sections_elsewhere`), to be said where the mission is missing.

    Returns:
        The mission; whole numbers have become floats.

    Raises:
        ParameterError: With every mistake there is, if there is any.
    """
    reader = _Reader(parameters)
    groups = reader.group("zones", _POSE)
    order = reader.order(groups, elsewhere)
    zones = [{"id": zone_id, **reader.zone(zone_id, groups)} for zone_id in order]
    base = reader.pose("base_station")
    run = reader.run()
    reader.complain()
    notes = [
        f"zones.{zone_id} is not in zone_order and is never visited"
        for zone_id in groups
        if zone_id not in order
    ]
    return MissionParameters(zones=zones, base_station=base, notes=tuple(notes), **run)


def lookalikes(given: Iterable[str], read: Iterable[str]) -> list[str]:
    """Say which parameters are nearly, and not quite, ones that are read.

    Args:
        given: The flat names of a node's parameters. Those that are like nothing are others' business.
        read: The names that are, beside ROS's own; of a group, such as `zones`, the first part.

    Returns:
        A note for each slip, with the name that was probably meant.
    """
    known = sorted({*read, *_ROS})
    plain = [name for name in known if "." not in name]
    notes: dict[str, None] = {}
    for name in given:
        first = name.partition(".")[0]
        if name in known or first in known:
            continue
        for written, names in ((name, known), (first, plain)):
            near = get_close_matches(written.lower(), names, 1, _ALIKE)
            if near:
                notes[f"parameter '{written}' is not read; did you mean '{near[0]}'?"] = None
                break
    return list(notes)


def read_survivors(
    parameters: Mapping[str, object], default: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Read where survivors are, by zone, from `survivors.<zone>.{x,y}`.

    Args:
        parameters: A node's parameters by flat name.
        default: The table that counts where no such parameter is given.

    Returns:
        Positions in metres in the frame `map`.

    Raises:
        ParameterError: With every mistake there is, if there is any.
    """
    reader = _Reader(parameters)
    groups = reader.group("survivors", _POINT)
    table: dict[str, tuple[float, float]] = {}
    for zone_id in groups:
        point = {name: reader.coordinate(f"survivors.{zone_id}", name, groups[zone_id]) for name in _POINT}
        table[zone_id] = (point["x"], point["y"])
    reader.complain()
    return table or dict(default)


class _Reader:
    """Reads values and collects what is wrong with them; a bad value is read as 0 and goes on."""

    def __init__(self, parameters: Mapping[str, object]) -> None:
        self._parameters = parameters
        self.problems: list[Problem] = []

    def _report(self, key: str, text: str) -> None:
        self.problems.append(Problem(key, text))

    def group(self, prefix: str, allowed: tuple[str, ...]) -> dict[str, set[str]]:
        """Return, of `<prefix>.<id>.<name>`, the names by id; anything else there is a mistake."""
        groups: dict[str, set[str]] = {}
        pattern = f"{prefix}.<id>.{{{','.join(allowed)}}}"
        for key in self._parameters:
            if key != prefix and not key.startswith(f"{prefix}."):
                continue
            member, _, name = key[len(prefix) + 1 :].rpartition(".")
            if not member or not name:
                self._report(key, f"is not of the form {pattern}")
                continue
            groups.setdefault(member, set()).add(name)
            if name not in allowed:
                self._report(key, f"is not known there; {_did_you_mean(name, allowed)}")
        return groups

    def order(self, groups: Mapping[str, object], elsewhere: str) -> list[str]:
        """Return the ids to visit, each once and known."""
        if "zone_order" not in self._parameters:
            near = get_close_matches("zone_order", self._parameters, 1, 0.75)
            hint = f" (is '{near[0]}' meant to be it?)" if near else ""
            place = f" ({elsewhere})" if elsewhere else ""
            self._report("zone_order", f"is missing{hint}: {_HOW_TO_ORDER}{place}")
            return []
        value = self._parameters["zone_order"]
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            self._report("zone_order", f"must be a list of zone ids, is {_shown(value)}")
            return []
        entries = list(value)
        if not entries:
            self._report("zone_order", f"is empty: {_HOW_TO_ORDER}")
        order: list[str] = []
        for entry in entries:
            if not isinstance(entry, str) or not entry:
                self._report("zone_order", f"must be a list of zone ids (text), holds {_shown(entry)}")
            elif entry in order:
                self._report("zone_order", f"names '{entry}' more than once")
            else:
                order.append(entry)
        return [zone_id for zone_id in order if self._has_pose(zone_id, groups)]

    def _has_pose(self, zone_id: str, groups: Mapping[str, object]) -> bool:
        if zone_id in groups:
            return True
        near = get_close_matches(zone_id, groups, 1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        self._report(
            "zone_order", f"names '{zone_id}', which has no pose: give zones.{zone_id}.x, .y and .yaw{hint}"
        )
        return False

    def zone(self, zone_id: str, groups: Mapping[str, set[str]]) -> dict[str, float]:
        """Return a zone's pose; all of it must be given."""
        return {name: self.coordinate(f"zones.{zone_id}", name, groups[zone_id]) for name in _POSE}

    def coordinate(self, prefix: str, name: str, present: set[str]) -> float:
        """Return one coordinate that must be given."""
        if name in present:
            return self.number(f"{prefix}.{name}")
        self._report(f"{prefix}.{name}", "is missing: give a number")
        return 0.0

    def pose(self, prefix: str) -> dict[str, float]:
        """Return the one pose `<prefix>.{x,y,yaw}`; what is not given is 0."""
        for key in self._parameters:
            if key == prefix:
                self._report(key, f"must hold x, y and yaw, is {_shown(self._parameters[key])}")
            elif key.startswith(f"{prefix}.") and key.partition(".")[2] not in _POSE:
                self._report(key, f"is not known there; {_did_you_mean(key.partition('.')[2], _POSE)}")
        keys = {name: f"{prefix}.{name}" for name in _POSE}
        return {name: self.number(key) if key in self._parameters else 0.0 for name, key in keys.items()}

    def number(self, key: str) -> float:
        """Return a finite number."""
        value = self._parameters[key]
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._report(key, f"must be a number, is {_shown(value)}{_unquoted(value)}")
            return 0.0
        number = float(value)
        if not math.isfinite(number):
            self._report(key, f"must be a finite number, is {number}")
            return 0.0
        return number

    def run(self) -> dict[str, Any]:
        """Return the values of a `RunParameters`."""
        limit, start = "time_limit_sec", self.pose("initial_pose")
        return {
            "tick_rate_hz": self.rate(),
            "set_initial_pose": self.switch("set_initial_pose", default=True),
            "initial_pose": (start["x"], start["y"], start["yaw"]),
            "startup_timeout_sec": self.duration("startup_timeout_sec", DEFAULT_STARTUP_TIMEOUT_SEC),
            limit: self.duration(limit, 0.0) if limit in self._parameters else None,
        }

    def complain(self) -> None:
        """Raise all that was found wrong, if anything was.

        Raises:
            ParameterError: With every mistake.
        """
        if self.problems:
            raise ParameterError(self.problems)

    def rate(self) -> float:
        """Return the tick rate."""
        key = "tick_rate_hz"
        if key not in self._parameters:
            return DEFAULT_TICK_RATE_HZ
        before = len(self.problems)
        rate = self.number(key)
        if len(self.problems) > before:
            return DEFAULT_TICK_RATE_HZ
        if rate <= 0:
            self._report(key, f"must be above 0, is {rate:g}")
        elif not _SLOWEST_TICK_HZ <= rate <= _FASTEST_TICK_HZ:
            self._report(key, f"must be between {_SLOWEST_TICK_HZ:g} and {_FASTEST_TICK_HZ:g}, is {rate:g}")
        return rate

    def duration(self, key: str, default: float) -> float:
        """Return a time span above 0, in seconds."""
        before = len(self.problems)
        seconds = self.number(key) if key in self._parameters else default
        if seconds <= 0 and key in self._parameters and len(self.problems) == before:
            self._report(key, f"must be above 0, is {seconds:g}")
        return seconds

    def switch(self, key: str, *, default: bool) -> bool:
        """Return a truth value."""
        value = self._parameters.get(key, default)
        if isinstance(value, bool):
            return value
        self._report(key, f"must be true or false, is {_shown(value)}")
        return default


def _shown(value: object) -> str:
    """Return a value with the kind of thing it is."""
    if isinstance(value, str):
        return f"the text '{value}'"
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "nothing"
    if isinstance(value, Iterable):
        return f"the list {list(value)}"
    return f"the number {value}" if isinstance(value, int | float) else repr(value)


def _unquoted(value: object) -> str:
    """Return advice for a text that would be a number without its quotes."""
    if not isinstance(value, str):
        return ""
    try:
        float(value)
    except ValueError:
        return ""
    return " (write it without quotes)"


def _did_you_mean(name: str, allowed: tuple[str, ...]) -> str:
    near = get_close_matches(name.lower(), allowed, 1, 0.5)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"there may be {', '.join(allowed)}"
