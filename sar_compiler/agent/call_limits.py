"""Limits on the files and memory of one tool call, which its process applies to itself."""

import json
import os
import sys
from collections.abc import MutableMapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from sar_compiler.commands import LIMITS_VARIABLE
from sar_compiler.opener import confine
from sar_compiler.process_end import dependent_environment

_NICENESS = 10


class CallLimits(NamedTuple):
    """The limits of a call.

    Attributes:
        places: The folders and files that it may read, with links followed.
        said: Their description in messages.
        memory_bytes: The largest address space.
    """

    places: tuple[str, ...]
    said: str
    memory_bytes: int

    def environment(self) -> dict[str, str]:
        """Return the environment of a call with these limits."""
        # A call does not outlive the server. Each thread of OpenBLAS reserves address space, which is limited here.
        return {**dependent_environment(), LIMITS_VARIABLE: json.dumps(self), "OPENBLAS_NUM_THREADS": "1"}


def limit_this_process(environment: MutableMapping[str, str]) -> None:
    """Apply the limits in an environment to this process, for its lifetime."""
    places, said, memory_bytes = json.loads(environment.pop(LIMITS_VARIABLE))
    confine(map(Path, places), said)
    if sys.platform == "win32":
        return
    import resource

    os.nice(_NICENESS)
    # The server's own limit may already be lower.
    with suppress(ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
