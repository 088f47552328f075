"""Tests of checking message values against the definitions of their messages, for every kind of invalid value."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from sar_compiler.ros import message_values
from sar_compiler.ros.message_values import UnusableValueError, ValueProblem, ValueReports

pytestmark = pytest.mark.ros

YEARS_SEC = 1.7e9
NOT_NUMBERS = (math.nan, math.inf, -math.inf)


def message(kind: str, **fields: Any) -> Any:
    """Return a message of a type `package/Name`, with fields by their paths: `pose__pose__position__x`."""
    from importlib import import_module

    package, name = kind.split("/")
    made = getattr(import_module(f"{package}.msg"), name)()
    for path, value in fields.items():
        *outer, last = path.split("__")
        inner = made
        for each in outer:
            inner = getattr(inner, each)
        setattr(inner, last, value)
    return made


SHARE = "must be from 0 to 1 (is it in percent? It must be between 0 and 1)"
# Type, field, valid values, and invalid values with the end of the message for each.
FIELDS: list[tuple[str, str, list[float], list[tuple[float, str]]]] = [
    ("sensor_msgs/BatteryState", "percentage", [0.0, 0.5, 1.0], [(85.0, SHARE), (-0.5, SHARE), (1.01, SHARE)]),
    ("sensor_msgs/BatteryState", "voltage", [0.0, 24.5], [(-1.0, ""), (24500.0, "(is it in millivolts?)")]),
    ("sensor_msgs/BatteryState", "temperature", [-20.0, 60.0], [(293.0, "(is it in kelvin?)")]),
    ("sensor_msgs/BatteryState", "current", [-3.0, 2.0], []),
    ("sensor_msgs/BatteryState", "charge", [0.0, 5.0], [(-1.0, "must be 0 or more")]),
    ("sensor_msgs/Temperature", "temperature", [-40.0, 900.0], [(-300.0, "must be -273.15 °C or more")]),
    ("sensor_msgs/RelativeHumidity", "relative_humidity", [0.4], [(40.0, SHARE)]),
    ("sensor_msgs/FluidPressure", "fluid_pressure", [101325.0], [(-1.0, "")]),
    ("sensor_msgs/Illuminance", "illuminance", [0.0, 300.0], [(-1.0, "")]),
    ("sensor_msgs/NavSatFix", "latitude", [-90.0, 48.1], [(481234567.0, "exchanged?)"), (120.0, "exchanged?)")]),
    ("sensor_msgs/NavSatFix", "longitude", [-180.0, 120.0], [(190.0, "exchanged?)")]),
    ("sensor_msgs/NavSatFix", "altitude", [-400.0, 8000.0], []),
    ("geometry_msgs/Point", "x", [-5.0, 5.0], []),
    ("geometry_msgs/Vector3", "z", [-5.0, 5.0], []),
    ("geometry_msgs/Pose2D", "theta", [7.0], []),
]  # fmt: skip


def of_type(kind: str, field: str, value: float) -> Any:
    made = message(kind, **{field: value})
    if kind.endswith("NavSatFix"):
        made.status.status = 0
    return made


@pytest.mark.parametrize(("kind", "field", "good", "bad"), FIELDS)
def test_field_accepts_only_values_defined_by_message(
    kind: str, field: str, good: list[float], bad: list[tuple[float, str]]
) -> None:
    for value in good:
        assert message_values.read_field(of_type(kind, field, value), field) == pytest.approx(value)
    for value, said in [*bad, *((each, "") for each in NOT_NUMBERS)]:
        with pytest.raises(UnusableValueError, match=f"{field} is ") as caught:
            message_values.read_field(of_type(kind, field, value), field)
        assert str(caught.value).endswith(said)
        assert caught.value.problem is ValueProblem.VALUE


def test_share_rounded_above_one_is_full_battery() -> None:
    assert message_values.battery_share(message("sensor_msgs/BatteryState", percentage=1.0000001)) == 1.0


def test_field_without_definition_is_unchanged() -> None:
    assert math.isinf(message_values.read_field(message("std_msgs/Float64", data=math.inf), "data"))
    assert message_values.read_field(message("sensor_msgs/BatteryState", present=True), "present") is True


def test_range_must_be_measurable_by_sensor() -> None:
    limits = {"min_range": 0.5, "max_range": 4.0}
    for value in (0.5, 4.0, math.inf, -math.inf):  # REP 117: no object in range, or one that is too near
        assert (
            message_values.read_field(message("sensor_msgs/Range", range=value, **limits), "range") == value
        )
    for value in (0.1, 4.5, math.nan):
        with pytest.raises(UnusableValueError):
            message_values.read_field(message("sensor_msgs/Range", range=value, **limits), "range")


def test_rays_outside_scanner_range_are_nan() -> None:
    scan = message(
        "sensor_msgs/LaserScan", range_min=0.5, range_max=4.0, ranges=[0.0, 0.5, 9.0, math.inf, math.nan]
    )
    read = message_values.read_field(scan, "ranges")
    assert [None if math.isnan(each) else each for each in read] == [None, 0.5, None, math.inf, None]


def test_receiver_without_fix_has_no_position() -> None:
    for field in ("latitude", "longitude", "altitude"):
        with pytest.raises(UnusableValueError, match="the receiver has no fix"):
            message_values.read_field(message("sensor_msgs/NavSatFix", status__status=-1), field)


@pytest.mark.parametrize(
    ("first", "said"),
    [(math.nan, "not a number"), (-0.5, "0 or more"), (-1.0, "does not measure"), (math.inf, "finite")],
)
def test_covariance_with_invalid_variance_is_rejected(first: float, said: str) -> None:
    imu = message("sensor_msgs/Imu", orientation_covariance=[first, *[0.0] * 8])
    with pytest.raises(UnusableValueError, match=said):
        message_values.read_field(imu, "orientation_covariance")
    sound = message("sensor_msgs/Imu", orientation_covariance=[0.1, *[0.0] * 8])
    assert message_values.read_field(sound, "orientation_covariance")[0] == 0.1


@pytest.mark.parametrize("length", [0.0, 0.5, 2.0, math.nan, math.inf])
def test_quaternion_without_unit_length_is_rejected(length: float) -> None:
    pose = message("geometry_msgs/PoseStamped", header__frame_id="map", pose__orientation__w=length)
    with pytest.raises(UnusableValueError, match="the length of the quaternion is"):
        message_values.stamped_pose(pose, "map")
    with pytest.raises(UnusableValueError, match="the length of the quaternion is"):
        message_values.read_field(pose, "pose.orientation.w")


@pytest.mark.parametrize("number", [*NOT_NUMBERS, 100_001.0, -1e300])
def test_invalid_position_is_rejected(number: float) -> None:
    readers: list[tuple[Callable[[], object], str]] = [
        (lambda: message_values.check_position(0.0, number), "not a position|out of range"),
        (lambda: message_values.planar_point(message("geometry_msgs/PointStamped", header__frame_id="map", point__x=number), "map"), "not a position|out of range"),
        (lambda: message_values.path_points(path(number)), "not a position|out of range"),
        (lambda: message_values.grid_geometry(message("nav_msgs/OccupancyGrid", info__resolution=0.05, info__origin__position__y=number)), "not a position|out of range"),
    ]  # fmt: skip
    for read, said in readers:
        with pytest.raises(UnusableValueError, match=said):
            read()


def path(number: float) -> Any:
    pose = message("geometry_msgs/PoseStamped", pose__position__x=number)
    return message("nav_msgs/Path", poses=[message("geometry_msgs/PoseStamped"), pose])


@pytest.mark.parametrize("resolution", [0.0, -0.05, math.nan, math.inf])
def test_map_with_invalid_resolution_is_rejected(resolution: float) -> None:
    with pytest.raises(UnusableValueError, match="the resolution is"):
        message_values.grid_geometry(message("nav_msgs/OccupancyGrid", info__resolution=resolution))


@pytest.mark.parametrize("frame", ["robot1/map", "odom", "/map", "Map", "", "map\n"])
def test_unexpected_frame_is_named(frame: str) -> None:
    for kind, read, subject in (
        ("geometry_msgs/PointStamped", message_values.planar_point, "the point"),
        ("geometry_msgs/PoseStamped", message_values.stamped_pose, "the pose"),
    ):
        with pytest.raises(UnusableValueError) as caught:
            read(message(kind, header__frame_id=frame), "map")
        assert str(caught.value).startswith(f"{subject} is in the frame '")
        assert caught.value.problem is ValueProblem.FRAME


class FixedClockNode:
    """A node whose clock shows a given time, and which records its log."""

    def __init__(self, now_sec: float, *, is_simulated: bool = False) -> None:
        self.now_sec, self.ros_time_is_active = now_sec, is_simulated
        self.lines: list[str] = []

    def get_clock(self) -> Any:
        return self

    def now(self) -> Any:
        return self

    @property
    def nanoseconds(self) -> int:
        return round(self.now_sec * 1e9)

    def get_logger(self) -> Any:
        return self

    def warning(self, text: str) -> None:
        self.lines.append(text)


def stamped(seconds: float) -> Any:
    return message(
        "sensor_msgs/BatteryState",
        header__stamp__sec=int(seconds),
        header__stamp__nanosec=int(seconds % 1 * 1e9),
    )


@pytest.mark.parametrize(
    ("stamp", "now", "is_simulated", "said"),
    [
        (YEARS_SEC - 8.0, YEARS_SEC, False, "its stamp is 8.0 s old, but may be at most 5 s"),
        (60.0, 100.0, True, "its stamp is 40.0 s old, but may be at most 5 s"),
        (YEARS_SEC + 3.0, YEARS_SEC, False, "its stamp is 3.0 s in the future"),
        (100.0, YEARS_SEC, False, "add `--ros-args -p use_sim_time:=true`"),
        (YEARS_SEC, 100.0, True, "Start the publisher with `-p use_sim_time:=true`"),
        (200.0, 100.0, True, "its stamp is 100.0 s in the future"),
    ],
)
def test_stale_or_future_stamp_is_rejected_with_likely_cause(
    stamp: float, now: float, is_simulated: bool, said: str
) -> None:
    with pytest.raises(UnusableValueError) as caught:
        message_values.check_stamp(stamped(stamp), FixedClockNode(now, is_simulated=is_simulated), 5.0)
    assert str(caught.value).endswith(said)
    assert "1700000000" not in str(caught.value)


@pytest.mark.parametrize(
    ("stamp", "now", "is_simulated"),
    [
        (YEARS_SEC - 6.0, YEARS_SEC, False),  # the clocks of two machines
        (80.0, 100.0, True),  # a fast simulation, whose messages come late
        (YEARS_SEC + 1.0, YEARS_SEC, False),  # AMCL stamps ahead
        (0.0, YEARS_SEC, False),  # no stamp
        (YEARS_SEC, 0.0, True),  # no time yet
        (120.0, 100.0, True),  # a fast simulation, whose clock comes late
    ],
)
def test_plausible_stamp_is_accepted(stamp: float, now: float, is_simulated: bool) -> None:
    message_values.check_stamp(stamped(stamp), FixedClockNode(now, is_simulated=is_simulated), 5.0)


def test_old_stamp_without_limit_and_message_without_header_are_accepted() -> None:
    message_values.check_stamp(stamped(1000.0), FixedClockNode(YEARS_SEC))
    message_values.check_stamp(message("std_msgs/Float64"), FixedClockNode(YEARS_SEC), 5.0)


def test_remaining_drive_is_none_for_invalid_distance() -> None:
    from nav2_msgs.action import NavigateToPose

    feedback = NavigateToPose.Feedback(distance_remaining=2.5)
    feedback.estimated_time_remaining.sec, feedback.estimated_time_remaining.nanosec = 3, 500_000_000
    assert message_values.remaining_drive(feedback) == (2.5, 3.5)
    for number in (*NOT_NUMBERS, -1.0):
        assert message_values.remaining_drive(NavigateToPose.Feedback(distance_remaining=number)) is None


class TestReports:
    """Tests that `ValueReports` reports once for each source and kind of problem."""

    @pytest.fixture
    def node(self) -> FixedClockNode:
        return FixedClockNode(YEARS_SEC)

    @pytest.fixture
    def clock(self, monkeypatch: pytest.MonkeyPatch) -> FixedClockNode:
        clock = FixedClockNode(0.0)
        monkeypatch.setattr(message_values, "AWAKE", clock)
        monkeypatch.setattr(FixedClockNode, "now", lambda self: self.now_sec if self is clock else self)
        return clock

    def test_problem_is_reported_once_and_again_after_minute_without_it(
        self, node: FixedClockNode, clock: FixedClockNode
    ) -> None:
        reports = ValueReports(node)

        def read(share: float) -> float | None:
            battery = message("sensor_msgs/BatteryState", percentage=share)
            return reports.read("Topic 'battery'", lambda: message_values.battery_share(battery))

        assert read(0.5) == 0.5
        for share in (85.0, 0.5, 84.0):
            clock.now_sec += 50.0
            read(share)
        assert read(83.0) is None
        assert len(node.lines) == 2
        assert (
            node.lines[0]
            == f"Topic 'battery': percentage is 85, but {SHARE}. The value is treated as unknown."
        )

    def test_problems_are_reported_separately_by_source_and_kind(
        self, node: FixedClockNode, clock: FixedClockNode
    ) -> None:
        reports = ValueReports(node)
        for source in ("a", "b"):
            for problem in (ValueProblem.VALUE, ValueProblem.FRAME, ValueProblem.FUTURE):
                for _ in range(2):
                    reports.report_problem(source, UnusableValueError(problem.value, problem))
        assert len(node.lines) == 6

    def test_stale_stamp_is_reported_if_it_persists(
        self, node: FixedClockNode, clock: FixedClockNode
    ) -> None:
        reports = ValueReports(node)
        stale = UnusableValueError("old", ValueProblem.STALE)
        reports.report_problem("a", stale)
        clock.now_sec += 0.5
        reports.report_problem("a", stale)
        assert node.lines == []
        clock.now_sec += 0.6
        reports.report_problem("a", stale)
        reports.report_problem("a", stale)
        assert node.lines == ["a: old. The value is treated as unknown."]
