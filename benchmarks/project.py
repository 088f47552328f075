"""The waiting times of contributors and users: the test suite, and a new installation."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.figures import Effort, UnmeasurableError
from benchmarks.rows import Benchmark, Limit, Measured, Row, seconds

_ROOT = Path(__file__).parents[1]
SUITE, INSTALLED = _ROOT / "build" / "suite.json", _ROOT / "build" / "plain" / ".installed"


@contextmanager
def set_up(_effort: Effort) -> Iterator[None]:
    """Set up nothing, because other targets of the Makefile have written their times."""
    yield


def _times(path: Path, target: str) -> tuple[float, float]:
    """Return the elapsed seconds and the CPU seconds that the last `benchmarks.timing` wrote to a file.

    Raises:
        UnmeasurableError: The file is missing.
    """
    if not path.exists():
        raise UnmeasurableError(f"`{target}` has not been run here")
    passed, cpu = json.loads(path.read_bytes())
    return passed, cpu


def _suite(_stage: None, _effort: Effort) -> Measured:
    passed, cpu = _times(SUITE, "make test")
    return Measured((passed / 60.0, cpu / 60.0))


def _install(_stage: None, _effort: Effort) -> Measured:
    passed, cpu = _times(INSTALLED, "make build/plain/.installed")
    return Measured((passed,), f"{seconds(cpu)} CPU")


BENCHMARK = Benchmark(
    (
        Row(
            "`make test`",
            (Limit(7.0, "min passing"), Limit(14.0, "min CPU")),
            "the last `make test` on this machine, from a built environment",
            _suite,
        ),
        Row(
            "an installation from nothing",
            (Limit(180.0, "s passing"),),
            "`pip install .` into a new environment, without ROS; the kernel is compiled",
            _install,
        ),
    ),
    set_up,
)
