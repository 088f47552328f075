"""Determines the command that resumes a mission from its journal."""

import shlex
from collections.abc import Iterable, Iterator

from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.mission_state import MissionState

# The options of a run that the resume command omits, and the only one of them that has a value.
_OMITTED, _WITH_VALUE = ("--new", "--resume", "--check", "--journal"), "--journal"


def resume_command(state: MissionState, journal: str) -> str:
    """Return the command that resumes a mission, or an empty string if the mission cannot be resumed.

    Args:
        state: The state of the mission.
        journal: The path of the mission's journal.
    """
    if not state.runs or not journal:
        return ""
    run = state.runs[-1]
    is_interrupted = run.ending in (Ending.STOPPED, Ending.FAILED) or (
        not run.ending and state.process.is_gone
    )
    words = run.about.get("command")
    if not is_interrupted or not isinstance(words, list):
        return ""
    # These options come first, because all words after --ros-args are ROS arguments.
    return shlex.join(["sar-run", "--resume", "--journal", journal, *_words_to_repeat(map(str, words))])


def _words_to_repeat(words: Iterable[str]) -> Iterator[str]:
    """Yield the words of a run's command line that the resume command repeats."""
    rest = iter(words)
    for word in rest:
        option = word.partition("=")[0]
        if option not in _OMITTED:
            yield word
        elif word == _WITH_VALUE:
            next(rest, None)
