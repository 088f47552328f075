"""Leaves that answer what a scenario says."""

from collections.abc import Callable, Sequence
from random import Random
from typing import NamedTuple

from py_trees.common import Status

from sar_compiler.checks.simulate.run_variables import RunVariables
from sar_compiler.checks.simulate.scenario import AnswerStep, Scenario
from sar_compiler.errors import SarError
from sar_compiler.runtime.answers import Answer, nominal
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.stub_leaf import StubLeaf

# Ticks come at multiples of the period, which floats hit only nearly.
_TOLERANCE_SEC = 1e-6


class ScriptedError(SarError):
    """A scenario demands an answer that a leaf cannot give at this point of the run."""


class Drawn(NamedTuple):
    """One choice that was made for a leaf.

    Attributes:
        leaf: The leaf.
        answer: The label or the status of the answer.
        after_sec: For how long it runs before, seconds.
        usual: Whether that is what the leaf usually answers.
    """

    leaf: StubLeaf
    answer: str
    after_sec: float = 0.0
    usual: bool = True


class Scripted:
    """Chooses the answers of leaves by a scenario; leaves that it does not mention give their usual answer.

    Args:
        scenario: What leaves answer, step by step, and what chance decides.
        variables: What the conditions of steps see.
        clock: What times are measured with.

    Attributes:
        choices: What was chosen so far, in order.
    """

    def __init__(self, scenario: Scenario, variables: RunVariables, clock: Clock) -> None:
        self.choices: list[Drawn] = []
        self._random = Random(scenario.seed)  # noqa: S311 - it must be possible to repeat a run
        self._unusual = scenario.unusual
        scripts = scenario.scripts.items()
        self._plans = {leaf: _Plan(leaf, steps, self._random, variables, clock) for leaf, steps in scripts}

    def choose(self, leaf: StubLeaf, options: Sequence[Answer]) -> Answer:
        """Return the scenario's answer, or else the usual one.

        Raises:
            ScriptedError: If the leaf cannot answer that now.
        """
        plan = self._plans.get(leaf)
        if plan is not None:
            return plan.choose(options, self.choices)
        answer = usual = nominal(options)
        if self._unusual and self._random.random() < self._unusual:
            others = [each for each in options if each.status != "RUNNING" and each != usual]
            answer = self._random.choice(others or [usual])
        self.choices.append(Drawn(leaf, answer.name, usual=answer == usual))
        return answer


class _Plan:
    def __init__(
        self,
        leaf: StubLeaf,
        steps: Sequence[AnswerStep],
        random: Random,
        variables: RunVariables,
        clock: Clock,
    ) -> None:
        self._leaf = leaf
        self._variables = variables
        self._clock = clock
        self._random = random
        self._steps = [_Left(step) for step in steps]
        self._current: Drawn | None = None
        self._since = 0.0

    def choose(self, options: Sequence[Answer], choices: list[Drawn]) -> Answer:
        """Return the leaf's next answer, and record the choice."""
        if self._leaf.status is not Status.RUNNING:
            self._current = None  # what was interrupted counts as taken
        if self._current is None:
            self._current = self._next(options)
            self._since = self._clock.now()
            choices.append(self._current)
        choice = self._current
        if self._clock.now() - self._since < choice.after_sec - _TOLERANCE_SEC:
            return self._named("RUNNING", options)
        self._current = None
        at_once = choice.usual and not choice.after_sec
        return nominal(options) if at_once else self._named(choice.answer, options)

    def _next(self, options: Sequence[Answer]) -> Drawn:
        """Return what is chosen of the steps that are left, or else what is usual."""
        step = next((left.step for left in self._steps if left.take(self._holds, self._random)), None)
        usual = nominal(options)
        if step is None:
            return Drawn(self._leaf, usual.name)
        after_sec = step.after_sec
        if step.longest_sec > after_sec:
            after_sec = round(self._random.uniform(after_sec, step.longest_sec), 3)
        named = _by_name(step.answer, options)
        return Drawn(self._leaf, step.answer, after_sec, named[:1] == [usual])

    def _named(self, name: str, options: Sequence[Answer]) -> Answer:
        found = _by_name(name, options)
        if found:
            return found[0]
        leaf = self._leaf
        conditions = [a.when for a in leaf.answers if name in (a.label, a.status) and a.when]
        raise ScriptedError(
            f"'{leaf.name}' cannot answer '{name}' here: that needs {' or '.join(conditions)}; it can answer "
            f"{', '.join(answer.name for answer in options)}"
        )

    def _holds(self, step: AnswerStep) -> bool:
        if step.when is None:
            return True
        try:
            return Program(step.when).holds(self._variables)
        except EvaluationError as error:
            raise ScriptedError(f"'{self._leaf.name}': when '{step.when.text}': {error}") from error


def _by_name(name: str, options: Sequence[Answer]) -> list[Answer]:
    """Return the answers that a label or a status names, those with the label first."""
    labelled = [answer for answer in options if answer.label == name]
    return labelled + [answer for answer in options if answer.status == name]


_Holds = Callable[[AnswerStep], bool]


class _Left:
    """The number of times that a step can still be taken."""

    def __init__(self, step: AnswerStep) -> None:
        self.step = step
        self._left = step.times
        self._chances = 0

    def take(self, holds: _Holds, random: Random) -> bool:
        """Take the step, if that can be now."""
        if self._left == 0 or not holds(self.step):
            return False
        self._chances += 1
        if self._chances % self.step.every:
            return False
        if self.step.chance < 1.0 and random.random() >= self.step.chance:
            return False
        if self._left is not None:
            self._left -= 1
        return True
