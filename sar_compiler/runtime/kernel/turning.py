"""Decorators of BehaviorTree.CPP that convert, keep or prevent the outcome of their child."""

from typing import Any

from librt.vecs import vec
from mypy_extensions import i32

from sar_compiler.runtime.kernel.cells import ENDED, INVALID, RUNNING, SKIPPED, WORDS, number_of
from sar_compiler.runtime.kernel.tree_nodes import ChildlessNode, DecoratorNode, NodeBuilder, Ticker, TreeNode
from sar_compiler.runtime.scripting import NodeScript


class TurningNode(DecoratorNode):
    """Replaces the outcome of its child.

    Attributes:
        turned: The replacement for each outcome; the behaviour has the names of those for SUCCESS, FAILURE and SKIPPED.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        turned: list[int] = [WORDS.index(word) for word in part.behaviour.turned]
        self.turned = [INVALID, RUNNING, *turned]

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Replace the outcome."""
        return self.set_outcome(ticker, self.turned[outcome])


class SubTreeNode(DecoratorNode):
    """Passes on the outcome of its child."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the child."""
        if ticker.cells[self.status_cell] == INVALID:
            ticker.cells[self.status_cell] = RUNNING
        return self.tick_child(self.child, ticker)


class RunOnceNode(DecoratorNode):
    """Lets its child end once.

    Attributes:
        answer: The cell with the final outcome of the child, which is never reset.
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
        return SKIPPED if then_skip else self.set_outcome(ticker, answer)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Keep the outcome if it is an end."""
        if outcome & ENDED:
            ticker.cells[self.answer] = ticker.cells[self.status_cell] = outcome
        return outcome


class GuardedNode(DecoratorNode):
    """Checks whether its child may start, but not while the child runs.

    Attributes:
        child_runs: The cell with 1 while the child runs.
        why_not: The message if the child may not start.
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
        return self.set_outcome(ticker, self.blocked_outcome())

    def may_start(self, ticker: Ticker) -> bool:
        """Return whether the child may start."""
        raise NotImplementedError

    def blocked_outcome(self) -> int:
        """Return the outcome if the child may not start."""
        raise NotImplementedError

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Pass on the outcome."""
        ticker.cells[self.child_runs] = int(outcome == RUNNING)
        return self.set_outcome(ticker, outcome)


class PreconditionNode(GuardedNode):
    """Evaluates a script that decides whether its child may start."""

    why_not = "the condition is false"

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        behaviour = part.behaviour
        scope, enums = behaviour.scope, behaviour.enums
        self.script: Any = NodeScript(behaviour.if_, behaviour.name, "if", scope, enums)

    def may_start(self, ticker: Ticker) -> bool:  # noqa: ARG002
        """Return whether the condition is true."""
        return bool(self.script.holds())

    def blocked_outcome(self) -> int:
        """Return the configured outcome for a false condition."""
        return number_of(self.behaviour.else_.get().status) or SKIPPED


class UpdateGuardNode(GuardedNode):
    """Checks whether an entry was written since the last check.

    Attributes:
        seen: The cell with the entry's number of writes at the last check.
        unless_written: The outcome if it was not written.
    """

    why_not = "no update"

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.unless_written = WORDS.index(part.behaviour.unless_written)
        self.entry = watched_entry(part.behaviour)
        self.seen = part.cell(keeps=True)
        part.watch_entry(self.entry, self.seen)

    def may_start(self, ticker: Ticker) -> bool:
        """Return whether the entry was written."""
        return is_news(self.entry, self.seen, ticker)

    def blocked_outcome(self) -> int:
        """Return the outcome if the entry was not written."""
        return self.unless_written


def watched_entry(behaviour: Any) -> Any:
    """Return the entry that a behaviour checks: that of its port, or the one whose key is the port's value."""
    port = behaviour.entry
    return port.entry or behaviour.scope.resolve(str(port.get()))


def is_news(entry: Any, seen: int, ticker: Ticker) -> bool:
    """Return whether an entry was written since the last check, and store its number of writes.

    Args:
        entry: The entry.
        seen: The cell with its number of writes at the last check.
        ticker: The ticker.
    """
    if not entry.exists:
        return False
    before = ticker.cells[seen]
    ticker.cells[seen] = now = entry.stamp
    return bool(before != now)


class ConditionsNode(DecoratorNode):
    """The pre- and post-conditions of a node, which is its child; both share one status.

    Attributes:
        runs_after: Whether there are scripts to run after an end.
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
        """Tick the node; directly if it is a leaf, unless all nodes are ticked step by step."""
        if self.has_children or ticker.by_step:
            return super().tick(ticker)
        ticker.reach(self)
        return self.begin(ticker)

    def begin(self, ticker: Ticker) -> int:
        """Tick the node, unless a condition decides."""
        outcome = self.check_preconditions(ticker)
        return (
            self.tick_child(self.child, ticker)
            if outcome == INVALID
            else self.on_child_outcome(ticker, outcome)
        )

    def check_preconditions(self, ticker: Ticker) -> int:
        """Return the result of the pre-conditions in this tick; INVALID if the node has to be ticked."""
        behaviour, status = self.behaviour, ticker.cells[self.status_cell]
        if status == RUNNING:
            if self.goes_on is None or self.goes_on.holds():
                return INVALID
            self.stop(ticker)
            return self.report_decision("halted by _while", SKIPPED)
        if self.has_told:
            behaviour.feedback_message, self.has_told = "", False
        if not self.starts(ticker):
            return INVALID
        for script, attribute, outcome in self.before:
            if script.holds():
                return self.report_decision(f"decided by {attribute}", outcome)
        if self.goes_on is not None and not self.goes_on.holds():
            return self.report_decision("decided by _while", SKIPPED)
        return INVALID

    def report_decision(self, message: str, outcome: int) -> int:
        """Report the decisive condition, and return the outcome."""
        self.behaviour.feedback_message, self.has_told = message, True
        return outcome

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the node."""
        return self.on_child_outcome(ticker, outcome)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Run the post-conditions, and pass on the outcome."""
        if self.runs_after and outcome & ENDED:
            self.behaviour.run_after(outcome)
        return self.set_outcome(ticker, outcome)

    def write_status(self, cells: vec[i32]) -> None:
        """Set the behaviour's status if a condition has decided; the node sets any other."""
        if self.has_told:
            super().write_status(cells)

    def reset_outcome(self, ticker: Ticker) -> None:
        """Reset the shared outcome of both nodes."""
        super().reset_outcome(ticker)
        self.child.reset_outcome(ticker)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Return the node, if it runs."""
        self.was_running = ticker.cells[self.status_cell] == RUNNING
        return super().stop_first(ticker)

    def stop_last(self, ticker: Ticker) -> None:
        """Run the scripts for a halt, if the node was running."""
        if self.was_running:
            self.behaviour.run_after(INVALID)
        super().stop_last(ticker)
