"""The rows of the table: their measurements, goals, and the format of their results."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

from benchmarks.figures import Effort


class Limit(NamedTuple):
    """A goal for one value of a row.

    Attributes:
        value: The maximum of the value, or the minimum.
        unit: A key of `UNITS`, or `x` with the name of a reference, for a ratio.
        is_least: Whether the limit is a minimum.
        what: The name of the value, if a row has several values of one unit.
    """

    value: float
    unit: str
    is_least: bool = False
    what: str = ""

    def is_met(self, value: float) -> bool:
        """Return whether a value meets the goal."""
        return value >= self.value if self.is_least else value <= self.value

    def write(self, value: float) -> str:
        """Return a value in the unit, with its name."""
        write = UNITS.get(self.unit)
        text = write(value) if write is not None else f"{_number(value)} {self.unit}"
        return f"{text} {self.what}".rstrip()

    def __str__(self) -> str:
        return f"{'≥' if self.is_least else '≤'} {self.write(self.value)}"


class Measured(NamedTuple):
    """The result of a row.

    Attributes:
        values: One for each limit of the row.
        note: Further information, such as the value of the reference.
    """

    values: tuple[float, ...]
    note: str = ""


class MissedError(Exception):
    """The goal is missed without a value: a proof is not decided, for example."""


class Row(NamedTuple):
    """A row of the table.

    Attributes:
        what: The name of the measured quantity, which identifies the row in the record.
        limits: The goal, a limit for each value.
        how: The method of measurement, in short.
        measure: The function that measures it. Its first argument is the result of `set_up`.
    """

    what: str
    limits: tuple[Limit, ...]
    how: str
    measure: Callable[[Any, Effort], Measured]

    @property
    def goal(self) -> str:
        """The limits in words."""
        return ", ".join(map(str, self.limits))


class Benchmark(NamedTuple):
    """Rows with the same requirements.

    Attributes:
        rows: The rows.
        set_up: The context manager that sets up the requirements.
    """

    rows: Sequence[Row]
    set_up: Callable[[Effort], AbstractContextManager[Any]]


class Result(NamedTuple):
    """The result of a row.

    Attributes:
        values: One for each limit; none if there is no value.
        note: Further information, or why there is no value.
        is_missed: Whether the goal is missed although there is no value.
    """

    values: tuple[float, ...] = ()
    note: str = ""
    is_missed: bool = False


def write_result(row: Row, result: Result | None) -> str:
    """Return a result in the format of the table."""
    if result is None:
        return "not measured"
    if not result.values:
        return f"{'**missed**' if result.is_missed else 'not measured'}: {result.note}"
    is_met = all(limit.is_met(value) for limit, value in zip(row.limits, result.values, strict=True))
    text = ", ".join(limit.write(value) for limit, value in zip(row.limits, result.values, strict=True))
    return f"{'met' if is_met else '**missed**'}: {text}{f' ({result.note})' if result.note else ''}"


def write_table(lines: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown; its first line is the head."""
    head, *rest = lines
    return "".join(f"| {' | '.join(cells)} |\n" for cells in (head, ["---"] * len(head), *rest))


def seconds(value: float) -> str:
    """Return seconds in a fitting unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{_number(value / size)} {unit}"
    return f"{_number(value / 1e-6)} µs"


def _number(value: float) -> str:
    """Return a number with three significant digits, without trailing zeros."""
    digits = next((digits for digits, below in enumerate((100.0, 10.0, 1.0, 0.1, 0.01)) if value >= below), 5)
    text = f"{value:,.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


UNITS: Mapping[str, Callable[[float], str]] = {
    "s": seconds,
    "s CPU": lambda value: f"{seconds(value)} CPU",
    "s passing": lambda value: f"{seconds(value)} passing",
    "ms passing": lambda value: f"{_number(value)} ms passing",
    "min passing": lambda value: f"{_number(value)} min passing",
    "min CPU": lambda value: f"{_number(value)} min CPU",
    "MB": lambda value: f"{_number(value)} MB",
    "% of a core": lambda value: f"{_number(value)} % of a core",
    "%": lambda value: f"{_number(value)} %",
    "/min": lambda value: f"{_number(value)} a minute",
}
"""The format of a value by its unit."""


def rows_of(benchmarks: Mapping[str, Benchmark]) -> Iterator[Row]:
    """Yield all rows, in their order."""
    for benchmark in benchmarks.values():
        yield from benchmark.rows
