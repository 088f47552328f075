"""A tick with breakpoints and overridden outcomes."""

from collections.abc import Generator
from typing import Any, Protocol

from sar_compiler.runtime.answers import OVERRIDDEN
from sar_compiler.runtime.kernel.cells import CALLED, ENDED, RUNNING, STATUSES
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.kernel.tree_nodes import Ticker, TreeNode, Visit


class TickHooks(Protocol):
    """Who is asked before and after the tick of each node.

    Both yield as long as the tick has to wait, and return what the node is made to come to: SUCCESS or FAILURE of
    `kernel.cells`; SKIPPED changes nothing.
    """

    def before(self, behaviour: Any) -> Generator[None, None, int]:
        """Be asked before a node, with the behaviour that is to be ticked."""

    def after(self, behaviour: Any) -> Generator[None, None, int]:
        """Be asked after a node."""


def hooked_tick(tree: LiveTree, hooks: TickHooks, visits: list[Visit]) -> Generator[None, None, None]:
    """Tick a tree once; yield wherever the tick has to wait. To close the generator breaks the tick off.

    Args:
        tree: The tree.
        hooks: Who is asked. Nodes of other people's controls and decorators, which only these tick, are not.
        visits: Where the nodes go that are ticked, in the order of their ends; may be emptied meanwhile.
    """
    ticker = tree.ticker
    ticker.enter()
    before = ticker.visits, ticker.by_step
    ticker.visits, ticker.by_step = visits, True
    waiting: list[TreeNode] = []
    node = tree.nodes[0]
    try:
        while True:
            outcome = yield from _begin(node, ticker, hooks)
            while outcome != CALLED:
                outcome = _come_to((yield from hooks.after(node.behaviour)), outcome, node, ticker)
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


def _begin(node: TreeNode, ticker: Ticker, hooks: TickHooks) -> Generator[None, None, int]:
    given = yield from hooks.before(node.behaviour)
    ticker.reach(node)
    if getattr(node.behaviour, "answer_label", "") == OVERRIDDEN:
        node.behaviour.answer_label = ""
    return _come_to(given, CALLED, node, ticker) if given & ENDED else node.begin(ticker)


def _come_to(given: int, outcome: int, node: TreeNode, ticker: Ticker) -> int:
    """Return the outcome of a node; where another one is given, what the node has under way is stopped."""
    if not given & ENDED:
        return outcome
    if ticker.cells[node.at] == RUNNING:
        node.stop(ticker)
    ticker.cells[node.at] = given
    node.behaviour.status = STATUSES[given]
    node.behaviour.feedback_message = "put in its place from outside"
    node.behaviour.answer_label = OVERRIDDEN
    return given
