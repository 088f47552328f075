"""Tests that listeners of a journal receive the entries that its file contains, with or without a file."""

import itertools
import time
import tracemalloc
from collections import deque
from contextlib import closing

import pytest

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Ending, JournalEntry, Row
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.recorded_events import recorded_events
from sar_compiler.reports.explanation import Explanation
from sar_compiler.reports.journals import journal_json, journal_lines


def record_run(journal):
    """Record a run; return the entries that a listener received."""
    told: list[JournalEntry] = []
    journal.add_listener(told.append)
    journal.begin({"mission": "patrol"}, {"node": "/patrol"})
    journal.record_observation("pose", x=1.0)
    journal.record_event("zone_visited", zone="zone_a")
    journal.end_run(Ending.OVER, 0, "Complete.")
    journal.close()
    return [(entry.number, entry.run, entry.kind, entry.data) for entry in told]


def test_listener_receives_same_entries_as_stream_of_file(tmp_path):
    journal_path = tmp_path / "mission.journal"
    told = record_run(open_journal(journal_path))
    with closing(JournalFile.read(journal_path)) as file:
        read = [(entry.number, entry.run, entry.kind, entry.data) for entry in file.stream()]
    assert read == told
    assert [kind for _, _, kind, _ in told] == ["run_began", "pose", "zone_visited", "run_ended"]
    assert told[0][3]["run"]["node"] == "/patrol"
    head = {"head": told[-1][3]["head"]}
    assert told[-1][3] == {"ending": "over", "status": 0, "reason": "Complete.", **head}


def test_listener_without_file_receives_same_entries_except_head(tmp_path):
    def without_process(told):
        told[-1][3].pop("head", None)
        return [(number, kind, data) for number, _, kind, data in told if kind != "run_began"]

    assert without_process(record_run(Journal())) == without_process(
        record_run(open_journal(tmp_path / "a.journal"))
    )


def test_failing_listener_is_removed_and_reported():
    journal = Journal()
    told: list[JournalEntry] = []
    said: list[str] = []
    journal.on_failure = said.append

    def fail(entry):
        raise OSError

    journal.add_listener(fail)
    journal.add_listener(told.append)
    journal.record_event("zone_visited", zone="zone_a")
    journal.record_event("zone_visited", zone="zone_b")
    assert [entry.data["zone"] for entry in told] == ["zone_a", "zone_b"]
    assert said == ["A listener of the journal has failed and was removed: OSError()."]


def test_stream_has_runs_in_order(tmp_path):
    journal_path = tmp_path / "mission.journal"
    for resume in (False, True):
        journal = open_journal(journal_path, resume=resume)
        journal.begin({}, {})
        journal.record_event("zone_visited", zone="zone_a")
        journal.end_run(Ending.STOPPED, 130)
        journal.close()
    with closing(JournalFile.read(journal_path)) as file:
        stream = [(entry.run, entry.kind) for entry in file.stream()]
    kinds = ("run_began", "zone_visited", "run_ended")
    assert stream == [(run, kind) for run in (1, 2) for kind in kinds]


def test_log_line_before_start_of_resumed_run_belongs_to_that_run(tmp_path):
    journal_path = tmp_path / "mission.journal"
    told: list[JournalEntry] = []
    for resume in (False, True, True):
        journal = open_journal(journal_path, resume=resume)
        journal.add_listener(told.append)
        journal.record_observation("log", text="waiting for navigation")
        journal.begin({}, {})
        journal.close()
    assert [(entry.run, entry.kind) for entry in told] == [
        (run, kind) for run in (1, 2, 3) for kind in ("log", "run_began")
    ]


def test_entries_keep_their_order_if_system_clock_is_set_back(tmp_path, monkeypatch):
    journal_path = tmp_path / "mission.journal"
    clock = iter([*range(100, 105), *range(50, 100)])
    monkeypatch.setattr(time, "time", lambda: float(next(clock)))
    written = []
    for run in (1, 2):
        journal = open_journal(journal_path, resume=run == 2)
        journal.begin({}, {})
        for number in range(3):
            journal.record_observation("pose", x=float(number))
            journal.record_event("zone_visited", zone=f"zone_{number}")
            written += [(run, "pose"), (run, "zone_visited")]
        journal.close()
    with closing(JournalFile.read(journal_path)) as file:
        happened = [entry for entry in file.stream() if entry.kind != "run_began"]
        told = [*journal_lines(file, MissionState(), with_watched=True)]
    assert [(entry.run, entry.kind) for entry in happened] == written
    assert [entry.data for entry in happened[:2]] == [{"x": 0.0}, {"zone": "zone_0"}]
    assert [line.split()[1] for line in told if line.startswith(" ")] == [kind for _, kind in written]


def test_value_that_is_not_json_raises_type_error_without_file():
    journal = Journal()
    entries: list[JournalEntry] = []
    journal.add_listener(entries.append)
    journal.begin({}, {})
    for tell in (journal.record_event, journal.record_observation):
        with pytest.raises(TypeError, match="not JSON serializable"):
            tell("odd", value={1, 2})
    assert [entry.kind for entry in entries] == ["run_began"]


def peak_memory(read):
    """Return the peak memory in bytes while `read` runs."""
    tracemalloc.start()
    try:
        read()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.unmeasured
def test_long_journal_is_processed_without_keeping_it_in_memory(tmp_path):
    def long(count):
        journal_path = tmp_path / f"{count}.journal"
        file = JournalFile.create(journal_path)
        file.begin_run({"mission": "patrol", "tree": {"name": "Root", "children": []}}, {"time": 0.0}, 9.0)
        said = (
            f'{{"node": 0, "tick": {number}, "status": "{status}", "message": ""}}'
            for number, status in zip(range(1, count + 1), itertools.cycle(["RUNNING", "FAILURE"]))
        )
        file.write([Row(number, 1, 9.0, 1.0, "status", data) for number, data in enumerate(said, 1)])
        file.close()
        return JournalFile.read(journal_path)

    with closing(long(500)) as short, closing(long(10_000)) as file:
        for read in (
            lambda file: MissionState.from_stream(file.stream()),
            lambda file: deque(journal_lines(file, MissionState(), with_watched=True), 0),
            lambda file: deque(journal_json(file, MissionState(), with_watched=True), 0),
            lambda file: Explanation.explain(file).data(),
            lambda file: deque(recorded_events(file.stream()), 0),
        ):
            read(short)  # imports and caches are not counted
            # An entry takes more than 500 bytes.
            assert (
                peak_memory(lambda read=read: read(file))
                < peak_memory(lambda read=read: read(short)) + 500_000
            )
