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

# The prefixes of log lines that report no error.
_NO_ERROR = ("[INFO]", "[DEBUG]")


def serve() -> int:
    """Run `sar-run` for each list of arguments on standard input.

    For each run, write the status, the output and the reason for a failure.

    The result of a run is written before ROS is shut down, because native code may crash during the shutdown and end the process.
    """
    with (
        os.fdopen(os.dup(sys.stdout.fileno()), "w") as results,
        _redirect(sys.stdout) as output,
        _redirect(sys.stderr) as log,
    ):
        for line in sys.stdin:
            with ExitStack() as ros:
                status = _run(json.loads(line), ros)
                reason = _failure_reason(_pop_output(log), status)
                results.write(json.dumps([status, _pop_output(output), reason]) + "\n")
                results.flush()
                shut_down(status, ros.pop_all().close)
            # Reference cycles of a finished run keep its maps alive. The garbage collector does not know how large they are.
            gc.collect()
    return 0


def _failure_reason(log: str, status: int) -> str:
    """Return why a run failed: the last line of the log, or the whole log if the run has not started."""
    lines = [line for line in log.strip().splitlines() if not line.startswith(_NO_ERROR)]
    return "\n".join(lines if status == USAGE and "usage: " not in log else lines[-1:])


def _run(arguments: list[str], ros: ExitStack) -> int:
    try:
        return run.run_with_ros(arguments, ros, stepped=True)
    except SystemExit as end:  # argparse has reported wrong usage
        return end.code if isinstance(end.code, int) else USAGE


def _redirect(stream: IO[str]) -> IO[bytes]:
    """Redirect what Python and native code write to a stream into a temporary file, and return the file."""
    file = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
    os.dup2(file.fileno(), stream.fileno())
    return file


def _pop_output(file: IO[bytes]) -> str:
    """Return the output that was redirected to a file, and empty the file."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    text = os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0)
    os.ftruncate(file.fileno(), 0)
    os.lseek(file.fileno(), 0, os.SEEK_SET)
    return text.decode(errors="replace")
