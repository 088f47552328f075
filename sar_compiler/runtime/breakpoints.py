"""Breakpoints: a tick pauses before a node with a breakpoint until the user continues the tick."""

import threading
import time
from collections.abc import Callable, Generator

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.kernel.cells import CALLED
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.kernel.tree_nodes import TreeNode, Visit


class Breakpoints:
    """The breakpoints of a tree, set in one thread while another thread ticks the tree.

    Args:
        log: Called with messages about breakpoints, in the thread that ticks the tree.
        patience_sec: Breakpoints have no effect after this time without a call of `keep_alive`, in seconds of the
            steady clock. A closed browser must not block a robot's tree.

    Attributes:
        held_at: The behaviour at which a tick waits; None if no tick waits.
        wake: Called in the thread that sets breakpoints when a waiting tick may continue.
    """

    def __init__(self, log: Callable[[str], object], patience_sec: float) -> None:
        self.held_at: Behaviour | None = None
        self.wake: Callable[[], object] = lambda: None
        self._log, self._patience_sec = log, patience_sec
        self._behaviours: dict[int, Behaviour] = {}
        self._is_continued = False
        self._lock = threading.Lock()
        self._alive_at = time.monotonic()

    def __contains__(self, behaviour: Behaviour) -> bool:
        return id(behaviour) in self._behaviours

    def add(self, behaviour: Behaviour) -> None:
        """Set a breakpoint at a node."""
        with self._lock:
            self._behaviours[id(behaviour)] = behaviour

    def remove(self, behaviour: Behaviour) -> None:
        """Remove the breakpoint at a node, if there is one, and continue a tick that waits there."""
        with self._lock:
            self._behaviours.pop(id(behaviour), None)
        self.wake()

    def clear(self) -> None:
        """Remove all breakpoints, and continue a waiting tick."""
        with self._lock:
            self._behaviours.clear()
        self.wake()

    def resume(self) -> None:
        """Continue the waiting tick. The breakpoint stays set for the next tick."""
        self._is_continued = True
        self.wake()

    def keep_alive(self) -> None:
        """Record that a user is still watching the tree."""
        self._alive_at = time.monotonic()

    def release_if_abandoned(self) -> None:
        """Continue a waiting tick if no user is watching the tree any more. Called regularly."""
        if self.held_at is not None and self._is_abandoned():
            self.wake()

    def wait_at(self, behaviour: Behaviour) -> Generator[None, None, None]:
        """Yield repeatedly while a breakpoint at a node makes the tick wait."""
        if behaviour not in self or self._is_abandoned():
            return
        self.held_at, self._is_continued = behaviour, False
        self._log(f"A breakpoint pauses the tree before '{behaviour.name}' until you continue it")
        try:
            while behaviour in self and not self._is_continued and not self._is_abandoned():
                yield
        finally:
            self.held_at = None
        self._log("The tree is ticked again")

    def _is_abandoned(self) -> bool:
        return time.monotonic() - self._alive_at > self._patience_sec


def tick_with_breakpoints(
    tree: LiveTree, breakpoints: Breakpoints, visits: list[Visit]
) -> Generator[None, None, None]:
    """Tick a tree once; yield while the tick waits at a breakpoint. Closing the generator aborts the tick.

    Args:
        tree: The tree.
        breakpoints: The breakpoints. They have no effect at nodes below a foreign control or decorator.
        visits: A list to which the ticked nodes are added, in the order in which their ticks end. The caller may clear the list between
            steps.
    """
    ticker = tree.ticker
    ticker.enter()
    before = ticker.visits, ticker.by_step
    ticker.visits, ticker.by_step = visits, True
    waiting: list[TreeNode] = []
    node = tree.tree_nodes[0]
    try:
        while True:
            yield from breakpoints.wait_at(node.behaviour)
            ticker.reach(node)
            outcome = node.begin(ticker)
            while outcome != CALLED:
                ticker.record_visit(node, outcome)
                if not waiting:
                    return
                node = waiting.pop()
                outcome = node.resume(ticker, outcome)
            waiting.append(node)
            called = ticker.called
            assert called is not None  # noqa: S101 - CALLED says so
            node = called
    except BaseException:
        for broken in (node, *reversed(waiting)):
            broken.break_off(ticker)
        raise
    finally:
        ticker.visits, ticker.by_step = before
        ticker.write_statuses()
