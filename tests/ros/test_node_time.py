"""Tests of the monitored clock of a node, without ROS."""

import time
from types import SimpleNamespace

import pytest

from sar_compiler.ros.clock import ClockedTime, NodeTime, deadline_clock, deadline_timer, trust_simulation


class Bench:
    """The clock of a node and the clock of the machine, both of which the test advances."""

    def __init__(self, monkeypatch, ros_sec=100.0, simulated=True):
        self.steady_sec, self.ros_sec = 7.0, ros_sec
        self.clock = SimpleNamespace(now=self._now, ros_time_is_active=simulated)
        self.said = []
        monkeypatch.setattr(time, "monotonic", lambda: self.steady_sec)

    def _now(self):
        return SimpleNamespace(nanoseconds=round(self.ros_sec * 1e9))

    def node(self, **others):
        return SimpleNamespace(get_clock=lambda: self.clock, **others)

    def node_time(self, **options):
        return NodeTime(self.node(), say=self.said.append, **options)

    def clocked_time(self):
        return ClockedTime(self.node())

    def passes(self, counted, steady_sec, ros_sec, steps=100):
        """Return the counted time while both clocks advance in small steps."""
        before = counted.now()
        for _ in range(steps):
            self.steady_sec += steady_sec / steps
            self.ros_sec += ros_sec / steps
            counted.now()
        return counted.now() - before


@pytest.fixture
def bench(monkeypatch):
    return Bench(monkeypatch)


@pytest.mark.parametrize("speed", [0.01, 1.0, 20.0, 150.0])
def test_simulated_time_is_counted_at_any_speed(bench, speed):
    counted = bench.node_time()
    assert bench.passes(counted, 60.0, 60.0 * speed) == pytest.approx(60.0 * speed)
    assert bench.said == []


def test_short_clock_standstill_is_not_counted(bench):
    counted = bench.node_time()
    assert bench.passes(counted, 9.9, 0.0) == 0.0
    assert bench.said == []


def test_machine_time_is_counted_from_last_advance_after_long_standstill(bench):
    counted = bench.node_time()
    assert bench.passes(counted, 15.0, 0.0) == pytest.approx(15.0)
    assert [line[:37] for line in bench.said] == ["The clock has stood still for 10 s (i"]


def test_clock_that_advances_again_is_counted_without_duplicates(bench):
    counted = bench.node_time()
    bench.passes(counted, 15.0, 0.0)
    assert bench.passes(counted, 5.0, 5.0) == pytest.approx(5.0)
    assert bench.said[1:] == ["The clock advances again."]


@pytest.mark.parametrize(("jump", "which"), [(5000.0, "forward by 5000.5 s"), (-90.0, "back by 89.5 s")])
def test_clock_jump_counts_as_machine_time_and_is_logged(bench, jump, which):
    counted = bench.node_time()
    assert bench.passes(counted, 0.5, 0.5 + jump, steps=1) == pytest.approx(0.5)
    assert bench.said == [
        f"The clock has jumped {which}. 0.5 s are counted instead, according to the machine's clock."
    ]


def test_first_time_is_not_a_jump(monkeypatch):
    bench = Bench(monkeypatch, ros_sec=0.0)
    counted = bench.node_time()
    assert bench.passes(counted, 2.0, 1.7e9, steps=1) == pytest.approx(2.0)
    assert bench.said == []


def test_steady_clock_is_counted_without_simulated_time(monkeypatch):
    bench = Bench(monkeypatch, simulated=False)
    counted = bench.node_time()
    assert bench.passes(counted, 3.0, 3600.0) == pytest.approx(3.0)
    assert bench.said == []


def test_speed_limit_caps_counted_time(bench):
    counted = bench.node_time(fastest=10.0)
    assert bench.passes(counted, 2.0, 100.0) == pytest.approx(20.0)
    assert bench.passes(counted, 2.0, 8.0) == pytest.approx(8.0)


def test_deadline_clock_is_capped_unless_simulation_is_trusted(bench):
    foreign, own = bench.node(), bench.node()
    trust_simulation(own)
    assert bench.passes(deadline_clock(foreign), 2.0, 100.0) == pytest.approx(20.0)
    assert bench.passes(deadline_clock(own), 2.0, 100.0) == pytest.approx(100.0)


@pytest.mark.ros
def test_deadline_timer_uses_simulated_time_only_if_trusted(bench):
    made = []
    create = {"create_timer": lambda _period, _call, clock="its own": made.append(clock)}
    foreign, own = bench.node(**create), bench.node(**create)
    trust_simulation(own)
    for node in (foreign, own):
        deadline_timer(node, 0.1, print)
    assert made[0].clock_type.name == "STEADY_TIME"
    assert made[1] == "its own"


@pytest.mark.ros
def test_robot_stands_after_half_second_of_its_own_time(bench):
    from nav_msgs.msg import Odometry
    from rclpy.serialization import serialize_message

    from sar_compiler.ros.robot_estimate import RobotEstimate

    heard = {}
    node = bench.node(create_subscription=lambda _, topic, call, *_a, **_k: heard.update({topic: call}))
    robot = RobotEstimate(node)
    heard["odometry/filtered"](serialize_message(Odometry()))
    stands = []
    for _ in range(2):
        bench.steady_sec += 0.01
        bench.ros_sec += 0.3
        stands.append(robot.is_standing)
    assert stands == [False, True]


def test_stepwise_clock_loses_no_time_between_steps(bench):
    counted = bench.node_time(fastest=10.0)
    before = counted.now()
    for _ in range(100):
        bench.steady_sec += 0.0099
        counted.now()
        bench.steady_sec += 0.0001
        bench.ros_sec += 0.05
        counted.now()
    assert counted.now() - before == pytest.approx(5.0)


@pytest.mark.parametrize("speed", [0.01, 1.0, 150.0])
def test_clocked_time_counts_only_while_clock_advances(bench, speed):
    clocked = bench.clocked_time()
    assert bench.passes(clocked, 60.0, 60.0 * speed) == pytest.approx(60.0)
    assert bench.passes(clocked, 60.0, 0.0) == 0.0
    # At most one second of the standstill is counted afterwards.
    assert bench.passes(clocked, 10.0, 10.0 * speed) == pytest.approx(10.9)
