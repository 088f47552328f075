"""Run a tree in a user's own program, and cancel the tree's goals when the program ends."""

import math
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from py_trees.behaviour import Behaviour
from rclpy.executors import Executor, ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import (
    SignalHandlerOptions,
    get_current_signal_handlers_options,
    install_signal_handlers,
    uninstall_signal_handlers,
)

from sar_compiler.commands import ROBOT_MAY_MOVE, print_error
from sar_compiler.compiler import CompiledTree
from sar_compiler.missions.parameter_reader import BLOCKED_TICK_SEC, SETTLE_SEC
from sar_compiler.process_end import end_after_program
from sar_compiler.ros.arguments import security_arguments, split_arguments
from sar_compiler.ros.engine import leaves_at_work
from sar_compiler.ros.forced_end import ForcedEnd
from sar_compiler.ros.guardian import Guardian
from sar_compiler.ros.leaves.leaf import is_node_valid
from sar_compiler.ros.orphaned_goals import CancelFunction, make_separate_canceller
from sar_compiler.ros.runner import TreeRunner
from sar_compiler.ros.signals import UNNOTICED_SEC, StopSignals
from sar_compiler.ros.tick_watch import TickWatch

_TURN_SEC = 0.05
# Time for an executor to leave a callback before it is interrupted, in seconds.
_SOON_SEC = 0.02


@contextmanager
def running_tree(
    tree: CompiledTree | Behaviour | TreeRunner,
    node: Node,
    *,
    guardian: bool = False,
    settle_timeout_sec: float = SETTLE_SEC,
    blocked_tick_timeout_sec: float = BLOCKED_TICK_SEC,
) -> Iterator[TreeRunner]:
    """Set up a tree on a node, and end all goals of the tree at the end of the block.

    Within the block, Ctrl-C, SIGTERM and SIGHUP interrupt the executor between two callbacks with a `KeyboardInterrupt`. At the end of the
    block, the tree is stopped from its root, its goals are canceled, and their ends are awaited. After a signal, the program then exits with
    130, 143 or 129, or with 4 if a goal may still be active. A second Ctrl-C ends the program at once. If a leaf blocks the tick, this is
    reported, and the program can still be ended. If the block is not in the main thread, the program must handle signals itself.

    Args:
        tree: The compiled tree, its root, or its `TreeRunner`.
        node: The node of the tree, which the program spins with any executor. ROS must not be shut down.
        guardian: Whether a separate process cancels the goals if the program is killed or crashes.
        settle_timeout_sec: The maximum wait until the goals have ended, in seconds of the steady clock.
        blocked_tick_timeout_sec: The maximum time without a tick before the goals are canceled, in seconds of the steady clock.

    Yields:
        The runner after its setup. Call its method `tick_tock` or `tick`.

    Raises:
        ExternalShutdownException: If a signal has already shut down ROS.
        SetupFailedError: If the setup of a behaviour raised an exception.
        SystemExit: At the end of the block, if a signal requested the end of the program.
    """
    runner = tree if isinstance(tree, TreeRunner) else TreeRunner(tree)
    if not is_node_valid(node):
        raise ExternalShutdownException
    name = Path(sys.argv[0]).name or "python"
    security = security_arguments(split_arguments(sys.argv[1:]).ros)
    with ExitStack() as stack:
        if guardian:
            guard = Guardian(node, security)
            stack.callback(guard.on_end, has_begun=True)
            guard.guard_goals()
        signals = _Signals() if threading.current_thread() is threading.main_thread() else None
        if signals is not None:
            stack.callback(signals.restore_handlers)
            signals.ends_unnoticed = True
        if runner.node is None:
            runner.setup(node=node)
        if signals is not None:
            signals.ends_unnoticed = False
        cancel = make_separate_canceller(node)
        stack.callback(runner.shutdown)
        hosted = _HostedTree(name, runner, node, cancel, settle_timeout_sec, signals)
        with hosted.tick_watch(blocked_tick_timeout_sec):
            try:
                yield runner
            except _InterruptionError:
                pass
            except KeyboardInterrupt:
                if signals is None or not signals.came:
                    raise
            finally:
                hosted.settle()
        if signals is not None and signals.came:
            end_after_program(hosted.status(signals), name)
            raise SystemExit(hosted.status(signals))


class _InterruptionError(RuntimeError):
    """Interrupts a multithreaded executor, which does not propagate a `KeyboardInterrupt`."""


class _Signals(StopSignals):
    """Temporarily replaces rclpy's signal handlers, so that goals are canceled before ROS shuts down."""

    def __init__(self) -> None:
        self._options = get_current_signal_handlers_options()
        uninstall_signal_handlers()
        super().__init__()

    def restore_handlers(self) -> None:
        """Restore the previous signal handlers."""
        super().restore_handlers()
        if self._options != SignalHandlerOptions.NO:
            install_signal_handlers(self._options)


class _HostedTree:
    """A tree that a user's program ticks.

    Args:
        name: The program's name, for messages.
        runner: Ticks the tree.
        node: The node of the tree.
        cancel: Cancels the tree's goals from another node if *node* cannot.
        settle_sec: The maximum wait until the goals have ended, in seconds of the steady clock.
        signals: The requests to stop; None if the program handles signals itself.
    """

    def __init__(
        self,
        name: str,
        runner: TreeRunner,
        node: Node,
        cancel: CancelFunction,
        settle_sec: float,
        signals: _Signals | None,
    ) -> None:
        self._name, self._runner, self._node, self._cancel = name, runner, node, cancel
        self._settle_sec, self._signals = settle_sec, signals
        self._is_ending = self._has_interrupted = False
        self._interrupted_at = -math.inf
        self._spinner = threading.get_ident()
        self._active: list[str] = []

    def tick_watch(self, blocked_sec: float) -> TickWatch:
        """Create the watchdog of the executor that ticks the tree."""
        signals = self._signals
        watch = TickWatch(
            self._node,
            self._runner.root,
            cancel=self._cancel,
            cancel_sec=blocked_sec,
            signals=signals,
            settle_sec=self._settle_sec,
            on_beat=self._on_beat,
        )
        if signals is not None:
            end = ForcedEnd(
                self._name, self._node, self._runner.root, signals, self._cancel, self._settle_sec
            )
            watch.end = lambda where: self._on_blocked_main_thread(watch, end, where)
            signals.last_words = end.end_immediately
        return watch

    def _on_beat(self) -> None:
        """Interrupt the executor of the current thread if a signal has arrived."""
        self._spinner = threading.get_ident()
        if self._signals is None or self._is_ending or not self._signals.came:
            return
        if isinstance(self._node.executor, MultiThreadedExecutor):
            self._interrupt_workers()
        elif threading.current_thread() is threading.main_thread() and isinstance(
            self._node.executor, Executor
        ):
            raise KeyboardInterrupt
        else:
            # Either the executor spins in another thread, or it is an EventsExecutor, which only logs exceptions.
            threading.Timer(_SOON_SEC, self._interrupt).start()

    def _interrupt_workers(self) -> None:
        """Interrupt the executor by an exception in a worker thread; repeat this until the executor stops."""
        if time.monotonic() - self._interrupted_at < UNNOTICED_SEC:
            return
        self._interrupted_at = time.monotonic()
        raise _InterruptionError

    def _on_blocked_main_thread(self, watch: TickWatch, end: ForcedEnd, where: str) -> None:
        """Interrupt a main thread that does not spin; end the process if the interrupt has no effect."""
        if watch.blocking_leaf() is not None or self._has_interrupted:
            if time.monotonic() - self._interrupted_at > UNNOTICED_SEC:
                end.end_blocked(where)
            return
        self._interrupt()

    def _interrupt(self) -> None:
        if self._signals is not None and not self._has_interrupted:
            self._has_interrupted, self._interrupted_at = True, time.monotonic()
            self._signals.interrupt_main()

    def settle(self) -> None:
        """Stop the tree, and wait until its goals have ended."""
        self._is_ending = True
        if self._signals is not None:
            self._signals.is_noticed = True
        names = self._settle_tree() if is_node_valid(self._node) else []
        if not is_node_valid(self._node):
            names = list(self._cancel(self._settle_sec))
        if names:
            self._active = names
            words = "a goal may still be active, and the robot may still be moving"
            print_error(f"{self._name}: {words}: {', '.join(names)}")

    def _settle_tree(self) -> list[str]:
        """Stop the tree, and wait until its goals have ended; return the names of leaves with active goals."""
        executor = self._node.executor
        if executor is not None and self._node not in executor.get_nodes():  # `rclpy.spin` has removed it
            executor = None
        is_elsewhere = executor is not None and self._spinner != threading.get_ident()
        if is_elsewhere and not isinstance(executor, MultiThreadedExecutor):
            return self._settle_in_other_thread()
        if executor is not None:
            with suppress(_InterruptionError):  # raised by a worker thread, but not yet propagated
                executor.spin_once(timeout_sec=0.0)
            return self._runner.settle(executor, self._settle_sec)
        own = SingleThreadedExecutor(context=self._node.context)
        own.add_node(self._node)
        try:
            return self._runner.settle(own, self._settle_sec)
        finally:
            own.remove_node(self._node)
            own.shutdown()

    def _settle_in_other_thread(self) -> list[str]:
        """Stop the tree in the thread that spins the executor; return the names of leaves with active goals."""
        self._runner.interrupt()
        deadline = time.monotonic() + self._settle_sec
        while (self._runner.is_running or leaves_at_work(self._runner.root)) and time.monotonic() < deadline:
            time.sleep(_TURN_SEC)
        return [leaf.name for leaf in leaves_at_work(self._runner.root)]

    def status(self, signals: StopSignals) -> int:
        """Return the exit status of a program after a request to stop."""
        return ROBOT_MAY_MOVE if self._active else signals.exit_status
