"""Tests of the file that stores the poses of robots."""

import math

import pytest

from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.placement import Placement, PoseFile, PoseFileError

POSES = {"": (Pose2D(1.0, 2.0, 0.5), Pose2D(0.25, 0.0, 0.1))}


@pytest.fixture
def pose_file(tmp_path):
    return PoseFile(tmp_path / "places.json", "disaster_zone")


def test_written_poses_are_read(pose_file):
    pose_file.write(POSES)
    assert pose_file.read() == POSES


def test_stored_pose_and_odometry_are_restored_and_other_robots_keep_their_starts(pose_file):
    pose_file.write(POSES)
    elsewhere = Placement("robot2", Pose2D(3.0, 3.0))
    assert pose_file.restore([Placement(""), elsewhere]) == [Placement("", *POSES[""]), elsewhere]


def test_robots_keep_their_starts_without_file(pose_file):
    assert pose_file.restore([Placement("")]) == [Placement("")]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "contains no poses of robots"),
        ("[]", "contains no poses of robots"),
        ('{"world": "disaster_zone", "robots": {"": [[1, 2], [1, 2, 3, 4]]}}', "contains no poses of robots"),
        (
            '{"world": "disaster_zone", "robots": {"": [["a", 2, 0], [1, 2, 3]]}}',
            "contains no poses of robots",
        ),
        ('{"world": "elsewhere", "robots": {}}', "contains poses for another world, 'elsewhere'"),
        ('{"world": "disaster_zone", "robots": {"": [[NaN, 2, 0], [1, 2, 3]]}}', "not finite"),
    ],
)
def test_invalid_pose_file_is_rejected(pose_file, text, problem):
    pose_file._path.write_text(text)
    with pytest.raises(PoseFileError, match=problem):
        pose_file.read()


def test_unwritable_file_is_named(tmp_path):
    with pytest.raises(
        PoseFileError, match=r"places\.json: the file cannot be written: No such file or directory"
    ):
        PoseFile(tmp_path / "nowhere" / "places.json", "disaster_zone").write(POSES)


@pytest.mark.ros
def test_simulation_stores_poses_of_robots(pose_file, ros_context, disaster_zone):
    from sar_compiler.sim.simulation import Simulation

    robots = [Placement("", Pose2D(1.0, 2.0, math.pi / 4), Pose2D(0.5, 0.0))]
    simulation = Simulation(disaster_zone, robots, speed=100.0, context=ros_context)
    simulation.store_poses(pose_file)
    with simulation:
        while not pose_file._path.is_file():
            assert simulation.failure is None
    assert pose_file.restore([Placement("")]) == robots
