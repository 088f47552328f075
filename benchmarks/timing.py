"""Runs a command and writes the seconds that it took: `python -m benchmarks.timing FILE COMMAND...`.

The file is written only if the command succeeds: [elapsed seconds, CPU seconds of it and of all processes that it has waited for].
"""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path


def main(file: str, *command: str) -> int:
    """Run the command; return its exit status."""
    start = time.monotonic()
    status = subprocess.run(command, check=False).returncode
    passed, usage = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if status == 0:
        Path(file).parent.mkdir(parents=True, exist_ok=True)
        Path(file).write_text(
            json.dumps([round(passed, 1), round(usage.ru_utime + usage.ru_stime, 1)]), encoding="utf-8"
        )
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
