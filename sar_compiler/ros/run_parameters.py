"""The parameters of a run, the same for every tree; works without ROS."""

from dataclasses import dataclass, fields

from sar_compiler.journal.georeference import GEOREFERENCE, Georeference
from sar_compiler.ros.parameter_reader import ParameterReader

SETTLE_SEC = 5.0
"""The longest wait for the goals of a stopped tree to end: Nav2 brakes, and answers late where a machine is busy."""

# The range that a timer and a tick can keep up with; other values are taken for slips.
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
        robot_radius_m: The radius of the robot's body, for planning before the flight, in metres.
        cruise_speed_mps: The speed that estimates of time assume, in m/s.
        settle_timeout_sec: The longest wait for the goals to end when the run is stopped, in seconds.
        georeference: Where the frame `map` lies on the earth; None if that is not said.
    """

    tick_rate_hz: float = 2.0
    set_initial_pose: bool = True
    initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    startup_timeout_sec: float = 60.0
    time_limit_sec: float | None = None
    robot_radius_m: float = 0.22
    cruise_speed_mps: float = 0.4
    settle_timeout_sec: float = SETTLE_SEC
    georeference: Georeference | None = None


RUN_PARAMETER_NAMES = tuple(field.name for field in fields(RunParameters))


def read_run(reader: ParameterReader) -> RunParameters:
    """Read the parameters of a run; missing ones have their default, and the reader collects mistakes."""
    limit, start = "time_limit_sec", reader.pose("initial_pose")
    return RunParameters(
        tick_rate_hz=_rate(reader, "tick_rate_hz", RunParameters.tick_rate_hz),
        set_initial_pose=reader.switch("set_initial_pose", default=RunParameters.set_initial_pose),
        initial_pose=(start["x"], start["y"], start["yaw"]),
        startup_timeout_sec=reader.positive("startup_timeout_sec", RunParameters.startup_timeout_sec),
        time_limit_sec=reader.positive(limit, 0.0) if limit in reader.parameters else None,
        robot_radius_m=reader.positive("robot_radius_m", RunParameters.robot_radius_m),
        cruise_speed_mps=reader.positive("cruise_speed_mps", RunParameters.cruise_speed_mps),
        settle_timeout_sec=reader.positive("settle_timeout_sec", RunParameters.settle_timeout_sec),
        georeference=_georeference(reader),
    )


def _georeference(reader: ParameterReader) -> Georeference | None:
    if not any(key == GEOREFERENCE or key.startswith(f"{GEOREFERENCE}.") for key in reader.parameters):
        return None
    before = len(reader.problems)
    reader.only(GEOREFERENCE, Georeference._fields)
    given = Georeference(**reader.point(GEOREFERENCE, Georeference._fields))
    if len(reader.problems) == before:
        for name, value, most in (
            ("lat", given.lat, 90),
            ("lon", given.lon, 180),
            ("heading", given.heading, 360),
        ):
            if abs(value) > most:
                text = f"must be degrees between -{most} and {most}, is {value:g}"
                reader.report(f"{GEOREFERENCE}.{name}", text)
    return given


def _rate(reader: ParameterReader, key: str, default: float) -> float:
    before = len(reader.problems)
    rate = reader.positive(key, default)
    if len(reader.problems) == before and not _SLOWEST_TICK_HZ <= rate <= _FASTEST_TICK_HZ:
        reader.report(key, f"must be between {_SLOWEST_TICK_HZ:g} and {_FASTEST_TICK_HZ:g}, is {rate:g}")
    return rate
