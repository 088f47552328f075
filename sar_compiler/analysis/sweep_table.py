"""Displays the results of Monte Carlo runs as a table or as JSON."""

from collections.abc import Iterator, Mapping, Sequence
from math import sqrt
from pathlib import Path
from statistics import NormalDist, fmean, stdev
from typing import NamedTuple

from sar_compiler.analysis.sweep import RunResultSample, StoppingRule, SweepRow
from sar_compiler.tree.plain import as_json

Smallest = tuple[SweepRow, RunResultSample] | None


def sweep_as_text(
    rows: Sequence[SweepRow], rule: StoppingRule, smallest: Smallest, written: tuple[Path, str] | None
) -> str:
    """Return a table with a line for each row and rates in percent, followed by the smallest failed run.

    Args:
        rows: The rows.
        rule: The stopping rule of the rows.
        smallest: The failed run that differs least from a default run, with its row; None if no run has
            failed.
        written: The scenario file of this run, and the command that replays the run; None for no file.
    """
    confidence = f"{100 * rule.confidence:g} % interval"
    lines = [_row_cells(row, rule, confidence) for row in rows]
    text = table_text(lines, len(rows[0].labels))
    if smallest is not None:
        row, played = smallest
        which = "".join(f"{name} {value}, " for name, value in row.labels.items())
        text += f"\n\nThe failed run that differs least from a default run ({which}seed {played.seed}): {played.failure}"
    if written is not None:
        text += f"\n  The smallest failing scenario was written to {written[0]}. Replay it with: {written[1]}"
    return text


def table_text(lines: Sequence[Mapping[str, str]], labels: int) -> str:
    """Format rows as a table in plain text.

    Args:
        lines: The rows, at least one; each maps column heads to cells.
        labels: The number of left-aligned columns, which come first.
    """
    heads = list(dict.fromkeys(head for line in lines for head in line))
    table = [heads, *([line.get(head, "") for head in heads] for line in lines)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return "\n".join("  ".join(_align(cells, widths, labels)).rstrip() for cells in table)


def _align(cells: Sequence[str], widths: Sequence[int], labels: int) -> Iterator[str]:
    """Yield the padded cells of a row. Labels are aligned left, and numbers are aligned right."""
    for index, (cell, width) in enumerate(zip(cells, widths, strict=True)):
        yield cell.ljust(width) if index < labels else cell.rjust(width)


def _row_cells(row: SweepRow, rule: StoppingRule, confidence: str) -> Mapping[str, str]:
    interval, times = rule.interval(row.outcomes), _times(row.outcomes)
    return {
        **row.labels,
        "runs": str(len(row.outcomes)),
        "success": f"{100 * _rate(row.outcomes):.1f} %" if row.outcomes else "",
        confidence: f"{100 * interval.low:.1f} to {100 * interval.high:.1f}",
        "time (median)": f"{quantile(times, 0.5):.1f} s" if times else "",
        "(95th percentile)": f"{quantile(times, 0.95):.1f} s" if times else "",
        **{name: _margin_text(*mean) for name, mean in _means(row.outcomes, rule.confidence).items()},
    }


def sweep_as_json(
    rows: Sequence[SweepRow], rule: StoppingRule, smallest: Smallest, written: tuple[Path, str] | None
) -> str:
    """Return the results as a JSON object, with times in seconds and rates between 0 and 1."""
    result: dict[str, object] = {"rows": [_row_data(row, rule) for row in rows], "smallest": None}
    if smallest is not None:
        row, played = smallest
        path, again = written or (None, None)
        file = {"file": path and str(path), "again": again}
        result["smallest"] = {"labels": row.labels, "seed": played.seed, "failure": played.failure, **file}
    return as_json(result)


def _row_data(row: SweepRow, rule: StoppingRule) -> Mapping[str, object]:
    times, failed = _times(row.outcomes), [each for each in row.outcomes if each.failure]
    means = _means(row.outcomes, rule.confidence)
    return {
        "labels": row.labels,
        "runs": len(row.outcomes),
        "successes": len(times),
        "rate": _rate(row.outcomes) if row.outcomes else None,
        "interval": list(rule.interval(row.outcomes)),
        "time": {"median": quantile(times, 0.5), "p95": quantile(times, 0.95)} if times else None,
        "means": {name: mean.value for name, mean in means.items()},
        "margins": {name: mean.margin for name, mean in means.items()},
        "failures": [{"seed": each.seed, "failure": each.failure} for each in failed],
    }


def _rate(outcomes: Sequence[RunResultSample]) -> float:
    return sum(not each.failure for each in outcomes) / len(outcomes)


class _Mean(NamedTuple):
    """The mean of a number over runs, and the half-width of its confidence interval (None for one run)."""

    value: float
    margin: float | None


def _means(outcomes: Sequence[RunResultSample], confidence: float) -> dict[str, _Mean]:
    """Return the mean count of each event over the runs in which the event was counted."""
    names = dict.fromkeys(name for each in outcomes for name in each.counts)
    counts = {name: [each.counts[name] for each in outcomes if name in each.counts] for name in names}
    z = NormalDist().inv_cdf((1.0 + confidence) / 2.0)
    return {
        name: _Mean(fmean(values), z * stdev(values) / sqrt(len(values)) if len(values) > 1 else None)
        for name, values in counts.items()
    }


def _margin_text(value: float, margin: float | None) -> str:
    return f"{value:.2f}" if margin is None else f"{value:.2f} ± {margin:.2f}"


def _times(outcomes: Sequence[RunResultSample]) -> list[float]:
    """Return the durations of successful runs in ascending order."""
    return sorted(each.time_sec for each in outcomes if not each.failure)


def quantile(ordered: Sequence[float], part: float) -> float:
    """Return the smallest value such that at least the share *part* of the values is not larger."""
    return ordered[max(0, -(-len(ordered) * round(part * 100) // 100) - 1)]
