"""Provides the ticks of a tree as the steps of a search."""

from collections.abc import Callable

from sar_compiler.analysis.state_search.forking import ENTERED, KNOWN, ForkingTicker
from sar_compiler.analysis.state_search.searching import (
    A_MIDDLE,
    A_NEW_MIDDLE,
    A_STATE,
    LEFT,
    NOTHING,
    Judgement,
    Stepper,
)
from sar_compiler.analysis.state_search.state_code import StateCode
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.entry_cells import Memo
from sar_compiler.runtime.kernel.tree import FlatTree

Judge = Callable[[int, int, bool | None], Judgement]
"""A function that judges a state. Its arguments are the outcome of the last tick, the state of the properties, and
whether every tick leaves the state unchanged, or None if this is unknown. The function always reads the same blackboard
entries.
"""


class TickSteps(Stepper):
    """The steps of a search between the states of a tree. The steps are all possible ticks of the tree.

    Args:
        flat: The tree.
        ticker: Ticks the tree.
        judge: Judges a state.
        judged_by: The places of the entries that *judge* reads.
        forgets: Whether states forget the last statuses of nodes that make no difference between ticks.

    Attributes:
        outcome: The outcome of the last complete tick; INVALID if it raised an error.
    """

    def __init__(
        self, flat: FlatTree, ticker: ForkingTicker, judge: Judge, judged_by: list[int], *, forgets: bool
    ) -> None:
        super().__init__()
        self._flat = flat
        self._ticker = ticker
        heeded = {node.status_cell for node in flat.nodes if node.heeds_end}
        forgotten = [index not in heeded for index in range(len(flat.nodes))] if forgets else []
        self._code = StateCode(ticker.cells, ticker.values, forgotten)
        ticker.ignore_statuses(forgotten)
        self._judge = judge
        self._judged_by = judged_by
        self._judged: dict[int, Memo] = {}
        self._question: tuple[int, int, bool | None] = (0, 0, None)
        self._ask: Callable[[], Judgement] = self._judge_tick
        self._is_fresh = True
        # The state whose ticks are played, and the head of the state's code, for judging the state again.
        self._entered, self._entered_head = b"", (0, 0)
        self._entries = ticker.entries.now
        self._first = self._write_state(0, 0)
        self.state = self._first
        self.outcome = 0

    def start(self) -> bytes:
        """Return the initial state."""
        return self._first

    def path(self) -> tuple[int, ...]:
        """Return the choices of the last step."""
        return self._ticker.choices.path

    def enter(self, state: bytes, *, alone: bool = False, path: tuple[int, ...] = ()) -> None:
        """Restore a state so that the ticks that start in it can be played.

        Args:
            state: The state.
            alone: Whether to play all ticks to their ends, even if ticks of other states have reached the same
                intermediate states.
            path: The choices of the first tick; if given, no other tick must be played.
        """
        self._entered_head = self.restore(state)
        self._entered, self._entries = state, self._ticker.entries.now[:]
        self._ticker.middles = None if alone else self.middles
        self._ticker.begin(self._flat.nodes[0], self._entered_head[1], path)
        self._is_fresh = True

    def step(self) -> int:
        """Play the next step, and return the kind of step.

        Raises:
            UndecidableError: If the ticks of the tree cannot be enumerated.
        """
        ticker = self._ticker
        while True:
            if not self._is_fresh:
                self.left = ticker.next_fork()
                if self.left < 0:
                    return NOTHING
                if self.left:
                    self._is_fresh = True
                    return LEFT
            self._is_fresh = False
            self.state, self.error = None, None
            self.outcome = self.broken = 0
            try:
                outcome = ticker.play()
                if outcome < KNOWN:
                    self._flat.copy_shared_statuses(ticker)
                    self._flat.renumber(ticker)
                    self.save_state(outcome)
                    return A_STATE
            except UndecidableError:
                raise
            except Exception as error:  # noqa: BLE001 - any error of a node would end the mission
                self.error = error
                return A_STATE
            if ticker.middles is not None:
                self.middle, self.waits = ticker.middle, ticker.waits
                self._is_fresh = outcome == ENTERED
                return A_NEW_MIDDLE if self._is_fresh else A_MIDDLE

    def save_state(self, outcome: int) -> None:
        """Encode the current contents of the cells as the state after a tick."""
        ticker = self._ticker
        self.state = self._write_state(outcome, ticker.trail.watched)
        self.outcome, self.waits, self.broken = outcome, ticker.waits, ticker.trail.broken

    def judge(self, state: bytes, idle: bool | None) -> Judgement:
        """Determine whether a run is over in a state, and which rules the state violates.

        Args:
            state: The state.
            idle: Whether every tick leaves the state unchanged; None if that is not known yet.
        """
        if state is self.state:
            outcome, watched = self.outcome, self._ticker.trail.watched
        elif state is self._entered:
            outcome, watched = self._entered_head
            self._ticker.entries.restore(self._entries)
        else:
            outcome, watched = self.restore(state)
        self._question = outcome, watched, idle
        place = (watched * 3 + (2 if idle is None else int(idle))) * len(WORDS) + outcome
        memo = self._judged.get(place)
        if memo is None:
            memo = self._judged[place] = Memo(self._ticker.entries, self._judged_by)
        judgement: Judgement = memo.call(self._ask)
        return judgement

    def _judge_tick(self) -> Judgement:
        outcome, watched, idle = self._question
        return self._judge(outcome, watched, idle)

    def restore(self, state: bytes) -> tuple[int, int]:
        """Restore a state of the tree. Return the outcome of the last tick and the state of the properties."""
        ticker = self._ticker
        ticker.entries.clear()
        ticker.cells = self._code.read(state, ticker.values, ticker.entries.now)
        return self._code.head(state)

    def _write_state(self, outcome: int, watched: int) -> bytes:
        ticker = self._ticker
        ticker.entries.update_contents()
        return self._code.write(outcome, watched, ticker.cells, ticker.values, ticker.entries.now)
