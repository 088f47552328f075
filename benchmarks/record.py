"""What a run has measured, the record that it is compared with, and the guard."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.figures import Figure, Missing

RECORD = Path(__file__).with_name("recorded.json")
WORSE = 1.5
"""A ratio that is so many times the recorded one is a failure."""


class Run(NamedTuple):
    """What has been measured.

    Attributes:
        surroundings: The machine, the date and the versions, by what they are called.
        figures: The figures of each benchmark.
        missing: What each benchmark could not measure.
    """

    surroundings: Mapping[str, str]
    figures: dict[str, list[Figure]]
    missing: dict[str, list[Missing]]


def worse(run: Run, recorded: Run) -> list[str]:
    """Return what is `WORSE` times the recorded ratio, or more; a line for each."""
    before = {(name, *each[:2]): each.ratio for name, figures in recorded.figures.items() for each in figures}
    lines = []
    for name, figures in run.figures.items():
        for figure in figures:
            ratio = before.get((name, *figure[:2]))
            if ratio and figure.ratio >= WORSE * ratio:
                beside = f" beside {figure.against}" if figure.against else ""
                lines.append(
                    f"{name}: {figure.subject}{beside}: {figure.ratio:.3g}, recorded was {ratio:.3g}: "
                    f"{figure.ratio / ratio:.1f} times as much"
                )
    return lines


def merged(run: Run, recorded: Run) -> Run:
    """Return the record with what a run of some benchmarks has measured in its place."""
    return Run(run.surroundings, {**recorded.figures, **run.figures}, {**recorded.missing, **run.missing})


def load(path: Path) -> Run:
    """Return the record; nothing if there is none."""
    if not path.exists():
        return Run({}, {}, {})
    data = json.loads(path.read_bytes())
    return Run(
        data["surroundings"],
        {name: [Figure(*each) for each in figures] for name, figures in data["figures"].items()},
        {name: [Missing(*each) for each in missing] for name, missing in data["missing"].items()},
    )


def save(run: Run, path: Path) -> None:
    """Write the record, with one figure in each line."""
    surroundings = json.dumps(run.surroundings, indent=1)
    path.write_text(
        f'{{"surroundings": {surroundings},\n"figures": {_by_name(run.figures)},\n'
        f'"missing": {_by_name(run.missing)}}}\n',
        encoding="utf-8",
    )


def _by_name(lists: Mapping[str, Sequence[Figure]] | Mapping[str, Sequence[Missing]]) -> str:
    parts = []
    for name, each in lists.items():
        lines = ",\n".join(json.dumps([_rounded(value) for value in entry]) for entry in each)
        parts.append(f"{json.dumps(name)}: [\n{lines}\n]")
    return "{" + ",\n".join(parts) + "}"


def _rounded(value: str | float) -> str | float:
    return value if isinstance(value, str) else float(f"{value:.4g}")
