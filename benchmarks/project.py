"""What contributors and users wait for: the test suite, and an installation from nothing."""

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
    """Set nothing up: other targets of the makefile have written their times."""
    yield


def _times(path: Path, target: str) -> tuple[float, float]:
    """Return the seconds that passed, and the CPU seconds, of the last `benchmarks.timing` with a file.

    Raises:
        UnmeasurableError: There was none.
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
