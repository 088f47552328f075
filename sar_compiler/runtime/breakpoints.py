"""Breakpoints: a tick that waits before a node until it is continued."""

import threading
import time
from collections.abc import Callable, Generator

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.kernel.cells import CALLED
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.kernel.tree_nodes import TreeNode, Visit


class Breakpoints:
    """The breakpoints of a tree. They are set in one thread, and the tree is ticked in another.

    Args:
        log: Called with what a breakpoint does, in words, in the thread that ticks.
        patience_sec: Breakpoints hold nothing once `keep_alive` was not called for so many seconds of the steady clock:
            a browser that was closed must not hold a robot's tree.

    Attributes:
        held_at: The behaviour before which a tick waits; None if none waits.
        wake: Called when a tick that waits may continue, from the thread that sets breakpoints.
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
        """Set a breakpoint before a node."""
        with self._lock:
            self._behaviours[id(behaviour)] = behaviour

    def remove(self, behaviour: Behaviour) -> None:
        """Remove the breakpoint before a node, if there is one; a tick that waits there continues."""
        with self._lock:
            self._behaviours.pop(id(behaviour), None)
        self.wake()

    def clear(self) -> None:
        """Remove all breakpoints."""
        with self._lock:
            self._behaviours.clear()
        self.wake()

    def resume(self) -> None:
        """Continue the tick that waits; its breakpoint stays for the next tick."""
        self._is_continued = True
        self.wake()

    def keep_alive(self) -> None:
        """Record that someone still looks at the tree."""
        self._alive_at = time.monotonic()

    def release_if_abandoned(self) -> None:
        """Continue a tick that waits although nobody looks at the tree any more; called now and then."""
        if self.held_at is not None and self._is_abandoned():
            self.wake()

    def before(self, behaviour: Behaviour) -> Generator[None, None, None]:
        """Yield as long as a tick has to wait before a node."""
        if behaviour not in self or self._is_abandoned():
            return
        self.held_at, self._is_continued = behaviour, False
        self._log(f"A breakpoint holds the tree before '{behaviour.name}': it is not ticked until it goes on")
        try:
            while behaviour in self and not self._is_continued and not self._is_abandoned():
                yield
        finally:
            self.held_at = None
        self._log("the tree is ticked again")

    def _is_abandoned(self) -> bool:
        return time.monotonic() - self._alive_at > self._patience_sec


def tick_with_breakpoints(
    tree: LiveTree, breakpoints: Breakpoints, visits: list[Visit]
) -> Generator[None, None, None]:
    """Tick a tree once; yield wherever the tick has to wait. To close the generator breaks the tick off.

    Args:
        tree: The tree.
        breakpoints: Where it waits. Nodes below other people's controls and decorators, which only these tick, have none.
        visits: Receives the nodes that are ticked, in the order of their ends; may be emptied meanwhile.
    """
    ticker = tree.ticker
    ticker.enter()
    before = ticker.visits, ticker.by_step
    ticker.visits, ticker.by_step = visits, True
    waiting: list[TreeNode] = []
    node = tree.nodes[0]
    try:
        while True:
            yield from breakpoints.before(node.behaviour)
            ticker.reach(node)
            outcome = node.begin(ticker)
            while outcome != CALLED:
                ticker.note(node, outcome)
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
        ticker.leave()
