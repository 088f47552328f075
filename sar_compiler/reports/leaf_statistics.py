"""Counts the results of leaves and the decisions of other nodes, and measures running times.

The statistics can also be written as assumptions for the analysis of other runs.
"""

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from operator import attrgetter
from typing import Any

from sar_compiler.analysis.sweep import Interval, wilson
from sar_compiler.analysis.sweep_table import quantile, table_text
from sar_compiler.journal.journal_entries import STATUS, JournalEntry
from sar_compiler.journal.recorded_events import recorded_events
from sar_compiler.runtime.events import DECIDED, HALTED, RETURNED, STARTED, Event
from sar_compiler.tree.display_text import escape_to_one_line
from sar_compiler.tree.plain import as_json, count_with_noun

FEWEST = 10
"""The minimum number of results of a leaf for which assumptions are written."""

# The assumed results of a leaf that does not declare its outcomes.
_USUAL = "SUCCESS", "FAILURE"


@dataclass
class OutcomeTimes:
    """The activations of a node that have ended with the same result.

    Attributes:
        status: The status of the result.
        label: The label of a leaf's outcome, or the message of another node; empty for none.
        times: The running time of the node in each activation, in seconds.
    """

    status: str
    label: str
    times: "array[float]" = field(default_factory=lambda: array("d"))

    @property
    def name(self) -> str:
        """The label, or the status if there is no label."""
        return self.label or self.status


@dataclass
class LeafStatistics:
    """The results of a leaf in recorded runs. The results of leaves with the same path are combined.

    Attributes:
        path: The names of the nodes from the root down to the leaf.
        outcomes: The results that ended an activation, by status and label.
        retries: The number of results whose preceding result, by the same leaf in the same run, was a
            failure.
        halted: The number of times that the leaf was halted while running.
        has_run: Whether the leaf was running at the end of a tick.
        is_declared: Whether the leaf declares its possible outcomes.
    """

    path: tuple[str, ...]
    outcomes: dict[tuple[str, str], OutcomeTimes] = field(default_factory=dict)
    retries: int = 0
    halted: int = 0
    has_run: bool = False
    is_declared: bool = False

    @property
    def key(self) -> str:
        """The name under which a properties or scenario file refers to the leaf."""
        return self.path[-1] if any("/" in part for part in self.path) else "/".join(self.path)

    @property
    def result_count(self) -> int:
        """The number of results that have ended an activation of the leaf."""
        return sum(len(each.times) for each in self.outcomes.values())

    def interval(self, outcome: OutcomeTimes, confidence: float) -> Interval:
        """Return the Wilson score interval for the share of an outcome in the results of the leaf."""
        return wilson(len(outcome.times), self.result_count, confidence)


@dataclass
class RunStatistics:
    """The results of a tree's nodes in recorded runs.

    Attributes:
        runs: The number of runs.
        leaves: The leaves with events, by path, in the order of their first events.
        decisions: The results that other nodes decided themselves, such as expired time limits, by node path,
            status and message.
    """

    runs: int = 0
    leaves: dict[tuple[str, ...], LeafStatistics] = field(default_factory=dict)
    decisions: dict[tuple[tuple[str, ...], str, str], OutcomeTimes] = field(default_factory=dict)

    def add(self, stream: Iterable[JournalEntry]) -> None:
        """Add the results in all runs of a journal.

        Args:
            stream: The entries of the journal, as `JournalFile.stream` yields them.
        """
        for _, entries in groupby(stream, key=attrgetter("run")):
            self.runs += 1
            declared: set[int] = set()
            numbers: dict[int, LeafStatistics] = {}
            run = _ActiveLeaves()
            for event in recorded_events(_record_labels(entries, declared)):
                if event.what == DECIDED:
                    self._add_decision(event)
                elif event.what in (STARTED, RETURNED, HALTED):
                    leaf = numbers.get(event.number)
                    if leaf is None:
                        leaf = self.leaves.setdefault(event.path, LeafStatistics(event.path))
                        numbers[event.number] = leaf
                    run.add_event(event, leaf)
            for number, leaf in numbers.items():
                leaf.is_declared |= number in declared

    def _add_decision(self, event: Event) -> None:
        made = OutcomeTimes(event.status, event.label)
        self.decisions.setdefault((event.path, event.status, event.label), made).times.append(event.ran_sec)


def _record_labels(entries: Iterable[JournalEntry], declared: set[int]) -> Iterator[JournalEntry]:
    """Yield the entries unchanged. Add the numbers of leaves with labelled outcomes to *declared*."""
    for entry in entries:
        if entry.kind == STATUS and "label" in entry.data:
            declared.add(entry.data["node"])
        yield entry


class _ActiveLeaves:
    """The leaves of a run that are currently active, with the starts of these activations."""

    def __init__(self) -> None:
        self._begun: dict[int, float] = {}
        self._failed: set[int] = set()

    def add_event(self, event: Event, leaf: LeafStatistics) -> None:
        """Add an event of a leaf to the leaf's statistics."""
        number, now = event.number, event.time_sec or 0.0
        if event.what == STARTED:
            self._begun[number] = now
        elif event.what == HALTED:
            leaf.halted += self._begun.pop(number, None) is not None
        elif event.status == "RUNNING":
            leaf.has_run = True
        elif event.status != "SKIPPED":
            outcome = event.status, event.label
            known = leaf.outcomes.get(outcome)
            if known is None:
                known = leaf.outcomes[outcome] = OutcomeTimes(*outcome)
            known.times.append(max(0.0, now - self._begun.pop(number, now)))
            leaf.retries += number in self._failed
            (self._failed.add if event.status == "FAILURE" else self._failed.discard)(number)


def statistics_as_text(found: RunStatistics, confidence: float) -> str:
    """Return a table with a line for each outcome of each leaf.

    The line states the outcome's share in percent.
    """
    interval = f"{100 * confidence:g} % interval"
    lines = [
        _line(leaf, outcome, interval, confidence, is_first=not place)
        for leaf in found.leaves.values()
        for place, outcome in enumerate(leaf.outcomes.values() or [None])
    ]
    remarks = f"{count_with_noun(found.runs, 'run')}. A share is the part of a leaf's activations that ended with this outcome. Intervals are Wilson score intervals. A result that is repeated on consecutive ticks is counted once."
    if not lines:
        return f"{count_with_noun(found.runs, 'run')}. No leaf has returned a result."
    decided = [
        {
            "node": path[-1],
            "own result": f"{status}{f', {message}' if message else ''}",
            "count": str(len(made.times)),
            "time (median)": f"{quantile(sorted(made.times), 0.5):.1f} s",
        }
        for (path, status, message), made in found.decisions.items()
    ]
    more = f"\n\n{table_text(decided, 2)}" if decided else ""
    return f"{table_text(lines, 2)}{more}\n\n{remarks}"


def _line(
    leaf: LeafStatistics, outcome: OutcomeTimes | None, interval: str, confidence: float, *, is_first: bool
) -> Mapping[str, str]:
    line = {"leaf": leaf.key if is_first else "", "outcome": outcome.name if outcome else ""}
    if outcome is not None:
        low, high = leaf.interval(outcome, confidence)
        times = sorted(outcome.times)
        line |= {
            "count": str(len(times)),
            "share": f"{100 * len(times) / leaf.result_count:.1f} %",
            interval: f"{100 * low:.1f} to {100 * high:.1f}",
            "time (median)": f"{quantile(times, 0.5):.1f} s",
            "(5th, 95th percentile)": f"{quantile(times, 0.05):.1f}, {quantile(times, 0.95):.1f}",
        }
    return line | ({"retries": str(leaf.retries), "stopped": str(leaf.halted)} if is_first else {})


def statistics_as_json(found: RunStatistics, confidence: float) -> str:
    """Return the statistics as a JSON object, with times in seconds and shares between 0 and 1."""
    leaves = [
        {
            "path": list(leaf.path),
            "count": leaf.result_count,
            "retries": leaf.retries,
            "stopped": leaf.halted,
            "outcomes": [_outcome_data(leaf, outcome, confidence) for outcome in leaf.outcomes.values()],
        }
        for leaf in found.leaves.values()
    ]
    decisions = [
        {
            "path": list(path),
            "status": status,
            "message": message,
            "count": len(made.times),
            "time": _times_data(made),
        }
        for (path, status, message), made in found.decisions.items()
    ]
    about = {"runs": found.runs, "confidence": confidence, "interval": "Wilson"}
    return as_json({**about, "leaves": leaves, "decisions": decisions})


def _outcome_data(leaf: LeafStatistics, outcome: OutcomeTimes, confidence: float) -> Mapping[str, Any]:
    return {
        "status": outcome.status,
        "label": outcome.label,
        "count": len(outcome.times),
        "share": len(outcome.times) / leaf.result_count,
        "interval": list(leaf.interval(outcome, confidence)),
        "time": _times_data(outcome),
    }


def _times_data(outcome: OutcomeTimes) -> Mapping[str, float]:
    times = sorted(outcome.times)
    return {name: quantile(times, part) for name, part in (("p5", 0.05), ("median", 0.5), ("p95", 0.95))}


def statistics_as_yaml(found: RunStatistics, confidence: float) -> str:
    """Return the statistics as a section `outcomes:` of a properties or scenario file, with `p` and `sec`.

    A leaf with fewer than `FEWEST` results is named only in a comment.
    """
    known = [leaf for leaf in found.leaves.values() if leaf.result_count >= FEWEST]
    lines = [
        f"# Results of leaves in {count_with_noun(found.runs, 'run')}, counted by sar-journal stats.",
        f"# p: {100 * confidence:g} % Wilson interval of a share. sec: 5th to 95th percentile of the running times.",
        *(
            f"# Fewer than {FEWEST} results, so no assumption is written: {leaf.key} ({leaf.result_count})"
            for leaf in found.leaves.values()
            if leaf not in known
        ),
        "outcomes:" if known else "outcomes: {}",
    ]
    for leaf in known:
        lines.append(f"  {as_json(leaf.key)}:  # {leaf.result_count} outcomes")
        lines += [f"  - {as_json(item, indent=None)}" for item in _outcome_assumptions(leaf, confidence)]
    return "\n".join(map(escape_to_one_line, lines))


def _outcome_assumptions(leaf: LeafStatistics, confidence: float) -> Sequence[object]:
    """Return assumptions about a leaf: each outcome with the bounds of its probability and duration."""
    items: list[object] = []
    outcomes = [*leaf.outcomes.values()]
    if not leaf.is_declared:
        # The file must list all possible outcomes of a leaf that does not declare them.
        seen = {outcome.status for outcome in outcomes}
        outcomes += [OutcomeTimes(status, "") for status in _USUAL if status not in seen]
    for outcome in outcomes:
        low, high = leaf.interval(outcome, confidence)
        item: dict[str, object] = {"outcome" if leaf.is_declared else "status": outcome.name}
        item["p"] = [round(low, 4), round(high, 4)]
        times = sorted(outcome.times)
        if leaf.has_run and times and times[-1]:
            item["sec"] = [round(quantile(times, part), 3) for part in (0.05, 0.95)]
        items.append(item)
    return items if leaf.is_declared or not leaf.has_run else [*items, "RUNNING"]
