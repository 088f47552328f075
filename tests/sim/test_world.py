"""Tests of the world, its file, and the collision test."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.opener import UnreadableFileError
from sar_compiler.sim.geometry import Box, Cylinder, Pose2D, normalise_angle
from sar_compiler.sim.world import Lidar, Solid, World, WorldError, cast, find_world, load_world
from sar_compiler.tree.diagnostic import Diagnostic, TreeError

coordinates = st.floats(-10.0, 10.0)
angles = st.floats(-math.pi, math.pi)


@given(
    st.builds(Pose2D, coordinates, coordinates, angles), st.builds(Pose2D, coordinates, coordinates, angles)
)
def test_relative_pose_composes_back_to_pose(here: Pose2D, there: Pose2D) -> None:
    again = here.compose(here.inverse().compose(there))
    assert again.distance_to(there) < 1e-9
    assert abs(normalise_angle(again.yaw - there.yaw)) < 1e-9


def test_distance_to_rotated_box_is_distance_to_face() -> None:
    solid = Solid([Box(0.0, 0.0, 2.0, 1.0, math.pi / 4)], [])
    out = 3.0
    assert solid.clearance(out * math.cos(math.pi / 4), out * math.sin(math.pi / 4)) == pytest.approx(2.0)
    assert solid.clearance(0.1, 0.0) == 0.0


def test_distance_to_cylinder_is_distance_to_rim() -> None:
    solid = Solid([], [Cylinder(1.0, 0.0, 0.5)])
    assert solid.clearance(3.0, 0.0) == pytest.approx(1.5)
    assert solid.clearance(1.0, 0.0) == 0.0


def test_travel_in_empty_world_is_unlimited() -> None:
    solid = Solid([], [])
    assert solid.free_travel((0.0, 0.0), 1.0, 100.0, 0.22) == 100.0


def test_disc_cannot_pass_through_thin_wall() -> None:
    solid = Solid([Box(5.0, 0.0, 0.001, 4.0)], [])
    assert solid.free_travel((0.0, 0.0), 0.0, 1e6, 0.22) == pytest.approx(5.0 - 0.0005 - 0.22, abs=1e-4)


def test_disc_in_contact_may_leave_and_slide() -> None:
    solid = Solid([Box(1.0, 0.0, 1.0, 100.0)], [])
    reached = solid.free_travel((0.0, 0.0), 0.0, 1.0, 0.22)
    assert solid.free_travel((reached, 0.0), 0.0, 1.0, 0.22) == 0.0
    assert solid.free_travel((reached, 0.0), math.pi, 1.0, 0.22) == 1.0
    assert solid.free_travel((reached, 0.0), math.pi / 2, 1.0, 0.22) == pytest.approx(1.0)


@given(coordinates, coordinates, angles, st.floats(0.0, 30.0))
def test_free_travel_keeps_clearance(x: float, y: float, heading: float, length: float) -> None:
    world = find_world("disaster_zone")
    radius = world.robot_radius
    if world.obstacle_arrays.clearance(x, y) <= radius:
        return
    free = world.obstacle_arrays.free_travel((x, y), heading, length, radius)
    for part in np.linspace(0.0, free, 50):
        assert (
            world.obstacle_arrays.clearance(x + part * math.cos(heading), y + part * math.sin(heading))
            >= radius - 1e-9
        )


def test_ray_ends_at_first_surface() -> None:
    solid = Solid([Box(3.0, 0.0, 1.0, 1.0)], [Cylinder(-2.0, 0.0, 0.5)])
    seen = cast(solid, 0.0, 0.0, np.array([0.0, math.pi, math.pi / 2]))
    assert seen == pytest.approx([2.5, 1.5, math.inf])


def test_scan_noise_depends_on_seed(disaster_zone: World) -> None:
    lidar, pose = Lidar(), Pose2D(0.5, 0.5, 0.3)
    scans = [
        lidar.scan(disaster_zone.obstacle_arrays, pose, np.random.default_rng(seed)) for seed in (1, 1, 2)
    ]
    assert np.array_equal(scans[0], scans[1])
    assert not np.array_equal(scans[0], scans[2])
    truth = cast(disaster_zone.obstacle_arrays, pose.x, pose.y, lidar.angles + pose.yaw)
    assert np.abs(scans[0] - truth).max() < 6 * lidar.noise


def test_scan_sees_nothing_beyond_range() -> None:
    scan = Lidar(range_max=2.0).scan(
        Solid([Box(3.0, 0.0, 0.5, 9.0)], []), Pose2D(0.0, 0.0), np.random.default_rng(0)
    )
    assert np.isinf(scan).all()


def test_shipped_disaster_zone_has_expected_content(disaster_zone: World) -> None:
    assert len(disaster_zone.boxes) == 11
    assert disaster_zone.cylinders == (Cylinder(-2.0, -2.5, 0.3),)
    assert disaster_zone.start == Pose2D(0.0, 0.0, 0.0)
    assert disaster_zone.robot_radius == 0.22
    assert dict(disaster_zone.places) == {
        "zone_a": (-3.0, 3.0),
        "zone_b": (3.5, 3.0),
        "zone_c": (4.0, -3.0),
        "zone_d": (-3.5, -3.0),
    }


def test_empty_world_has_no_map() -> None:
    world = find_world("empty")
    assert world.map_path is None
    assert world.obstacle_arrays.clearance(0.0, 0.0) > 19.0


def test_unknown_world_is_reported_with_known_worlds() -> None:
    with pytest.raises(WorldError, match=r"shipped: disaster_zone, empty.*did you mean 'disaster_zone'"):
        find_world("disaster_zon")


ROBOT = "robot: {x: 0, y: 0, radius: 0.22}\n"


# Each: file content, line, column, code, part of the message, and part of the advice.
INVALID_WORLDS: list[tuple[str, int, int, str, str, str]] = [
    ("", 1, 1, "empty-file", "the file is empty", "for example robot: "),
    ("robot: [\n", 2, 1, "malformed-yaml", "something is missing here", "write the missing part"),
    (
        "- 1\n",
        1,
        1,
        "wrong-shape",
        "a world must be a mapping of robot, battery, walls, debris, zones, survey, map",
        "",
    ),
    (ROBOT, 1, 1, "missing-key", "a world needs 'walls'", ""),
    ("robot: {x: 0}\nwalls: []\n", 1, 1, "missing-key", "'robot' needs 'y' and 'radius'", ""),
    (
        ROBOT + "walls: []\nzons: {}\n",
        3,
        1,
        "unknown-key",
        "a world has no key 'zons' (known: robot",
        "zones",
    ),
    (ROBOT + "wals: []\n", 2, 1, "unknown-key", "a world has no key 'wals'", "walls"),
    (
        ROBOT + "walls: []\nwalls: []\n",
        3,
        1,
        "duplicate-key",
        "the key 'walls' is given twice in this mapping",
        "",
    ),
    (ROBOT + "walls: 3\n", 2, 8, "wrong-shape", "'walls' must be a list of walls, but is '3'", ""),
    (
        ROBOT + "walls: [3]\n",
        2,
        9,
        "wrong-shape",
        "'walls' must be a mapping of x, y, size_x, size_y, yaw",
        "",
    ),
    (
        ROBOT + "walls:\n  - {x: 1, y: 1, size_x: 0, size_y: 1}\n",
        *(3, 26, "wrong-value", "'size_x' must be a number above 0, at most 1000000, but is '0'", ""),
    ),
    (
        ROBOT + "walls:\n  - {x: .nan, y: 1, size_x: 1, size_y: 1}\n",
        *(3, 9, "wrong-value", "'x' must be a number of at most 1000000, but is '.nan'", ""),
    ),
    (
        ROBOT + "walls: []\nzones: {a: {x: nan, y: '1'}}\n",
        *(3, 16, "wrong-value", "'x' must be a number of at most 1000000, but is 'nan'", ""),
    ),
    (
        ROBOT + "walls: []\nzones: {a: {x: 1, y: '1'}}\n",
        *(3, 23, "wrong-value", "'y' must be a number of at most 1000000, but 1 in quotes is a string", ""),
    ),
    (
        ROBOT + "walls: []\ndebris:\n  - {shape: bx, x: 1}\n",
        *(4, 13, "wrong-value", "'shape' must be one of box, cylinder, but is 'bx'", "box"),
    ),
    (
        ROBOT + "walls: []\ndebris:\n  - {hape: box, x: 1}\n",
        *(4, 5, "missing-key", "an obstacle needs 'shape'", ""),
    ),
    (
        ROBOT + "walls: []\ndebris:\n  - {shape: cylinder, x: 1, y: 1, radius: 1, yaw: 0}\n",
        *(4, 46, "unknown-key", "a cylinder has no key 'yaw'", ""),
    ),
    (
        ROBOT + "walls: []\ndebris:\n  - {shape: box, x: 1, y: 1, radius: 1, size_x: 1}\n",
        *(4, 5, "missing-key", "a box needs 'size_y'", ""),
    ),
    (
        ROBOT + "walls:\n  - {x: 0.3, y: 0, size_x: 0.2, size_y: 1}\n",
        *(1, 1, "wrong-value", "the robot would start inside an obstacle", ""),
    ),
    (ROBOT + "walls: []\nmap: ''\n", 3, 7, "missing-value", "'map' must be a path, but is the string ''", ""),
]


def load_findings(tmp_path: Path, text: str) -> tuple[Diagnostic, ...]:
    path = tmp_path / "world.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TreeError) as caught:
        load_world(path)
    return caught.value.findings


@pytest.mark.parametrize(("text", "line", "column", "code", "problem", "advice"), INVALID_WORLDS)
def test_error_in_world_file_is_reported_with_location(
    tmp_path: Path, text: str, line: int, column: int, code: str, problem: str, advice: str
) -> None:
    first = load_findings(tmp_path, text)[0]
    assert (first.code, first.span.line, first.span.column) == (code, line, column)
    assert problem in first.message
    assert advice in first.advice


def test_all_errors_in_world_file_are_reported_in_order(tmp_path: Path) -> None:
    text = "robot: {x: 0, y: 0, radus: 0.22}\nwals: []\nzones: {a: {x: 1}}\nsurvey: [{x: 1, y: b}]\n"
    assert [(each.code, each.span.line, each.suggestion) for each in load_findings(tmp_path, text)] == [
        ("unknown-key", 1, "radius"),
        ("unknown-key", 2, "walls"),
        ("missing-key", 3, None),
        ("wrong-value", 4, None),
    ]


def test_unreadable_world_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match="cannot read"):
        load_world(tmp_path)
