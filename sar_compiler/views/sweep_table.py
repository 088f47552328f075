"""The table of a sweep, as text and as JSON."""

from collections.abc import Mapping, Sequence
from statistics import fmean

from sar_compiler.checks.sweep.sweeping import Played, StoppingRule, SweptRow


def sweep_as_text(rows: Sequence[SweptRow], rule: StoppingRule) -> str:
    """Return a line for each row, with the rates in percent."""
    confidence = f"{100 * rule.confidence:g} % interval"
    lines = [_line(row, rule, confidence) for row in rows]
    heads = list(dict.fromkeys(head for line in lines for head in line))
    table = [heads, *([line.get(head, "") for head in heads] for line in lines)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    labels = max(len(row.labels) for row in rows)
    return "\n".join(
        "  ".join(
            cell.ljust(width) if index < labels else cell.rjust(width)
            for index, (cell, width) in enumerate(zip(cells, widths, strict=True))
        ).rstrip()
        for cells in table
    )


def _line(row: SweptRow, rule: StoppingRule, confidence: str) -> Mapping[str, str]:
    interval, times = rule.interval(row.outcomes), _times(row.outcomes)
    return {
        **row.labels,
        "runs": str(len(row.outcomes)),
        "success": f"{100 * _rate(row.outcomes):.1f} %" if row.outcomes else "",
        confidence: f"{100 * interval.low:.1f} to {100 * interval.high:.1f}",
        "time (median)": f"{_quantile(times, 0.5):.1f} s" if times else "",
        "(95th percentile)": f"{_quantile(times, 0.95):.1f} s" if times else "",
        **{name: f"{mean:.2f}" for name, mean in _means(row.outcomes).items()},
    }


def failure_as_text(row: SweptRow, outcome: Played) -> str:
    """Return what failed in a run, and in which."""
    labels = "".join(f"{name} {value}, " for name, value in row.labels.items())
    return f"The failure nearest to a usual run ({labels}seed {outcome.seed}): {outcome.failure}"


def sweep_as_json(rows: Sequence[SweptRow], rule: StoppingRule) -> Sequence[Mapping[str, object]]:
    """Return an object for each row, for JSON; times are seconds, rates between 0 and 1."""
    return [_object(row, rule) for row in rows]


def _object(row: SweptRow, rule: StoppingRule) -> Mapping[str, object]:
    interval, times = rule.interval(row.outcomes), _times(row.outcomes)
    return {
        "labels": row.labels,
        "runs": len(row.outcomes),
        "successes": sum(not each.failure for each in row.outcomes),
        "rate": _rate(row.outcomes) if row.outcomes else None,
        "interval": list(interval),
        "time": {"median": _quantile(times, 0.5), "p95": _quantile(times, 0.95)} if times else None,
        "means": _means(row.outcomes),
        "failures": [{"seed": each.seed, "failure": each.failure} for each in row.outcomes if each.failure],
    }


def _rate(outcomes: Sequence[Played]) -> float:
    return sum(not each.failure for each in outcomes) / len(outcomes)


def _means(outcomes: Sequence[Played]) -> dict[str, float]:
    names = dict.fromkeys(name for each in outcomes for name in each.counts)
    return {name: fmean(each.counts.get(name, 0.0) for each in outcomes) for name in names}


def _times(outcomes: Sequence[Played]) -> list[float]:
    """Return how long the runs took that have succeeded, the shortest first."""
    return sorted(each.time_sec for each in outcomes if not each.failure)


def _quantile(ordered: Sequence[float], part: float) -> float:
    """Return the smallest time that so large a part of the times does not exceed."""
    return ordered[max(0, -(-len(ordered) * round(part * 100) // 100) - 1)]
