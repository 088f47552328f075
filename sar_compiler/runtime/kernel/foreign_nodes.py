"""Controls and decorators of a user's classes in a tree whose states are put back: they are ticked by their own methods."""

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.kernel.cells import INVALID, SKIPPED, STATUSES, WORDS, number_of
from sar_compiler.runtime.kernel.choices import Choices, UnsteadyError
from sar_compiler.runtime.kernel.leaf_nodes import StrictUpdate
from sar_compiler.runtime.kernel.trail import Trail
from sar_compiler.runtime.kernel.tree_nodes import Part, Ticker, TreeNode, show_statuses
from sar_compiler.runtime.pausing import PAUSE, Called

_INVALID: Final[Any] = Status.INVALID


class Claim:
    """What the record of a class says of its objects.

    Args:
        outcomes: The outcomes that a tick can have, as bits by their numbers.
        goes_on: The outcome after which the next child is ticked, where children are ticked in order; 0 for no such.
    """

    def __init__(self, outcomes: int, goes_on: int = 0) -> None:
        self.outcomes = outcomes
        self.goes_on = goes_on


class ForeignObjects:
    """The behaviours of a tree that are ticked by their own methods, which the nodes below them are called by.

    While one of them is ticked or stopped, the statuses of all behaviours are what the cells say; what it does to these, and
    what it remembers itself, is taken over into cells afterwards.

    Args:
        memory: Takes what these behaviours remember, and puts it back.
        choices: Decide whether a time is up that one of them looks at.
        trail: Is told what is waited for, and that a claim is wrong.
        claims: What is claimed of them.
        rule: The number of the property that all claims are right.

    Attributes:
        wrong: What was done first that a claim excludes, in words; empty if nothing was.
    """

    def __init__(
        self, memory: Any, choices: Choices, trail: Trail, claims: Mapping[Any, Claim], rule: int
    ) -> None:
        self.wrong = ""
        self._claims = claims
        self._rule = rule
        self.memory = memory
        self._choices = choices
        self._trail = trail
        self._opened: list[int] = []
        # For each that is open, what it depended on when it paused last; None if it has not.
        self._pauses: list[Any] = []
        self._is_paused = False
        # The pauses of the tick in hand and of the one played before: how deep they were, and after how many choices.
        self._log: list[tuple[int, int]] = []
        self._log_before: list[tuple[int, int]] = []
        self._turn = -1
        self._is_merging = False
        self.kept = -1
        self._nodes: list[TreeNode] = []
        self._indexes: dict[Any, int] = {}
        # What behaviours below them show of themselves besides their statuses, which they may look at.
        self._shown: list[tuple[Any, str, Any]] = []
        self._children: list[tuple[Any, list[Any]]] = []
        self._ticker: Ticker | None = None
        self._failure: UndecidableError | None = None
        # What the behaviours remember at the moment, as it is in a cell; None while that is not known.
        self._held: Any = None

    def add(self, part: Part) -> None:
        """Add one of them, all below it being there already."""
        if self.kept < 0:
            self._held = (self.memory.taken(), ())
            self.kept = part.value(self._held)
        self._children.append((part.behaviour, list(part.behaviour.children)))
        part.behaviour.update = StrictUpdate(part.behaviour)
        for child in part.children:
            _heed(child)

    def call_through(self, nodes: list[TreeNode]) -> None:
        """Have the nodes below these behaviours ticked and stopped where their behaviours are asked to.

        Args:
            nodes: All nodes of the tree.
        """
        self._nodes = nodes
        others = {node.behaviour: node for node in nodes}
        for node in nodes:
            if isinstance(node, ForeignParentNode):
                self._indexes[node.behaviour] = node.index
                self._call_below(node)
                for value in vars(node.behaviour).values():
                    # A node that it refers to, wherever that stands.
                    if (
                        isinstance(value, Behaviour)
                        and value in others
                        and value is not node.behaviour.parent
                    ):
                        _heed(others[value])

    def _call_below(self, around: TreeNode) -> None:
        below = around.children[:]
        while below:
            node = below.pop()
            behaviour = node.behaviour
            called = Called(behaviour, partial(self.run, node), partial(self.halt, node), self.fail)
            behaviour.tick, behaviour.stop = called.tick, called.stop
            if node.is_skippable:
                self._shown.append((behaviour, "skipped", False))
            if not isinstance(node, ForeignParentNode):
                if hasattr(behaviour, "current_child"):
                    self._shown.append((behaviour, "current_child", None))
                below.extend(node.children)

    def values(self, ticker: Ticker) -> dict[str, Any]:
        """Return what they remember in the state that the cells have, by the names of the behaviour and the attribute."""
        if self.kept < 0:
            return {}
        self.memory.put_back(ticker.values[self.kept][0])
        self._held = None
        values: dict[str, Any] = self.memory.values()
        return values

    def unsteady(self, first: Any, second: Any) -> str:
        """Return what to say of a tick that was played twice in the same state, and did not do the same.

        Args:
            first: What was kept after it at first.
            second: What was kept after it then.
        """
        where = self.memory.difference(first[0], second[0])
        classes = ", ".join(sorted({type(behaviour).__qualname__ for behaviour, _ in self._children}))
        what = where or f"something in {classes}"
        return (
            f"the tree does not do the same in the same state: {what}, when the same tick was played twice; what a class does must "
            "follow from its attributes and from what it ticks: no time but that of a parameter 'clock: Clock', no chance, nothing "
            "that is kept in the class or in its module"
        )

    def look(self, has_begun: bool | None) -> bool:
        """Choose whether a time is up that the behaviour in hand looks at.

        Args:
            has_begun: Whether it has begun in an earlier tick, so that it is up one day; None if that is not known.
        """
        is_up = self._choices.pick(2) == 1
        if self._pauses:
            # What it has seen then may be in a variable.
            self._pauses[-1] = None
        if has_begun is not None and self._opened:
            bit = self._trail.bit(self._opened[-1])
            if has_begun and not is_up:
                self._trail.going_on |= bit
            else:
                self._trail.changed |= bit
        return is_up

    def whose(self) -> str:
        """Return which behaviour is in hand, in words."""
        if not self._opened:
            return "a node"
        behaviour = self._nodes[self._opened[-1]].behaviour
        return f"'{behaviour.name}' ({type(behaviour).__module__}.{type(behaviour).__qualname__})"

    def open(self, ticker: Ticker, index: int) -> None:
        """Give the behaviours what the cells say, before one of them is ticked or stopped."""
        if not self._opened:
            self._ticker, self._failure = ticker, None
            kept = ticker.values[self.kept]
            if kept is not self._held:
                self.memory.put_back(kept[0])
                for place, (behaviour, name, first) in enumerate(self._shown):
                    setattr(behaviour, name, kept[1][place] if kept[1] else first)
            self._held = None
        self._opened.append(index)
        self._pauses.append(None)
        self.show()

    def close(self) -> None:
        """Leave the one that was opened last."""
        self._opened.pop()
        self._pauses.pop()

    def pause(self, generator: Any) -> None:
        """Note all that the behaviour in hand depends on, which pauses before it ticks a child."""
        self._is_paused = True
        place, depth = len(self._log), len(self._opened)
        self._log.append((depth, self._choices.asked))
        if self._is_merging and not self._is_passed(place, depth):
            self._pauses[-1] = self.memory.snapshot(generator)
        else:
            self._pauses[-1] = None

    def _is_passed(self, place: int, depth: int) -> bool:
        """Return whether a pause comes before everything that was not played before."""
        before = self._log_before
        for index in range(place + 1, len(before)):
            if before[index][0] <= depth:
                return before[index][1] <= self._turn
        return False

    def begin_play(self, *, is_merging: bool) -> None:
        """Begin to play a tick, or the rest of one.

        Args:
            is_merging: Whether anybody will ask what goes on in it.
        """
        self._log_before, self._log = self._log, []
        self._turn = self._choices.turn
        self._is_merging = is_merging

    def now(self) -> Any:
        """Return all that goes on in the behaviours that are ticked at the moment; None if that cannot be said."""
        if None in self._pauses:
            return None
        remembered = self.memory.snapshot(None)
        shown = tuple([getattr(behaviour, name) for behaviour, name, _ in self._shown])
        return None if remembered is None else (tuple(self._pauses), remembered, shown)

    def take(self) -> None:
        """Take over what one of them did, into the cells.

        Raises:
            UndecidableError: If that cannot be done, or if it has kept such an error to itself.
        """
        ticker = self._ticker
        assert ticker is not None  # noqa: S101 - one of them was opened
        if self._failure is not None:
            raise self._failure
        self.take_statuses()
        for behaviour, children in self._children:
            if behaviour.children != children:
                message = (
                    f"'{behaviour.name}' has other children than it had when it was made: what is in a tree must remain "
                    "there, or its runs cannot be gone through"
                )
                raise UnsteadyError(message)
        if not self._opened:
            shown = tuple([getattr(behaviour, name) for behaviour, name, _ in self._shown])
            is_as_first = shown == tuple([first for _, _, first in self._shown])
            self._held = ticker.values[self.kept] = (self.memory.taken(), () if is_as_first else shown)
            for behaviour in self.memory.dated:
                # Who looks at a time that begins anew in every tick waits for ever.
                self._trail.changed |= self._trail.bit(self._indexes[behaviour])

    def take_statuses(self) -> None:
        """Take over the statuses; a node whose status was changed forgets where it was."""
        ticker = self._ticker
        assert ticker is not None  # noqa: S101 - one of them was opened
        cells = ticker.cells
        changed = [node for node in self._nodes if node.behaviour.status is not STATUSES[cells[node.at]]]
        for node in changed:
            cells[node.at] = number_of(node.behaviour.status)
        for node in changed:
            node.forget(ticker)

    def show(self) -> None:
        """Give the behaviours the statuses that the cells say."""
        assert self._ticker is not None  # noqa: S101 - one of them was opened
        show_statuses(self._nodes, self._ticker.cells)

    def check_order(self, node: TreeNode) -> None:
        """See whether the behaviour in hand may tick a child now."""
        around = self._nodes[self._opened[-1]]
        claim = self._claims.get(around.behaviour)
        place = around.children.index(node) if node in around.children else 0
        if claim is None or not claim.goes_on or not place:
            return
        before = around.children[place - 1]
        outcome = (
            SKIPPED if getattr(before.behaviour, "skipped", False) else number_of(before.behaviour.status)
        )
        if outcome not in (claim.goes_on, SKIPPED, INVALID):
            what = f"ticked '{node.behaviour.name}' although '{before.behaviour.name}' had returned {WORDS[outcome]}"
            self._deny(f"{what}; its record has it go on only after {WORDS[claim.goes_on]}")

    def check_outcome(self, outcome: int) -> None:
        """See whether the behaviour in hand may have an outcome."""
        claim = self._claims.get(self._nodes[self._opened[-1]].behaviour)
        if claim is not None and not claim.outcomes >> outcome & 1:
            listed = ", ".join([word for number, word in enumerate(WORDS) if claim.outcomes >> number & 1])
            self._deny(f"returned {WORDS[outcome]}; by its record it returns {listed or 'nothing'} here")

    def _deny(self, what: str) -> None:
        """Note that the behaviour in hand did what its record excludes."""
        self._trail.broken |= 1 << self._rule
        if not self.wrong:
            self.wrong = f"{self.whose()} {what}: mend its outcomes or semantics, which checks rely on"

    def run(self, node: TreeNode) -> None:
        """Tick a node below one of them."""
        self.take_statuses()
        self.check_order(node)
        if not self._is_paused:
            # Nobody has seen the pause, so what goes on around the child is not known.
            self._pauses[-1] = None
        self._is_paused = False
        ticker = self._ticker
        assert ticker is not None  # noqa: S101 - one of them was opened
        try:
            outcome = ticker.run(node)
        except UndecidableError as error:
            self._failure = error
            raise
        if node.is_skippable:
            node.behaviour.skipped = outcome == SKIPPED
        self.show()

    def fail(self, error: UndecidableError) -> None:
        """Note what went wrong where nothing can be raised."""
        if self._opened:
            self._failure = error

    def halt(self, node: TreeNode, status: Any) -> None:
        """Stop a node below one of them; one that is ticked by its own methods may stop itself in the middle of these."""
        if isinstance(node, ForeignParentNode) and node.is_open:
            node.own_stop(status)
            return
        self.take_statuses()
        ticker = self._ticker
        assert ticker is not None  # noqa: S101 - one of them was opened
        try:
            if isinstance(node, ForeignParentNode):
                node.halt(ticker, status)
            elif status is _INVALID:
                node.stop(ticker)
            else:
                ticker.cells[node.at] = number_of(status)
                node.forget(ticker)
        except UndecidableError as error:
            self._failure = error
            raise
        self.show()


def _heed(node: TreeNode) -> None:
    """Have it matter how a node, and those below it, have ended: somebody may look at that."""
    below = [node]
    while below:
        node = below.pop()
        node.heeds_end = True
        below.extend(node.children)


class ForeignParentNode(TreeNode):
    """A control or decorator that is ticked by its own methods, over nodes of the tree.

    Args:
        part: What it is built of.
        objects: What such nodes of a tree share.

    Attributes:
        is_open: Whether it is being ticked or stopped.
    """

    def __init__(self, part: Part, objects: ForeignObjects) -> None:
        super().__init__(part)
        self.heeds_end = True
        self.is_open = False
        self._objects = objects
        objects.add(part)

    def begin(self, ticker: Ticker) -> int:
        """Tick the behaviour."""
        behaviour = self.behaviour
        self._open(ticker)
        try:
            tick = type(behaviour).tick(behaviour)
            for each in tick:
                if each is PAUSE:
                    self._objects.pause(tick)
            outcome = number_of(behaviour.status)
            if outcome == INVALID or getattr(behaviour, "skipped", False):
                outcome = SKIPPED
            self._objects.check_outcome(outcome)
        finally:
            self._close()
        self._objects.take()
        return outcome

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Stop the behaviour, which stops those below it."""
        self.halt(ticker, _INVALID)
        return []

    def stop_last(self, ticker: Ticker) -> None:
        """Do nothing more: it has stopped."""

    def halt(self, ticker: Ticker, status: Any) -> None:
        """Stop the behaviour with a status."""
        self._open(ticker)
        try:
            self.own_stop(status)
        finally:
            self._close()
        self._objects.take()

    def own_stop(self, status: Any) -> None:
        """Call the behaviour's own method."""
        type(self.behaviour).stop(self.behaviour, status)

    def _open(self, ticker: Ticker) -> None:
        self._objects.open(ticker, self.index)
        self.is_open = True

    def _close(self) -> None:
        self.is_open = False
        self._objects.close()
