"""Refuse outdated commands: compare the state that the sender of a command saw with the current state.

A page shows a state that is slightly old, and a person needs seconds to confirm a command. In the meantime
the robot may have reached the next location, or another operator may have reviewed the same detection. Each
command therefore contains the objects that the sender saw, by the keys of this module. If any of these
objects has changed, the mission refuses the command. The objects are compared in the thread that changes the
mission's state.
"""

import json
from collections.abc import Mapping
from typing import Any

from sar_compiler.journal.display import Landmark

RUN, OBJECT = "run", "object"
"""The keys that stand for the run and for the object of the command. Other keys name landmarks, such as `point/north`."""

SeenObjects = Mapping[str, str]
"""The objects that the sender of a command saw, each described by a string. An object that did not exist has an empty string."""

_MAX_OBJECTS, _MAX_LENGTH = 20, 500


def parse_seen(text: str) -> dict[str, str]:
    """Parse the objects that the sender of a command saw from JSON text.

    Raises:
        ValueError: If the text is not a JSON object of strings, or if it has too many or too long strings.
    """
    try:
        seen = json.loads(text)
    except (ValueError, RecursionError):
        seen = None
    if not isinstance(seen, dict) or len(seen) > _MAX_OBJECTS:
        raise ValueError(f"expected a JSON object with at most {_MAX_OBJECTS} strings")
    if any(not isinstance(value, str) or len(value) > _MAX_LENGTH for value in seen.values()):
        raise ValueError(
            f"expected a JSON object whose values are strings of at most {_MAX_LENGTH} characters each"
        )
    return seen


def run_identity(number: int, about: Mapping[str, Any]) -> str:
    """Return the identity of a run, such as `run 2 (process 4711)`.

    Args:
        number: The run's number.
        about: The run's description, with `pid`.
    """
    return f"run {number} (process {about.get('pid', 'unknown')})"


def describe_change(seen: SeenObjects, now: SeenObjects, landmarks: Mapping[str, Landmark]) -> str:
    """Describe the first object that has changed since the sender saw it, or return an empty string.

    Args:
        seen: The objects that the sender saw.
        now: The current run, and the current object of the command.
        landmarks: The current landmarks, by `kind/name`.
    """
    for key, before in seen.items():
        if key in (RUN, OBJECT):
            after, name = now.get(key, ""), "the object of the command"
        else:
            known = landmarks.get(key)
            after, name = "" if known is None else known.identity, key.partition("/")[2]
        if key == RUN and before != after:
            return f"you saw {before}, but the mission is now in {after}"
        if before != after:
            return f"{name} has changed. You saw '{before or 'none'}', and now it is '{after or 'none'}'"
    return ""
