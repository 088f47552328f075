"""Other libraries, each in a process of its own, with the Python below build/ that has them (`make build/peers`)."""

import json
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benchmarks.peer import COMPILED, COMPILED_WITH_PYTHON, PY_TREES

__all__ = ["COMPILED", "COMPILED_WITH_PYTHON", "PYTHON", "PY_TREES", "Peer", "RefusedError", "peers"]

PYTHON = Path(__file__).parents[1] / "build" / "peers" / "bin" / "python"


class RefusedError(Exception):
    """A library cannot do what was asked."""


class Peer:
    """One library.

    Args:
        engine: A name that `peer.py` knows.
    """

    def __init__(self, engine: str) -> None:
        script = str(Path(__file__).with_name("peer.py"))
        self._process = subprocess.Popen(
            [PYTHON, "-W", "ignore", script, engine], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def load(self, path: Path) -> float:
        """Make the tree of a file; return the CPU seconds that it took."""
        return self._ask("load", str(path))

    def parse(self, path: Path) -> float:
        """Make it with py_trees' own parser."""
        return self._ask("parse", str(path))

    def tick(self, count: int) -> float:
        """Tick the tree so many times; return the mean CPU seconds."""
        return self._ask("tick", count)

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()

    def _ask(self, command: str, argument: str | int) -> float:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            print(json.dumps([command, argument]), file=self._process.stdin, flush=True)
            answer = json.loads(self._process.stdout.readline() or '"its process has ended"')
        except BrokenPipeError:
            answer = "its process has ended"
        if isinstance(answer, str):
            raise RefusedError(answer.strip().splitlines()[-1])
        return float(answer)


@contextmanager
def peers(*engines: str) -> Iterator[dict[str, Peer]]:
    """Start libraries; none where they are not installed."""
    with ExitStack() as stack:
        started = {engine: Peer(engine) for engine in engines if PYTHON.exists()}
        for peer in started.values():
            stack.callback(peer.close)
        yield started
