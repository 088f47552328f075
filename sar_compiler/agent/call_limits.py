"""Limits on the files and the memory that a tool call may use.

Each call's process applies these limits to itself.
"""

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
    """The limits of a tool call.

    Attributes:
        places: The folders and files that the call may read, with links resolved.
        said: The description of these folders and files in messages.
        memory_bytes: The maximum address space.
    """

    places: tuple[str, ...]
    said: str
    memory_bytes: int

    def environment(self) -> dict[str, str]:
        """Return the environment variables for the process of a call with these limits."""
        # The process ends with the server. Each thread of OpenBLAS reserves address space, which is limited.
        return {**dependent_environment(), LIMITS_VARIABLE: json.dumps(self), "OPENBLAS_NUM_THREADS": "1"}


def limit_this_process(environment: MutableMapping[str, str]) -> None:
    """Apply the limits that the environment variables define to this process."""
    limits = CallLimits(*json.loads(environment.pop(LIMITS_VARIABLE)))
    confine(map(Path, limits.places), limits.said)
    if sys.platform == "win32":
        return
    import resource

    os.nice(_NICENESS)
    # The limit of the server's process may already be lower.
    with suppress(ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (limits.memory_bytes, limits.memory_bytes))
