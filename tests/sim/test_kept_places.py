"""The file that keeps the robots' places."""

import math

import pytest

from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.placement import Placement, PoseFile, PoseFileError

PLACES = {"": (Pose2D(1.0, 2.0, 0.5), Pose2D(0.25, 0.0, 0.1))}


@pytest.fixture
def kept(tmp_path):
    return PoseFile(tmp_path / "places.json", "disaster_zone")


def test_what_was_written_is_read(kept):
    kept.write(PLACES)
    assert kept.read() == PLACES


def test_a_robot_starts_where_it_stood_with_the_odometry_that_it_had_and_others_at_their_starts(kept):
    kept.write(PLACES)
    elsewhere = Placement("robot2", Pose2D(3.0, 3.0))
    assert kept.restore([Placement(""), elsewhere]) == [Placement("", *PLACES[""]), elsewhere]


def test_without_a_file_robots_are_at_their_starts(kept):
    assert kept.restore([Placement("")]) == [Placement("")]


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
def test_a_file_of_something_else_is_refused(kept, text, problem):
    kept._path.write_text(text)
    with pytest.raises(PoseFileError, match=problem):
        kept.read()


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(
        PoseFileError, match=r"places\.json: the file cannot be written: No such file or directory"
    ):
        PoseFile(tmp_path / "nowhere" / "places.json", "disaster_zone").write(PLACES)


@pytest.mark.ros
def test_a_simulation_keeps_the_places_of_its_robots(kept, ros_context, disaster_zone):
    from sar_compiler.sim.simulation import Simulation

    robots = [Placement("", Pose2D(1.0, 2.0, math.pi / 4), Pose2D(0.5, 0.0))]
    simulation = Simulation(disaster_zone, robots, speed=100.0, context=ros_context)
    simulation.store_poses(kept)
    with simulation:
        while not kept._path.is_file():
            assert simulation.failure is None
    assert kept.restore([Placement("")]) == robots
