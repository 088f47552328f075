"""A process that runs `sar-run` again and again, each time in a new ROS context: `sar-sim sweep` has some of them."""

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

# What ROS logs of a run that begins is no mistake.
_LOGGED = ("[INFO]", "[DEBUG]")


def serve() -> int:
    """Do the runs whose arguments come in, a JSON list a line; answer each with its status, its output and its last words.

    An answer is given before ROS is taken down: what is native in it may crash there, and the process with it.
    """
    with (
        os.fdopen(os.dup(sys.stdout.fileno()), "w") as answers,
        _caught(sys.stdout) as output,
        _caught(sys.stderr) as log,
    ):
        for line in sys.stdin:
            with ExitStack() as ros:
                status = _run(json.loads(line), ros)
                words = _last_words(_taken(log), status)
                answers.write(json.dumps([status, _taken(output), words]) + "\n")
                answers.flush()
                shut_down(status, ros.pop_all().close)
            # A run ends in cycles that hold its maps, which the collector does not know to be large.
            gc.collect()
    return 0


def _last_words(log: str, status: int) -> str:
    """Return why a run has failed: all mistakes of one that has not begun, else the last line, as of an option that argparse refuses."""
    lines = [line for line in log.strip().splitlines() if not line.startswith(_LOGGED)]
    return "\n".join(lines if status == USAGE and "usage: " not in log else lines[-1:])


def _run(arguments: list[str], ros: ExitStack) -> int:
    try:
        return run.run_in(arguments, ros, stepped=True)
    except SystemExit as end:  # wrong usage, in the words of argparse
        return end.code if isinstance(end.code, int) else USAGE


def _caught(stream: IO[str]) -> IO[bytes]:
    """Have a file take what is written to a stream, by Python or by native code; return the file."""
    file = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
    os.dup2(file.fileno(), stream.fileno())
    return file


def _taken(file: IO[bytes]) -> str:
    """Return what a file has taken, and empty it."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    text = os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0)
    os.ftruncate(file.fileno(), 0)
    os.lseek(file.fileno(), 0, os.SEEK_SET)
    return text.decode(errors="replace")
