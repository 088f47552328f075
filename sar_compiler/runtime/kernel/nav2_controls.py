"""Controls of Nav2: children in order that are ticked again, and recoveries."""

from typing import Final

from sar_compiler.errors import SarError
from sar_compiler.runtime.kernel.cells import CALLED, ENDED, FAILURE, INVALID, RUNNING, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.tree_nodes import ControlNode, Part, Ticker, is_reset, reset, reset_all

_USUAL_RETRIES: Final = 1
"""How often to recover where the number is less than 0."""


class Nav2ControlError(SarError):
    """A control cannot go on with what a child has answered, or a port holds."""


class RecoveringNode(ControlNode):
    """Ticks its first child; after a failure the second one, and after that one's success the first one again.

    Attributes:
        current: The cell with the index of the child in hand.
        retries: The cell with the number of recoveries. It outlasts a recovery that was skipped.
        wanted: The cell with the number of recoveries that are allowed, in a tick.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.current, self.retries, self.wanted = part.cell(), part.cell(), part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Read how many recoveries are allowed, and go on with the child in hand."""
        cells = ticker.cells
        number: int = self.behaviour.number_of_retries.get()
        cells[self.wanted] = number if number >= 0 else _USUAL_RETRIES
        cells[self.at] = RUNNING
        if cells[self.retries] > cells[self.wanted]:
            return self.end(ticker, FAILURE)
        return self.tick_child(self.children[cells[self.current]], ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Go on after the child in hand."""
        if outcome == RUNNING:
            ticker.cells[self.wanted] = 0
            return RUNNING
        after = self.after_main if ticker.cells[self.current] == 0 else self.after_recovery
        return after(ticker, outcome)

    def after_main(self, ticker: Ticker, outcome: int) -> int:
        """Go on after the first child has ended or was skipped."""
        cells = ticker.cells
        if outcome != FAILURE or cells[self.retries] == cells[self.wanted]:
            return self.end(ticker, outcome)
        reset(self.children[0], ticker)
        cells[self.current] = 1
        return self.tick_child(self.children[cells[self.current]], ticker)

    def after_recovery(self, ticker: Ticker, outcome: int) -> int:
        """Go on after the second child has ended or was skipped."""
        cells = ticker.cells
        if outcome == FAILURE:
            return self.end(ticker, FAILURE)
        reset(self.children[1], ticker)
        cells[self.current] = 0
        if outcome == SKIPPED:
            cells[self.wanted] = 0
            cells[self.at] = FAILURE
            return FAILURE
        cells[self.retries] += 1
        if ticker.tells:
            self.behaviour.feedback_message = f"recovery {cells[self.retries]} of {cells[self.wanted]}"
        return self.tick_child(self.children[cells[self.current]], ticker)

    def end(self, ticker: Ticker, outcome: int) -> int:
        """End, or be skipped, with all forgotten."""
        self.forget(ticker)
        reset_all(self.children, ticker)
        ticker.cells[self.at] = INVALID
        return self.pass_on(ticker, outcome)

    def break_off(self, ticker: Ticker) -> None:
        """Forget what belongs to a single tick."""
        ticker.cells[self.wanted] = 0

    def forget(self, ticker: Ticker) -> None:
        """Forget which child was in hand, and the recoveries."""
        ticker.cells[self.current] = ticker.cells[self.retries] = ticker.cells[self.wanted] = 0


class PipelineNode(ControlNode):
    """Ticks every child again in each tick, up to the furthest one that was reached, whether those before it run or not.

    Attributes:
        position: The cell with the index of the child in hand, in a tick.
        furthest: The cell with the index of the furthest child that has run.
        skips: The cell with the number of children that were skipped, in a tick.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.position, self.furthest, self.skips = part.cell(), part.cell(), part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Begin with the first child."""
        ticker.cells[self.position] = ticker.cells[self.skips] = 0
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Tick the children from the one in hand on, whose outcome may be known; INVALID if it is to be ticked."""
        cells, children = ticker.cells, self.children
        while True:
            index = cells[self.position]
            if outcome == INVALID:
                if index == len(children):
                    return self.end(ticker, SKIPPED if cells[self.skips] == index else SUCCESS)
                self.behaviour.current_child = children[index].behaviour
                outcome = children[index].tick(ticker)
                if outcome == CALLED:
                    return CALLED
            if outcome == FAILURE:
                return self.end(ticker, FAILURE)
            if outcome == RUNNING and index >= cells[self.furthest]:
                self.break_off(ticker)
                cells[self.furthest] = index
                cells[self.at] = RUNNING
                return RUNNING
            cells[self.skips] += int(outcome == SKIPPED)
            cells[self.position] = index + 1
            outcome = INVALID

    def end(self, ticker: Ticker, outcome: int) -> int:
        """End, or be skipped; children that still run are halted."""
        self.forget(ticker)
        reset_all(self.children, ticker)
        return self.pass_on(ticker, outcome)

    def break_off(self, ticker: Ticker) -> None:
        """Forget what belongs to a single tick."""
        ticker.cells[self.position] = ticker.cells[self.skips] = 0

    def forget(self, ticker: Ticker) -> None:
        """Forget which child was the furthest."""
        self.break_off(ticker)
        ticker.cells[self.furthest] = 0


class RoundRobinNode(ControlNode):
    """Ticks one child after another until one succeeds, and continues with the next one when it is started again.

    Where it does not wrap around, any end of the last child ends it without a success.

    Attributes:
        current: The cell with the index of the child in hand; it outlasts a success.
        failures: The cell with the number of children that have failed.
        skips: The cell with the number of children that were skipped, in a tick.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.current, self.failures, self.skips = part.cell(), part.cell(), part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Go on with the child in hand."""
        ticker.cells[self.at] = RUNNING
        ticker.cells[self.skips] = 0
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Tick children from the one in hand on, whose outcome may be known; INVALID if it is to be ticked."""
        cells, children = ticker.cells, self.children
        count = len(children)
        while True:
            if outcome == INVALID:
                if cells[self.failures] + cells[self.skips] >= count:
                    return self.give_up(ticker)
                child = children[cells[self.current]]
                self.behaviour.current_child = child.behaviour
                outcome = child.tick(ticker)
                if outcome == CALLED:
                    return CALLED
            if outcome == RUNNING:
                cells[self.skips] = 0
                return RUNNING
            is_last = cells[self.current] + 1 == count
            cells[self.failures] += int(outcome == FAILURE)
            cells[self.skips] += int(outcome == SKIPPED)
            if is_last and not self.behaviour.wrap_around.get():
                return self.give_up(ticker)
            cells[self.current] = 0 if is_last else cells[self.current] + 1
            if outcome == SUCCESS:
                cells[self.failures] = cells[self.skips] = 0
                reset_all(children, ticker)
                cells[self.at] = SUCCESS
                return SUCCESS
            outcome = INVALID

    def give_up(self, ticker: Ticker) -> int:
        """End without a success; be skipped if all children were."""
        all_skipped = ticker.cells[self.skips] == len(self.children)
        self.forget(ticker)
        reset_all(self.children, ticker)
        ticker.cells[self.at] = INVALID
        return self.pass_on(ticker, SKIPPED if all_skipped else FAILURE)

    def break_off(self, ticker: Ticker) -> None:
        """Forget what belongs to a single tick."""
        ticker.cells[self.skips] = 0

    def forget(self, ticker: Ticker) -> None:
        """Forget whose turn it was."""
        ticker.cells[self.current] = ticker.cells[self.failures] = ticker.cells[self.skips] = 0


class NonblockingNode(ControlNode):
    """Ticks all children in every tick, also those that have succeeded, until none of them runs or one fails.

    Attributes:
        position: The cell with the index of the child in hand, in a tick.
        runs: The cell with 1 if a child runs, in a tick.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.position, self.runs = part.cell(), part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Begin with the first child."""
        self.forget(ticker)
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Tick the children from the one in hand on, whose outcome may be known; INVALID if it is to be ticked.

        Raises:
            Nav2ControlError: If a child is skipped.
        """
        cells, children = ticker.cells, self.children
        while True:
            index = cells[self.position]
            if outcome == INVALID:
                if index == len(children):
                    return self.end(ticker, RUNNING if cells[self.runs] else SUCCESS)
                self.behaviour.current_child = children[index].behaviour
                outcome = children[index].tick(ticker)
                if outcome == CALLED:
                    return CALLED
            if outcome == FAILURE:
                return self.end(ticker, FAILURE)
            if outcome == SKIPPED:
                name = children[index].behaviour.name
                message = f"'{name}' was skipped, which '{self.behaviour.name}' takes for an error"
                raise Nav2ControlError(message)
            cells[self.runs] |= int(outcome == RUNNING)
            cells[self.position] = index + 1
            outcome = INVALID

    def end(self, ticker: Ticker, outcome: int) -> int:
        """Leave the tick; with SUCCESS or FAILURE the node's work is over."""
        self.forget(ticker)
        if outcome & ENDED:
            reset_all(self.children, ticker)
        ticker.cells[self.at] = outcome
        return outcome

    def break_off(self, ticker: Ticker) -> None:
        """Forget what belongs to a single tick."""
        self.forget(ticker)

    def forget(self, ticker: Ticker) -> None:
        """Forget what belongs to a single tick."""
        ticker.cells[self.position] = ticker.cells[self.runs] = 0


class PersistentNode(ControlNode):
    """A sequence whose place is a key of the blackboard, which outlasts a halt.

    Attributes:
        position: The cell with the index of the child in hand, in a tick.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.position = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Read the place, and go on there.

        Raises:
            Nav2ControlError: If it is below 0.
        """
        place: int = self.behaviour.current_child_idx.get()
        if place < 0:
            message = f"'{self.behaviour.name}' is to begin with child {place}; they are counted from 0"
            raise Nav2ControlError(message)
        ticker.cells[self.position] = place
        ticker.cells[self.at] = RUNNING
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Tick the children from the one in hand on, whose outcome may be known; INVALID if it is to be ticked."""
        cells, children = ticker.cells, self.children
        while True:
            index = cells[self.position]
            if outcome == INVALID:
                if index >= len(children):
                    return self.end(ticker, SUCCESS)
                self.behaviour.current_child = children[index].behaviour
                outcome = children[index].tick(ticker)
            if outcome == CALLED:
                return CALLED
            if outcome == RUNNING:
                cells[self.position] = 0
                return RUNNING
            if outcome == FAILURE:
                return self.end(ticker, FAILURE)
            cells[self.position] = index + 1
            self.behaviour.current_child_idx.set(index + 1)
            outcome = INVALID

    def end(self, ticker: Ticker, outcome: int) -> int:
        """End; the next start is with the first child."""
        self.forget(ticker)
        reset_all(self.children, ticker)
        self.behaviour.current_child_idx.set(0)
        ticker.cells[self.at] = outcome
        return outcome

    def break_off(self, ticker: Ticker) -> None:
        """Forget what belongs to a single tick."""
        self.forget(ticker)

    def forget(self, ticker: Ticker) -> None:
        """Forget what belongs to a single tick."""
        ticker.cells[self.position] = 0


_RESUMED: Final = 0
_PAUSED: Final = 1
_ON_PAUSE: Final = 2
_ON_RESUME: Final = 3
_NEXT: Final = (_RESUMED, _PAUSED, _PAUSED, _RESUMED)


class PauseResumeNode(ControlNode):
    """Ticks the child of its mode: to work, to be paused, and the changes between these two.

    The first of its nodes is asked in every tick what was requested. A request to pause is heard unless it is paused, one to
    resume only if it is; the skipped answer is both, the second one after the first.

    Attributes:
        asking: The cell with 1 while it is asked what was requested.
        mode: The cell with the mode, which is the index of its child.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.asked, self.branches = part.children[0], part.children[1:]
        self.asking, self.mode = part.cell(), part.cell(_RESUMED)
        self.is_reset = self.heeds_end = is_reset(part.behaviour)

    def begin(self, ticker: Ticker) -> int:
        """Ask what was requested."""
        cells = ticker.cells
        if cells[self.at] == INVALID or (cells[self.at] != RUNNING and not self.is_reset):
            cells[self.mode] = _RESUMED
        cells[self.at] = RUNNING
        cells[self.asking] = 1
        outcome = self.asked.tick(ticker)
        return CALLED if outcome == CALLED else self.resume(ticker, outcome)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Go on after what was asked, or the child of the mode."""
        cells = ticker.cells
        if cells[self.asking]:
            cells[self.asking] = 0
            self.asked.rest(ticker)
            return self.answered(ticker, outcome)
        if outcome == RUNNING:
            return RUNNING
        if outcome == FAILURE or cells[self.mode] == _RESUMED:
            cells[self.at] = FAILURE if outcome == FAILURE else SUCCESS
            return cells[self.at]
        return self.next_mode(ticker)

    def answered(self, ticker: Ticker, outcome: int) -> int:
        """Change the mode as was requested, and tick its child."""
        cells = ticker.cells
        is_paused = cells[self.mode] == _PAUSED
        pauses = (outcome == SKIPPED) if is_paused else (outcome in (FAILURE, SKIPPED))
        if pauses or (is_paused and outcome == RUNNING):
            reset_all(self.branches, ticker)
            cells[self.mode] = _ON_PAUSE if pauses else _ON_RESUME
        if cells[self.mode] >= len(self.branches):
            return self.next_mode(ticker)
        child = self.branches[cells[self.mode]]
        self.behaviour.current_child = child.behaviour
        outcome = child.tick(ticker)
        return CALLED if outcome == CALLED else self.resume(ticker, outcome)

    def next_mode(self, ticker: Ticker) -> int:
        """Go on to the mode after this one, if there is one, and run."""
        ticker.cells[self.mode] = _NEXT[ticker.cells[self.mode]]
        return RUNNING

    def break_off(self, ticker: Ticker) -> None:
        """Ask no more."""
        ticker.cells[self.asking] = 0

    def forget(self, ticker: Ticker) -> None:
        """Be resumed."""
        ticker.cells[self.mode], ticker.cells[self.asking] = _RESUMED, 0
