"""The objects of commands: a comparison of the state that the operator saw with the current one.

A page shows the state of a moment ago, and a person needs seconds to confirm a command. Meanwhile the robot may have reached the next
place, or another operator may have reviewed the same detection. So each command carries what its sender saw, by the keys of this module, and the
mission refuses it, in the thread that changes its state, if any of that has changed.
"""

import json
from collections.abc import Mapping
from typing import Any

from sar_compiler.journal.display import Landmark

RUN, OBJECT = "run", "object"
"""Keys of the seen objects: the run, and the object of the command. All other keys are landmarks: `point/north`."""

SeenObjects = Mapping[str, str]
"""The objects of a command as its sender saw them: a string for each key, empty for an object that did not exist."""

_MOST, _LONGEST = 20, 500


def parse_seen(text: str) -> dict[str, str]:
    """Parse the seen objects of a command from JSON.

    Raises:
        ValueError: If it is not an object of strings, or too large.
    """
    try:
        seen = json.loads(text)
    except (ValueError, RecursionError):
        seen = None
    if not isinstance(seen, dict) or len(seen) > _MOST:
        raise ValueError("not a JSON object of a few strings")
    if any(not isinstance(value, str) or len(value) > _LONGEST for value in seen.values()):
        raise ValueError("not a string for each key")
    return seen


def run_identity(number: int, about: Mapping[str, Any]) -> str:
    """Return the identity of a run: `run 2 (process 4711)`.

    Args:
        number: Its number.
        about: Its description, with `pid`.
    """
    return f"run {number} (process {about.get('pid', 'unknown')})"


def describe_change(seen: SeenObjects, now: SeenObjects, landmarks: Mapping[str, Landmark]) -> str:
    """Return the change since the sender of a command saw its objects; empty if there is none.

    Args:
        seen: What the sender saw.
        now: The present run, and the present object of the command.
        landmarks: The present landmarks, by `kind/name`.
    """
    for key, before in seen.items():
        if key in (RUN, OBJECT):
            after, name = now.get(key, ""), "the object of the command"
        else:
            known = landmarks.get(key)
            after, name = "" if known is None else known.identity, key.partition("/")[2]
        if key == RUN and before != after:
            return f"you saw {before}, and this is {after}"
        if before != after:
            return f"{name} has changed. You saw '{before or 'none'}', and now it is '{after or 'none'}'"
    return ""
