"""Comparing a run with the scenario's expectations."""

from collections.abc import Iterator
from dataclasses import dataclass

from sar_compiler.checks.leaf_words import EventPattern
from sar_compiler.checks.simulate.running import Run


@dataclass(frozen=True)
class Failure:
    """An expectation that does not hold.

    Attributes:
        expected: The word of the expectation in a scenario; `run` for a run that could not be finished.
        message: What is the case instead.
        line: Where the scenario says it; 0 where it does not.
    """

    expected: str
    message: str
    line: int = 0


def failures(run: Run) -> list[Failure]:
    """Return what does not hold of the expectations of a run's scenario, but for its trace."""
    if run.trouble:
        return [Failure("run", f"tick {len(run.ticks)} could not be finished: {run.trouble}")]
    lines = run.scenario.expect.lines
    return [Failure(place.split()[0], message, lines.get(place, 0)) for place, message in _all(run)]


def _all(run: Run) -> Iterator[tuple[str, str]]:
    """Yield the key of each failed expectation in `Expectations.lines`, and the actual result."""
    expect = run.scenario.expect
    yield from _ending(run)
    if expect.root is not None and run.root != expect.root:
        yield "root", f"the root is {run.root} in the last tick; expected {expect.root}"
    values = run.simulated.fact_values()
    for name, fact in expect.facts.items():
        if values.get(name) != fact:
            yield (
                f"facts {name}",
                f"the fact '{name}' is {values.get(name)!r} at the end; expected {fact!r}",
            )
    yield from _order(run)
    for deed in expect.never:
        event = next(filter(deed.matches, run.events), None)
        if event is not None:
            yield f"never {deed.text}", f"'{deed.text}' happens in tick {event.tick} ({event.time_sec:g} s)"
    for deed, bounds in expect.counts:
        number = sum(map(deed.matches, run.events))
        if number < bounds.least or (bounds.most is not None and number > bounds.most):
            yield f"count {deed.text}", f"'{deed.text}' {_times(number)}; expected {bounds}"


def _ending(run: Run) -> Iterator[tuple[str, str]]:
    expect, last = run.scenario.expect, f"tick {len(run.ticks)} ({run.time_sec:g} s)"
    if run.ended != expect.ends:
        until = run.scenario.until
        what = f"until '{until.text}' is" if until else "the root has"
        how = "true" if until else "succeeded or failed"
        if run.ended:
            yield "ends", f"the run ends with {last}: {what} {how}"
        else:
            yield "ends", f"the run has not ended by {last}: {what} not {how} yet"
    elif run.ended and expect.within_ticks is not None and len(run.ticks) > expect.within_ticks:
        yield "within", f"the run ends with {last}, not by tick {expect.within_ticks}"
    elif run.ended and expect.within_sec is not None and run.time_sec > expect.within_sec:
        yield "within", f"the run ends with {last}, not by {expect.within_sec:g} s"


def _order(run: Run) -> Iterator[tuple[str, str]]:
    """Search for the events of an order, each after the one before."""
    events = run.events
    before: EventPattern | None = None
    for deed in run.scenario.expect.order:
        if not any(map(deed.matches, events)):
            place = f" after '{before.text}'" if before else ""
            yield f"order {deed.text}", f"'{deed.text}' does not happen{place}"
            return
        before = deed


def _times(number: int) -> str:
    return "never happens" if not number else f"happens {'once' if number == 1 else f'{number} times'}"
