"""Tick a tree on a ROS node, in the thread of the node's executor.

`TreeRunner` has the interface of `py_trees_ros.trees.BehaviourTree`, so a program can use either class. In addition, a
leaf with a new result triggers a tick at once (`runtime.leaf_protocol`), and the tree is also ticked while the node's
clock stands still. The tree is always stopped from its root, so that all goals are cancelled.
"""

import atexit
import time
from collections.abc import Callable, Collection, Generator, Sequence
from typing import Any

import py_trees
import rclpy
from py_trees.behaviour import Behaviour
from py_trees.common import Duration, Status
from py_trees.visitors import DisplaySnapshotVisitor, VisitorBase
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.timer import Timer

from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.missions.parameter_reader import SETTLE_SEC
from sar_compiler.ros.clock import steady_timer
from sar_compiler.ros.engine import (
    error_text,
    give_up,
    log_error,
    log_failure,
    require_tickable_depth,
    settle,
    shut_down,
    stop_behaviours,
)
from sar_compiler.ros.executors import call_soon
from sar_compiler.ros.leaves.leaf import is_node_valid
from sar_compiler.ros.orphaned_goals import CancelFunction, make_separate_canceller
from sar_compiler.runtime.breakpoints import Breakpoints, tick_with_breakpoints
from sar_compiler.runtime.kernel.live import LiveTree, show_visits
from sar_compiler.runtime.kernel.tree_nodes import Visit


class TickScheduler:
    """Schedules ticks on a node's simulated clock, or on the steady clock if simulated time is unused or stands still.

    Args:
        node: The node whose clock is used.
        period_sec: The time between two ticks, in seconds.
        tick: Ticks the tree.
        count: Returns the total number of ticks so far, including ticks that were not scheduled here.
    """

    def __init__(
        self, node: Node, period_sec: float, tick: Callable[[], None], count: Callable[[], int]
    ) -> None:
        self._node = node
        self._period_sec = period_sec
        self._tick = tick
        self._count = count
        self._seen = (-1, -1)
        self._timers = [steady_timer(node, period_sec, self._on_timer)]
        self._is_simulated = False
        self._check_clock()

    def destroy(self) -> None:
        """Destroy the timers, even if the ROS context is already shut down."""
        timers, self._timers = self._timers, []
        for timer in timers:
            self._destroy(timer)

    def _destroy(self, timer: Timer) -> None:
        try:
            timer.cancel()
            self._node.destroy_timer(timer)
        except Exception as error:  # noqa: BLE001
            self._node.get_logger().debug(f"a timer could not be destroyed: {error_text(error)}")

    def _check_clock(self) -> bool:
        """Adapt the timers to the use of simulated time; return whether there was no progress since the last call.

        There is no progress if neither the clock has advanced nor the tree was ticked.
        """
        clock = self._node.get_clock()
        if clock.ros_time_is_active != self._is_simulated:
            self._is_simulated = not self._is_simulated
            if self._is_simulated:
                self._timers.append(self._node.create_timer(self._period_sec, self._tick))
            else:
                self._destroy(self._timers.pop())
        seen, self._seen = self._seen, (self._count(), clock.now().nanoseconds)
        return seen == self._seen

    def _on_timer(self) -> None:
        """Tick the tree if the node does not use simulated time, or if simulated time stands still.

        The tree must be ticked while simulated time stands still, because the leaves' deadlines for servers use the machine's time. A slow
        simulation does not cause additional ticks.
        """
        if self._check_clock() or not self._is_simulated:
            self._tick()
            self._seen = (self._count(), self._seen[1])


TickHandler = Callable[[py_trees.trees.BehaviourTree], None]


class SetupTimeoutError(SarError, RuntimeError):
    """Raised if the setup of a tree takes too long. As in py_trees, the exception is a `RuntimeError`.

    Attributes:
        behaviour: The name of the behaviour whose setup exceeded the time limit.
    """

    def __init__(self, behaviour: str, timeout_sec: float) -> None:
        self.behaviour = behaviour
        message = (
            f"the setup of the tree took longer than {timeout_sec:g} s. The last behaviour was '{behaviour}'"
        )
        super().__init__(message)


class _TaskGuard:
    """Replaces a guard condition if the executor does not support guard conditions."""

    def __init__(self, node: Node, callback: Callable[[], None]) -> None:
        self._node = node
        self._callback = callback

    def trigger(self) -> None:
        """Schedule the callback in the node's current executor."""
        executor: Any = self._node.executor
        if executor is not None:
            call_soon(executor, self._callback)


class TreeRunner(py_trees.trees.BehaviourTree):
    """Ticks a tree on a node.

    All methods except `wake` and `interrupt` must be called in the thread of the node's executor. If many trees share a process, rclpy's
    `EventsExecutor` needs only a fraction of the time that other executors need. The node must be added to this executor before `setup`.

    Args:
        tree: The compiled tree, or its root.
        unicode_tree_debug: Whether to print the tree after every tick.

    Attributes:
        node: The node; None before `setup`.
        last_status: The root's status after the last tick. The value is kept when the tree is stopped.
        failure: The exception of a leaf or tick handler that stopped the tree; None if no exception has stopped the tree.
        failed_behaviour: The behaviour that raised `failure`; None if other code raised it.
    """

    def __init__(self, tree: CompiledTree | Behaviour, unicode_tree_debug: bool = False) -> None:
        super().__init__(tree if isinstance(tree, Behaviour) else tree.root)
        self._live: LiveTree | None = None
        self._breakpoints: Breakpoints | None = None
        self._paused_tick: Generator[None, None, None] | None = None
        if unicode_tree_debug:
            self.add_visitor(DisplaySnapshotVisitor())
        self.node: Node | None = None
        self.last_status = Status.INVALID
        self.failure: Exception | None = None
        self.failed_behaviour: Behaviour | None = None
        self._owns_node = False
        self._cancel_separately: CancelFunction = _cancel_nothing
        self._beat: TickScheduler | None = None
        self._guard: Any = None
        self._handlers: tuple[TickHandler | None, TickHandler | None] = (None, None)
        self._ticks_left = py_trees.trees.CONTINUOUS_TICK_TOCK
        self._last: set[Status] = set()
        self._running = self._ticking = self._stopped = self._shut_down = self._woken = False

    @property
    def is_running(self) -> bool:
        """Whether the tree is being ticked."""
        return self._running

    def setup(  # type: ignore[override]
        self,
        node: Node | None = None,
        node_name: str = "tree",
        timeout: float | Duration = Duration.INFINITE,
        visitor: py_trees.visitors.VisitorBase | None = None,
        **kwargs: Any,
    ) -> None:
        """Set up every behaviour of the tree, with the arguments `node`, `wake` and *kwargs*.

        Args:
            node: The node whose executor ticks the tree; by default, a node is created, which `shutdown` destroys.
            node_name: The name of the created node.
            timeout: The time limit of the whole setup, in seconds. The limit is checked after the setup of each behaviour. py_trees uses a
                signal instead, which only works in the main thread.
            visitor: Visits each behaviour after the behaviour's setup.
            kwargs: Further arguments for the setup of every behaviour.

        Raises:
            TypeError: If *node* is not a node.
            TreeTooDeepError: If the tree is nested too deeply to be ticked.
            SetupTimeoutError: If the setup exceeds the time limit.
            SetupFailedError: If the setup of a behaviour raised an exception. After this error, and after a `SetupTimeoutError`, the
                behaviours whose setup succeeded are shut down.
        """
        if node is not None and not isinstance(node, Node):
            raise TypeError(f"the node of a tree must be an rclpy node, but is {node!r}")
        require_tickable_depth(self.root)
        self._owns_node = node is None
        self.node = node if node is not None else rclpy.create_node(node_name)
        self._guard = self._make_guard(self.node)
        self._cancel_separately = make_separate_canceller(self.node)
        limit = float(timeout.value if isinstance(timeout, Duration) else timeout)
        try:
            self._set_up_behaviours(limit, visitor, {"node": self.node, "wake": self.wake, **kwargs})
        except Exception as error:  # noqa: BLE001 - `give_up` raises it again, with its context
            self._stopped = self._shut_down = True
            give_up(self.root, error, self.node)
        atexit.register(self._shut_down_at_exit)

    def _make_guard(self, node: Node) -> Any:
        """Create a trigger with which any thread can schedule a call of `_on_wake` in the node's executor."""
        executor: Any = node.executor
        if executor is None or isinstance(executor, Executor):
            return node.create_guard_condition(self._on_wake)
        return _TaskGuard(node, self._on_wake)

    def _set_up_behaviours(
        self, limit_sec: float, visitor: py_trees.visitors.VisitorBase | None, given: dict[str, Any]
    ) -> None:
        deadline = time.monotonic() + limit_sec
        if visitor is not None:
            visitor.initialise()
        for behaviour in self.root.iterate():
            behaviour.setup(**given)
            if visitor is not None:
                behaviour.visit(visitor)
            if time.monotonic() > deadline:
                raise SetupTimeoutError(behaviour.name, limit_sec)
        if visitor is not None:
            visitor.finalise()

    def tick_tock(  # type: ignore[override]
        self,
        period_ms: float,
        number_of_iterations: int = py_trees.trees.CONTINUOUS_TICK_TOCK,
        pre_tick_handler: TickHandler | None = None,
        post_tick_handler: TickHandler | None = None,
        until: Status | Collection[Status] = (),
    ) -> None:
        """Start ticking in the node's executor, and return at once.

        Args:
            period_ms: The maximum time between two ticks, in milliseconds of the node's clock.
            number_of_iterations: The maximum number of ticks, including ticks that leaves trigger; by default, there is no limit.
            pre_tick_handler: Called before every tick, before handlers that were added to the tree.
            post_tick_handler: Called after every tick, after handlers that were added to the tree.
            until: Ticking ends when the root returns one of these statuses. Afterwards, `is_running` is False, and `last_status` keeps the
                status. By default, ticking does not end: the tree starts over in the next tick, which changes `last_status`.

        Raises:
            RuntimeError: If `setup` was not called, or the tree was already stopped.
            ValueError: If the period is not above 0.
        """
        self._require_not_stopped()
        if self.node is None:
            raise RuntimeError("call setup() before tick_tock()")
        if not period_ms > 0:
            raise ValueError(f"the period between ticks must be above 0 ms, but is {period_ms}")
        self._pause()
        self._handlers = (pre_tick_handler, post_tick_handler)
        self._ticks_left = number_of_iterations
        self._last = {until} if isinstance(until, Status) else {*until}
        self._woken = False
        if number_of_iterations == 0:
            return
        self._running = True
        self._beat = TickScheduler(self.node, period_ms / 1000.0, self._tick_now, lambda: self.count)

    def tick(
        self,
        pre_tick_handler: TickHandler | None = None,
        post_tick_handler: TickHandler | None = None,
    ) -> None:
        """Tick once, or continue a paused tick. This method raises exceptions of leaves, while `tick_tock` stores them in `failure`.

        Raises:
            RuntimeError: If the tree was already stopped.
        """
        self._require_not_stopped()
        tick = self._paused_tick or self._tick(pre_tick_handler, post_tick_handler)
        self._paused_tick = None
        self._ticking = True
        try:
            for _ in tick:
                self._paused_tick = tick
                break
        finally:
            self._ticking = False
        if self.interrupt_tick_tocking:
            self.stop()

    def use_breakpoints(self, breakpoints: Breakpoints) -> None:
        """Enable breakpoints. A tick pauses at each breakpoint.

        While a tick is paused, the node's executor continues with all other callbacks. The tick is continued, if possible, at the times of scheduled
        ticks and when the tree is woken.
        """
        self._breakpoints = breakpoints

    def _tick(
        self, pre_tick_handler: TickHandler | None, post_tick_handler: TickHandler | None
    ) -> Generator[None, None, None]:
        """Tick the tree and call handlers and visitors like py_trees' `BehaviourTree`; yield when the tick is paused."""
        for handler in (pre_tick_handler, *self.pre_tick_handlers):
            if handler is not None:
                handler(self)
        for visitor in self.visitors:
            visitor.initialise()
        yield from self._tick_nodes([visitor for visitor in self.visitors if not visitor.full])
        for visitor in self.visitors:
            for node in self.root.iterate() if visitor.full else ():
                node.visit(visitor)
        for visitor in self.visitors:
            visitor.finalise()
        self.last_status = self.root.status
        for handler in (*self.post_tick_handlers, post_tick_handler):
            if handler is not None:
                handler(self)
        self.count += 1

    def _tick_nodes(self, visitors: list[VisitorBase]) -> Generator[None, None, None]:
        live = self._live_tree()
        if not visitors and self._breakpoints is None:
            live.tick()
            return
        visits: list[Visit] = []
        try:
            if self._breakpoints is None:
                live.tick_and_visit(visits)
            else:
                for _ in tick_with_breakpoints(live, self._breakpoints, visits):
                    _show(visits, visitors)
                    yield
        finally:
            _show(visits, visitors)

    def _live_tree(self) -> LiveTree:
        if self._live is None or self._live.root is not self.root or not self._live.is_whole():
            self._live = LiveTree(self.root, is_strict=True, former=self._live)
        return self._live

    def wake(self) -> None:
        """Request one tick as soon as the executor is free.

        This method may be called at any time from any thread. During a tick, it requests a further tick.
        """
        self._woken = True
        self._trigger()

    def interrupt(self) -> None:
        """Request that the executor's thread stops the tree. Signal handlers and other threads may call this method."""
        super().interrupt()
        self._trigger()

    def stop(self) -> None:
        """Stop ticking, and stop the tree from its root, so that active goals are cancelled.

        If a handler or a leaf calls this method during a tick, the tree is stopped after the tick.
        """
        self.interrupt_tick_tocking = True
        if self._ticking or self._stopped:
            return
        self._stopped = True
        self._pause()
        paused_tick, self._paused_tick = self._paused_tick, None
        if paused_tick is not None:
            paused_tick.close()
        stop_behaviours(self.root, self.failed_behaviour, self.node)

    def settle(self, executor: Executor, timeout_sec: float = SETTLE_SEC) -> list[str]:
        """Stop the tree, then spin until no leaf has work in progress.

        Args:
            executor: The executor of the node.
            timeout_sec: The maximum time to spin, in seconds of the steady clock.

        Returns:
            The names of the leaves that still have work in progress.
        """
        self.stop()
        return settle(self.root, executor, timeout_sec, self.node)

    def shutdown(self) -> None:
        """Stop the tree and release its resources, without raising exceptions. This method may be called repeatedly.

        If ROS is already shut down, for example by rclpy's signal handlers, this method cancels active goals in a separate ROS context, and
        waits some seconds for the goals to end.
        """
        self.stop()
        atexit.unregister(self._shut_down_at_exit)
        if self.node is not None and not is_node_valid(self.node):
            self._cancel_active_goals()
        if not self._shut_down:
            self._shut_down = True
            shut_down(list(self.root.iterate()), self.node)
        node, guard, self._guard = self.node, self._guard, None
        if node is None or guard is None:
            return
        self._try(lambda: node.destroy_guard_condition(guard), "the runner's guard could not be destroyed")
        if self._owns_node:
            self._try(node.destroy_node, "the node could not be destroyed")

    def _shut_down_at_exit(self) -> None:
        """Shut down at the end of a program that has not called `shutdown`."""
        self.shutdown()
        self._cancel_active_goals()

    def _cancel_active_goals(self) -> None:
        active: Sequence[str] = []

        def cancel() -> None:
            nonlocal active
            active = self._cancel_separately(SETTLE_SEC)
            self._cancel_separately = _cancel_nothing

        self._try(cancel, "active goals could not be canceled. The robot may still be moving")
        for action in active:
            log_error(
                self.node, f"the server of {action} has not ended the goal. The robot may still be moving"
            )

    def _try(self, action: Callable[[], object], complaint: str) -> None:
        """Execute one step of the shutdown. An exception is logged, so that the remaining steps are still executed."""
        try:
            action()
        except Exception as error:  # noqa: BLE001
            log_error(self.node, f"{complaint}: {error_text(error)}")

    def _require_not_stopped(self) -> None:
        if self._stopped:
            raise RuntimeError("a stopped tree cannot be ticked again")

    def _trigger(self) -> None:
        guard = self._guard
        try:
            if guard is not None:
                guard.trigger()
        except (InvalidHandle, RuntimeError):
            pass  # another thread has destroyed the guard, so there is no executor to wake

    def _on_wake(self) -> None:
        if self.interrupt_tick_tocking:
            self.stop()
        elif self._woken:
            self._tick_now()

    def _tick_now(self) -> None:
        """Tick in a callback of the executor. This method must not raise an exception."""
        if not self._running:
            return
        self._woken = False
        try:
            self.tick(*self._handlers)
        except Exception as error:  # noqa: BLE001 - stored and logged, and the tree is stopped
            self._fail(error)
            return
        if self._paused_tick is not None:
            return
        if self._ticks_left > 0:
            self._ticks_left -= 1
        if self._ticks_left == 0 or self.last_status in self._last:
            self._pause()

    def _fail(self, error: Exception) -> None:
        if isinstance(
            error.__cause__, StopIteration
        ):  # Python replaces a StopIteration in a generator such as `_tick` by a RuntimeError
            error = error.__cause__
        self.failure = error
        self.failed_behaviour = log_failure(self.node, error)
        self.stop()

    def _pause(self) -> None:
        self._running = False
        beat, self._beat = self._beat, None
        if beat is not None:
            beat.destroy()


def _cancel_nothing(limit_sec: float) -> Sequence[str]:  # noqa: ARG001
    """Return an empty list, because there are no goals to cancel."""
    return []


def _show(visits: list[Visit], visitors: list[VisitorBase]) -> None:
    """Call the visitors once for each ticked node, and clear the list of visits."""
    ticked, visits[:] = visits[:], []
    for node in show_visits(ticked):
        for visitor in visitors:
            node.visit(visitor)
