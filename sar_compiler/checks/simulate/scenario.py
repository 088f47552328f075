"""Scenarios as plain data."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from sar_compiler.checks.leaf_words import EventPattern
from sar_compiler.runtime.answers import Fact
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.stub_leaf import StubLeaf

PERIOD_SEC = 0.5
"""The default time between two ticks, seconds: 2 Hz, as `sar-run` ticks."""
MAX_TICKS = 1000
"""The default limit: a run is stopped after this many ticks."""


@dataclass(frozen=True)
class AnswerStep:
    """One step of a script: an answer given once, or a number of times.

    Attributes:
        answer: The label or the status of the answer.
        after_sec: For how long it runs before, seconds.
        longest_sec: If above `after_sec`, it runs for a time between the two, chosen by chance.
        when: Takes the step only where this is true; None: always.
        times: How often the step is taken; None for any number.
        every: Takes the step only at every n-th chance.
        chance: The probability with which the step is taken where it could be.
    """

    answer: str
    after_sec: float = 0.0
    longest_sec: float = 0.0
    when: Script | None = None
    times: int | None = 1
    every: int = 1
    chance: float = 1.0


@dataclass(frozen=True)
class Bounds:
    """The number of times that something may happen.

    Attributes:
        least: At least.
        most: At most; None for any number.
    """

    least: int
    most: int | None

    def __str__(self) -> str:
        if self.least == self.most:
            return str(self.least)
        return f"at least {self.least}" if self.most is None else f"at most {self.most}"


@dataclass(frozen=True)
class Expectations:
    """The expected results of a run.

    Attributes:
        root: The root's status after the last tick: `SUCCESS`, `FAILURE`, `RUNNING` or `SKIPPED`.
        ends: Whether the run ends, before it is broken off.
        within_ticks: The largest number of ticks to the end.
        within_sec: The longest time to the end, in seconds.
        facts: Facts at the end.
        order: Each happens after the one before.
        never: None of these happens.
        counts: How often these happen.
        trace: A file that holds the trace.
        lines: The lines in the scenario's file, by the word there, and what stands below it: `root`, `facts at`,
            `never NotifyBase refused`.
    """

    root: str | None = None
    ends: bool = True
    within_ticks: int | None = None
    within_sec: float | None = None
    facts: Mapping[str, Fact] = field(default_factory=dict)
    order: tuple[EventPattern, ...] = ()
    never: tuple[EventPattern, ...] = ()
    counts: tuple[tuple[EventPattern, Bounds], ...] = ()
    trace: Path | None = None
    lines: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Scenario:
    """A scripted run.

    Attributes:
        name: What it is called.
        path: Its file; empty where there is none.
        period_sec: The time between two ticks, seconds.
        max_ticks: The number of ticks after which it is broken off.
        until: It ends when this is true; None: when the root has succeeded or failed.
        scripts: What leaves answer; any other leaf answers what is usual.
        expect: What must be true of it.
        seed: Of all that chance decides in it.
        unusual: The probability with which a leaf of which the scripts say nothing answers what is not usual.
    """

    name: str = "as usual"
    path: str = ""
    period_sec: float = PERIOD_SEC
    max_ticks: int = MAX_TICKS
    until: Script | None = None
    scripts: Mapping[StubLeaf, tuple[AnswerStep, ...]] = field(default_factory=dict)
    expect: Expectations = field(default_factory=Expectations)
    seed: int = 0
    unusual: float = 0.0
