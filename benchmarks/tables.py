"""The tables of `benchmarks/README.md`, made of what a run has measured."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from benchmarks.figures import Figure, Missing
from benchmarks.goals import GOALS, Goal
from benchmarks.record import Run

README = Path(__file__).with_name("README.md")
BEGIN, END = "<!-- made by `make bench` -->\n", "<!-- end -->\n"
NOT_MEASURED = "not measured"


def _seconds(value: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{_number(value / size)} {unit}"
    return f"{_number(value / 1e-6)} µs"


def _number(value: float) -> str:
    """Return a number with three digits that count."""
    digits = next((digits for digits, below in enumerate((100.0, 10.0, 1.0, 0.1, 0.01)) if value >= below), 5)
    return f"{value:,.{digits}f}"


UNITS: Mapping[str, Callable[[float], str]] = {
    "s": _seconds,
    "s/state": lambda value: f"{1 / value:,.0f} states/s",
    "s/run": lambda value: f"{1 / value:,.0f} runs/s",
    "s/mission": lambda value: f"{60 / value:,.0f} missions/min",
    "s/event": lambda value: f"{1e6 * value:.2f} µs an event and property",
    "s/step": lambda value: f"{1 / value:,.0f} steps/s",
    "bytes": lambda value: f"{value / 2**20:,.0f} MiB",
    "bytes/state": lambda value: f"{value:,.0f} bytes a state",
    "states": lambda value: f"{value:,.0f} states",
    "core": lambda value: f"{value:.1%} of a core",
    "share": lambda value: f"{value:.1%}",
    "modules": lambda value: f"{value:,.0f} modules",
}
"""How a figure is written, by its unit."""
_MORE_IS_BETTER = {"s/run", "s/mission", "s/state", "s/step"}  # as they are written


def rewrite(run: Run, path: Path) -> None:
    """Put the tables of a run into the page, in place of those between its two marks."""
    before, _, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    path.write_text(f"{before}{BEGIN}{tables(run)}{END}{rest.partition(END)[2]}", encoding="utf-8")


def tables(run: Run) -> str:
    """Return all tables."""
    parts = [_table(("", ""), run.surroundings.items()) if run.surroundings else f"{NOT_MEASURED} yet\n"]
    rows = [(goal.what, goal.before, _wanted(goal), _now(goal, run), goal.how) for goal in GOALS]
    parts.append("## Goals\n\n" + _table(("", "before", "goal", "now", "how measured"), rows))
    names = dict.fromkeys([*run.figures, *run.missing])
    parts.extend(
        f"## {name.replace('-', ' ').capitalize()}\n\n{benchmark_table(run, name)}" for name in names
    )
    return "\n" + "\n".join(parts)


def benchmark_table(run: Run, name: str) -> str:
    """Return the table of one benchmark, with a column for each reference, and what was not measured below it."""
    figures = run.figures.get(name, ())
    references = list(dict.fromkeys(each.against for each in figures if each.against))
    by_subject: dict[str, dict[str, Figure]] = {}
    for figure in figures:
        by_subject.setdefault(figure.subject, {})[figure.against] = figure
    rows = [
        (subject, _taken(found.values()), *(_ratio(found.get(each)) for each in references))
        for subject, found in by_subject.items()
    ]
    head = ("", "takes", *(f"x {each}" for each in references))
    missing = [f"- {NOT_MEASURED}: {_words(each)}\n" for each in run.missing.get(name, ())]
    return (_table(head, rows) if rows else "") + ("\n" if rows and missing else "") + "".join(missing)


def _words(missing: Missing) -> str:
    beside = f"{'beside ' if missing.subject else ''}{missing.against}" if missing.against else ""
    return ": ".join(
        part for part in (" ".join(filter(None, (missing.subject, beside))), missing.reason) if part
    )


def _now(goal: Goal, run: Run) -> str:
    """Return what a goal has come to."""
    found = {each.against: each for each in _of(goal, run)}
    wanted = [against for against in goal.limits if against]
    if not found or any(against not in found for against in wanted):
        reasons = [each.reason for each in run.missing.get(goal.benchmark, ()) if _concerns(each, goal)]
        return ": ".join([NOT_MEASURED, *reasons[:1]])
    is_met = all(
        (found[against].ratio if against else next(iter(found.values())).ours) <= limit
        for against, limit in goal.limits.items()
    )
    said = [_taken(found.values()), *(f"{_ratio(found[against])} x {against}" for against in wanted)]
    return f"{'met' if is_met else '**missed**'}: {', '.join(said)}"


def _wanted(goal: Goal) -> str:
    """Return a goal's limits in words."""
    if not goal.limits:
        return "done"
    said = []
    for against, limit in goal.limits.items():
        sign = "≥" if not against and goal.unit in _MORE_IS_BETTER else "≤"
        said.append(f"{sign} {limit:g} x {against}" if against else f"{sign} {UNITS[goal.unit](limit)}")
    return ", ".join(said)


def _of(goal: Goal, run: Run) -> list[Figure]:
    return [each for each in run.figures.get(goal.benchmark, ()) if each.subject == goal.subject]


def _concerns(missing: Missing, goal: Goal) -> bool:
    return missing.subject in {"", goal.subject} and (not missing.against or missing.against in goal.limits)


def _taken(figures: Iterable[Figure]) -> str:
    figure = next(iter(figures))
    return UNITS[figure.unit](figure.ours)


def _ratio(figure: Figure | None) -> str:
    """Return a ratio with its quartiles."""
    if figure is None:
        return ""
    return f"{_number(figure.ratio)} ({_number(figure.low)} to {_number(figure.high)})"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    head = list(head)
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
