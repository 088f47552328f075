"""Running the benchmarks, each in a separate process; a row that fails does not stop the others."""

import datetime as dt
import multiprocessing
import os
import platform
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from benchmarks import editing, files, journals, missions, project, proofs, scores, ticks
from benchmarks.figures import Effort, UnmeasurableError
from benchmarks.record import Run
from benchmarks.rows import Benchmark, MissedError, Result, Row, rows_of, write_result
from sar_compiler.runtime import kernel

BENCHMARKS: Mapping[str, Benchmark] = {
    "files": files.BENCHMARK,
    "editing": editing.BENCHMARK,
    "journals": journals.BENCHMARK,
    "proofs": proofs.BENCHMARK,
    "ticks": ticks.BENCHMARK,
    "missions": missions.BENCHMARK,
    "scores": scores.BENCHMARK,
    "project": project.BENCHMARK,
}
ROWS: Sequence[Row] = tuple(rows_of(BENCHMARKS))

_ROW_SEC = 300
"""The time limit of a row."""


def measure_benchmarks(names: Sequence[str], effort: Effort) -> tuple[Run, bool]:
    """Measure each benchmark in a separate process; return also whether a row has failed.

    Objects that one measurement leaves in memory would slow down the next one.
    """
    results: dict[str, Result] = {}
    is_failed = False
    conditions = describe_conditions()
    for name in names:
        start = time.monotonic()
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            try:
                found, has_failed = process.submit(measure_rows, name, effort).result()
            except Exception as error:  # noqa: BLE001 - the process may have died
                found = {
                    row.what: Result(note=f"its process failed: {error}") for row in BENCHMARKS[name].rows
                }
                has_failed = True
        results |= found
        is_failed |= has_failed
        print(f"{name}: {time.monotonic() - start:.0f} s", flush=True)
    return Run(conditions, results), is_failed


def measure_rows(name: str, effort: Effort) -> tuple[dict[str, Result], bool]:
    """Measure the rows of a benchmark one after the other, and print each; return also whether one has failed."""
    benchmark = BENCHMARKS[name]
    results: dict[str, Result] = {}
    is_failed = False
    try:
        with benchmark.set_up(effort) as stage:
            for row in benchmark.rows:
                start = time.monotonic()
                results[row.what], has_failed = _measure_row(row, stage, effort)
                is_failed |= has_failed
                text = write_result(row, results[row.what])
                print(f"  {row.what}: {text} [{time.monotonic() - start:.0f} s]", flush=True)
    except Exception as error:  # noqa: BLE001 - rows after it are reported as not measured
        is_failed |= not isinstance(error, UnmeasurableError)
        reason = _report_failure(error)
        results = {row.what: results.get(row.what, Result(note=reason)) for row in benchmark.rows}
    return results, is_failed


def _measure_row(row: Row, stage: object, effort: Effort) -> tuple[Result, bool]:
    try:
        with _limited(_ROW_SEC):
            return Result(*row.measure(stage, effort)), False
    except MissedError as error:
        return Result(note=str(error), is_missed=True), False
    except UnmeasurableError as error:
        return Result(note=str(error)), False
    except Exception as error:  # noqa: BLE001 - the other rows are measured all the same
        return Result(note=_report_failure(error)), True


def _report_failure(error: Exception) -> str:
    if isinstance(error, UnmeasurableError):
        return str(error)
    print("".join(traceback.format_exception(error)), file=sys.stderr, flush=True)
    return f"it failed: {type(error).__name__}: {str(error).strip().partition(chr(10))[0]}"


@contextmanager
def _limited(seconds: int) -> Iterator[None]:
    """Raise TimeoutError in the main thread after some seconds."""

    def on_alarm(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"not done in {seconds} s")

    before = signal.signal(signal.SIGALRM, on_alarm)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def describe_conditions() -> dict[str, str]:
    """Return the conditions of the measurement, apart from the project."""
    cpu = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("model name\t: ")[2].partition("\n")[0]
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return {
        "date": f"{dt.datetime.now(tz=dt.timezone.utc):%Y-%m-%d}",
        "machine": f"{cpu or platform.machine()}, {os.cpu_count()} cores, {memory:.0f} GiB",
        "load before": f"{os.getloadavg()[0]:.1f} processes in the last minute",
        "system": f"{platform.system()} {platform.release()}, Python {platform.python_version()}",
        "kernel of this project": kernel.describe(),
        "BehaviorTree.CPP": ticks.describe_driver(),
    }
