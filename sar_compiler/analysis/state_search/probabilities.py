"""Leaves and timers whose chances and times are known, so that runs can be weighed: the same search as that of all runs, with other nodes.

What is known of time is how many ticks are left, and that is part of the state: a leaf that runs for forty seconds and a Timeout of a minute
meet as they do in flight, which chances for each tick could not tell. A tick in which nothing happens but that time passes is followed by more of
them until the next time is up; these are one step, so a minute takes no more states than a second.

What a leaf answers, and how long that takes, is chosen when it begins, as `checks.simulate` does.
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
from sar_compiler.runtime.answers import Answer, probabilities
from sar_compiler.runtime.kernel.cells import INVALID, RUNNING, SKIPPED
from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, Ticker

TOLERANCE_SEC: Final = 1e-6
"""Ticks come at multiples of the period, which floats hit only nearly."""


class TicksLeft:
    """A number of ticks until a time is up. Equal ones are the same object, so that states can be compared.

    Args:
        ticks: The number.
    """

    def __init__(self, ticks: int) -> None:
        self.ticks = ticks


class LimitUse:
    """What takes from limits in a run that is followed: what a condition finds in one tick after the other (a mission that is held) takes once.

    Such an answer is possible as it was when it came first, and leaves the limits as they are.

    Args:
        conditions: The numbers of the conditions that take from limits.
        limits: The entries of the limits.
    """

    def __init__(self, conditions: set[int], limits: list[Any]) -> None:
        self._conditions = conditions
        self._limits = limits
        # Of each that was ticked in the last tick, and in this one: what it has found, and what was left of the limits before.
        self._last: dict[int, tuple[str, list[Any]]] = {}
        self._now: dict[int, tuple[str, list[Any]]] = {}

    def begin_tick(self) -> None:
        """Begin a tick, or begin it anew."""
        self._now = {}

    def end_tick(self) -> None:
        """Note that the tick was so."""
        self._last = self._now

    def before(self, index: int, found: str) -> list[Any]:
        """Return what is left of the limits, if a leaf finds what it has found in the last tick; from now on they are as they were before that.

        Args:
            index: The number of the leaf.
            found: What it finds.
        """
        if index not in self._conditions:
            return []
        left = [limit.read() for limit in self._limits]
        last = self._last.get(index)
        if last is None or last[0] != found:
            self._now[index] = found, left
            return []
        self._now[index] = last
        self.after(last[1])
        return left

    def after(self, left: list[Any]) -> None:
        """Make the limits what was left of them, as `before` has returned it."""
        for limit, value in zip(self._limits, left, strict=False):
            limit.write(value)


class CountedTimes(Times):
    """Timers that are up after a number of ticks, whose tokens are `TicksLeft`.

    Args:
        period_sec: The time between two ticks, seconds.
    """

    def __init__(self, period_sec: float) -> None:
        self._period_sec = period_sec
        self._known: dict[int, TicksLeft] = {}

    def ticks(self, seconds: float) -> int:
        """Return after how many ticks a time is up."""
        return max(0, math.ceil((seconds - TOLERANCE_SEC) / self._period_sec))

    def seconds(self, ticks: int) -> float:
        """Return how long a number of ticks takes."""
        return ticks * self._period_sec

    def left(self, ticks: int) -> TicksLeft:
        """Return what stands for a number of ticks."""
        known = self._known.get(ticks)
        if known is None:
            known = self._known[ticks] = TicksLeft(ticks)
        return known

    def start(self, index: int, seconds: float) -> Any:  # noqa: ARG002 - as the protocol has it
        """Start a timer, in seconds."""
        return self.left(self.ticks(seconds))

    def is_up(self, index: int, token: Any) -> bool:  # noqa: ARG002
        """Return whether a timer's time is over."""
        ticks: int = token.ticks
        return ticks == 0


class Choice(NamedTuple):
    """A choice among answers of a leaf.

    Attributes:
        leaf: The index of the leaf.
        answers: What it chooses among.
        bounds: How likely each is, at least and at most.
    """

    leaf: int
    answers: tuple[Answer, ...]
    bounds: tuple[tuple[float, float], ...]


class TransitionProbability(NamedTuple):
    """The weight of one way to go on after a choice.

    Attributes:
        choice: The number of the choice.
        answer: Which of its answers it is.
        share: Which part of this answer's chance goes this way.
    """

    choice: int
    answer: int
    share: float


class ChoiceTable:
    """The choices that leaves have in the runs of a tree, and what their ways to go on weigh.

    Args:
        times: Counts their ticks.

    Attributes:
        choices: The choices, by their numbers.
        weights: The weights, by the number that a step has in `going_on`; none has 0.
    """

    def __init__(self, times: CountedTimes) -> None:
        self.times = times
        self.choices: list[Choice] = []
        self.weights: list[TransitionProbability] = [TransitionProbability(-1, 0, 1.0)]

    def spread(self, sec: tuple[float, float]) -> list[tuple[int, float]]:
        """Return the numbers of ticks that a time takes which is as likely to be any between two, each with its share."""
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
    """A way for a leaf to go on: what it will answer, and after how many ticks.

    Args:
        reply: The answer.
        ticks: The ticks.
        weight: The number of its weight.
    """

    def __init__(self, reply: Reply, ticks: int, weight: int) -> None:
        self.reply = reply
        self.ticks = ticks
        self.weight = weight


class ProbabilisticLeaf(StubNode):
    """A leaf that chooses when it begins what it will answer, and after how many ticks; until then it answers RUNNING.

    If that answer is not possible any more when its time has come, it chooses again. One that cannot answer RUNNING takes no time.

    Args:
        part: What it is built of.
        leaves: What the leaves of a tree share.
        chances: Is told of each choice.
    """

    def __init__(self, part: NodeBuilder, leaves: LeafNodes, probabilities: ChoiceTable) -> None:
        super().__init__(part, leaves)
        self._probabilities = probabilities
        self._chosen, self._left = part.value(None), part.value(None)
        self._known: dict[tuple[int, ...], list[Option]] = {}

    def ways(self, ticker: Ticker) -> int:
        """Return in how many ways it may go on; if that cannot be said, its tick will say why."""
        try:
            replies = self._possible()
        except SarError:
            return 1
        return 1 if self._in_hand(ticker, replies) else len(self._options(replies))

    def begin(self, ticker: Ticker) -> int:
        """Start the leaf, unless it runs; answer what it has chosen, or RUNNING until its time has come."""
        cells, values, trail = ticker.cells, ticker.values, self._trail
        self._ran.add(self.index)
        if cells[self.at] != RUNNING:
            trail.take(self._started)
        reply = self._taken(self._chosen_reply(ticker, self._possible()))
        outcome = reply.outcome
        if outcome != RUNNING:
            values[self._chosen] = values[self._left] = None
        if outcome != SKIPPED:
            cells[self.at] = outcome
        return outcome

    def _chosen_reply(self, ticker: Ticker, replies: list[Reply]) -> Reply:
        """Return what it has chosen, or RUNNING until its time has come."""
        values = ticker.values
        if not self._in_hand(ticker, replies):
            self._choose(ticker, self._options(replies))
        running = [reply for reply in replies if reply.outcome == RUNNING]
        if running and values[self._left].ticks:
            return running[0]
        chosen: Reply = values[self._chosen]
        return chosen

    def stop(self, ticker: Ticker) -> None:
        """Halt the leaf if it runs."""
        cells, values = ticker.cells, ticker.values
        if cells[self.at] == RUNNING:
            self._trail.take(self._halted)
        values[self._chosen] = values[self._left] = None
        cells[self.at] = INVALID

    def _in_hand(self, ticker: Ticker, replies: list[Reply]) -> bool:
        """Return whether there is nothing to choose: it has chosen, and the answer is possible or not due."""
        values = ticker.values
        chosen = values[self._chosen]
        return chosen is not None and (values[self._left].ticks > 0 or chosen in replies)

    def _choose(self, ticker: Ticker, options: list[Option]) -> None:
        option = options[self._choices.pick(len(options))]
        if len(options) > 1:
            if self._trail.going_on:
                message = (
                    f"'{self.behaviour.name}' answers by chance while it is ticked in the middle of another node's end, as by catch_on_halt; "
                    "how likely that is cannot be computed: give it one answer, or none by chance"
                )
                raise UndecidableError(message)
            self._trail.going_on = option.weight
        ticker.values[self._chosen] = option.reply
        ticker.values[self._left] = self._probabilities.times.left(option.ticks)

    def _options(self, replies: list[Reply]) -> list[Option]:
        """Return the ways to go on that there are with some answers."""
        place = tuple([reply.event for reply in replies])
        known = self._known.get(place)
        if known is None:
            known = self._known[place] = self._work_out_options(replies)
        return known

    def _ending(self, replies: list[Reply]) -> list[Reply]:
        """Return what it can choose of some answers; one that only ever runs answers RUNNING for ever."""
        return [reply for reply in replies if reply.outcome != RUNNING] or replies[:1]

    def _work_out_options(self, replies: list[Reply]) -> list[Option]:
        ending = self._ending(replies)
        answers = tuple([reply.answer for reply in ending])
        given, options = self._probabilities, []
        given.choices.append(Choice(self.index, answers, tuple(probabilities(answers))))
        for place, reply in enumerate(ending):
            if given.choices[-1].bounds[place][1] == 0.0:
                continue
            for ticks, share in given.spread(reply.answer.sec):
                given.weights.append(TransitionProbability(len(given.choices) - 1, place, share))
                options.append(Option(reply, ticks, len(given.weights) - 1))
        return options


class WeighedSteps(TickSteps):
    """The steps of a tree whose chances are known. Runs end where they are over, and ticks in which only time passes are one step.

    `waits` has the number of a step's weight, or, of a step in which only time passes, how many ticks that takes, with a minus before it.

    Args:
        flat: The tree.
        ticker: What ticks it.
        judge: Judges a state.
        judged_by: The places of the entries that it looks at.
        times: Counts the ticks.
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
        """Go to a state, to play its ticks; see `TickSteps.enter`."""
        super().enter(state, alone=alone, path=path)
        self._is_over = self.judge(state, None).ends
        ticker = self._ticker
        self._cells, self._values = ticker.cells[:], ticker.values[:]
        self._watched = ticker.trail.watched

    def step(self) -> int:
        """Play the next step, and return what it has led to; raises as `TickSteps.step`."""
        return NOTHING if self._is_over else super().step()

    def take_state(self, outcome: int) -> None:
        """Take the state after a tick, and after those that follow in which nothing else will happen."""
        ticker = self._ticker
        ticker.entries.settle()
        self._pass_by(1)
        passed = self._unchanged() if ticker.choices.asked == 0 else 0
        if passed:
            self._pass_by(passed)
        super().take_state(outcome)
        if passed:
            self.waits = -1 - passed, 0, 0

    def _pass_by(self, ticks: int) -> None:
        """Let time pass."""
        values = self._ticker.values
        for place, value in enumerate(values):
            if isinstance(value, TicksLeft) and value.ticks:
                values[place] = self._times.left(value.ticks - ticks)

    def _unchanged(self) -> int:
        """Return how many ticks are like the last one, in which only time has passed; 0 if it was another one."""
        ticker, least = self._ticker, 0
        if ticker.trail.watched != self._watched or ticker.trail.broken:
            return 0
        if not (_are_equal(ticker.cells, self._cells) and _are_equal(ticker.entries.now, self._entries)):
            return 0
        for now, before in zip(ticker.values, self._values, strict=True):
            if isinstance(now, TicksLeft) and isinstance(before, TicksLeft):
                # One that was up before is not looked at; of one that is up now something may come.
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
