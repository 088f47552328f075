"""The results of a measurement, the record to which they are compared, and their table."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from benchmarks.rows import Result, Row, write_result, write_table

RECORD, PAGE = (Path(__file__).with_name(name) for name in ("recorded.json", "README.md"))
WORSE = 1.5
"""A value that exceeds the recorded one by this factor is a failure."""
BEGIN, END = "<!-- made by `make bench` -->\n", "<!-- end -->\n"


class Run(NamedTuple):
    """The results of a measurement.

    Attributes:
        conditions: The machine, the date and the versions, by their names.
        results: The result of each row, by the name of the row.
    """

    conditions: Mapping[str, str]
    results: Mapping[str, Result]


def find_worse(rows: Iterable[Row], run: Run, recorded: Run) -> list[str]:
    """Return a line for each value that is `WORSE` times the recorded one, or more."""
    lines = []
    for row in rows:
        now, before = (each.results.get(row.what, Result()).values for each in (run, recorded))
        for limit, value, old in zip(row.limits, now, before, strict=False):
            low, high = (value, old) if limit.is_least else (old, value)
            if low > 0.0 and high >= WORSE * low:
                lines.append(f"{row.what}: {limit.write(value)}, recorded was {limit.write(old)}")
    return lines


def merged(run: Run, recorded: Run) -> Run:
    """Return the record with the results of a run of some benchmarks in place of the old ones."""
    return Run(run.conditions, {**recorded.results, **run.results})


def load(path: Path) -> Run:
    """Return the record, or an empty record if there is no file."""
    if not path.exists():
        return Run({}, {})
    data = json.loads(path.read_bytes())
    results = {
        what: Result(tuple(values), note, is_missed)
        for what, (values, note, is_missed) in data["results"].items()
    }
    return Run(data["conditions"], results)


def save(rows: Iterable[Row], run: Run, path: Path) -> None:
    """Write the record, with one row in each line."""
    lines = [
        f"{json.dumps(row.what)}: {json.dumps([[float(f'{value:.4g}') for value in result.values], *result[1:]])}"
        for row in rows
        if (result := run.results.get(row.what)) is not None
    ]
    conditions = json.dumps(run.conditions, indent=1)
    text = ",\n".join(lines)
    path.write_text(f'{{"conditions": {conditions},\n"results": {{\n{text}\n}}}}\n', encoding="utf-8")


def write_tables(rows: Iterable[Row], run: Run) -> str:
    """Return the table of the conditions, and that of all rows."""
    conditions = write_table([("Condition", "Value"), *run.conditions.items()])
    lines = [(row.what, row.goal, write_result(row, run.results.get(row.what)), row.how) for row in rows]
    return f"\n{conditions}\n{write_table([('Row', 'Goal', 'Result', 'How it is measured'), *lines])}"


def rewrite(rows: Iterable[Row], run: Run, path: Path) -> None:
    """Replace the tables between the two marks of the page by those of a run."""
    before, _, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    text = f"{before}{BEGIN}{write_tables(rows, run)}{END}{rest.partition(END)[2]}"
    path.write_text(text, encoding="utf-8")
