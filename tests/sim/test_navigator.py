"""Tests of planning, following, and ending drives, without ROS."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from sar_compiler.sim.follower import Follower, FollowerSettings, Path2D
from sar_compiler.sim.geometry import Box, Pose2D, normalise_angle
from sar_compiler.sim.navigator import Drive, DriveEnd, DriveOutcome
from sar_compiler.sim.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from sar_compiler.sim.planner import NavCode, Planner, PlanningError
from sar_compiler.sim.robot import Robot, RobotState
from sar_compiler.sim.world import World

STEP = 0.05
HOME = Pose2D(0.0, 0.0)
TOUR = (
    Pose2D(-3.0, 3.0, 0.0),
    Pose2D(3.5, 3.0, 1.57),
    Pose2D(4.0, -3.0, 3.14),
    Pose2D(-3.5, -3.0, -1.57),
    HOME,
)


@pytest.fixture(scope="module")
def planner(shipped_map: OccupancyMap) -> Planner:
    return Planner(shipped_map, 0.22)


def finish(drive: Drive, robot: Robot, now: float = 0.0) -> tuple[DriveOutcome, list[RobotState]]:
    """Drive to the end."""
    states: list[RobotState] = []
    for step in range(4000):
        progress = drive.step(robot.state, now + step * STEP)
        if progress.outcome is not None:
            return progress.outcome, states
        robot.command(progress.command)
        states.append(robot.step(STEP))
    pytest.fail("the drive did not end within 200 s")


@pytest.mark.parametrize(("start", "goal"), list(itertools.pairwise((HOME, *TOUR))))
def test_paths_stay_where_robot_fits(
    planner: Planner, shipped_map: OccupancyMap, start: Pose2D, goal: Pose2D
) -> None:
    points = planner.plan(start, goal).points
    for x, y in points:
        cell = shipped_map.cell_at(x, y)
        assert cell is not None
        assert planner.fits[cell]
    assert np.hypot(*np.diff(points, axis=0).T).max() < 0.15
    assert tuple(points[-1]) == (goal.x, goal.y)


@pytest.mark.parametrize(
    ("start", "goal", "code"),
    [
        (HOME, Pose2D(50.0, 0.0), NavCode.GOAL_OUTSIDE_MAP),
        (HOME, Pose2D(3.0, -3.0), NavCode.GOAL_OCCUPIED),
        (HOME, Pose2D(5.85, 3.0), NavCode.GOAL_OCCUPIED),
        (HOME, Pose2D(6.2, 0.0), NavCode.GOAL_OCCUPIED),
        (Pose2D(-50.0, 0.0), HOME, NavCode.START_OUTSIDE_MAP),
        (Pose2D(3.0, -3.0), HOME, NavCode.START_OCCUPIED),
    ],
)
def test_invalid_pose_is_rejected_with_nav2_code(
    planner: Planner, start: Pose2D, goal: Pose2D, code: NavCode
) -> None:
    with pytest.raises(PlanningError) as raised:
        planner.plan(start, goal)
    assert raised.value.code is code


def two_rooms() -> OccupancyMap:
    cells = np.full((40, 80), FREE, dtype=np.int8)
    cells[:, 39:41] = OCCUPIED
    return OccupancyMap(cells, 0.05, 0.0, 0.0)


def test_goal_behind_wall_has_no_path() -> None:
    with pytest.raises(PlanningError, match="no path leads from") as raised:
        Planner(two_rooms(), 0.22).plan(Pose2D(1.0, 1.0), Pose2D(3.0, 1.0))
    assert raised.value.code is NavCode.NO_VALID_PATH


def test_goal_on_map_without_free_ground_is_occupied() -> None:
    unknown = OccupancyMap(np.full((10, 10), UNKNOWN, dtype=np.int8), 0.05, 0.0, 0.0)
    with pytest.raises(PlanningError) as raised:
        Planner(unknown, 0.22).plan(Pose2D(0.2, 0.2), Pose2D(0.3, 0.3))
    assert raised.value.code is NavCode.GOAL_OCCUPIED


def test_robot_at_wall_may_leave() -> None:
    path = Planner(two_rooms(), 0.22).plan(Pose2D(0.2, 1.0), Pose2D(1.0, 1.0))
    assert path.remaining_lengths[0] > 0.5


def test_tour_reaches_pose_of_each_zone(disaster_zone: World, planner: Planner) -> None:
    robot, now = Robot(disaster_zone), 0.0
    for goal in TOUR:
        drive = Drive(planner, robot.limits, goal, robot.state.pose, now)
        outcome, states = finish(drive, robot, now)
        now += len(states) * STEP
        assert outcome == DriveOutcome(DriveEnd.SUCCEEDED)
        assert robot.state.pose.distance_to(goal) < 0.1
        assert abs(normalise_angle(robot.state.pose.yaw - goal.yaw)) < 0.1
        assert abs(robot.state.velocity.v) < 0.02
        assert not any(state.touching for state in states)
    assert now < 100.0


def test_robot_drives_until_within_tolerance(disaster_zone: World) -> None:
    robot = Robot(disaster_zone)
    way = Path2D(np.array([(0.0, 0.0), (0.5, 0.0), (0.75, 0.0), (1.0, 0.0)]))
    speeds = []
    for x in (0.75, 0.76):
        follower = Follower(way, None, robot.limits, FollowerSettings(position_tolerance=0.25))
        speeds.append(follower.command(replace(robot.state, pose=Pose2D(x, 0.0))).v)
    assert speeds[0] > 0.0 == speeds[1]


def test_repeated_drive_is_identical(disaster_zone: World, planner: Planner) -> None:
    runs = []
    for _ in range(2):
        robot = Robot(disaster_zone, seed=7)
        runs.append(finish(Drive(planner, robot.limits, TOUR[0], HOME, 0.0), robot)[1])
    assert runs[0] == runs[1]


def test_goal_at_robot_position_only_turns_robot(disaster_zone: World, planner: Planner) -> None:
    robot = Robot(disaster_zone)
    outcome, states = finish(Drive(planner, robot.limits, Pose2D(0.0, 0.0, 2.0), HOME, 0.0), robot)
    assert outcome.ending is DriveEnd.SUCCEEDED
    assert all(state.pose.distance_to(HOME) < 0.05 for state in states)


def test_brake_stops_robot_and_cancels_drive(disaster_zone: World, planner: Planner) -> None:
    robot = Robot(disaster_zone)
    drive = Drive(planner, robot.limits, TOUR[0], HOME, 0.0)
    for step in range(100):
        robot.command(drive.step(robot.state, step * STEP).command)
        robot.step(STEP)
    assert robot.state.velocity.v > 0.4
    drive.brake()
    outcome, states = finish(drive, robot, 5.0)
    assert outcome == DriveOutcome(DriveEnd.CANCELED)
    assert abs(robot.state.velocity.v) < 0.02
    assert len(states) < 20


def test_unmapped_obstacle_aborts_drive_for_lack_of_progress(disaster_zone: World, planner: Planner) -> None:
    fence = (
        Box(-0.9, 0.0, 0.1, 3.0),
        Box(0.9, 0.0, 0.1, 3.0),
        Box(0.0, 0.9, 3.0, 0.1),
        Box(0.0, -0.9, 3.0, 0.1),
    )
    robot = Robot(World("fenced", HOME, 0.22, boxes=disaster_zone.boxes + fence))
    outcome, _ = finish(Drive(planner, robot.limits, TOUR[0], HOME, 0.0), robot)
    assert outcome.ending is DriveEnd.ABORTED
    assert outcome.code is NavCode.FAILED_TO_MAKE_PROGRESS


def test_distance_remaining_decreases_to_zero(disaster_zone: World, planner: Planner) -> None:
    robot = Robot(disaster_zone)
    drive = Drive(planner, robot.limits, TOUR[0], HOME, 0.0)
    left = []
    for step in itertools.count():
        progress = drive.step(robot.state, step * STEP)
        left.append(progress.distance_remaining)
        if progress.outcome:
            break
        robot.command(progress.command)
        robot.step(STEP)
    assert left[0] > HOME.distance_to(TOUR[0])
    assert left[-1] < 0.1
    assert max(after - before for before, after in itertools.pairwise(left)) < 0.1


def test_path_that_passes_its_own_end_is_driven_completely() -> None:
    robot = Robot(World("open", HOME, 0.22))
    path = Path2D.through_corners(np.array([(0.0, 0.0), (2.0, 0.0), (1.0, 1.0), (0.0, 0.0)]))
    follower = Follower(path, None, robot.limits)
    farthest = 0.0
    for _ in range(800):
        robot.command(follower.command(robot.state))
        farthest = max(farthest, robot.step(STEP).pose.x)
    assert follower.is_done
    assert farthest > 1.5
