"""What one call of a tool for agents may read and take: its process limits itself before it does anything else."""

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
        said: How a message calls them.
        memory_bytes: How much address space it may take.
    """

    places: tuple[str, ...]
    said: str
    memory_bytes: int

    def environment(self) -> dict[str, str]:
        """Return the environment of a call with these limits."""
        # A call does not outlive the server. Each thread of OpenBLAS takes address space of its own, which is what is limited.
        return {**dependent_environment(), LIMITS_VARIABLE: json.dumps(self), "OPENBLAS_NUM_THREADS": "1"}


def limit_this_process(environment: MutableMapping[str, str]) -> None:
    """Apply the limits in an environment to this process, to its end."""
    places, said, memory_bytes = json.loads(environment.pop(LIMITS_VARIABLE))
    confine(map(Path, places), said)
    if sys.platform == "win32":
        return
    import resource

    os.nice(_NICENESS)
    # Less is allowed already where the server itself is limited.
    with suppress(ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
