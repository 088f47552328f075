"""Displays scripted runs as a trace in plain text, as JSON, or as JUnit XML for continuous integration."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

from sar_compiler.analysis.simulate.scenario_run import Failure, NodeCoverage, OutcomeCoverage, ScenarioRun
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.events import HALTED, RETURNED, TICKED, Event, TickRecord, ValueChange
from sar_compiler.tree.plain import as_json, speakable, to_json_value, value_as_script


def trace(run: ScenarioRun) -> str:
    """Return the trace of a run.

    Ticks with new events are shown in full, and other ticks are summarised in a line.
    """
    writer = _TraceWriter(run)
    lines: list[str] = []
    repeated: list[TickRecord] = []
    for before, tick in zip([None, *run.ticks], run.ticks, strict=False):
        if _is_news(tick, before):
            lines += [*writer.summary(repeated), *writer.block(tick)]
            repeated = []
        else:
            repeated.append(tick)
    return "\n".join([*lines, *writer.summary(repeated), _end(run), *_facts_at_the_end(run)]) + "\n"


def leaf_labels(leaves: Sequence[StubLeaf]) -> Mapping[int, str]:
    """Return the label of each leaf by leaf number.

    The label is the name, or the part of the path that is unique.
    """
    return {
        leaf.number: _label(leaf, [other for other in leaves if other.name == leaf.name]) for leaf in leaves
    }


def _label(leaf: StubLeaf, namesakes: Sequence[StubLeaf]) -> str:
    if len(namesakes) == 1:
        return leaf.name
    for count in range(2, len(leaf.path) + 1):
        if sum(other.path[-count:] == leaf.path[-count:] for other in namesakes) == 1:
            return "/".join(leaf.path[-count:])
    # The whole paths are equal, because siblings have the same name.
    return f"{leaf.name} ({namesakes.index(leaf) + 1})"


def verdict(run: ScenarioRun, failures: Sequence[Failure]) -> str:
    """Describe whether a scenario's expectations are met, or how a run without a scenario was played."""
    scenario = run.scenario
    if not (scenario.path or failures):
        text = "Every leaf returned its default outcome."
        by_root = run.ended and scenario.until is None
        return (
            f"{text} A run ends when the root succeeds or fails. Set another end with --until."
            if by_root
            else text
        )
    title = f"{scenario.path}: '{scenario.name}'" if scenario.path else f"'{scenario.name}'"
    if not failures:
        return f"{title} holds."
    how = "is not decided" if run.is_undecided else "does not hold"
    return "\n".join([f"{title} {how}:", *(f"  {failure_line(run, each)}" for each in failures)])


def failure_line(run: ScenarioRun, failure: Failure) -> str:
    """Describe a violated expectation with its location."""
    place = f"{run.scenario.path}:{failure.line}: " if failure.line and run.scenario.path else ""
    return f"{place}{failure.expected}: {failure.message}"


def coverage_text(coverage: OutcomeCoverage) -> str:
    """Describe how many nodes and leaf outcomes a set of runs covers, and list those that are not covered."""
    nodes, missed = coverage.nodes, coverage.never_ticked
    possible = sum(len(node.outcomes) for node in nodes)
    unseen = sum(len(node.unseen_outcomes) for node in nodes)
    seen = f"{possible - unseen} of {possible} leaf outcomes seen"
    lines = [f"coverage: {len(nodes) - len(missed)} of {len(nodes)} nodes ticked, {seen}"]
    lines += [f"  {node.bound.element.file_and_line}: '{node.bound.name}' is never ticked" for node in missed]
    for node in coverage.nodes_with_unseen_outcomes:
        unseen_names = ", ".join(node.unseen_outcomes)
        lines.append(
            f"  {node.bound.element.file_and_line}: '{node.bound.name}' never returned {unseen_names}"
        )
    return "\n".join(lines)


def _is_news(tick: TickRecord, before: TickRecord | None) -> bool:
    """Return whether a tick has changed a value, or has an event that the previous tick did not have."""
    if before is None or tick.facts or tick.keys or tick.root != before.root:
        return True
    known = {(event.number, event.status, event.label) for event in _visible_events(before)}
    return any((event.number, event.status, event.label) not in known for event in _visible_events(tick))


def _visible_events(tick: TickRecord) -> list[Event]:
    return [event for event in tick.events if event.what in (RETURNED, HALTED)]


class _TraceWriter:
    def __init__(self, run: ScenarioRun) -> None:
        self._labels = leaf_labels(run.simulated.leaves)
        self._width = max(map(len, self._labels.values()), default=0)
        origins = run.simulated.compiled.origins
        self._conditions = {
            leaf.number for leaf in run.simulated.leaves if origins[leaf.id].bound.spec.kind is Kind.CONDITION
        }

    def block(self, tick: TickRecord) -> Iterator[str]:
        """Yield the lines of a tick."""
        root = f"root {tick.root}" if tick.root else "not finished"
        yield f"tick {tick.number}, {tick.time_sec:g} s: {root}"
        for event in _visible_events(tick):
            status = f" ({event.status})" if event.label else ""
            yield f"  {self._labels[event.number]:{self._width}}  {event.action}{status}"
        if tick.facts:
            yield f"  facts: {_values(_new_values(tick.facts))}"
        if tick.keys:
            yield f"  keys: {_values(_new_values(tick.keys))}"

    def summary(self, repeated: Sequence[TickRecord]) -> list[str]:
        """Return a line that summarises consecutive ticks without new events, if there are such ticks."""
        if not repeated:
            return []
        first, last = repeated[0], repeated[-1]
        which = f"tick {first.number}" if first is last else f"ticks {first.number} to {last.number}"
        events = (event for tick in repeated for event in _visible_events(tick) if self._is_done(event))
        again = dict.fromkeys(f"{self._labels[event.number]} {event.action}" for event in events)
        events_text = f"again {', '.join(again)}" if again else "nothing new"
        return [f"{which}, until {last.time_sec:g} s: {events_text}"]

    def _is_done(self, event: Event) -> bool:
        """Return whether to list an event in a summary.

        The summary lists halts, and ends of leaves that are not conditions.
        """
        return event.status != "RUNNING" and event.number not in self._conditions


def _end(run: ScenarioRun) -> str:
    last = f"tick {len(run.ticks)} ({run.time_sec:g} s)"
    if run.trouble:
        return f"aborted in {last}: {run.trouble}"
    return f"{'ended' if run.ended else 'aborted without an end'} after {last}: root {run.root}"


def _facts_at_the_end(run: ScenarioRun) -> list[str]:
    facts = run.simulated.fact_values()
    return [f"facts at the end: {_values(facts)}"] if facts else []


def _new_values(changes: Mapping[str, ValueChange]) -> Mapping[str, object]:
    return {name: value for name, (_, value) in changes.items()}


def _values(values: Mapping[str, object]) -> str:
    return ", ".join(f"{name} = {value_as_script(value)}" for name, value in values.items())


@dataclass(frozen=True)
class PlayedScenario:
    """A scenario that was played, or that is invalid.

    Attributes:
        name: The name of the scenario.
        run: The run of the scenario; None if the scenario is invalid.
        failures: The expectations that were not met.
        problem: The reason why the scenario is invalid.
        is_finding: Whether the reason is an error in the scenario or a node of unknown behaviour, not an unreadable file.
    """

    name: str
    run: ScenarioRun | None = None
    failures: Sequence[Failure] = field(default_factory=tuple)
    problem: str = ""
    is_finding: bool = False


def junit(tree: str, scenarios: Sequence[PlayedScenario]) -> str:
    """Return a JUnit test suite for a tree file, with a test case for each scenario.

    Times are simulated seconds.
    """
    counts = {
        "tests": str(len(scenarios)),
        "failures": str(sum(bool(each.failures) for each in scenarios)),
        "errors": str(sum(each.run is None for each in scenarios)),
        "time": f"{sum(each.run.time_sec for each in scenarios if each.run):.3f}",
    }
    suites = ET.Element("testsuites", counts)
    suite = ET.SubElement(suites, "testsuite", {"name": speakable(tree), **counts})
    for each in scenarios:
        _add_case(suite, tree, each)
    ET.indent(suites, "")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(suites, "unicode")}\n'


def _add_case(suite: ET.Element, tree: str, played: PlayedScenario) -> None:
    run, about = played.run, {"name": speakable(played.name), "classname": speakable(tree)}
    case = ET.SubElement(suite, "testcase", about, time=f"{run.time_sec if run else 0.0:.3f}")
    if run is None:
        result = ET.SubElement(case, "error", message="the scenario is invalid or cannot be read")
        text = played.problem
    elif played.failures:
        lines = [failure_line(run, failure) for failure in played.failures]
        about = {"message": speakable(lines[0]), "type": played.failures[0].expected}
        result = ET.SubElement(case, "failure", about)
        text = "\n".join([*lines, "", trace(run)])
    else:
        result, text = ET.SubElement(case, "system-out"), trace(run)
    result.text = speakable(text)


def runs_as_json(
    tree: str, scenarios: Sequence[PlayedScenario], coverage: OutcomeCoverage | None = None
) -> str:
    """Return the played scenarios as a JSON object. Times are simulated seconds."""
    result: dict[str, object] = {"file": tree, "scenarios": [_scenario(each) for each in scenarios]}
    if coverage is not None:
        result["coverage"] = {
            "never_ticked": [_node_as_json(each) for each in coverage.never_ticked],
            "unseen": [
                {**_node_as_json(each), "outcomes": each.unseen_outcomes}
                for each in coverage.nodes_with_unseen_outcomes
            ],
        }
    return as_json(result)


def _scenario(played: PlayedScenario) -> dict[str, object]:
    run = played.run
    if run is None:
        return {"name": played.name, "holds": None, "problem": played.problem}
    return {
        "name": played.name,
        "file": run.scenario.path or None,
        "holds": None if run.is_undecided else not played.failures,
        "failures": [
            {"expected": each.expected, "message": each.message, "line": each.line or None}
            for each in played.failures
        ],
        "ended": run.ended,
        "root": run.root,
        "time": run.time_sec,
        "facts": run.simulated.fact_values(),
        "ticks": [_tick_as_json(run, tick) for tick in run.ticks],
    }


def _tick_as_json(run: ScenarioRun, tick: TickRecord) -> dict[str, object]:
    names = {behaviour.id: behaviour.name for behaviour in run.simulated.root.iterate()}
    return {
        "tick": tick.number,
        "time": tick.time_sec,
        "root": tick.root,
        "events": [
            {
                "leaf": "/".join(event.path),
                "what": event.what,
                "outcome": event.outcome or None,
                "status": event.status or None,
            }
            for event in tick.events
            if event.what != TICKED
        ],
        "facts": {name: to_json_value(value) for name, value in _new_values(tick.facts).items()},
        "keys": {name: to_json_value(value) for name, value in _new_values(tick.keys).items()},
        "statuses": [{"node": names[node], "status": status} for node, status in tick.statuses.items()],
    }


def _node_as_json(covered: NodeCoverage) -> dict[str, object]:
    element = covered.bound.element
    return {"name": covered.bound.name, "file": element.source.path, "line": element.line}
