"""Decorators of BehaviorTree.CPP that turn, keep or prevent what their child answers."""

from typing import Any

from librt.vecs import vec
from mypy_extensions import i32

from sar_compiler.runtime.kernel.cells import ENDED, INVALID, RUNNING, SKIPPED, WORDS, number_of
from sar_compiler.runtime.kernel.tree_nodes import ChildlessNode, DecoratorNode, NodeBuilder, Ticker, TreeNode
from sar_compiler.runtime.scripting import NodeScript


class TurningNode(DecoratorNode):
    """Answers something else for each outcome of its child.

    Attributes:
        turned: The answer for each outcome; the behaviour has the words of those for SUCCESS, FAILURE and SKIPPED.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        turned: list[int] = [WORDS.index(word) for word in part.behaviour.turned]
        self.turned = [INVALID, RUNNING, *turned]

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Turn the outcome."""
        return self.come_to(ticker, self.turned[outcome])


class SubTreeNode(DecoratorNode):
    """Passes on what its child answers."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the child."""
        if ticker.cells[self.at] == INVALID:
            ticker.cells[self.at] = RUNNING
        return self.tick_child(self.child, ticker)


class RunOnceNode(DecoratorNode):
    """Lets its child end once.

    Attributes:
        answer: The cell with the outcome of the child, which is kept for good.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.answer = part.cell(INVALID, keeps=True)

    def begin(self, ticker: Ticker) -> int:
        """Tick the child, unless it has ended before."""
        then_skip, answer = self.behaviour.then_skip.get(), ticker.cells[self.answer]
        if answer == INVALID:
            return super().begin(ticker)
        self.behaviour.feedback_message = "has run"
        return SKIPPED if then_skip else self.come_to(ticker, answer)

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Keep the outcome if it is an end."""
        if outcome & ENDED:
            ticker.cells[self.answer] = ticker.cells[self.at] = outcome
        return outcome


class GuardedNode(DecoratorNode):
    """Asks whether its child may start, and not again while the child runs.

    Attributes:
        child_runs: The cell with 1 while the child runs.
        why_not: What it tells when the child may not start.
    """

    why_not = ""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.child_runs = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the child if it may start, or runs."""
        if ticker.cells[self.child_runs] or self.may_start(ticker):
            self.behaviour.feedback_message = ""
            return self.tick_child(self.child, ticker)
        self.behaviour.feedback_message = self.why_not
        return self.come_to(ticker, self.otherwise())

    def may_start(self, ticker: Ticker) -> bool:
        """Return whether the child may start."""
        raise NotImplementedError

    def otherwise(self) -> int:
        """Return the outcome when it may not."""
        raise NotImplementedError

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Pass the outcome on."""
        ticker.cells[self.child_runs] = int(outcome == RUNNING)
        return self.come_to(ticker, outcome)


class PreconditionNode(GuardedNode):
    """Asks a script whether its child may start."""

    why_not = "the condition is false"

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        behaviour = part.behaviour
        scope, enums = behaviour.scope, behaviour.enums
        self.script: Any = NodeScript(behaviour.if_, behaviour.name, "if", scope, enums)

    def may_start(self, ticker: Ticker) -> bool:  # noqa: ARG002
        """Return whether the condition is true."""
        return bool(self.script.holds())

    def otherwise(self) -> int:
        """Return what the node is to answer if it is not."""
        return number_of(self.behaviour.else_.get().status) or SKIPPED


class UpdateGuardNode(GuardedNode):
    """Asks whether an entry was written since the node last looked.

    Attributes:
        seen: The cell that says how often the entry had been written then.
        unless_written: What it answers if it was not.
    """

    why_not = "no update"

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.unless_written = WORDS.index(part.behaviour.unless_written)
        self.entry = watched_entry(part.behaviour)
        self.seen = part.cell(keeps=True)
        part.watch(self.entry, self.seen)

    def may_start(self, ticker: Ticker) -> bool:
        """Return whether the entry was written."""
        return is_news(self.entry, self.seen, ticker)

    def otherwise(self) -> int:
        """Return what the node answers if it was not written."""
        return self.unless_written


def watched_entry(behaviour: Any) -> Any:
    """Return the entry that a behaviour looks at: that of its port, or the one whose key the port says."""
    port = behaviour.entry
    return port.entry or behaviour.scope.resolve(str(port.get()))


def is_news(entry: Any, seen: int, ticker: Ticker) -> bool:
    """Return whether an entry was written since a node last looked, which is noted.

    Args:
        entry: The entry.
        seen: The cell that says how often it had been written then.
        ticker: What ticks the node.
    """
    if not entry.exists:
        return False
    before = ticker.cells[seen]
    ticker.cells[seen] = now = entry.stamp
    return bool(before != now)


class ConditionsNode(DecoratorNode):
    """The pre- and post-conditions of a node, which is its child; they have one status between them.

    Attributes:
        runs_after: Whether there is anything to run after an end.
        has_children: Whether the node has children.
        has_told: Whether the behaviour may have a message.
        was_running: Whether the node was running when it began to be stopped.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        behaviour = part.behaviour
        self.before: list[Any] = behaviour._before
        self.goes_on: Any = behaviour._while
        self.runs_after: bool = behaviour.runs_after
        self.has_children = not isinstance(self.child, ChildlessNode)
        self.has_told = True
        self.was_running = False

    def tick(self, ticker: Ticker) -> int:
        """Tick the node; in passing where it is a leaf, unless all nodes are ticked step by step."""
        if self.has_children or ticker.by_step:
            return super().tick(ticker)
        ticker.reach(self)
        return self.begin(ticker)

    def begin(self, ticker: Ticker) -> int:
        """Tick the node, unless a condition decides."""
        outcome = self.decided(ticker)
        return self.tick_child(self.child, ticker) if outcome == INVALID else self.after(ticker, outcome)

    def decided(self, ticker: Ticker) -> int:
        """Return what the pre-conditions make of this tick; INVALID if the node is to be ticked."""
        behaviour, status = self.behaviour, ticker.cells[self.at]
        if status == RUNNING:
            if self.goes_on is None or self.goes_on.holds():
                return INVALID
            self.stop(ticker)
            return self.tell("halted by _while", SKIPPED)
        if self.has_told:
            behaviour.feedback_message, self.has_told = "", False
        if not self.starts(ticker):
            return INVALID
        for script, attribute, outcome in self.before:
            if script.holds():
                return self.tell(f"decided by {attribute}", outcome)
        if self.goes_on is not None and not self.goes_on.holds():
            return self.tell("decided by _while", SKIPPED)
        return INVALID

    def tell(self, message: str, outcome: int) -> int:
        """Tell what has decided; return the outcome."""
        self.behaviour.feedback_message, self.has_told = message, True
        return outcome

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Go on after the node."""
        return self.after(ticker, outcome)

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Run the post-conditions, and pass the outcome on."""
        if self.runs_after and outcome & ENDED:
            self.behaviour.run_after(outcome)
        return self.come_to(ticker, outcome)

    def show(self, cells: vec[i32]) -> None:
        """Give the behaviour the status that a condition has decided; any other is the node's, which shows it."""
        if self.has_told:
            super().show(cells)

    def rest(self, ticker: Ticker) -> None:
        """Forget how both have ended, which have one status."""
        super().rest(ticker)
        self.child.rest(ticker)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Return the node, if it runs."""
        self.was_running = ticker.cells[self.at] == RUNNING
        return super().stop_first(ticker)

    def stop_last(self, ticker: Ticker) -> None:
        """If the node was running, run what is to be run then."""
        if self.was_running:
            self.behaviour.run_after(INVALID)
        super().stop_last(ticker)
