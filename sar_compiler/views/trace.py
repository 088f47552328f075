"""A scripted run as text: what happened, tick by tick."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from sar_compiler.checks.simulate.coverage import Coverage, Covered
from sar_compiler.checks.simulate.judging import Failure
from sar_compiler.checks.simulate.running import Run, TickRecord
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.stub_leaf import HALTED, STARTED, Event, StubLeaf
from sar_compiler.views.plain import value_as_script


def trace(run: Run) -> str:
    """Return the ticks of a run with new events, and its end."""
    writer = _Writer(run)
    lines: list[str] = []
    quiet: list[TickRecord] = []
    for before, tick in zip([None, *run.ticks], run.ticks, strict=False):
        if _is_news(tick, before):
            lines += [*writer.left_out(quiet), *writer.block(tick)]
            quiet = []
        else:
            quiet.append(tick)
    return "\n".join([*lines, *writer.left_out(quiet), _end(run), *_facts_at_the_end(run)]) + "\n"


def leaf_labels(leaves: Sequence[StubLeaf]) -> Mapping[StubLeaf, str]:
    """Return a label for each leaf: its name, or the part of its path that distinguishes it from others of the name."""
    return {leaf: _label(leaf, [other for other in leaves if other.name == leaf.name]) for leaf in leaves}


def _label(leaf: StubLeaf, namesakes: Sequence[StubLeaf]) -> str:
    if len(namesakes) == 1:
        return leaf.name
    for count in range(2, len(leaf.path) + 1):
        if sum(other.path[-count:] == leaf.path[-count:] for other in namesakes) == 1:
            return "/".join(leaf.path[-count:])
    # The same all the way up: two of one name side by side.
    return f"{leaf.name} ({namesakes.index(leaf) + 1})"


def verdict(run: Run, failures: Sequence[Failure]) -> str:
    """Return a scenario's unmet expectations, or that all are met; for a run without a scenario, the reason of its end."""
    scenario = run.scenario
    if not (scenario.path or failures):
        said = "Every leaf answered what is usual."
        by_root = run.ended and scenario.until is None
        return (
            f"{said} A run ends when the root succeeds or fails; --until says when else." if by_root else said
        )
    title = f"{scenario.path}: '{scenario.name}'" if scenario.path else f"'{scenario.name}'"
    if not failures:
        return f"{title} holds."
    return "\n".join([f"{title} does not hold:", *(f"  {failure_line(run, each)}" for each in failures)])


def failure_line(run: Run, failure: Failure) -> str:
    """Return an unmet expectation with its place."""
    place = f"{run.scenario.path}:{failure.line}: " if failure.line and run.scenario.path else ""
    return f"{place}{failure.expected}: {failure.message}"


def coverage_text(coverage: Coverage) -> str:
    """Return the nodes and outcomes that did not occur in a set of runs."""
    nodes, missed = coverage.nodes, coverage.never_ticked
    possible = sum(len(node.outcomes) for node in nodes)
    unseen = sum(len(node.unseen) for node in nodes)
    seen = f"{possible - unseen} of {possible} outcomes of leaves seen"
    lines = [f"coverage: {len(nodes) - len(missed)} of {len(nodes)} nodes ticked, {seen}"]
    lines += [f"  {_place(node)}: '{node.bound.name}' is never ticked" for node in missed]
    for node in coverage.unseen:
        lines.append(f"  {_place(node)}: '{node.bound.name}' has not shown {', '.join(node.unseen)}")
    return "\n".join(lines)


def _place(node: Covered) -> str:
    element = node.bound.element
    return f"{element.source.path}:{element.line}"


def _is_news(tick: TickRecord, before: TickRecord | None) -> bool:
    """Return whether a tick has events that the previous one did not have."""
    if before is None or tick.facts or tick.keys or tick.root != before.root:
        return True
    known = _seen(before.events)
    return any(event not in known for event in _seen(tick.events))


def _seen(events: Iterable[Event]) -> list[Event]:
    return [event for event in events if event.what != STARTED]


class _Writer:
    def __init__(self, run: Run) -> None:
        self._labels = leaf_labels(run.simulated.leaves)
        self._width = max(map(len, self._labels.values()), default=0)
        self._origins = run.simulated.compiled.origins

    def block(self, tick: TickRecord) -> Iterator[str]:
        """Yield the lines of a tick."""
        came_to = f"root {tick.root}" if tick.root else "not finished"
        yield f"tick {tick.number}, {tick.time_sec:g} s: {came_to}"
        for event in _seen(tick.events):
            answer = event.answer
            status = f" ({answer.status})" if answer is not None and answer.label else ""
            yield f"  {self._labels[event.leaf]:{self._width}}  {_what(event)}{status}"
        if tick.facts:
            yield f"  facts: {_values(tick.facts)}"
        if tick.keys:
            yield f"  keys: {_values(tick.keys)}"

    def left_out(self, quiet: Sequence[TickRecord]) -> list[str]:
        """Return a line for ticks without new events, with the repeated ones in them."""
        if not quiet:
            return []
        first, last = quiet[0], quiet[-1]
        which = f"tick {first.number}" if first is last else f"ticks {first.number} to {last.number}"
        events = (event for tick in quiet for event in _seen(tick.events) if self._is_done(event))
        again = dict.fromkeys(f"{self._labels[event.leaf]} {_what(event)}" for event in events)
        said = f"again {', '.join(again)}" if again else "nothing new"
        return [f"{which}, until {last.time_sec:g} s: {said}"]

    def _is_done(self, event: Event) -> bool:
        """Return whether an event is more than a leaf's continuation or the evaluation of a condition."""
        running = event.answer is not None and event.answer.status == "RUNNING"
        return not running and self._origins[event.leaf.id].bound.spec.kind is not Kind.CONDITION


def _what(event: Event) -> str:
    return HALTED if event.answer is None else event.answer.name


def _end(run: Run) -> str:
    last = f"tick {len(run.ticks)} ({run.time_sec:g} s)"
    if run.trouble:
        return f"broken off in {last}: {run.trouble}"
    return f"{'ended' if run.ended else 'broken off, without an end,'} after {last}: root {run.root}"


def _facts_at_the_end(run: Run) -> list[str]:
    facts = run.simulated.fact_values()
    return [f"facts at the end: {_values(facts)}"] if facts else []


def _values(values: Mapping[str, object]) -> str:
    return ", ".join(f"{name} = {value_as_script(value)}" for name, value in values.items())
