"""Decorators of BehaviorTree.CPP that convert or store the outcome of their child, or prevent the child's start."""

from typing import Any

from librt.vecs import vec
from mypy_extensions import i32

from sar_compiler.runtime.kernel.cells import ENDED, INVALID, RUNNING, SKIPPED, WORDS, number_of
from sar_compiler.runtime.kernel.tree_nodes import ChildlessNode, DecoratorNode, NodeBuilder, Ticker, TreeNode
from sar_compiler.runtime.scripting import NodeScript


class TurningNode(DecoratorNode):
    """Replaces the outcome of its child.

    Attributes:
        turned: The replacement of each outcome. Attributes of the behaviour define the replacements of SUCCESS, FAILURE and SKIPPED.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        turned: list[int] = [WORDS.index(word) for word in part.behaviour.turned]
        self.turned = [INVALID, RUNNING, *turned]

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the replacement of the child's outcome."""
        return self.set_outcome(ticker, self.turned[outcome])


class SubTreeNode(DecoratorNode):
    """The root of a subtree, which returns the outcome of its child."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the child."""
        if ticker.cells[self.status_cell] == INVALID:
            ticker.cells[self.status_cell] = RUNNING
        return self.tick_child(self.child, ticker)


class RunOnceNode(DecoratorNode):
    """Ticks its child until the child has ended once.

    Attributes:
        final: The cell that stores the final outcome of the child. The outcome is never reset.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.final = part.cell(INVALID, keeps=True)

    def begin(self, ticker: Ticker) -> int:
        """Tick the child. If it has ended before, return the stored outcome or SKIPPED instead."""
        then_skip, final = self.behaviour.then_skip.get(), ticker.cells[self.final]
        if final == INVALID:
            return super().begin(ticker)
        self.behaviour.feedback_message = "has run"
        return SKIPPED if then_skip else self.set_outcome(ticker, final)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the child's outcome. If the child has ended, also store the outcome."""
        if outcome & ENDED:
            ticker.cells[self.final] = ticker.cells[self.status_cell] = outcome
        return outcome


class GuardedNode(DecoratorNode):
    """A decorator that checks whether its child may start. It does not check while the child is running.

    Attributes:
        child_runs: The cell that contains 1 while the child runs.
        why_not: The feedback message if the child is not allowed to start.
    """

    why_not = ""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.child_runs = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the child if the child is running or may start."""
        if ticker.cells[self.child_runs] or self.may_start(ticker):
            self.behaviour.feedback_message = ""
            return self.tick_child(self.child, ticker)
        self.behaviour.feedback_message = self.why_not
        return self.set_outcome(ticker, self.blocked_outcome())

    def may_start(self, ticker: Ticker) -> bool:
        """Return whether the child may start."""
        raise NotImplementedError

    def blocked_outcome(self) -> int:
        """Return the node's outcome if the child is not allowed to start."""
        raise NotImplementedError

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the child's outcome, and store whether the child is still running."""
        ticker.cells[self.child_runs] = int(outcome == RUNNING)
        return self.set_outcome(ticker, outcome)


class PreconditionNode(GuardedNode):
    """A decorator with a condition that decides whether its child may start."""

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
    """A decorator whose child may start if a blackboard entry was written since the last check.

    Attributes:
        seen: The cell that stores the entry's number of writes at the last check.
        unless_written: The outcome if the entry was not written.
    """

    why_not = "no update"

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.unless_written = WORDS.index(part.behaviour.unless_written)
        self.entry = watched_entry(part.behaviour)
        self.seen = part.cell(keeps=True)
        part.watch_entry(self.entry, self.seen)

    def may_start(self, ticker: Ticker) -> bool:
        """Return whether the entry was written since the last check."""
        return is_news(self.entry, self.seen, ticker)

    def blocked_outcome(self) -> int:
        """Return the node's outcome if the entry was not written."""
        return self.unless_written


def watched_entry(behaviour: Any) -> Any:
    """Return the entry that a behaviour checks. A port with a constant contains the key of this entry."""
    port = behaviour.entry
    return port.entry or behaviour.scope.resolve(str(port.get()))


def is_news(entry: Any, seen: int, ticker: Ticker) -> bool:
    """Return whether an entry was written since the last check, and store its current number of writes.

    Args:
        entry: The entry.
        seen: The cell that stores the entry's number of writes at the last check.
        ticker: The ticker.
    """
    if not entry.exists:
        return False
    before = ticker.cells[seen]
    ticker.cells[seen] = now = entry.stamp
    return bool(before != now)


class ConditionsNode(DecoratorNode):
    """A node for the pre- and postconditions of its child. Both nodes have the same status.

    Attributes:
        runs_after: Whether there are postconditions.
        has_children: Whether the child has children.
        has_message: Whether the behaviour may have a feedback message.
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
        self.has_message = True
        self.was_running = False

    def tick(self, ticker: Ticker) -> int:
        """Tick the node. Except in step-by-step mode, one call completes the tick if the child is a leaf."""
        if self.has_children or ticker.by_step:
            return super().tick(ticker)
        ticker.reach(self)
        return self.begin(ticker)

    def begin(self, ticker: Ticker) -> int:
        """Check the preconditions. If none of them determines the outcome, tick the child."""
        outcome = self.check_preconditions(ticker)
        return (
            self.tick_child(self.child, ticker)
            if outcome == INVALID
            else self.on_child_outcome(ticker, outcome)
        )

    def check_preconditions(self, ticker: Ticker) -> int:
        """Return the outcome that a precondition determines, or INVALID if the child has to be ticked."""
        behaviour, status = self.behaviour, ticker.cells[self.status_cell]
        if status == RUNNING:
            if self.goes_on is None or self.goes_on.holds():
                return INVALID
            self.stop(ticker)
            return self.report_decision("halted by _while", SKIPPED)
        if self.has_message:
            behaviour.feedback_message, self.has_message = "", False
        if not self.starts(ticker):
            return INVALID
        for script, attribute, outcome in self.before:
            if script.holds():
                return self.report_decision(f"decided by {attribute}", outcome)
        if self.goes_on is not None and not self.goes_on.holds():
            return self.report_decision("decided by _while", SKIPPED)
        return INVALID

    def report_decision(self, message: str, outcome: int) -> int:
        """Set the feedback message to *message*, and return *outcome*."""
        self.behaviour.feedback_message, self.has_message = message, True
        return outcome

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue the tick after the child was ticked. Do not reset the child, because it shares the status."""
        return self.on_child_outcome(ticker, outcome)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """If the outcome ends the node, run the postconditions. Return the outcome."""
        if self.runs_after and outcome & ENDED:
            self.behaviour.run_after(outcome)
        return self.set_outcome(ticker, outcome)

    def write_status(self, cells: vec[i32]) -> None:
        """Set the behaviour's status if a precondition determined it. Otherwise, the child's node sets it."""
        if self.has_message:
            super().write_status(cells)

    def reset_outcome(self, ticker: Ticker) -> None:
        """Reset the outcomes of the node and of its child."""
        super().reset_outcome(ticker)
        self.child.reset_outcome(ticker)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Return the child if the child is running."""
        self.was_running = ticker.cells[self.status_cell] == RUNNING
        return super().stop_first(ticker)

    def stop_last(self, ticker: Ticker) -> None:
        """If the node was running, run its postconditions for a halt."""
        if self.was_running:
            self.behaviour.run_after(INVALID)
        super().stop_last(ticker)
