"""Tests of the command that resumes a mission, which page and reports offer."""

import pytest

from sar_compiler.journal.journal_entries import RUN_BEGAN, RUN_ENDED, JournalEntry
from sar_compiler.journal.mission_state import MissionState, RunProcess
from sar_compiler.journal.resume_command import resume_command

WORDS = ["patrol", "--sim", "--view", "web"]


def mission(words, *, ending="", is_gone=False):
    """Return the state of a mission that was started by a command line, and has ended if an ending is given."""
    state = MissionState()
    about = {"node": "/patrol"} if words is None else {"node": "/patrol", "command": words}
    state.apply(JournalEntry(1, 1, 0.0, 0.0, RUN_BEGAN, {"run": about}))
    if ending:
        state.apply(JournalEntry(2, 1, 1.0, 1.0, RUN_ENDED, {"ending": ending, "status": 1, "reason": ""}))
    state.process = RunProcess(is_gone=is_gone)
    return state


@pytest.mark.parametrize(
    "how",
    [{"ending": "stopped"}, {"ending": "failed"}, {"is_gone": True}],
    ids=["stopped", "failed", "crashed"],
)
def test_interrupted_mission_is_resumed_by_its_command_line_and_journal(how):
    command = "sar-run --resume --journal '/a place/patrol.journal' patrol --sim --view web"
    assert resume_command(mission(WORDS, **how), "/a place/patrol.journal") == command


@pytest.mark.parametrize(
    "words",
    [
        ["--new", *WORDS],
        ["--resume", *WORDS],
        [*WORDS, "--journal", "old.journal"],
        [*WORDS, "--journal=old.journal"],
    ],
    ids=str,
)
def test_journal_options_of_first_start_are_not_repeated(words):
    command = resume_command(mission(words, is_gone=True), "new.journal")
    assert command == "sar-run --resume --journal new.journal patrol --sim --view web"


def test_ros_arguments_stay_last():
    words = ["patrol", "--ros-args", "-p", "tick_rate_hz:=5.0"]
    command = resume_command(mission(words, is_gone=True), "a.journal")
    assert command.endswith("a.journal patrol --ros-args -p tick_rate_hz:=5.0")


@pytest.mark.parametrize(
    ("state", "journal"),
    [
        (MissionState(), "a.journal"),
        (mission(WORDS), "a.journal"),
        (mission(WORDS, ending="over"), "a.journal"),
        (mission(None, is_gone=True), "a.journal"),
        (mission("patrol", is_gone=True), "a.journal"),
        (mission(WORDS, is_gone=True), ""),
    ],
    ids=["no run", "active", "over", "unknown command line", "no words", "no journal"],
)
def test_mission_that_cannot_be_resumed_has_no_command(state, journal):
    assert resume_command(state, journal) == ""
