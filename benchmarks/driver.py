"""BehaviorTree.CPP in a separate process: `btcpp_driver.cpp`, built by hand, at the path in `BTCPP_DRIVER`."""

import json
import os
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from benchmarks.figures import UnmeasurableError

VARIABLE = "BTCPP_DRIVER"


class Driver:
    """A process that ticks trees, and answers as `btcpp_driver.cpp` describes.

    Args:
        command: The command that starts it.
    """

    def __init__(self, command: Sequence[str | Path]) -> None:
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def load(self, path: Path) -> float:
        """Make the tree of a file; return the CPU seconds."""
        return self._ask("load", str(path))

    def tick(self, count: int) -> float:
        """Tick the tree so many times; return the mean CPU seconds."""
        return self._ask("tick", count)

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def _ask(self, command: str, argument: str | int) -> float:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            print(json.dumps([command, argument]), file=self._process.stdin, flush=True)
            answer = json.loads(self._process.stdout.readline() or '"its process has ended"')
        except BrokenPipeError:
            answer = "its process has ended"
        if isinstance(answer, str):
            raise UnmeasurableError(f"BehaviorTree.CPP: {answer.strip().splitlines()[-1]}")
        return float(answer)


def driver_path() -> Path | None:
    """Return the path of the driver, or None if the driver is not built."""
    path = Path(os.environ.get(VARIABLE, ""))
    return path if path.is_file() else None


@contextmanager
def running() -> Iterator[Driver | None]:
    """Run the driver. Yield None if the driver is not built."""
    path = driver_path()
    if path is None:
        yield None
        return
    driver = Driver([path])
    try:
        yield driver
    finally:
        driver.close()
