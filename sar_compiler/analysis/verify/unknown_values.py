"""Searches trees in which leaves write unknown values.

A run is not explored beyond a tick that needs an unknown value. So the runs that are shown are possible, but statements
about all runs are undecided.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar

from sar_compiler.analysis.state_search.graph import Breach, Graph
from sar_compiler.analysis.state_search.searching import A_STATE, Judgement, Report, Stepper, explore
from sar_compiler.analysis.verify.properties import ConditionError, Properties
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.analysis.verify.verdicts import questions_of
from sar_compiler.runtime.variables import unknown_value_of

DecidableResult = TypeVar("DecidableResult")


def search_decidable(
    properties: Properties, search: Callable[[Properties], DecidableResult]
) -> tuple[DecidableResult, dict[str, str]]:
    """Search a tree, leaving out the properties whose conditions need unknown values.

    Args:
        properties: The properties of the tree.
        search: Searches the tree with given properties.

    Returns:
        The result, and for each question that was left out the reason.

    Raises:
        ConditionError: If a condition cannot be evaluated for another reason.
    """
    try:
        return search(properties), {}
    except ConditionError as error:
        if unknown_value_of(error) is None:
            raise
        owner, reason = error.owner, error.reason
    others = properties.without_owner(owner)
    found, reasons = search_decidable(others, search)
    left_out = set(questions_of(properties)).difference(questions_of(others))
    return found, {**dict.fromkeys(left_out, reason), **reasons}


def explore_decidable(
    stepper: TreeStepper, max_states: int, report: Report, names: Sequence[str] = ()
) -> tuple[Graph, Breach | None]:
    """Search the states of a tree as `explore` does, and report ticks that need unknown values separately.

    Returns:
        The graph, and the first tick that needs an unknown value (None if there is none). The error of the graph is the
        first tick that raises an error for another reason.
    """
    if not stepper.writes_unknown_values:
        return explore(stepper.steps, max_states, report, names), None
    steps = _RecordedErrors(stepper.steps)
    graph = explore(steps, max_states, report, names)
    graph.error = steps.errors.get(False)
    return graph, steps.errors.get(True)


class _RecordedErrors(Stepper):
    """Provides the steps of a tree, and records the first ticks that raise errors.

    Args:
        steps: The steps.

    Attributes:
        errors: The first tick that needs an unknown value (True), and the first tick that raises an error for another
            reason (False).
    """

    def __init__(self, steps: Stepper) -> None:
        super().__init__()
        self.errors: dict[bool, Breach] = {}
        self._steps = steps
        self.middles = steps.middles
        # The number of the current state: a search enters the states in the order of their numbers.
        self._entered = -1

    def start(self) -> bytes:
        return self._steps.start()

    def enter(self, state: bytes, *, alone: bool = False) -> None:
        self._entered += 1
        self._steps.enter(state, alone=alone)

    def step(self) -> int:
        steps = self._steps
        led = steps.step()
        self.state, self.waits, self.broken = steps.state, steps.waits, steps.broken
        self.error, self.middle, self.left = steps.error, steps.middle, steps.left
        if led == A_STATE and steps.error is not None:
            kind = unknown_value_of(steps.error) is not None
            self.errors.setdefault(kind, Breach(self._entered, steps.path(), steps.error))
        return led

    def judge(self, state: bytes, idle: bool | None) -> Judgement:
        return self._steps.judge(state, idle)

    def path(self) -> tuple[int, ...]:
        return self._steps.path()
