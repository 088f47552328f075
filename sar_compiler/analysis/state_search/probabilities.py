"""Search nodes for leaves and timers with known probabilities and times.

Why time is part of the state: a leaf that runs for forty seconds below a Timeout of a minute always ends in time. A
probability for each tick could not express this, because it would not depend on how long the leaf has run. So the number
of remaining ticks (`TicksLeft`) of each running leaf and timer is stored in a cell.

Why a leaf chooses its outcome and duration when it starts: later choices would require the distribution of the leaf's
remaining duration, which differs in each tick. So there is one choice for each activation, as in `analysis.simulate`.
If other nodes have changed the facts in between, the chosen outcome may be impossible when it is due. Then the leaf
chooses among the outcomes that are possible at that time.

Why a weight has two parts: the probability of an outcome may only be known within bounds, and the solver varies it
(`predict.weighed_graph`). The share of each duration in the outcome's probability is fixed. So a step has the number of
a weight, which names the choice and the outcome and contains the share. A step can have only one weight, which
suffices because a tick is divided at each choice (`forking`). A choice while a node is halted is an exception, and is
rejected.

Why consecutive ticks in which only time passes are one step: otherwise a minute would take as many states as ticks.
Such ticks are recognised after a tick was played. If it made no choice and changed only the numbers of remaining
ticks, the next ticks do the same until the first of these times expires. So all of them except the last are skipped.
"""

import math
from typing import Any, Final, NamedTuple

from librt.vecs import vec
from mypy_extensions import i32, i64

from sar_compiler.analysis.state_search.forking import ForkingTicker
from sar_compiler.analysis.state_search.searching import NOTHING
from sar_compiler.analysis.state_search.stub_nodes import LeafNodes, Reply, StubNode
from sar_compiler.analysis.state_search.tick_steps import Judge, TickSteps
from sar_compiler.errors import SarError, UndecidableError
from sar_compiler.runtime.kernel.cells import INVALID, RUNNING, SKIPPED
from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, Ticker
from sar_compiler.runtime.outcomes import Outcome, probabilities

TOLERANCE_SEC: Final = 1e-6
"""The tolerance for comparing times in seconds, because floats represent multiples of the period inexactly."""


class TicksLeft:
    """The number of ticks until a time expires.

    Equal numbers share one object, so that states can be compared.

    Args:
        ticks: The number of ticks.
    """

    def __init__(self, ticks: int) -> None:
        self.ticks = ticks


class LimitUse:
    """Lets a condition decrease limits only once while the same situation lasts, such as a pause.

    A repeated outcome is evaluated with the limits before its first occurrence, and leaves the limits unchanged.

    Args:
        conditions: The numbers of the conditions that decrease limits.
        limits: The entries of the limits.
    """

    def __init__(self, conditions: set[int], limits: list[Any]) -> None:
        self._conditions = conditions
        self._limits = limits
        # For each condition of the last tick, and of the current tick: the outcome, and the limits before the outcome.
        self._last: dict[int, tuple[str, list[Any]]] = {}
        self._now: dict[int, tuple[str, list[Any]]] = {}

    def begin_tick(self) -> None:
        """Start or restart a tick."""
        self._now = {}

    def end_tick(self) -> None:
        """Make the outcomes of the current tick the outcomes of the last tick."""
        self._last = self._now

    def spend(self, index: int, found: str) -> list[Any]:
        """Reset the limits if an outcome is repeated, and return the current limits for `restore`.

        For any other outcome, nothing is changed, and the result is empty.

        Args:
            index: The number of the leaf.
            found: The outcome.
        """
        if index not in self._conditions:
            return []
        left = [limit.read() for limit in self._limits]
        last = self._last.get(index)
        if last is None or last[0] != found:
            self._now[index] = found, left
            return []
        self._now[index] = last
        self.restore(last[1])
        return left

    def restore(self, left: list[Any]) -> None:
        """Set the limits to the values that `spend` returned."""
        for limit, value in zip(self._limits, left, strict=False):
            limit.write(value)


class CountedTimes(Times):
    """Provides timers that expire after a number of ticks. The token of a timer is a `TicksLeft`.

    Args:
        period_sec: The time between two ticks, in seconds.
    """

    def __init__(self, period_sec: float) -> None:
        self._period_sec = period_sec
        self._known: dict[int, TicksLeft] = {}

    def ticks(self, seconds: float) -> int:
        """Convert a time in seconds to the number of ticks that this time takes, rounded up."""
        return max(0, math.ceil((seconds - TOLERANCE_SEC) / self._period_sec))

    def seconds(self, ticks: int) -> float:
        """Convert a number of ticks to seconds."""
        return ticks * self._period_sec

    def remaining_ticks(self, ticks: int) -> TicksLeft:
        """Return the `TicksLeft` object for a number of ticks."""
        known = self._known.get(ticks)
        if known is None:
            known = self._known[ticks] = TicksLeft(ticks)
        return known

    def start(self, index: int, seconds: float) -> Any:  # noqa: ARG002 - required by the protocol
        """Start a timer with a duration in seconds, and return its token."""
        return self.remaining_ticks(self.ticks(seconds))

    def is_up(self, index: int, token: Any) -> bool:  # noqa: ARG002
        """Return whether a timer has expired."""
        ticks: int = token.ticks
        return ticks == 0


class Choice(NamedTuple):
    """A choice among several outcomes of a leaf.

    Attributes:
        leaf: The index of the leaf.
        outcomes: The outcomes.
        bounds: The minimum and maximum probability of each outcome.
    """

    leaf: int
    outcomes: tuple[Outcome, ...]
    bounds: tuple[tuple[float, float], ...]


class TransitionProbability(NamedTuple):
    """The weight of one option of a choice. It is a share of the probability of an outcome.

    Attributes:
        choice: The number of the choice.
        outcome: The index of the outcome in the choice.
        share: The share of the outcome's probability.
    """

    choice: int
    outcome: int
    share: float


class ChoiceTable:
    """The choices that leaves have in the runs of a tree, with the weights of the options.

    Args:
        times: Converts durations to numbers of ticks.

    Attributes:
        choices: The choices, by number.
        weights: The weights, by the number in a step's `going_on`. Number 0 is the weight of a step without a choice.
    """

    def __init__(self, times: CountedTimes) -> None:
        self.times = times
        self.choices: list[Choice] = []
        self.weights: list[TransitionProbability] = [TransitionProbability(-1, 0, 1.0)]

    def spread(self, sec: tuple[float, float]) -> list[tuple[int, float]]:
        """Convert a uniformly distributed duration to the possible numbers of ticks and their probabilities."""
        least, most = sec
        first, last = self.times.ticks(least), self.times.ticks(most)
        if first == last:
            return [(first, 1.0)]
        bounds = [least, *(self.times.seconds(ticks) for ticks in range(first, last)), most]
        return [
            (first + place, (bounds[place + 1] - bounds[place]) / (most - least))
            for place in range(last - first + 1)
            if bounds[place + 1] > bounds[place]
        ]


class Option:
    """What a leaf can choose when it starts: an outcome, and the number of ticks until this outcome.

    Args:
        reply: The outcome.
        ticks: The number of ticks.
        weight: The number of the option's weight.
    """

    def __init__(self, reply: Reply, ticks: int, weight: int) -> None:
        self.reply = reply
        self.ticks = ticks
        self.weight = weight


class ProbabilisticLeaf(StubNode):
    """A leaf that chooses its outcome and duration when it starts, and returns RUNNING until the outcome is due.

    If the outcome is no longer possible when it is due, the leaf chooses again. A leaf that cannot return RUNNING takes
    no time.

    Args:
        part: The builder of the node.
        leaves: The shared context of all leaves.
        probabilities: The table to which choices are added.
    """

    def __init__(self, part: NodeBuilder, leaves: LeafNodes, probabilities: ChoiceTable) -> None:
        super().__init__(part, leaves)
        self._probabilities = probabilities
        self._chosen, self._left = part.value(None), part.value(None)
        self._known: dict[tuple[int, ...], list[Option]] = {}

    def branch_count(self, ticker: Ticker) -> int:
        """Return the number of options, or 1 if a condition raises an error.

        The tick then raises the same error.
        """
        try:
            replies = self._possible()
        except SarError:
            return 1
        return 1 if self._has_chosen(ticker, replies) else len(self._options(replies))

    def begin(self, ticker: Ticker) -> int:
        """Start the leaf if it is not running.

        Return the chosen outcome, or RUNNING until that outcome is due.
        """
        cells, values, trail = ticker.cells, ticker.values, self._trail
        self._ran.add(self.index)
        if cells[self.status_cell] != RUNNING:
            trail.add_event(self._started)
        reply = self._apply_reply(self._chosen_reply(ticker, self._possible()))
        outcome = reply.outcome
        if outcome != RUNNING:
            values[self._chosen] = values[self._left] = None
        if outcome != SKIPPED:
            cells[self.status_cell] = outcome
        return outcome

    def _chosen_reply(self, ticker: Ticker, replies: list[Reply]) -> Reply:
        """Return the chosen outcome, or RUNNING until the outcome is due."""
        values = ticker.values
        if not self._has_chosen(ticker, replies):
            self._choose(ticker, self._options(replies))
        running = [reply for reply in replies if reply.outcome == RUNNING]
        if running and values[self._left].ticks:
            return running[0]
        chosen: Reply = values[self._chosen]
        return chosen

    def stop(self, ticker: Ticker) -> None:
        """Halt the leaf if it is running."""
        cells, values = ticker.cells, ticker.values
        if cells[self.status_cell] == RUNNING:
            self._trail.add_event(self._halted)
        values[self._chosen] = values[self._left] = None
        cells[self.status_cell] = INVALID

    def _has_chosen(self, ticker: Ticker, replies: list[Reply]) -> bool:
        """Return whether the leaf has chosen an outcome that is still possible or not yet due."""
        values = ticker.values
        chosen = values[self._chosen]
        return chosen is not None and (values[self._left].ticks > 0 or chosen in replies)

    def _choose(self, ticker: Ticker, options: list[Option]) -> None:
        option = options[self._choices.pick(len(options))]
        if len(options) > 1:
            if self._trail.going_on:
                message = (
                    f"'{self.behaviour.name}' has several outcomes with probabilities while another node ends (catch_on_halt), "
                    "which cannot be computed. Declare only one outcome of the leaf, or outcomes without p"
                )
                raise UndecidableError(message)
            self._trail.going_on = option.weight
        ticker.values[self._chosen] = option.reply
        ticker.values[self._left] = self._probabilities.times.remaining_ticks(option.ticks)

    def _options(self, replies: list[Reply]) -> list[Option]:
        """Return the leaf's options, given the outcomes that are possible now."""
        place = tuple([reply.event for reply in replies])
        known = self._known.get(place)
        if known is None:
            known = self._known[place] = self._create_options(replies)
        return known

    def _ending_replies(self, replies: list[Reply]) -> list[Reply]:
        """Return the outcomes that the leaf can choose. Exclude RUNNING if any other outcome is possible."""
        return [reply for reply in replies if reply.outcome != RUNNING] or replies[:1]

    def _create_options(self, replies: list[Reply]) -> list[Option]:
        ending = self._ending_replies(replies)
        outcomes = tuple([reply.declared for reply in ending])
        given, options = self._probabilities, []
        given.choices.append(Choice(self.index, outcomes, tuple(probabilities(outcomes))))
        for place, reply in enumerate(ending):
            if given.choices[-1].bounds[place][1] == 0.0:
                continue
            for ticks, share in given.spread(reply.declared.sec):
                given.weights.append(TransitionProbability(len(given.choices) - 1, place, share))
                options.append(Option(reply, ticks, len(given.weights) - 1))
        return options


class WeighedSteps(TickSteps):
    """The steps of a tree, each with a known probability.

    Consecutive ticks in which only time passes form one step.

    `waits` contains the number of a step's weight, or the negative number of ticks if only time passes in the step.

    Args:
        flat: The tree.
        ticker: Ticks the tree.
        judge: Judges a state.
        judged_by: The places of the entries that *judge* reads.
        times: Converts durations to numbers of ticks.
    """

    def __init__(
        self, flat: FlatTree, ticker: ForkingTicker, judge: Judge, judged_by: list[int], times: CountedTimes
    ) -> None:
        super().__init__(flat, ticker, judge, judged_by, forgets=True)
        self._times = times
        self._is_over = False
        self._cells = vec[i32]()
        self._values: list[Any] = []
        self._watched = 0

    def enter(self, state: bytes, *, alone: bool = False, path: tuple[int, ...] = ()) -> None:
        """Restore a state in order to play its ticks; see `TickSteps.enter`."""
        super().enter(state, alone=alone, path=path)
        self._is_over = self.judge(state, None).ends
        ticker = self._ticker
        self._cells, self._values = ticker.cells[:], ticker.values[:]
        self._watched = ticker.trail.watched

    def step(self) -> int:
        """Play the next step, and return its kind; see `TickSteps.step`."""
        return NOTHING if self._is_over else super().step()

    def save_state(self, outcome: int) -> None:
        """Save the state after a tick and after any subsequent ticks in which only time passes."""
        ticker = self._ticker
        ticker.entries.update_contents()
        self._pass_by(1)
        passed = self._count_waiting_ticks() if ticker.choices.choice_count == 0 else 0
        if passed:
            self._pass_by(passed)
        super().save_state(outcome)
        if passed:
            self.waits = -1 - passed, 0, 0

    def _pass_by(self, ticks: int) -> None:
        """Let a number of ticks pass: decrease the remaining ticks of all running leaves and timers."""
        values = self._ticker.values
        for place, value in enumerate(values):
            if isinstance(value, TicksLeft) and value.ticks:
                values[place] = self._times.remaining_ticks(value.ticks - ticks)

    def _count_waiting_ticks(self) -> int:
        """Return the number of next ticks in which only time passes, or 0 if more happened in the last tick."""
        ticker, least = self._ticker, 0
        if ticker.trail.watched != self._watched or ticker.trail.broken:
            return 0
        if not (_are_equal(ticker.cells, self._cells) and _are_equal(ticker.entries.now, self._entries)):
            return 0
        for now, before in zip(ticker.values, self._values, strict=True):
            if isinstance(now, TicksLeft) and isinstance(before, TicksLeft):
                # An expired timer is not read again, but a timer that expires now may have an effect.
                if now.ticks != before.ticks - 1 and (now.ticks or before.ticks):
                    return 0
                if before.ticks and (not least or before.ticks < least):
                    least = before.ticks
            elif now != before:
                return 0
        return max(least - 1, 0)


def _are_equal(some: vec[i32], others: vec[i32]) -> bool:
    index: i64 = 0
    if len(some) != len(others):
        return False
    while index < len(some):
        if some[index] != others[index]:
            return False
        index += 1
    return True
