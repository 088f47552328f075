"""Tests of the simulated robot: limits, contact, odometry, repeatability."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sar_compiler.sim.geometry import Box, Pose2D
from sar_compiler.sim.robot import STAND, Limits, Robot, RobotState, Twist2D
from sar_compiler.sim.world import World

STEP = 0.05
anything = st.floats(allow_nan=True, allow_infinity=True)
commands = st.lists(
    st.tuples(
        st.builds(Twist2D, anything | st.floats(-1, 1), anything | st.floats(-3, 3)), st.integers(1, 60)
    ),
    max_size=25,
)


def open_ground() -> World:
    return World("open", Pose2D(0.0, 0.0), 0.22)


def drive(robot: Robot, orders: list[tuple[Twist2D, int]]) -> list[RobotState]:
    states = []
    for twist, steps in orders:
        for _ in range(steps):
            robot.command(twist)
            states.append(robot.step(STEP))
    return states


@settings(max_examples=60, deadline=None)
@given(commands, st.floats(0.1, 30.0))
def test_robot_never_enters_obstacle(
    disaster_zone: World, orders: list[tuple[Twist2D, int]], speed: float
) -> None:
    robot = Robot(disaster_zone, limits=Limits(speed=speed, acceleration=50.0))
    for state in drive(robot, orders):
        assert state.pose.is_finite
        assert (
            disaster_zone.obstacle_arrays.clearance(state.pose.x, state.pose.y) >= disaster_zone.robot_radius
        )


@given(commands, st.integers(0, 3))
@settings(max_examples=20, deadline=None)
def test_same_seed_and_commands_give_identical_states(
    disaster_zone: World, orders: list[tuple[Twist2D, int]], seed: int
) -> None:
    assert drive(Robot(disaster_zone, seed=seed), orders) == drive(Robot(disaster_zone, seed=seed), orders)


@given(commands)
@settings(max_examples=20, deadline=None)
def test_speeds_and_accelerations_keep_to_limits(orders: list[tuple[Twist2D, int]]) -> None:
    robot = Robot(open_ground())
    last = STAND
    for state in drive(robot, orders):
        now, limits = state.velocity, robot.limits
        assert abs(now.v) <= limits.speed
        assert abs(now.w) <= limits.turn
        assert abs(now.v - last.v) <= limits.acceleration * STEP + 1e-9
        assert abs(now.w - last.w) <= limits.turn_acceleration * STEP + 1e-9
        last = now


def test_robot_without_command_stands() -> None:
    robot = Robot(open_ground())
    assert robot.step(STEP).pose == Pose2D(0.0, 0.0)


def test_command_expires_after_timeout() -> None:
    robot = Robot(open_ground(), command_timeout=0.5)
    robot.command(Twist2D(0.5, 0.0))
    states = [robot.step(STEP) for _ in range(40)]
    assert states[9].velocity.v == pytest.approx(0.5)
    assert states[11].velocity.v < 0.5
    assert states[-1].velocity.v == 0.0


def test_wall_stops_robot_and_lets_it_turn_and_leave() -> None:
    world = World("wall", Pose2D(0.0, 0.0), 0.22, boxes=(Box(1.0, 0.0, 0.1, 4.0),))
    robot = Robot(world)
    state = drive(robot, [(Twist2D(0.6, 0.0), 80)])[-1]
    assert state.touching
    assert state.velocity.v == 0.0
    assert state.pose.x == pytest.approx(1.0 - 0.05 - 0.22, abs=1e-4)
    state = drive(robot, [(Twist2D(0.0, 1.0), 40)])[-1]
    assert abs(state.pose.yaw) > 1.0
    state = drive(robot, [(Twist2D(0.6, 0.0), 40)])[-1]
    assert not state.touching


def test_circle_has_commanded_radius() -> None:
    robot = Robot(open_ground())
    drive(robot, [(Twist2D(0.5, 1.0), 30)])
    here = robot.state.pose
    centre = here.compose(Pose2D(0.0, 0.5))
    for state in drive(robot, [(Twist2D(0.5, 1.0), 200)]):
        assert state.pose.distance_to(Pose2D(centre.x, centre.y)) == pytest.approx(0.5, abs=1e-3)


def test_odometry_begins_at_zero_and_drifts_little() -> None:
    world = World("open", Pose2D(2.0, 1.0, math.pi / 2), 0.22)
    robot = Robot(world, seed=4)
    state = drive(robot, [(Twist2D(0.6, 0.0), 100)])[-1]
    believed = world.start.compose(state.odometry)
    assert 0.0 < believed.distance_to(state.pose) < 0.05


def test_odometry_differs_between_seeds() -> None:
    ends = [drive(Robot(open_ground(), seed=seed), [(Twist2D(0.6, 0.3), 50)])[-1].odometry for seed in (0, 1)]
    assert ends[0] != ends[1]
