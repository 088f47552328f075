"""The watched clock of a node, without ROS."""

import time
from types import SimpleNamespace

import pytest

from sar_compiler.ros.clock import ClockedTime, NodeTime, deadline_clock, deadline_timer, trust_simulation


class Bench:
    """A node whose clock, and a machine whose clock, stand still until they are moved."""

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
        """Return what the time counts while both clocks go on in small steps."""
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
def test_simulated_time_is_counted_as_it_comes_however_slow_or_fast(bench, speed):
    counted = bench.node_time()
    assert bench.passes(counted, 60.0, 60.0 * speed) == pytest.approx(60.0 * speed)
    assert bench.said == []


def test_a_clock_that_stands_still_for_less_than_the_patience_counts_nothing(bench):
    counted = bench.node_time()
    assert bench.passes(counted, 9.9, 0.0) == 0.0
    assert bench.said == []


def test_after_that_the_machines_time_counts_from_the_last_advance_on(bench):
    counted = bench.node_time()
    assert bench.passes(counted, 15.0, 0.0) == pytest.approx(15.0)
    assert [line[:37] for line in bench.said] == ["The clock has stood still for 10 s (i"]


def test_a_clock_that_goes_on_is_counted_again_and_nothing_twice(bench):
    counted = bench.node_time()
    bench.passes(counted, 15.0, 0.0)
    assert bench.passes(counted, 5.0, 5.0) == pytest.approx(5.0)
    assert bench.said[1:] == ["The clock advances again."]


@pytest.mark.parametrize(("jump", "which"), [(5000.0, "forward by 5000.5 s"), (-90.0, "back by 89.5 s")])
def test_a_jump_counts_as_the_machines_time_and_is_said(bench, jump, which):
    counted = bench.node_time()
    assert bench.passes(counted, 0.5, 0.5 + jump, steps=1) == pytest.approx(0.5)
    assert bench.said == [
        f"The clock has jumped {which}. 0.5 s are counted instead, according to the machine's clock."
    ]


def test_the_first_time_that_comes_is_no_jump(monkeypatch):
    bench = Bench(monkeypatch, ros_sec=0.0)
    counted = bench.node_time()
    assert bench.passes(counted, 2.0, 1.7e9, steps=1) == pytest.approx(2.0)
    assert bench.said == []


def test_without_simulated_time_the_steady_clock_counts_whoever_sets_the_systems(monkeypatch):
    bench = Bench(monkeypatch, simulated=False)
    counted = bench.node_time()
    assert bench.passes(counted, 3.0, 3600.0) == pytest.approx(3.0)
    assert bench.said == []


def test_a_limit_to_its_speed_cuts_off_what_exceeds_it(bench):
    counted = bench.node_time(fastest=10.0)
    assert bench.passes(counted, 2.0, 100.0) == pytest.approx(20.0)
    assert bench.passes(counted, 2.0, 8.0) == pytest.approx(8.0)


def test_a_deadline_is_no_faster_than_the_network_unless_who_simulates_waits_for_those_that_it_answers(bench):
    foreign, own = bench.node(), bench.node()
    trust_simulation(own)
    assert bench.passes(deadline_clock(foreign), 2.0, 100.0) == pytest.approx(20.0)
    assert bench.passes(deadline_clock(own), 2.0, 100.0) == pytest.approx(100.0)


@pytest.mark.ros
def test_a_mission_is_watched_by_simulated_time_only_where_that_is_trusted(bench):
    made = []
    create = {"create_timer": lambda _period, _call, clock="its own": made.append(clock)}
    foreign, own = bench.node(**create), bench.node(**create)
    trust_simulation(own)
    for node in (foreign, own):
        deadline_timer(node, 0.1, print)
    assert made[0].clock_type.name == "STEADY_TIME"
    assert made[1] == "its own"


@pytest.mark.ros
def test_a_robot_stands_after_half_a_second_of_its_own_time_however_fast_that_is(bench):
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


def test_a_clock_that_comes_in_steps_loses_nothing_between_them(bench):
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
def test_who_acts_by_a_clock_is_judged_by_the_seconds_in_which_it_goes_on(bench, speed):
    clocked = bench.clocked_time()
    assert bench.passes(clocked, 60.0, 60.0 * speed) == pytest.approx(60.0)
    assert bench.passes(clocked, 60.0, 0.0) == 0.0
    # Of the standstill a second, at most, may have been none.
    assert bench.passes(clocked, 10.0, 10.0 * speed) == pytest.approx(10.9)
