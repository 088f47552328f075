"""The condition that ends a run, and the result of the run."""

from collections.abc import Callable
from dataclasses import dataclass, field

from py_trees.common import Status

from sar_compiler.execution.until import Until
from sar_compiler.missions.mission import MissionRun
from sar_compiler.runtime.clock import clock_text

_ENDS = {
    Until.END: (Status.SUCCESS, Status.FAILURE, Status.INVALID),
    Until.SUCCESS: (Status.SUCCESS,),
    Until.FAILURE: (Status.FAILURE,),
}


@dataclass(frozen=True)
class RunResult:
    """The result of a run.

    Attributes:
        achieved: Whether the run achieved its goal.
        reason: Why the run ended, as a sentence.
    """

    achieved: bool
    reason: str


@dataclass
class EndCondition:
    """Decides after every tick whether a run is over.

    Args:
        until: The condition that ends the run.
        mission: The run's mission.
        time_limit_sec: The time limit of the run, in seconds of the node's clock; None for no limit.
        say: Called with a message each time the tree's root has returned SUCCESS or FAILURE and the tree starts again.
    """

    until: Until
    mission: MissionRun = field(default_factory=MissionRun)
    time_limit_sec: float | None = None
    say: Callable[[str], object] = lambda _: None
    _rounds: int = field(default=0, init=False)
    _idle_ticks: int = field(default=0, init=False)

    @property
    def complete(self) -> bool:
        """Whether the mission's own end condition is fulfilled; False if the mission has none."""
        return self.mission.shortfalls() == []

    def shortfalls(self) -> list[str]:
        """Return a sentence for each unfinished item, or an empty list if the mission has no end condition."""
        return self.mission.shortfalls() or []

    def after_tick(self, status: Status, elapsed_sec: float) -> RunResult | None:
        """Return the result of the run, or None if the run continues.

        Args:
            status: The root's status after the tick; INVALID if it was skipped.
            elapsed_sec: Time since the first tick, in seconds of the node's clock.
        """
        result = self._mission_result(status) if self.until is Until.COMPLETE else self._root_result(status)
        if result is None and self.time_limit_sec is not None and elapsed_sec > self.time_limit_sec:
            limit = f"The time limit of {clock_text(self.time_limit_sec)} has expired."
            return RunResult(achieved=False, reason=" ".join([limit, *self.shortfalls()]))
        return result

    def _root_result(self, status: Status) -> RunResult | None:
        if self.until not in _ENDS or status == Status.RUNNING:
            return None
        name = "SKIPPED" if status == Status.INVALID else status.name
        if status in _ENDS[self.until]:
            achieved = self.until is not Until.END or status == Status.SUCCESS
            return RunResult(achieved=achieved, reason=f"The root of the tree ended with {name}.")
        self._rounds += 1
        # A tree that fails at once starts again in every tick, so fewer and fewer rounds are reported.
        if self._rounds % 10 ** (len(str(self._rounds)) - 1) == 0:
            self.say(f"Root {name}, starting again ({_ordinal(self._rounds)} time).")
        return None

    def _mission_result(self, status: Status) -> RunResult | None:
        if self.complete:
            return RunResult(
                achieved=True, reason=" ".join(["Mission complete.", *self.mission.open_points()])
            )
        # If no work is left, the tree is finished when its root ends on two consecutive ticks. One tick is not enough: the tick that completes the
        # last task succeeds before the return path has been checked.
        idle_reason = self.mission.idle_reason()
        over = idle_reason and status != Status.RUNNING
        self._idle_ticks = self._idle_ticks + 1 if over else 0
        if self._idle_ticks > 1:
            return RunResult(achieved=False, reason=" ".join([f"{idle_reason}.", *self.shortfalls()]))
        return None


def default_summary(mission: MissionRun, outcome: str, elapsed_sec: float, ticks: int) -> str:
    """Return the summary for a mission that does not define one: outcome, figures, duration, and missing items.

    Args:
        mission: The run's mission.
        outcome: The run's outcome in words, such as `succeeded`.
        elapsed_sec: The run's duration, in seconds of the node's clock.
        ticks: The number of ticks.
    """
    return "\n".join(
        (
            f"Summary: the run {outcome}.",
            *(f"  {figure.text}" for figure in mission.display().figures),
            f"  duration: {clock_text(elapsed_sec)}, {ticks} tick{'' if ticks == 1 else 's'}",
            *(f"  missing: {line}" for line in mission.shortfalls() or ()),
        )
    )


def _ordinal(number: int) -> str:
    """Return the ordinal of a number, such as `1st`, `2nd`, `3rd` or `11th`."""
    teen = number // 10 % 10 == 1
    return f"{number}{'th' if teen else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')}"
