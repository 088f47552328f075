"""The runner: when it ticks, and how it stops."""

from __future__ import annotations

import gc
import re
import threading
import time
import weakref
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import py_trees
import pytest
from py_trees.common import ParallelPolicy, Status

from sar_compiler.runtime.clock import ManualClock
from tests.waiting import SILENCE_SEC, Stopwatch

if TYPE_CHECKING:
    from collections.abc import Callable

    from sar_compiler.ros.runner import TreeRunner
    from tests.ros.conftest import Ros, Said

pytestmark = pytest.mark.ros

SLOW_MS = 60_000.0
"""A period in which no timer ticks in a test."""


class Probe(py_trees.behaviour.Behaviour):
    """Counts what happens to it; `on_update` may do anything."""

    def __init__(self, name: str = "Probe", on_update: Callable[[Probe], Status] | None = None) -> None:
        super().__init__(name)
        self.on_update = on_update
        self.given: dict[str, Any] = {}
        self.starts = self.updates = self.shutdowns = 0
        self.ends: list[Status] = []

    def setup(self, **kwargs: Any) -> None:
        self.given = kwargs

    def initialise(self) -> None:
        self.starts += 1

    def update(self) -> Status:
        self.updates += 1
        return Status.RUNNING if self.on_update is None else self.on_update(self)

    def terminate(self, new_status: Status) -> None:
        self.ends.append(new_status)

    def shutdown(self) -> None:
        self.shutdowns += 1


class Lingering(Probe):
    """Has something under way for some time after it was stopped."""

    def __init__(self, name: str, linger_sec: float) -> None:
        super().__init__(name)
        self.linger_sec = linger_sec
        self.stopped_at = 0.0

    def terminate(self, new_status: Status) -> None:
        super().terminate(new_status)
        self.stopped_at = time.monotonic()

    def is_settled(self) -> bool:
        return time.monotonic() - self.stopped_at >= self.linger_sec


class Unready(Probe):
    """Cannot be set up."""

    def setup(self, **kwargs: Any) -> None:
        message = "boom"
        raise ValueError(message)


def runner_of(root: py_trees.behaviour.Behaviour, node: Any, **kwargs: Any) -> TreeRunner:
    from sar_compiler.ros.runner import TreeRunner

    runner = TreeRunner(root)
    runner.setup(node=node, **kwargs)
    return runner


def failing(probe: Probe) -> Status:
    message = "the arm fell off"
    raise ValueError(message)


def sequence(*children: py_trees.behaviour.Behaviour) -> py_trees.composites.Sequence:
    return py_trees.composites.Sequence("Sequence", memory=True, children=list(children))


def side_by_side(*children: py_trees.behaviour.Behaviour) -> py_trees.composites.Parallel:
    return py_trees.composites.Parallel("Both", ParallelPolicy.SuccessOnAll(), list(children))


class TestTicking:
    def test_ticks_at_the_rate_it_was_given(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(20.0)
        watch = Stopwatch()
        ros.spin_until(lambda: runner.count >= 20, "20 ticks")
        assert watch.passed_sec > 0.36
        assert watch.own_sec < 2.0

    def test_a_wake_ticks_at_once(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(SLOW_MS)
        runner.wake()
        ros.spin_until(lambda: probe.updates == 1, "the tick that was asked for")

    def test_a_wake_ticks_at_once_with_the_executor_of_events_too(self) -> None:
        from rclpy.context import Context
        from rclpy.node import Node

        experimental = pytest.importorskip("rclpy.experimental", reason="an rclpy without EventsExecutor")
        context = Context()
        context.init(initialize_logging=False)
        executor = experimental.EventsExecutor(context=context)
        node = Node("events", context=context)
        executor.add_node(node)
        probe = Probe()
        runner = runner_of(probe, node)
        runner.tick_tock(SLOW_MS)
        threading.Thread(target=runner.wake).start()
        deadline = time.monotonic() + SILENCE_SEC
        while not probe.updates and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.02)
        assert probe.updates == 1
        runner.shutdown()
        executor.remove_node(node)
        node.destroy_node()
        context.try_shutdown()

    def test_a_wake_that_an_executor_of_events_does_not_hear_keeps_no_tree(self) -> None:
        from rclpy.context import Context
        from rclpy.node import Node

        experimental = pytest.importorskip("rclpy.experimental", reason="an rclpy without EventsExecutor")

        def run_once() -> weakref.ref[Probe]:
            context = Context()
            context.init(initialize_logging=False)
            executor = experimental.EventsExecutor(context=context)
            node = Node("events", context=context)
            executor.add_node(node)
            probe = Probe()
            runner = runner_of(probe, node)
            runner.tick_tock(SLOW_MS)
            runner.wake()
            runner.shutdown()
            executor.shutdown()
            node.destroy_node()
            context.try_shutdown()
            return weakref.ref(probe)

        kept = run_once()
        gc.collect()
        assert kept() is None

    def test_many_wakes_before_a_tick_are_one(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(SLOW_MS)
        for _ in range(50):
            runner.wake()
        ros.spin_for(0.1)
        assert probe.updates == 1

    def test_a_wake_during_a_tick_means_one_more_after_it(self, ros: Ros) -> None:
        def wake_twice(probe: Probe) -> Status:
            if probe.updates == 1:
                probe.given["wake"]()
                probe.given["wake"]()
                assert probe.updates == 1
            return Status.RUNNING

        probe = Probe(on_update=wake_twice)
        runner = runner_of(probe, ros.node())
        runner.tick_tock(SLOW_MS)
        runner.wake()
        ros.spin_for(0.1)
        assert probe.updates == 2

    def test_a_wake_from_another_thread_ticks_in_the_executors(self, ros: Ros) -> None:
        threads: list[threading.Thread] = []

        def note(_: Probe) -> Status:
            threads.append(threading.current_thread())
            return Status.RUNNING

        runner = runner_of(Probe(on_update=note), ros.node())
        runner.tick_tock(SLOW_MS)
        other = threading.Thread(target=runner.wake)
        other.start()
        ros.spin_until(lambda: threads, "the tick that was asked for")
        other.join()
        assert threads == [threading.current_thread()]

    def test_a_wake_leaves_the_period_alone(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(SLOW_MS)
        begun = time.monotonic()
        ros.spin_for(0.2)
        runner.wake()
        ros.spin_until(lambda: probe.updates == 1, "the tick that was asked for")
        assert runner._beat is not None
        passed_sec = time.monotonic() - begun
        assert runner._beat._timers[0].time_until_next_call() / 1e9 <= SLOW_MS / 1e3 - passed_sec

    def test_a_wake_before_it_ticks_or_after_it_stopped_does_nothing(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.wake()
        ros.spin_for(0.05)
        runner.stop()
        runner.wake()
        ros.spin_for(0.05)
        runner.shutdown()
        runner.wake()
        ros.spin_for(0.05)
        assert probe.updates == 0

    def test_counts_wakes_among_the_iterations_and_ends_after_the_last(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(10.0, number_of_iterations=3)
        runner.wake()
        ros.spin_until(lambda: not runner.is_running, "the end of the iterations")
        ros.spin_for(0.05)
        assert (probe.updates, runner.count, probe.ends) == (3, 3, [])

    def test_no_iterations_are_no_tick(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0, number_of_iterations=0)
        runner.wake()
        ros.spin_for(0.05)
        assert (probe.updates, runner.is_running) == (0, False)

    def test_can_be_started_again_after_its_iterations(self, ros: Ros) -> None:
        runner = runner_of(Probe(), ros.node())
        runner.tick_tock(5.0, number_of_iterations=2)
        ros.spin_until(lambda: not runner.is_running, "the end of the iterations")
        runner.tick_tock(5.0, number_of_iterations=2)
        ros.spin_until(lambda: runner.count == 4, "two more ticks")

    @pytest.mark.parametrize("until", [Status.SUCCESS, [Status.FAILURE, Status.SUCCESS]])
    def test_ends_at_the_status_that_it_is_told_and_keeps_it(self, ros: Ros, until: Any) -> None:
        probe = Probe(on_update=lambda probe: Status.SUCCESS if probe.updates == 3 else Status.RUNNING)
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0, until=until)
        ros.spin_until(lambda: not runner.is_running, "the end of ticking")
        ros.spin_for(0.1)
        assert (probe.updates, runner.last_status) == (3, Status.SUCCESS)

    def test_handlers_are_called_in_order_around_each_tick(self, ros: Ros) -> None:
        order: list[str] = []

        def note(_: Probe) -> Status:
            order.append("tick")
            return Status.RUNNING

        runner = runner_of(Probe(on_update=note), ros.node())
        runner.add_pre_tick_handler(lambda _: order.append("added before"))
        runner.add_post_tick_handler(lambda _: order.append("added after"))
        runner.tick_tock(5.0, 1, lambda _: order.append("before"), lambda _: order.append("after"))
        ros.spin_until(lambda: not runner.is_running, "one tick")
        assert order == ["before", "added before", "tick", "added after", "after"]

    def test_visitors_see_what_was_ticked(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        visitor = py_trees.visitors.SnapshotVisitor()
        runner.add_visitor(visitor)
        runner.tick()
        assert list(visitor.visited) == [probe.id]

    @pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
    def test_refuses_a_period_that_is_none(self, ros: Ros, period: float) -> None:
        runner = runner_of(Probe(), ros.node())
        with pytest.raises(ValueError, match="above 0 ms"):
            runner.tick_tock(period)


class TestClocks:
    def sim_node(self, ros: Ros) -> Any:
        from rclpy.parameter import Parameter

        return ros.node("sim", parameter_overrides=[Parameter("use_sim_time", value=True)])

    def clock(self, ros: Ros) -> Callable[[float], None]:
        from rosgraph_msgs.msg import Clock

        publisher = ros.node("clock").create_publisher(Clock, "/clock", 10)
        ros.spin_until(publisher.get_subscription_count, "the node's subscription to /clock")

        def publish(seconds: float) -> None:
            message = Clock()
            message.clock.sec, message.clock.nanosec = int(seconds), int(seconds % 1 * 1e9)
            publisher.publish(message)

        return publish

    def shows(self, node: Any, nanoseconds: float) -> bool:
        return bool(node.get_clock().now().nanoseconds == nanoseconds)

    def test_ticks_by_simulated_time(self, ros: Ros) -> None:
        probe = Probe()
        node = self.sim_node(ros)
        set_time = self.clock(ros)
        runner = runner_of(probe, node)
        set_time(100.0)
        ros.spin_until(lambda: node.get_clock().now().nanoseconds, "the first time")
        runner.tick_tock(2_000.0)
        for step in range(1, 41):
            set_time(100.0 + step / 2)
            wanted = (100.0 + step / 2) * 1e9
            ros.spin_until(partial(self.shows, node, wanted), "the time that was published")
            ros.spin_for(0.002)
        assert 9 <= probe.updates <= 11

    def test_ticks_by_the_steady_clock_while_there_is_no_time(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, self.sim_node(ros))
        runner.tick_tock(20.0)
        ros.spin_until(lambda: probe.updates >= 5, "ticks without /clock")

    def test_ticks_by_the_steady_clock_while_time_stands_still(self, ros: Ros) -> None:
        probe = Probe()
        node = self.sim_node(ros)
        set_time = self.clock(ros)
        set_time(7.0)
        ros.spin_until(lambda: node.get_clock().now().nanoseconds, "the first time")
        runner = runner_of(probe, node)
        runner.tick_tock(20.0)
        watch = Stopwatch()
        ros.spin_until(lambda: probe.updates >= 10, "ticks while /clock stands still")
        assert watch.own_sec < 2.0

    def test_leaves_time_that_is_only_slow_alone(self, ros: Ros) -> None:
        probe = Probe()
        node = self.sim_node(ros)
        set_time = self.clock(ros)
        set_time(1.0)
        ros.spin_until(lambda: node.get_clock().now().nanoseconds, "the first time")
        runner = runner_of(probe, node)
        runner.tick_tock(250.0)
        for step in range(1, 41):
            set_time(1.0 + step * 0.001)
            ros.spin_for(0.02)
        assert probe.updates == 0

    def test_does_not_tick_twice_while_the_systems_clock_runs(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        watch = Stopwatch()
        runner.tick_tock(20.0)
        ros.spin_for(0.5)
        assert probe.updates <= watch.passed_sec / 0.02 + 1

    def test_the_nodes_clock_is_a_clock_for_trees(self, ros: Ros) -> None:
        from sar_compiler.ros.clock import mission_clock

        node = self.sim_node(ros)
        clock = mission_clock(node)
        publish = self.clock(ros)
        publish(12.25)
        ros.spin_until(lambda: node.get_clock().now().nanoseconds == 12_250_000_000, "the first time")
        first = clock.now()
        publish(13.75)
        ros.spin_until(lambda: clock.now() == first + 1.5, "the time that was published")


class TestStopping:
    def test_stops_the_tree_from_its_root(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(sequence(probe), ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: probe.updates, "a tick")
        runner.stop()
        ticks = probe.updates
        ros.spin_for(0.05)
        assert (probe.ends, probe.updates, runner.is_running) == ([Status.INVALID], ticks, False)
        assert runner.last_status == Status.RUNNING

    def test_an_interrupt_from_another_thread_stops_in_the_executors(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(SLOW_MS)
        runner.wake()
        ros.spin_until(lambda: probe.updates, "a tick")
        other = threading.Thread(target=runner.interrupt)
        other.start()
        ros.spin_until(lambda: probe.ends == [Status.INVALID], "the end of the tree")
        other.join()
        assert not runner.is_running

    def test_a_handler_can_stop_on_the_status_of_the_tick(self, ros: Ros) -> None:
        probe = Probe(on_update=lambda probe: Status.SUCCESS if probe.updates == 3 else Status.RUNNING)
        runner = runner_of(probe, ros.node())

        def stop_when_done(tree: Any) -> None:
            if tree.last_status == Status.SUCCESS:
                tree.stop()

        runner.tick_tock(5.0, post_tick_handler=stop_when_done)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert (probe.updates, runner.count, runner.last_status) == (3, 3, Status.SUCCESS)

    def test_a_leaf_that_stops_the_runner_finishes_its_tick(self, ros: Ros) -> None:
        def stop(_: Probe) -> Status:
            runner.stop()
            return Status.RUNNING

        probe = Probe(on_update=stop)
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert (probe.updates, probe.ends, runner.failure) == (1, [Status.INVALID], None)

    def test_settles_when_the_leaves_have(self, ros: Ros) -> None:
        leaf = Lingering("Driving", 0.15)
        runner = runner_of(leaf, ros.node())
        runner.tick()
        watch = Stopwatch()
        assert runner.settle(ros.executor) == []
        assert watch.passed_sec > 0.1
        assert watch.own_sec < 1.0

    def test_names_the_leaves_that_do_not_settle_in_time(self, ros: Ros) -> None:
        quick, slow = Lingering("Quick", 0.0), Lingering("Slow", 60.0)
        runner = runner_of(side_by_side(quick, slow), ros.node())
        runner.tick()
        assert runner.settle(ros.executor, timeout_sec=0.1) == ["Slow"]

    def test_settling_ends_when_the_context_goes_down(self, ros: Ros) -> None:
        runner = runner_of(Lingering("Slow", 60.0), ros.node())
        runner.tick()
        ros.context.try_shutdown()
        watch = Stopwatch()
        assert runner.settle(ros.executor, timeout_sec=10.0) == ["Slow"]
        assert watch.own_sec < 2.0

    def test_a_callback_that_raises_does_not_keep_the_goals_from_settling(self, ros: Ros, said: Said) -> None:
        node = ros.node()
        node.create_timer(0.01, lambda: failing(Probe()))
        runner = runner_of(Lingering("Driving", 0.1), node)
        runner.tick()
        assert runner.settle(ros.executor) == []
        assert said.has("while the tree was stopped", "the arm fell off")

    def test_is_not_ticked_again(self, ros: Ros) -> None:
        runner = runner_of(Probe(), ros.node())
        runner.stop()
        with pytest.raises(RuntimeError, match="stopped"):
            runner.tick_tock(5.0)
        with pytest.raises(RuntimeError, match="stopped"):
            runner.tick()


class TestFailing:
    def test_keeps_the_exception_names_the_leaf_and_lets_the_executor_live(
        self, ros: Ros, said: Said
    ) -> None:
        probe = Probe("Grip", on_update=failing)
        runner = runner_of(sequence(probe), ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert isinstance(runner.failure, ValueError)
        assert runner.failed_behaviour is probe
        assert said.has("'Grip' (Probe)", "ValueError: the arm fell off")

    def test_stops_the_siblings_of_the_leaf_that_failed(self, ros: Ros) -> None:
        driving, broken = Probe("Driving"), Probe("Grip", on_update=failing)
        runner = runner_of(sequence(side_by_side(driving, broken)), ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert driving.ends == [Status.INVALID]
        assert all(node.status != Status.RUNNING for node in runner.root.iterate())

    def test_stops_the_leaf_that_failed_too_because_it_had_begun(self, ros: Ros) -> None:
        broken = Probe("Grip", on_update=failing)
        runner = runner_of(broken, ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert (broken.starts, broken.ends) == (1, [Status.INVALID])

    def test_a_leaf_that_fails_while_it_is_stopped_does_not_spare_the_others(
        self, ros: Ros, said: Said
    ) -> None:
        class Stubborn(Probe):
            def terminate(self, new_status: Status) -> None:
                failing(self)

        driving = Probe("Driving")
        runner = runner_of(side_by_side(Stubborn("Stubborn"), driving), ros.node())
        runner.tick()
        runner.stop()
        assert driving.ends == [Status.INVALID]
        assert said.has("'Stubborn' failed while it was stopped", "the arm fell off", ", in terminate")

    def test_a_leaf_that_raises_what_ends_an_iteration_is_named_with_its_line(
        self, ros: Ros, said: Said
    ) -> None:
        def exhausted(_: Probe) -> Status:
            return next(iter(()))

        runner = runner_of(Probe("Reader", exhausted), ros.node())
        runner.tick_tock(SLOW_MS)
        runner.wake()
        ros.spin_until(lambda: runner.failure is not None, "the failure")
        assert isinstance(runner.failure, StopIteration)
        line = f"tests/ros/test_runner.py:{Probe.update.__code__.co_firstlineno + 2}, in update"
        assert said.has(f"'Reader' (Probe) failed: StopIteration ({line}). The tree is stopped.")

    def test_a_handler_that_fails_is_not_blamed_on_a_leaf(self, ros: Ros, said: Said) -> None:
        def fail(_: py_trees.trees.BehaviourTree) -> None:
            message = "the disk is full"
            raise ValueError(message)

        runner = runner_of(Probe(), ros.node())
        runner.tick_tock(5.0, post_tick_handler=fail)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert isinstance(runner.failure, ValueError)
        assert runner.failed_behaviour is None
        assert said.has("a tick handler failed")

    @pytest.mark.parametrize("returned", [None, True, "SUCCESS"])
    def test_an_update_that_returns_no_status_fails_and_says_what_it_returned(
        self, ros: Ros, said: Said, returned: Any
    ) -> None:
        probe = Probe("Out", on_update=lambda _: returned)
        runner = runner_of(sequence(probe), ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert (runner.failed_behaviour, probe.updates, probe.ends) == (probe, 1, [Status.INVALID])
        assert said.has(
            f"'Out' (Probe) failed: update() returned {returned!r}, which is not a status. "
            "Return Status.SUCCESS, FAILURE or RUNNING. The tree is stopped."
        )

    def test_a_leaf_that_forgets_its_status_later_on_ends_its_time_out_too(self, ros: Ros) -> None:
        from sar_compiler.runtime.clock import ManualClock
        from sar_compiler.runtime.stock import Timeout

        def forget(probe: Probe) -> Any:
            return Status.RUNNING if probe.updates < 3 else None

        probe = Probe("Out", on_update=forget)
        runner = runner_of(Timeout("Within", probe, 30.0, ManualClock()), ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert (runner.failed_behaviour, probe.updates) == (probe, 3)
        assert set(probe.ends) == {Status.INVALID}

    def test_a_leaf_may_be_invalid(self, ros: Ros) -> None:
        probe = Probe(on_update=lambda _: Status.INVALID)
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0, number_of_iterations=3)
        ros.spin_until(lambda: not runner.is_running, "three ticks")
        assert (probe.updates, runner.failure) == (3, None)

    def test_behaviours_keep_their_classes(self, ros: Ros) -> None:
        root = sequence(Probe())
        runner_of(root, ros.node())
        assert [type(each) for each in root.iterate()] == [Probe, py_trees.composites.Sequence]

    def test_a_single_tick_raises_what_the_leaf_raised(self, ros: Ros) -> None:
        runner = runner_of(Probe(on_update=failing), ros.node())
        with pytest.raises(ValueError, match="arm"):
            runner.tick()


class TestSetupAndShutdown:
    def test_hands_the_node_and_a_wake_to_every_leaf(self, ros: Ros) -> None:
        probe = Probe()
        node = ros.node()
        runner_of(sequence(probe), node, extra=3)
        assert probe.given["node"] is node
        assert probe.given["extra"] == 3
        assert callable(probe.given["wake"])

    def test_names_the_leaf_at_which_the_time_for_setup_was_over(
        self, ros: Ros, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from sar_compiler.ros.runner import SetupTimeoutError

        clock = ManualClock()

        class Dawdling(Probe):
            def setup(self, **kwargs: Any) -> None:
                clock.advance(20.0)

        monkeypatch.setattr("sar_compiler.ros.runner.time", SimpleNamespace(monotonic=clock.now))
        with pytest.raises(SetupTimeoutError, match=r"'Dawdling'") as caught:
            runner_of(sequence(Dawdling("Dawdling"), Probe()), ros.node(), timeout=10.0)
        assert caught.value.behaviour == "Dawdling"

    def test_names_the_leaf_whose_setup_raises(self, ros: Ros) -> None:
        from sar_compiler.ros.engine import SetupFailedError

        with pytest.raises(SetupFailedError) as caught:
            runner_of(sequence(Unready("M")), ros.node())
        assert re.fullmatch(
            r"'M' \(Unready\) failed in setup: ValueError: boom \(.*\.py:\d+, in setup\)", str(caught.value)
        )
        assert isinstance(caught.value.__cause__, ValueError)

    def test_what_was_set_up_before_a_setup_that_raises_is_stopped_and_shut_down_once(
        self, ros: Ros, said: Said
    ) -> None:
        from sar_compiler.ros.engine import SetupFailedError
        from sar_compiler.ros.runner import TreeRunner

        ready, unready, untouched = Probe(), Unready("M"), Probe()
        runner = TreeRunner(sequence(ready, unready, untouched))
        with pytest.raises(SetupFailedError):
            runner.setup(node=ros.node())
        runner.shutdown()
        assert (ready.ends, ready.shutdowns) == ([Status.INVALID], 1)
        assert (untouched.ends, untouched.shutdowns, unready.shutdowns) == ([], 0, 0)
        assert not said.has("could not be shut down")

    def test_a_setup_that_says_in_words_what_is_wrong_is_passed_on(self, ros: Ros) -> None:
        from sar_compiler.errors import SarError

        class Particular(Probe):
            def setup(self, **kwargs: Any) -> None:
                message = "the arm is not plugged in"
                raise SarError(message)

        with pytest.raises(SarError, match=r"^the arm is not plugged in$"):
            runner_of(sequence(Particular()), ros.node())

    def test_can_be_set_up_with_a_time_limit_off_the_main_thread(self, ros: Ros) -> None:
        probe = Probe()
        node = ros.node()
        thread = threading.Thread(target=lambda: runner_of(probe, node, timeout=5.0))
        thread.start()
        thread.join()
        assert probe.given["node"] is node

    def test_shows_every_behaviour_to_the_visitor_of_the_setup(self, ros: Ros) -> None:
        visitor = py_trees.visitors.SnapshotVisitor()
        probe = Probe()
        runner_of(probe, ros.node(), visitor=visitor)
        assert list(visitor.visited) == [probe.id]

    def test_refuses_what_is_not_a_node(self) -> None:
        with pytest.raises(TypeError, match="rclpy node"):
            runner_of(Probe(), "node")

    def test_must_be_set_up_before_it_ticks(self) -> None:
        from sar_compiler.ros.runner import TreeRunner

        with pytest.raises(RuntimeError, match="setup"):
            TreeRunner(Probe()).tick_tock(5.0)

    def test_refuses_a_tree_too_deep_to_be_stopped(self, ros: Ros) -> None:
        from sar_compiler.ros.engine import TreeTooDeepError

        root: py_trees.behaviour.Behaviour = Probe()
        for _ in range(800):
            root = sequence(root)
        with pytest.raises(TreeTooDeepError, match="801 nested levels"):
            runner_of(root, ros.node())

    # What traces, as the measuring of coverage does, has a share of Python 3.12's stack at each level.
    @pytest.mark.unmeasured
    def test_ticks_and_stops_a_tree_of_the_greatest_depth(self, ros: Ros) -> None:
        probe = Probe()
        root: py_trees.behaviour.Behaviour = probe
        for _ in range(798):
            root = sequence(root)
        runner = runner_of(root, ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: probe.updates > 1, "two ticks")
        runner.stop()
        assert (runner.failure, probe.ends) == (None, [Status.INVALID])

    def test_shutdown_may_be_called_twice_and_reaches_the_leaves(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: probe.updates, "a tick")
        runner.shutdown()
        runner.shutdown()
        assert probe.shutdowns == 1
        assert probe.ends == [Status.INVALID]

    def test_shutdown_does_not_raise_when_the_context_is_down(self, ros: Ros) -> None:
        runner = runner_of(Probe(), ros.node())
        runner.tick_tock(5.0)
        ros.context.try_shutdown()
        runner.wake()
        runner.shutdown()

    def test_shutdown_leaves_a_node_that_it_was_given(self, ros: Ros) -> None:
        node = ros.node()
        runner_of(Probe(), node).shutdown()
        assert node.get_name() == "tester"
        node.create_timer(1.0, lambda: None)

    def test_makes_a_node_of_its_own_where_none_is_given(self) -> None:
        import rclpy
        from rclpy.exceptions import InvalidHandle

        rclpy.init(args=[])
        try:
            runner = runner_of(Probe(), None, node_name="patrol")
            assert runner.node is not None
            assert runner.node.get_name() == "patrol"
            node = runner.node
            runner.shutdown()
            with pytest.raises(InvalidHandle):
                node.get_name()
        finally:
            rclpy.try_shutdown()


def contract_shaped(log: list[str]) -> py_trees.behaviour.Behaviour:
    """Make a tree of the mission's shape: a patrol that is resumed, and one way home."""

    def stepping(name: str, length: int) -> Probe:
        def step(probe: Probe) -> Status:
            log.append(name)
            return Status.SUCCESS if probe.updates % length == 0 else Status.RUNNING

        return Probe(name, on_update=step)

    zones = iter([Status.SUCCESS, Status.SUCCESS])
    remaining = Probe("Remaining", on_update=lambda _: next(zones, Status.FAILURE))
    patrol = sequence(remaining, stepping("drive", 3), stepping("look", 2))
    home = py_trees.decorators.OneShot(
        "Home", stepping("home", 2), py_trees.common.OneShotPolicy.ON_COMPLETION
    )
    return py_trees.composites.Selector("Root", memory=False, children=[patrol, home])


def test_a_tree_does_the_same_under_py_trees_own_manager(ros: Ros) -> None:
    ours: list[str] = []
    theirs: list[str] = []
    runner = runner_of(contract_shaped(ours), ros.node())
    runner.tick_tock(2.0, number_of_iterations=15)
    ros.spin_until(lambda: not runner.is_running, "15 ticks")
    tree = py_trees.trees.BehaviourTree(contract_shaped(theirs))
    tree.setup()
    for _ in range(15):
        tree.tick()
    assert ours == theirs
    assert runner.root.status == tree.root.status == Status.SUCCESS
