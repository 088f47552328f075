"""Scores: how often `why` names the cause of a failure first, and how often suggestions restore a tree with a typo."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.commands import require_ros
from benchmarks.explaining import CAUSES, score
from benchmarks.figures import Effort
from benchmarks.fixing import TREES, fixed, typos
from benchmarks.rows import Benchmark, Limit, Measured, Row
from sar_compiler.checks.fixing import is_safe

_TYPOS = 500


@contextmanager
def set_up(_effort: Effort) -> Iterator[None]:
    """Set up nothing."""
    yield


def _why(_stage: None, effort: Effort) -> Measured:
    require_ros()
    chosen = CAUSES if effort.share == 1 else CAUSES[::10]
    missed = score(chosen)
    named = len(chosen) - len(missed)
    names = f"; missed: {', '.join(missed)}" if missed else ""
    return Measured((100.0 * named / len(chosen),), f"{named} of {len(chosen)}{names}")


def _fix(_stage: None, effort: Effort) -> Measured:
    made = list(typos(effort.size(_TYPOS)))
    with TemporaryDirectory() as name:
        folder = Path(name)
        for path in TREES:
            shutil.copy(path, folder)
        suggested = [fixed(each, folder, lambda _: True) for each in made]
        safely = [fixed(each, folder, is_safe).is_as_before for each in made]
    shares = [
        100.0 * sum(found) / len(made)
        for found in (
            [each.is_as_before for each in suggested],
            [not each.has_errors for each in suggested],
            safely,
        )
    ]
    return Measured(
        (shares[0], shares[1]), f"`--fix`, which makes only unambiguous changes, restores {shares[2]:.0f} %"
    )


BENCHMARK = Benchmark(
    (
        Row(
            "causes that `sar-journal why` names first",
            (Limit(97.0, "%", is_least=True),),
            f"{len(CAUSES)} kinds of causes, each planted in a simulated run of a shipped tree",
            _why,
        ),
        Row(
            "trees with a typo that suggestions restore",
            (
                Limit(85.0, "%", is_least=True, what="restored"),
                Limit(93.0, "%", is_least=True, what="without errors"),
            ),
            f"{_TYPOS} shipped trees with one typo, all suggestions applied",
            _fix,
        ),
    ),
    set_up,
)
