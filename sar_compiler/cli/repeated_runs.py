"""The process in which `sar-sim sweep` runs `sar-run` repeatedly, each time in a new ROS context."""

import gc
import json
import os
import sys
import tempfile
from contextlib import ExitStack
from typing import IO

from sar_compiler.cli import run
from sar_compiler.commands import USAGE
from sar_compiler.process_end import shut_down

# ROS's log of a starting run is not an error.
_LOGGED = ("[INFO]", "[DEBUG]")


def serve() -> int:
    """Execute the runs whose arguments standard input lists, and write status, output and errors of each.

    A result is written before ROS is shut down, because native code may crash there and take the process with it.
    """
    with (
        os.fdopen(os.dup(sys.stdout.fileno()), "w") as answers,
        _caught(sys.stdout) as output,
        _caught(sys.stderr) as log,
    ):
        for line in sys.stdin:
            with ExitStack() as ros:
                status = _run(json.loads(line), ros)
                words = _last_words(_pop_output(log), status)
                answers.write(json.dumps([status, _pop_output(output), words]) + "\n")
                answers.flush()
                shut_down(status, ros.pop_all().close)
            # A run ends in reference cycles that hold its maps, whose size the collector does not know.
            gc.collect()
    return 0


def _last_words(log: str, status: int) -> str:
    """Return why a run failed: all errors if it has not started, otherwise the last line."""
    lines = [line for line in log.strip().splitlines() if not line.startswith(_LOGGED)]
    return "\n".join(lines if status == USAGE and "usage: " not in log else lines[-1:])


def _run(arguments: list[str], ros: ExitStack) -> int:
    try:
        return run.run_with_ros(arguments, ros, stepped=True)
    except SystemExit as end:  # wrong usage, reported by argparse
        return end.code if isinstance(end.code, int) else USAGE


def _caught(stream: IO[str]) -> IO[bytes]:
    """Redirect a stream, written by Python or by native code, to a file; return the file."""
    file = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
    os.dup2(file.fileno(), stream.fileno())
    return file


def _pop_output(file: IO[bytes]) -> str:
    """Return the redirected output, and clear the file."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    text = os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0)
    os.ftruncate(file.fileno(), 0)
    os.lseek(file.fileno(), 0, os.SEEK_SET)
    return text.decode(errors="replace")
