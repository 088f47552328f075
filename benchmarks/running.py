"""Running the benchmarks, each in a process of its own."""

import datetime as dt
import os
import platform
import shutil
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path

from benchmarks import (
    editing,
    explaining,
    flying,
    journaling,
    large_files,
    mending,
    ordering,
    paging,
    pipeline,
    predicting,
    startup,
    sweeping,
    ticking,
    verifying,
    watched_properties,
    watching,
)
from benchmarks.figures import Effort, Figure, Missing, Result, alone
from benchmarks.peers import PYTHON
from benchmarks.record import Run
from sar_compiler.runtime import kernel

BENCHMARKS: Mapping[str, Callable[[Effort], Iterator[Result]]] = {
    "ticking": ticking.measure,
    "pipeline": pipeline.measure,
    "startup": startup.measure,
    "flight": flying.measure,
    "journal": journaling.measure,
    "watching": watching.measure,
    "page": paging.measure,
    "verify": verifying.measure,
    "sweep": sweeping.measure,
    "predict": predicting.measure,
    "order": ordering.measure,
    "properties": watched_properties.measure,
    "large-files": large_files.measure,
    "editing": editing.measure,
    "mending": mending.measure,
    "explaining": explaining.measure,
}


def measured(names: Sequence[str], effort: Effort) -> tuple[Run, bool]:
    """Measure each benchmark in a process of its own; return also whether one has failed."""
    run, failed = Run(surroundings(), {}, {}), False
    for name in names:
        start = time.monotonic()
        results, failure = alone(results_of, name, effort)
        if failure:
            failed = True
            results.append(Missing("", "", f"it failed: {failure.strip().splitlines()[-1]}"))
            print(failure, file=sys.stderr)
        run.figures[name] = [each for each in results if isinstance(each, Figure)]
        run.missing[name] = [each for each in results if isinstance(each, Missing)]
        print(f"{name}: {len(run.figures[name])} figures in {time.monotonic() - start:.0f} s", flush=True)
    return run, failed


def surroundings() -> dict[str, str]:
    """Return what the figures depend on, besides the project."""
    cpu = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("model name\t: ")[2].partition("\n")[0]
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return {
        "date": f"{dt.datetime.now(tz=dt.timezone.utc):%Y-%m-%d}",
        "machine": f"{cpu or platform.machine()}, {os.cpu_count()} cores, {memory:.0f} GiB",
        "load before": f"{os.getloadavg()[0]:.1f} processes in the last minute",
        "system": f"{platform.system()} {platform.release()}, Python {platform.python_version()}",
        "kernel of this project": kernel.describe(),
        "py_trees": metadata.version("py_trees"),
        "peers": _peers(),
        "SPIN": _spin(),
    }


def results_of(name: str, effort: Effort) -> tuple[list[Result], str]:
    """Return what a benchmark has measured and, if it has failed, why; the others are measured all the same."""
    results: list[Result] = []
    try:
        results.extend(BENCHMARKS[name](effort))
    except Exception:  # noqa: BLE001 - whatever it is, it is told
        return results, traceback.format_exc()
    return results, ""


def _peers() -> str:
    if not PYTHON.exists():
        return "not installed"
    wanted = "('behaviortreepy', 'py_trees')"
    code = f"import importlib.metadata as m; print(*(f'{{d.name}} {{d.version}}' for d in m.distributions() if d.name in {wanted}), sep=', ')"
    done = subprocess.run([PYTHON, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip() or "not installed"


def _spin() -> str:
    program = shutil.which("spin")
    if program is None:
        return "not installed"
    return subprocess.run([program, "-V"], capture_output=True, text=True, check=True).stdout.strip()
