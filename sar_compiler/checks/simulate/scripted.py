"""Leaves that answer what a scenario says."""

from collections.abc import Callable, Mapping, Sequence

from py_trees.common import Status

from sar_compiler.checks.simulate.run_variables import RunVariables
from sar_compiler.checks.simulate.scenario import AnswerStep
from sar_compiler.errors import SarError
from sar_compiler.runtime.answers import Answer, nominal
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.stub_leaf import StubLeaf

# Ticks come at multiples of the period, which floats hit only nearly.
_TOLERANCE_SEC = 1e-6


class ScriptedError(SarError):
    """A scenario says something of a leaf that cannot be at this point of the run."""


class Scripted:
    """Chooses the answers of leaves by a scenario.

    Args:
        scripts: What leaves answer, step by step; the others answer what is usual.
        variables: What the conditions of steps see.
        clock: What times are measured with.
    """

    def __init__(
        self, scripts: Mapping[StubLeaf, Sequence[AnswerStep]], variables: RunVariables, clock: Clock
    ) -> None:
        self._plans = {leaf: _Plan(leaf, steps, variables, clock) for leaf, steps in scripts.items()}

    def choose(self, leaf: StubLeaf, options: Sequence[Answer]) -> Answer:
        """Return what the scenario says, else what is usual.

        Raises:
            ScriptedError: If the leaf cannot answer that now.
        """
        plan = self._plans.get(leaf)
        return nominal(options) if plan is None else plan.choose(options)


class _Plan:
    def __init__(
        self, leaf: StubLeaf, steps: Sequence[AnswerStep], variables: RunVariables, clock: Clock
    ) -> None:
        self._leaf = leaf
        self._variables = variables
        self._clock = clock
        self._steps = [_Left(step) for step in steps]
        self._current: AnswerStep | None = None
        self._since = 0.0

    def choose(self, options: Sequence[Answer]) -> Answer:
        if self._leaf.status is not Status.RUNNING:
            self._current = None  # what was interrupted counts as taken
        if self._current is None:
            self._current = next((left.step for left in self._steps if left.take(self._holds)), None)
            self._since = self._clock.now()
        step = self._current
        if step is None:
            return nominal(options)
        if self._clock.now() - self._since < step.after_sec - _TOLERANCE_SEC:
            return self._named("RUNNING", options)
        self._current = None
        return self._named(step.answer, options)

    def _named(self, name: str, options: Sequence[Answer]) -> Answer:
        found = [answer for answer in options if answer.label == name]
        found += [answer for answer in options if answer.status == name]
        if found:
            return found[0]
        leaf = self._leaf
        conditions = [a.when for a in leaf.answers if name in (a.label, a.status) and a.when]
        message = (
            f"'{leaf.name}' cannot answer '{name}' here: that needs {' or '.join(conditions)}; it can answer "
            f"{', '.join(answer.name for answer in options)}"
        )
        raise ScriptedError(message)

    def _holds(self, step: AnswerStep) -> bool:
        if step.when is None:
            return True
        try:
            return Program(step.when).holds(self._variables)
        except EvaluationError as error:
            message = f"'{self._leaf.name}': when '{step.when.text}': {error}"
            raise ScriptedError(message) from error


_Holds = Callable[[AnswerStep], bool]


class _Left:
    """The number of times that a step can still be taken."""

    def __init__(self, step: AnswerStep) -> None:
        self.step = step
        self._left = step.times
        self._chances = 0

    def take(self, holds: _Holds) -> bool:
        """Take the step, if that can be now."""
        if self._left == 0 or not holds(self.step):
            return False
        self._chances += 1
        if self._chances % self.step.every:
            return False
        if self._left is not None:
            self._left -= 1
        return True
