"""Runs `sar-run` repeatedly in one process: `python -m tests.faults.endurance COUNT ARGUMENTS`.

After each run it prints the resources of the process as `mission NUMBER: JSON`, with the object types whose number has grown.
"""

import gc
import json
import os
import sys
import threading
from collections import Counter
from pathlib import Path

from sar_compiler.cli.run import main

_PAGE_KB = os.sysconf("SC_PAGE_SIZE") / 1024


def holdings(pid="self"):
    """Return the resources of a process: memory in kB, and the numbers of threads and file descriptors."""
    process = Path(f"/proc/{pid}")
    return {
        "memory": int((process / "statm").read_text(encoding="ascii").split()[1]) * _PAGE_KB,
        "threads": len(list((process / "task").iterdir())),
        "descriptors": len(list((process / "fd").iterdir())),
    }


def types():
    """Count the objects of the garbage collector by type."""
    return Counter(f"{type(each).__module__}.{type(each).__qualname__}" for each in gc.get_objects())


if __name__ == "__main__":
    before = types()
    for number in range(1, int(sys.argv[1]) + 1):
        status = main(sys.argv[2:])
        # On a busy machine, a guardian may still be starting when so short a mission ends, which waits only 1 s for it.
        for thread in threading.enumerate():
            if thread.name == "guardian":
                thread.join()
        gc.collect()
        now = types()
        told = {
            "status": status,
            "objects": now.total(),
            "came": dict((now - before).most_common(8)),
            **holdings(),
        }
        before = now
        sys.stdout.write(f"mission {number}: {json.dumps(told)}\n")
        sys.stdout.flush()
