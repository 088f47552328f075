"""Reports, as text or JSON, whether recorded runs are possible runs of their trees."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from sar_compiler.analysis.conformance import (
    Conformance,
    ImpossibleEvent,
    PropertyResult,
    RecordedProperty,
    event_text,
)
from sar_compiler.analysis.sweep_table import table_text
from sar_compiler.runtime.clock import clock_text
from sar_compiler.runtime.events import Event
from sar_compiler.tree.display_text import escape_to_one_line
from sar_compiler.tree.plain import as_json, count_with_noun

_WRONG = (PropertyResult.BROKEN, PropertyResult.IN_DOUBT)
# The text for the end of a run that is still active.
_END_WORDS = {"running": "running, compared so far"}


class ComparedRun(NamedTuple):
    """The last run of a journal, and the result of comparing this run with the possible runs of its tree.

    Attributes:
        journal: The path of the journal.
        run: The number of the run, from 1; 0 if the journal has no run.
        end: The end of the run in a word: `over`, `stopped`, `failed`, `crashed`, `running`.
        found: The result of the comparison; None if the run could not be compared.
        problem: The reason why the run could not be compared; empty if the run was compared.
        changed: The changes of the tree since the run, in words; empty for none.
    """

    journal: Path
    run: int
    end: str
    found: Conformance | None
    problem: str = ""
    changed: str = ""

    @property
    def is_fine(self) -> bool:
        """Whether the recorded run is possible in its tree, and no property was or may have been violated."""
        return self.found is not None and self.found.is_fine

    @property
    def violated_properties(self) -> list[RecordedProperty]:
        """The properties that the run violated or may have violated."""
        return [each for each in self.found.properties if each.fate in _WRONG] if self.found else []


def runs_as_text(runs: Sequence[ComparedRun]) -> str:
    """Return the details of a single run.

    For several runs, return a table and the details of the failed ones.
    """
    if len(runs) == 1:
        return "\n".join(map(escape_to_one_line, _run_lines(runs[0])))
    lines = [table_text([*map(_row, runs)], 4)]
    for compared in runs:
        if not compared.is_fine:
            lines += ["", *map(escape_to_one_line, _run_lines(compared))]
    return "\n".join(lines)


def _row(compared: ComparedRun) -> dict[str, str]:
    found = compared.found
    fits = "not compared"
    if found is not None:
        fits = "yes" if found.misfit is None else f"no, from tick {found.misfit.tick}"
    names = [f"{each.name}{_uncertainty_text(each)}" for each in compared.violated_properties]
    return {
        "journal": escape_to_one_line(str(compared.journal)),
        "end": compared.end,
        "conforms": fits,
        "violated": escape_to_one_line(", ".join(names))
        or ("none" if found else compared.problem.partition(". ")[0]),
    }


def _uncertainty_text(each: RecordedProperty) -> str:
    return " (perhaps)" if each.fate is PropertyResult.IN_DOUBT else ""


def _run_lines(compared: ComparedRun) -> Iterator[str]:
    found = compared.found
    if found is None:
        yield f"{compared.journal}: not compared: {compared.problem}"
        return
    end = _END_WORDS.get(compared.end, compared.end)
    yield f"{compared.journal}: run {compared.run}, {end}, {count_with_noun(found.ticks, 'tick')}"
    if compared.changed:
        yield f"the tree has changed since the run: {compared.changed}"
    if found.misfit is None:
        assumed = f", if {' and '.join(found.assumed)}" if found.assumed else ""
        yield f"conforms: it is a possible run of the tree{assumed}"
    else:
        yield from _misfit_lines(found.misfit)
    yield from _property_lines(found)


def _misfit_lines(misfit: ImpossibleEvent) -> Iterator[str]:
    yield f"does not conform from tick {misfit.tick} on, {clock_text(misfit.time_sec)}: {misfit.event}  ({misfit.place})"
    if misfit.why:
        yield f"  {misfit.why}"
    if misfit.possible:
        yield f"  possible instead: {', '.join(misfit.possible)}"
    yield from _event_lines(misfit.run)


def _property_lines(found: Conformance) -> Iterator[str]:
    if found.properties:
        counts = Counter(each.fate for each in found.properties)
        listed = ", ".join(f"{counts[fate]} {fate.value}" for fate in PropertyResult if counts[fate])
        yield f"{'1 property' if len(found.properties) == 1 else f'{len(found.properties)} properties'}: {listed}"
    if found.misfit is not None and found.properties:
        yield f"  from tick {found.misfit.tick} on, only the events of leaves are used to check properties"
    width = max((len(each.name) for each in found.properties), default=0) + 1
    yield from (f"  {each.name + ':':{width}} {each.fate.value}" for each in found.properties)
    for each in found.left_out:
        yield f"  {each.name}: left out, because this tree has no {', '.join(each.missing)}"
    for broken in found.properties:
        if broken.fate in _WRONG:
            yield ""
            yield from _violation_lines(broken)


def _violation_lines(broken: RecordedProperty) -> Iterator[str]:
    said = f"by {broken.event} in" if broken.event else "at the end of"
    place = f"  ({broken.place})" if broken.place else ""
    yield f"{broken.name}: {broken.fate.value} {said} tick {broken.tick}, {clock_text(broken.time_sec)}{place}"
    if broken.fate is PropertyResult.IN_DOUBT:
        yield "  the record matches runs that violate the property, but also runs that do not violate it"
    yield from _event_lines(broken.run)


def _event_lines(run: Sequence[Event]) -> Iterator[str]:
    if run:
        yield "  the last events:"
    for event in run:
        yield f"    {clock_text(event.time_sec or 0.0):>7}  tick {event.tick:>4}  {event_text(event)}"


def runs_as_json(runs: Sequence[ComparedRun]) -> str:
    """Return the comparisons of runs as a JSON object."""
    return as_json({"fine": all(each.is_fine for each in runs), "runs": [*map(_run_data, runs)]})


def _run_data(compared: ComparedRun) -> dict[str, object]:
    found = compared.found
    data: dict[str, object] = {
        "journal": str(compared.journal),
        "run": compared.run,
        "end": compared.end,
        "problem": compared.problem,
    }
    if found is None:
        return {**data, "conforms": None}
    return {
        **data,
        "conforms": found.misfit is None,
        "assumed": list(found.assumed),
        "ticks": found.ticks,
        "tree_changed": compared.changed,
        "misfit": found.misfit and _with_run(found.misfit._asdict()),
        "properties": [_with_run({**each._asdict(), "fate": each.fate.value}) for each in found.properties],
        "left_out": [{"property": each.name, "missing": list(each.missing)} for each in found.left_out],
    }


def _with_run(data: dict[str, object]) -> dict[str, object]:
    """Replace each event in `run` by a list of time, tick, node and action, as in journals."""
    run = data["run"]
    assert isinstance(run, tuple)  # noqa: S101 - of events
    return {**data, "run": [[each.time_sec, each.tick, each.number, each.action] for each in run]}
