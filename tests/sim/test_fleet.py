"""Tests of several robots in one world, without ROS: names, placements and collisions."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sar_compiler.sim.geometry import Box, Pose2D
from sar_compiler.sim.navigator import Drive, DriveEnd, DriveOutcome
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.placement import Placement, PlacementError, parse_placement
from sar_compiler.sim.planner import NavCode, Planner
from sar_compiler.sim.robot import Robot, RobotState, Twist2D
from sar_compiler.sim.simulation import check_placements, make_robots, seed_of
from sar_compiler.sim.world import Lidar, World

STEP = 0.05
OPEN = World("open", Pose2D(0.0, 0.0), 0.22)
AHEAD = Twist2D(0.6, 0.0)
PAIR = (Placement("robot1", Pose2D(-0.7, 0.0, math.pi)), Placement("robot2", Pose2D(0.7, 0.0)))

speeds = st.builds(Twist2D, st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
orders = st.lists(st.tuples(speeds, speeds, speeds, st.integers(1, 60)), max_size=20)


def make_placed_robots(*starts: Pose2D, world: World = OPEN, seed: int = 0) -> list[Robot]:
    placements = [Placement(f"robot{number}", start) for number, start in enumerate(starts, 1)]
    return make_robots(world, placements, seed=seed)


def run(robots: list[Robot], commands: Sequence[tuple[Twist2D, ...]]) -> list[list[RobotState]]:
    """Command each robot in every step, step all robots in order, and return their states."""
    states = []
    for step in commands:
        for robot, twist in zip(robots, step, strict=False):
            robot.command(twist)
        states.append([robot.step(STEP) for robot in robots])
    return states


def expand_commands(drawn: list[tuple[Twist2D, Twist2D, Twist2D, int]]) -> list[tuple[Twist2D, ...]]:
    return [(one, two, three) for one, two, three, steps in drawn for _ in range(steps)]


@pytest.fixture(scope="module")
def planner(shipped_map: OccupancyMap) -> Planner:
    return Planner(shipped_map, 0.22)


class TestNames:
    @pytest.mark.parametrize(
        ("text", "placement"),
        [
            ("robot1", Placement("robot1")),
            ("robot1:1,-2.5", Placement("robot1", Pose2D(1.0, -2.5))),
            ("_r:-.7,0,3.14", Placement("_r", Pose2D(-0.7, 0.0, 3.14))),
        ],
    )
    def test_placement_is_name_with_optional_pose(self, text: str, placement: Placement) -> None:
        assert parse_placement(text) == placement

    @pytest.mark.parametrize(
        ("text", "problem"),
        [
            ("", "the robot has no name. Write NAME"),
            ("1st", "'1st' is not a valid namespace"),
            ("/robot1", "'/robot1' is not a valid namespace"),
            ("robot-1:0,0", "'robot-1' is not a valid namespace"),
            ("r" * 101, "is not a valid namespace"),
            ("a__b:1,1", "'a__b' is not a valid namespace"),
            ("___", "'___' is not a valid namespace"),
            ("robot1:", "'' is not a finite number"),
            ("robot1:1", "'1' has 1 number."),
            ("robot1:1,2,3,4", "'1,2,3,4' has 4 numbers."),
            ("robot1:1,east", "'east' is not a finite number"),
            ("robot1:1,inf", "'inf' is not a finite number"),
        ],
    )
    def test_invalid_placement_is_reported_with_expected_form(self, text: str, problem: str) -> None:
        with pytest.raises(PlacementError) as raised:
            parse_placement(text)
        assert text in str(raised.value)
        assert problem in str(raised.value)
        assert "rite NAME, NAME:X,Y or NAME:X,Y,YAW" in str(raised.value)

    @pytest.mark.ros
    @given(st.from_regex(r"[A-Za-z_0-9/~-]{1,4}", fullmatch=True) | st.text(min_size=1, max_size=3))
    def test_accepted_name_is_valid_ros_namespace(self, name: str) -> None:
        from rclpy.validate_namespace import validate_namespace

        try:
            placement = parse_placement(name.partition(":")[0])
        except PlacementError:
            return
        assert validate_namespace(f"/{placement.name}")

    @given(st.text(max_size=12) | st.from_regex(r"r:[0-9.,e+-]{0,10}", fullmatch=True))
    def test_any_text_is_placement_or_rejected(self, text: str) -> None:
        try:
            placement = parse_placement(text)
        except PlacementError:
            return
        assert placement.start is None or placement.start.is_finite


class TestPlacements:
    def test_duplicate_names_are_rejected(self) -> None:
        with pytest.raises(PlacementError, match="robot 'twin': 2 robots have this name"):
            check_placements(OPEN, [Placement("twin"), Placement("twin", Pose2D(3.0, 0.0))])

    def test_start_at_obstacle_is_rejected(self, disaster_zone: World) -> None:
        with pytest.raises(
            PlacementError,
            match=r"robot 'lost': would start in contact with an obstacle.* at \(3.00, -3.00\)",
        ):
            check_placements(disaster_zone, [Placement("lost", Pose2D(3.0, -3.0))])
        with pytest.raises(PlacementError, match=r"more than 0.22 m"):
            check_placements(disaster_zone, [Placement("near", Pose2D(0.2, 3.0))])

    def test_start_outside_map_is_rejected(self, disaster_zone: World) -> None:
        with pytest.raises(
            PlacementError,
            match=r"robot 'far': would start at \(100.00, 100.00\), which is outside the world's map",
        ):
            check_placements(disaster_zone, [Placement("far", Pose2D(100.0, 100.0))])

    def test_two_robots_at_world_start_are_rejected_with_remedy(self) -> None:
        with pytest.raises(PlacementError, match=r"in contact with robot 'robot1' at .*Write robot2:X,Y"):
            check_placements(OPEN, [Placement("robot1"), Placement("robot2")])

    def test_two_robots_may_start_close_together(self) -> None:
        check_placements(OPEN, [Placement("robot1"), Placement("robot2", Pose2D(0.0, 0.45))])

    def test_robots_start_at_placement_or_at_world_start(self) -> None:
        world = World("open", Pose2D(2.0, 1.0, 0.5), 0.22)
        robots = make_robots(world, [Placement("robot1"), Placement("robot2", Pose2D(0.0, 0.0, 1.0))])
        assert [robot.state.pose for robot in robots] == [world.start, Pose2D(0.0, 0.0, 1.0)]


class TestSolidity:
    @settings(max_examples=40, deadline=None)
    @given(orders)
    def test_no_robot_enters_other_robot_or_obstacle(
        self, disaster_zone: World, drawn: list[tuple[Twist2D, Twist2D, Twist2D, int]]
    ) -> None:
        starts = [Pose2D(0.0, 0.0), Pose2D(0.5, 0.1, 2.0), Pose2D(0.2, 0.6, -1.5)]
        for states in run(make_placed_robots(*starts, world=disaster_zone), expand_commands(drawn)):
            for number, state in enumerate(states):
                assert (
                    disaster_zone.obstacle_arrays.clearance(state.pose.x, state.pose.y)
                    >= disaster_zone.robot_radius
                )
                for other in states[number + 1 :]:
                    assert state.pose.distance_to(other.pose) >= 2 * disaster_zone.robot_radius

    def test_colliding_robots_stop_rim_to_rim(self) -> None:
        robots = make_placed_robots(Pose2D(0.0, 0.0), Pose2D(2.0, 0.0, math.pi))
        one, other = run(robots, [(AHEAD, AHEAD)] * 100)[-1]
        assert one.pose.distance_to(other.pose) == pytest.approx(2 * OPEN.robot_radius, abs=1e-4)
        assert one.touching
        assert other.touching

    def test_standing_robot_is_not_pushed(self) -> None:
        robots = make_placed_robots(Pose2D(0.0, 0.0), Pose2D(1.0, 0.0))
        pushing, standing = run(robots, [(AHEAD,)] * 100)[-1]
        assert standing.pose == Pose2D(1.0, 0.0)
        assert pushing.pose.x == pytest.approx(1.0 - 2 * OPEN.robot_radius, abs=1e-4)

    def test_robot_in_contact_may_turn_and_leave(self) -> None:
        robots = make_placed_robots(Pose2D(0.0, 0.0), Pose2D(0.5, 0.0))
        assert run(robots, [(AHEAD,)] * 20)[-1][0].touching
        leaving = run(robots, [(Twist2D(0.0, 2.0),)] * 20 + [(AHEAD,)] * 40)[-1][0]
        assert not leaving.touching
        assert leaving.pose.y > 0.5

    def test_fast_robot_does_not_pass_through_other_robot(self) -> None:
        robots = make_placed_robots(Pose2D(0.0, 0.0), Pose2D(2.0, 0.0))
        robots[0].limits = type(robots[0].limits)(speed=1000.0, acceleration=1e6)
        run(robots, [(Twist2D(1000.0, 0.0),)] * 3)
        assert robots[0].state.pose.x == pytest.approx(2.0 - 2 * OPEN.robot_radius, abs=1e-4)


class TestRepeatability:
    @settings(max_examples=15, deadline=None)
    @given(orders, st.integers(0, 3))
    def test_same_seed_and_commands_give_identical_states(
        self, drawn: list[tuple[Twist2D, Twist2D, Twist2D, int]], seed: int
    ) -> None:
        starts = Pose2D(0.0, 0.0), Pose2D(0.5, 0.0, 1.0)
        twice = [run(make_placed_robots(*starts, seed=seed), expand_commands(drawn)) for _ in range(2)]
        assert twice[0] == twice[1]

    @settings(max_examples=15, deadline=None)
    @given(orders)
    def test_single_placed_robot_equals_plain_robot(
        self, disaster_zone: World, drawn: list[tuple[Twist2D, Twist2D, Twist2D, int]]
    ) -> None:
        alone = run([Robot(disaster_zone, seed=5)], expand_commands(drawn))
        assert run(make_robots(disaster_zone, [Placement("")], seed=5), expand_commands(drawn)) == alone

    def test_distant_robot_does_not_affect_states(self) -> None:
        commands = [(Twist2D(0.5, 0.7), Twist2D(-0.3, 0.2))] * 200
        alone = [states[0] for states in run(make_placed_robots(Pose2D(0.0, 0.0), seed=3), commands)]
        beside = [
            states[0]
            for states in run(make_placed_robots(Pose2D(0.0, 0.0), Pose2D(9.0, 0.0), seed=3), commands)
        ]
        assert beside == alone

    def test_each_robot_has_its_own_noise(self) -> None:
        robots = make_placed_robots(Pose2D(0.0, 0.0), Pose2D(0.0, 5.0), Pose2D(0.0, 9.0))
        last = run(robots, [(AHEAD, AHEAD, AHEAD)] * 40)[-1]
        assert len({state.odometry for state in last}) == 3
        assert len({seed_of(seed, number) for seed in range(10) for number in range(10)}) == 100


class TestLidar:
    def test_lidar_sees_rim_of_other_robot(self) -> None:
        robots = make_placed_robots(Pose2D(0.0, 0.0), Pose2D(0.0, 2.0))
        exact = Lidar(noise=0.0)
        scan = exact.scan(robots[0].surroundings(), robots[0].state.pose, np.random.default_rng(0))
        assert scan[270] == pytest.approx(2.0 - OPEN.robot_radius)
        seen = np.flatnonzero(np.isfinite(scan))
        half = math.degrees(math.asin(OPEN.robot_radius / 2.0))
        assert list(seen) == list(range(math.ceil(270 - half), math.floor(270 + half) + 1))

    def test_lidar_sees_current_position_of_other_robot_and_not_itself(self) -> None:
        robots = make_placed_robots(Pose2D(0.0, 0.0), Pose2D(1.0, 0.0))
        run(robots, [(Twist2D(), AHEAD)] * 100)
        exact = Lidar(noise=0.0)
        for robot, beam in zip(robots, (180, 0), strict=True):
            scan = exact.scan(robot.surroundings(), robot.state.pose, np.random.default_rng(0))
            gap = robots[0].state.pose.distance_to(robots[1].state.pose) - OPEN.robot_radius
            assert scan[beam] == pytest.approx(gap)

    def test_other_robot_hides_wall_behind_it(self) -> None:
        world = World("wall", Pose2D(0.0, 0.0), 0.22, boxes=(Box(3.0, 0.0, 0.1, 9.0),))
        robots = make_placed_robots(Pose2D(0.0, 0.0), Pose2D(1.5, 0.0), world=world)
        scan = Lidar(noise=0.0).scan(robots[0].surroundings(), Pose2D(0.0, 0.0), np.random.default_rng(0))
        assert scan[180] == pytest.approx(1.5 - 0.22)
        assert scan[200] == pytest.approx(2.95 / math.cos(math.radians(20)))


class TestNavigators:
    """Tests of two simultaneous drives, each with its own robot, on the shipped map."""

    def drive(
        self, robots: list[Robot], goals: list[Pose2D], planner: Planner
    ) -> list[tuple[DriveOutcome, float]]:
        """Drive each robot to its goal, and return how and when (simulated seconds) each ended."""
        drives = [
            Drive(planner, robot.limits, goal, robot.state.pose, 0.0)
            for robot, goal in zip(robots, goals, strict=True)
        ]
        ends: dict[int, tuple[DriveOutcome, float]] = {}
        for step in range(6000):
            for number, (drive, robot) in enumerate(zip(drives, robots, strict=True)):
                if number not in ends:
                    progress = drive.step(robot.state, step * STEP)
                    robot.command(progress.command)
                    if progress.outcome is not None:
                        ends[number] = progress.outcome, step * STEP
            if len(ends) == len(drives):
                return [ends[number] for number in range(len(drives))]
            for robot in robots:
                robot.step(STEP)
        pytest.fail(f"of {len(drives)} drives only {ends} ended within 300 s")

    def test_both_robots_arrive_on_separate_paths(self, disaster_zone: World, planner: Planner) -> None:
        robots = make_robots(disaster_zone, PAIR)
        goals = [Pose2D(-3.0, 3.0), Pose2D(4.0, -3.0, 3.14)]
        outcomes = [outcome for outcome, _ in self.drive(robots, goals, planner)]
        assert outcomes == [DriveOutcome(DriveEnd.SUCCEEDED)] * 2
        assert all(
            robot.state.pose.distance_to(goal) < 0.1 for robot, goal in zip(robots, goals, strict=True)
        )

    def test_drive_is_unaffected_by_standing_robot(self, disaster_zone: World, planner: Planner) -> None:
        alone = make_robots(disaster_zone, PAIR[:1])
        self.drive(alone, [Pose2D(-3.0, 3.0)], planner)
        both = make_robots(disaster_zone, PAIR)
        self.drive(both, [Pose2D(-3.0, 3.0), Pose2D(0.7, 0.0)], planner)
        assert both[0].state.pose.distance_to(alone[0].state.pose) < 0.01

    def test_robots_that_block_each_other_both_abort(self, disaster_zone: World, planner: Planner) -> None:
        robots = make_robots(disaster_zone, PAIR)
        ends = self.drive(robots, [Pose2D(0.7, 0.0), Pose2D(-0.7, 0.0)], planner)
        for outcome, after_sec in ends:
            assert (outcome.ending, outcome.code) == (DriveEnd.ABORTED, NavCode.FAILED_TO_MAKE_PROGRESS)
            assert outcome.text.endswith("an obstacle that is not on the map blocks the path")
            assert after_sec < 20.0

    @settings(max_examples=30, deadline=None)
    @given(st.integers(0, 2**32))
    def test_both_drives_end_for_any_goals(
        self, disaster_zone: World, planner: Planner, shipped_map: OccupancyMap, seed: int
    ) -> None:
        cells = np.random.default_rng(seed).choice(np.argwhere(planner.fits), 2)
        goals = [Pose2D(float(x), float(y)) for x, y in shipped_map.centre_of(cells[:, 0], cells[:, 1])]
        self.drive(make_robots(disaster_zone, PAIR), goals, planner)
