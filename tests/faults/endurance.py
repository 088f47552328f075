"""A program that is `sar-run` again and again, in one process: `python -m tests.faults.endurance COUNT ARGUMENTS`.

After each run it prints what the process holds then, as `mission NUMBER: JSON`, with the types of which there are more than after the last.
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
    """Return what a process holds: memory in kB, and the numbers of its threads and descriptors."""
    process = Path(f"/proc/{pid}")
    return {
        "memory": int((process / "statm").read_text(encoding="ascii").split()[1]) * _PAGE_KB,
        "threads": len(list((process / "task").iterdir())),
        "descriptors": len(list((process / "fd").iterdir())),
    }


def types():
    """Count the objects that the garbage collector knows, by their types."""
    return Counter(f"{type(each).__module__}.{type(each).__qualname__}" for each in gc.get_objects())


if __name__ == "__main__":
    before = types()
    for number in range(1, int(sys.argv[1]) + 1):
        status = main(sys.argv[2:])
        # A guardian that is still starting, as on a busy machine, ends later than so short a mission, which waits for it 1 s.
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
