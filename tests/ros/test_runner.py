"""Tests of the runner: when it ticks, and how it stops."""

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
    """Counts its calls; `on_update` may do anything."""

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
    """Settles some time after it was stopped."""

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
    """Fails in setup."""

    def setup(self, **kwargs: Any) -> None:
        message = "boom"
        raise ValueError(message)


def runner_of(root: py_trees.behaviour.Behaviour, node: Any, **kwargs: Any) -> TreeRunner:
    from sar_compiler.ros.runner import TreeRunner

    runner = TreeRunner(root)
    runner.setup(node=node, **kwargs)
    return runner


def raise_arm_error(probe: Probe) -> Status:
    message = "the arm fell off"
    raise ValueError(message)


def sequence(*children: py_trees.behaviour.Behaviour) -> py_trees.composites.Sequence:
    return py_trees.composites.Sequence("Sequence", memory=True, children=list(children))


def parallel(*children: py_trees.behaviour.Behaviour) -> py_trees.composites.Parallel:
    return py_trees.composites.Parallel("Both", ParallelPolicy.SuccessOnAll(), list(children))


class TestTicking:
    def test_runner_ticks_at_given_rate(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(20.0)
        watch = Stopwatch()
        ros.spin_until(lambda: runner.count >= 20, "20 ticks")
        assert watch.passed_sec > 0.36
        assert watch.own_sec < 2.0

    def test_wake_ticks_at_once(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(SLOW_MS)
        runner.wake()
        ros.spin_until(lambda: probe.updates == 1, "the tick that was asked for")

    def test_wake_ticks_at_once_with_events_executor(self) -> None:
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

    def test_unprocessed_wake_of_events_executor_does_not_leak_tree(self) -> None:
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

    def test_wakes_before_tick_are_merged(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(SLOW_MS)
        for _ in range(50):
            runner.wake()
        ros.spin_for(0.1)
        assert probe.updates == 1

    def test_wakes_during_tick_cause_one_more_tick(self, ros: Ros) -> None:
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

    def test_wake_from_other_thread_ticks_in_executor_thread(self, ros: Ros) -> None:
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

    def test_wake_does_not_shift_period(self, ros: Ros) -> None:
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

    def test_wake_before_start_or_after_stop_does_nothing(self, ros: Ros) -> None:
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

    def test_wakes_count_as_iterations_and_last_iteration_ends_ticking(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(10.0, number_of_iterations=3)
        runner.wake()
        ros.spin_until(lambda: not runner.is_running, "the end of the iterations")
        ros.spin_for(0.05)
        assert (probe.updates, runner.count, probe.ends) == (3, 3, [])

    def test_zero_iterations_do_not_tick(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0, number_of_iterations=0)
        runner.wake()
        ros.spin_for(0.05)
        assert (probe.updates, runner.is_running) == (0, False)

    def test_runner_can_be_started_again_after_iterations(self, ros: Ros) -> None:
        runner = runner_of(Probe(), ros.node())
        runner.tick_tock(5.0, number_of_iterations=2)
        ros.spin_until(lambda: not runner.is_running, "the end of the iterations")
        runner.tick_tock(5.0, number_of_iterations=2)
        ros.spin_until(lambda: runner.count == 4, "two more ticks")

    @pytest.mark.parametrize("until", [Status.SUCCESS, [Status.FAILURE, Status.SUCCESS]])
    def test_ticking_ends_at_given_status_and_keeps_it(self, ros: Ros, until: Any) -> None:
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

    def test_visitors_see_ticked_behaviours(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        visitor = py_trees.visitors.SnapshotVisitor()
        runner.add_visitor(visitor)
        runner.tick()
        assert list(visitor.visited) == [probe.id]

    @pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
    def test_invalid_period_is_rejected(self, ros: Ros, period: float) -> None:
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

    def test_runner_ticks_by_simulated_time(self, ros: Ros) -> None:
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

    def test_runner_ticks_by_steady_clock_without_simulated_time(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, self.sim_node(ros))
        runner.tick_tock(20.0)
        ros.spin_until(lambda: probe.updates >= 5, "ticks without /clock")

    def test_runner_ticks_by_steady_clock_while_simulated_time_is_frozen(self, ros: Ros) -> None:
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

    def test_slow_simulated_time_is_not_replaced(self, ros: Ros) -> None:
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

    def test_runner_does_not_tick_twice_with_system_clock(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        watch = Stopwatch()
        runner.tick_tock(20.0)
        ros.spin_for(0.5)
        assert probe.updates <= watch.passed_sec / 0.02 + 1

    def test_node_clock_serves_as_tree_clock(self, ros: Ros) -> None:
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
    def test_stop_stops_tree_from_root(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(sequence(probe), ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: probe.updates, "a tick")
        runner.stop()
        ticks = probe.updates
        ros.spin_for(0.05)
        assert (probe.ends, probe.updates, runner.is_running) == ([Status.INVALID], ticks, False)
        assert runner.last_status == Status.RUNNING

    def test_interrupt_from_other_thread_stops_tree(self, ros: Ros) -> None:
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

    def test_handler_can_stop_on_tick_status(self, ros: Ros) -> None:
        probe = Probe(on_update=lambda probe: Status.SUCCESS if probe.updates == 3 else Status.RUNNING)
        runner = runner_of(probe, ros.node())

        def stop_when_done(tree: Any) -> None:
            if tree.last_status == Status.SUCCESS:
                tree.stop()

        runner.tick_tock(5.0, post_tick_handler=stop_when_done)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert (probe.updates, runner.count, runner.last_status) == (3, 3, Status.SUCCESS)

    def test_leaf_that_stops_runner_finishes_its_tick(self, ros: Ros) -> None:
        def stop(_: Probe) -> Status:
            runner.stop()
            return Status.RUNNING

        probe = Probe(on_update=stop)
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert (probe.updates, probe.ends, runner.failure) == (1, [Status.INVALID], None)

    def test_settle_waits_for_leaves(self, ros: Ros) -> None:
        leaf = Lingering("Driving", 0.15)
        runner = runner_of(leaf, ros.node())
        runner.tick()
        watch = Stopwatch()
        assert runner.settle(ros.executor) == []
        assert watch.passed_sec > 0.1
        assert watch.own_sec < 1.0

    def test_settle_names_leaves_that_do_not_settle_in_time(self, ros: Ros) -> None:
        quick, slow = Lingering("Quick", 0.0), Lingering("Slow", 60.0)
        runner = runner_of(parallel(quick, slow), ros.node())
        runner.tick()
        assert runner.settle(ros.executor, timeout_sec=0.1) == ["Slow"]

    def test_settle_ends_when_context_is_shut_down(self, ros: Ros) -> None:
        runner = runner_of(Lingering("Slow", 60.0), ros.node())
        runner.tick()
        ros.context.try_shutdown()
        watch = Stopwatch()
        assert runner.settle(ros.executor, timeout_sec=10.0) == ["Slow"]
        assert watch.own_sec < 2.0

    def test_failing_callback_does_not_prevent_settling(self, ros: Ros, said: Said) -> None:
        node = ros.node()
        node.create_timer(0.01, lambda: raise_arm_error(Probe()))
        runner = runner_of(Lingering("Driving", 0.1), node)
        runner.tick()
        assert runner.settle(ros.executor) == []
        assert said.has("while the tree was stopped", "the arm fell off")

    def test_stopped_runner_cannot_tick(self, ros: Ros) -> None:
        runner = runner_of(Probe(), ros.node())
        runner.stop()
        with pytest.raises(RuntimeError, match="stopped"):
            runner.tick_tock(5.0)
        with pytest.raises(RuntimeError, match="stopped"):
            runner.tick()


class TestFailing:
    def test_leaf_exception_is_stored_and_logged_without_stopping_executor(
        self, ros: Ros, said: Said
    ) -> None:
        probe = Probe("Grip", on_update=raise_arm_error)
        runner = runner_of(sequence(probe), ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert isinstance(runner.failure, ValueError)
        assert runner.failed_behaviour is probe
        assert said.has("'Grip' (Probe)", "ValueError: the arm fell off")

    def test_siblings_of_failing_leaf_are_stopped(self, ros: Ros) -> None:
        driving, broken = Probe("Driving"), Probe("Grip", on_update=raise_arm_error)
        runner = runner_of(sequence(parallel(driving, broken)), ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert driving.ends == [Status.INVALID]
        assert all(node.status != Status.RUNNING for node in runner.root.iterate())

    def test_failing_leaf_itself_is_stopped(self, ros: Ros) -> None:
        broken = Probe("Grip", on_update=raise_arm_error)
        runner = runner_of(broken, ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: not runner.is_running, "the end of the tree")
        assert (broken.starts, broken.ends) == (1, [Status.INVALID])

    def test_failure_in_terminate_does_not_prevent_stopping_others(self, ros: Ros, said: Said) -> None:
        class Stubborn(Probe):
            def terminate(self, new_status: Status) -> None:
                raise_arm_error(self)

        driving = Probe("Driving")
        runner = runner_of(parallel(Stubborn("Stubborn"), driving), ros.node())
        runner.tick()
        runner.stop()
        assert driving.ends == [Status.INVALID]
        assert said.has("'Stubborn' failed while it was stopped", "the arm fell off", ", in terminate")

    def test_leaf_that_raises_stop_iteration_is_named_with_line(self, ros: Ros, said: Said) -> None:
        def exhausted(_: Probe) -> Status:
            return next(iter(()))

        runner = runner_of(Probe("Reader", exhausted), ros.node())
        runner.tick_tock(SLOW_MS)
        runner.wake()
        ros.spin_until(lambda: runner.failure is not None, "the failure")
        assert isinstance(runner.failure, StopIteration)
        line = f"tests/ros/test_runner.py:{Probe.update.__code__.co_firstlineno + 2}, in update"
        assert said.has(f"'Reader' (Probe) failed: StopIteration ({line}). The tree is stopped.")

    def test_handler_failure_is_not_attributed_to_leaf(self, ros: Ros, said: Said) -> None:
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
    def test_update_without_status_fails_and_reports_returned_value(
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

    def test_later_missing_status_ends_enclosing_timeout(self, ros: Ros) -> None:
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

    def test_leaf_may_return_invalid(self, ros: Ros) -> None:
        probe = Probe(on_update=lambda _: Status.INVALID)
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0, number_of_iterations=3)
        ros.spin_until(lambda: not runner.is_running, "three ticks")
        assert (probe.updates, runner.failure) == (3, None)

    def test_behaviours_keep_their_classes(self, ros: Ros) -> None:
        root = sequence(Probe())
        runner_of(root, ros.node())
        assert [type(each) for each in root.iterate()] == [Probe, py_trees.composites.Sequence]

    def test_single_tick_raises_leaf_exception(self, ros: Ros) -> None:
        runner = runner_of(Probe(on_update=raise_arm_error), ros.node())
        with pytest.raises(ValueError, match="arm"):
            runner.tick()


class TestSetupAndShutdown:
    def test_setup_passes_node_and_wake_to_leaf(self, ros: Ros) -> None:
        probe = Probe()
        node = ros.node()
        runner_of(sequence(probe), node, extra=3)
        assert probe.given["node"] is node
        assert probe.given["extra"] == 3
        assert callable(probe.given["wake"])

    def test_setup_timeout_names_leaf(self, ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
        from sar_compiler.ros.runner import SetupTimeoutError

        clock = ManualClock()

        class Dawdling(Probe):
            def setup(self, **kwargs: Any) -> None:
                clock.advance(20.0)

        monkeypatch.setattr("sar_compiler.ros.runner.time", SimpleNamespace(monotonic=clock.now))
        with pytest.raises(SetupTimeoutError, match=r"'Dawdling'") as caught:
            runner_of(sequence(Dawdling("Dawdling"), Probe()), ros.node(), timeout=10.0)
        assert caught.value.behaviour == "Dawdling"

    def test_failing_setup_names_leaf(self, ros: Ros) -> None:
        from sar_compiler.ros.engine import SetupFailedError

        with pytest.raises(SetupFailedError) as caught:
            runner_of(sequence(Unready("M")), ros.node())
        assert re.fullmatch(
            r"'M' \(Unready\) failed in setup: ValueError: boom \(.*\.py:\d+, in setup\)", str(caught.value)
        )
        assert isinstance(caught.value.__cause__, ValueError)

    def test_leaves_before_failing_setup_are_stopped_and_shut_down_once(self, ros: Ros, said: Said) -> None:
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

    def test_sar_error_in_setup_is_passed_on(self, ros: Ros) -> None:
        from sar_compiler.errors import SarError

        class Particular(Probe):
            def setup(self, **kwargs: Any) -> None:
                message = "the arm is not plugged in"
                raise SarError(message)

        with pytest.raises(SarError, match=r"^the arm is not plugged in$"):
            runner_of(sequence(Particular()), ros.node())

    def test_setup_with_timeout_works_outside_main_thread(self, ros: Ros) -> None:
        probe = Probe()
        node = ros.node()
        thread = threading.Thread(target=lambda: runner_of(probe, node, timeout=5.0))
        thread.start()
        thread.join()
        assert probe.given["node"] is node

    def test_setup_visitor_sees_every_behaviour(self, ros: Ros) -> None:
        visitor = py_trees.visitors.SnapshotVisitor()
        probe = Probe()
        runner_of(probe, ros.node(), visitor=visitor)
        assert list(visitor.visited) == [probe.id]

    def test_setup_rejects_invalid_node(self) -> None:
        with pytest.raises(TypeError, match="rclpy node"):
            runner_of(Probe(), "node")

    def test_ticking_requires_setup(self) -> None:
        from sar_compiler.ros.runner import TreeRunner

        with pytest.raises(RuntimeError, match="setup"):
            TreeRunner(Probe()).tick_tock(5.0)

    def test_too_deep_tree_is_rejected(self, ros: Ros) -> None:
        from sar_compiler.ros.engine import TreeTooDeepError

        root: py_trees.behaviour.Behaviour = Probe()
        for _ in range(800):
            root = sequence(root)
        with pytest.raises(TreeTooDeepError, match="801 nested levels"):
            runner_of(root, ros.node())

    # Tracing, as for coverage, uses part of Python 3.12's stack at each level.
    @pytest.mark.unmeasured
    def test_tree_of_greatest_depth_ticks_and_stops(self, ros: Ros) -> None:
        probe = Probe()
        root: py_trees.behaviour.Behaviour = probe
        for _ in range(798):
            root = sequence(root)
        runner = runner_of(root, ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: probe.updates > 1, "two ticks")
        runner.stop()
        assert (runner.failure, probe.ends) == (None, [Status.INVALID])

    def test_shutdown_may_be_called_twice_and_reaches_leaves(self, ros: Ros) -> None:
        probe = Probe()
        runner = runner_of(probe, ros.node())
        runner.tick_tock(5.0)
        ros.spin_until(lambda: probe.updates, "a tick")
        runner.shutdown()
        runner.shutdown()
        assert probe.shutdowns == 1
        assert probe.ends == [Status.INVALID]

    def test_shutdown_works_after_context_is_shut_down(self, ros: Ros) -> None:
        runner = runner_of(Probe(), ros.node())
        runner.tick_tock(5.0)
        ros.context.try_shutdown()
        runner.wake()
        runner.shutdown()

    def test_shutdown_keeps_given_node(self, ros: Ros) -> None:
        node = ros.node()
        runner_of(Probe(), node).shutdown()
        assert node.get_name() == "tester"
        node.create_timer(1.0, lambda: None)

    def test_runner_creates_and_destroys_own_node(self) -> None:
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


def make_mission_shaped_tree(log: list[str]) -> py_trees.behaviour.Behaviour:
    """Make a tree of the mission's shape: a patrol that is resumed, and one drive home."""

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


def test_tree_behaves_as_under_py_trees_manager(ros: Ros) -> None:
    ours: list[str] = []
    theirs: list[str] = []
    runner = runner_of(make_mission_shaped_tree(ours), ros.node())
    runner.tick_tock(2.0, number_of_iterations=15)
    ros.spin_until(lambda: not runner.is_running, "15 ticks")
    tree = py_trees.trees.BehaviourTree(make_mission_shaped_tree(theirs))
    tree.setup()
    for _ in range(15):
        tree.tick()
    assert ours == theirs
    assert runner.root.status == tree.root.status == Status.SUCCESS
