"""Tests that rows that repeat a status can be omitted without a change of the results."""

import random
from contextlib import closing

import pytest

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import LOG, OF_ROBOT, STATUS, Row, check_value_types
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.row_reader import entries_of, mapping
from sar_compiler.json_values import json_text
from sar_compiler.reports.leaf_statistics import RunStatistics, statistics_as_json
from sar_compiler.reports.why import FailureAnalysis
from tests.random_inputs import rounds


def leaf(name):
    return {"name": name, "class": "a.Leaf", "children": [], "file": "t.xml", "line": 1}


TREE = {
    **leaf("Root"),
    "children": [
        {**leaf("Left"), "children": [leaf("a"), leaf("b")]},
        {**leaf("Right"), "children": [leaf("c")]},
    ],
}
PARENTS = [None, 0, 1, 1, 0, 4]


def write_journal(path, rows):
    """Write a journal of rows, given as kind and data; return its path."""
    with closing(JournalFile.create(path)) as file:
        file.reserve()
        file.begin_run({"mission": "m", "tree": TREE}, {"time": 0.0}, 0.0)
        # All entries of a tick have the same time.
        tick, made = 0, []
        for number, (kind, data) in enumerate(rows, 1):
            tick = data.get("tick", tick) if isinstance(data, dict) else tick
            text = data if isinstance(data, str) else json_text(data)
            made.append(Row(number, 1, float(tick), float(tick), kind, text))
        file.write(made)
    return path


def status(node, tick, word="RUNNING", message="", **more):
    return STATUS, {"node": node, "tick": tick, "status": word, "message": message, **more}


def numbers(path, **options):
    with JournalFile.open_snapshot(path) as file:
        return [entry.number for entry in file.last_run(**options)][1:]


RUNNING = [status(0, 1), status(1, 1), status(2, 1, message="9 m")]


def test_last_of_repeated_status_rows_is_kept(tmp_path):
    path = write_journal(
        tmp_path / "j", [*RUNNING, *(status(2, tick, message=f'{tick} "m"') for tick in range(2, 9))]
    )
    assert numbers(path, is_condensed=True) == [1, 2, 3, 10]
    assert numbers(path) == [*range(1, 11)]


def test_last_row_of_each_parallel_node_is_kept(tmp_path):
    rows = [*RUNNING, status(4, 1), status(5, 1)]
    rows += [status(node, tick, message=str(tick)) for tick in range(2, 9) for node in (2, 5)]
    assert numbers(write_journal(tmp_path / "j", rows), is_condensed=True) == [1, 2, 3, 4, 5, 18, 19]


@pytest.mark.parametrize(
    "between",
    [
        status(3, 3, "SUCCESS"),
        status(2, 3, "SUCCESS"),
        status(2, 3, label="near"),
        (LOG, {"node": "n", "level": 10, "text": "x", "stamp": 0.0}),
        (STATUS, '{"tick": 3, "node": 2, "status": "RUNNING", "message": ""}'),
    ],
)
def test_rows_around_other_entry_are_kept(between, tmp_path):
    rows = [*RUNNING, status(2, 2, message="8 m"), between, status(2, 4, message="7 m")]
    assert numbers(write_journal(tmp_path / "j", rows), is_condensed=True) == [1, 2, 3, 4, 5, 6]


def test_rows_below_inactive_node_are_kept(tmp_path):
    rows = [
        status(0, 1),
        status(1, 1, "SUCCESS"),
        status(2, 1),
        *(status(2, tick, message=str(tick)) for tick in (2, 3)),
    ]
    assert numbers(write_journal(tmp_path / "j", rows), is_condensed=True) == [1, 2, 3, 4, 5]


def random_rows(chance):
    tick, words = 1, ("RUNNING", "RUNNING", "RUNNING", "SUCCESS", "FAILURE", "IDLE", "HALTED")
    for _ in range(60):
        tick += chance.choice((0, 1, 1, 1))
        node = chance.choice((2, 2, 2, 3, 5, chance.randrange(6)))
        word = "RUNNING" if chance.random() < 0.7 else chance.choice(words)
        more = (
            {"last": tick}
            if word in ("IDLE", "HALTED")
            else {"label": chance.choice(("", "", "x"))}
            if chance.random() < 0.2
            else {}
        )
        yield status(node, tick, word, chance.choice(("", "8 m", 'a "b" \\ ü')), **more)
        if chance.random() < 0.05:
            yield LOG, {"node": "n", "level": 30, "text": "x", "stamp": 0.0}


def compute_results(path, **options):
    """Return all results that are computed from a journal."""
    with JournalFile.open_snapshot(path) as file:
        state = MissionState.from_stream(file.every_run(**options))
        inquiry = FailureAnalysis.from_stream(file.last_run(without=OF_ROBOT, **options))
        found = RunStatistics()
        found.add(file.every_run(without=OF_ROBOT, **options))
        return (
            state.nodes,
            state.now,
            state.tick,
            inquiry.find_cause(),
            inquiry.failed_tick,
            statistics_as_json(found, 0.95),
        )


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(rounds(60)))
def test_results_are_the_same_without_repeated_rows(seed, tmp_path):
    path = write_journal(tmp_path / "j", random_rows(random.Random(seed)))  # noqa: S311
    assert compute_results(path, is_condensed=True) == compute_results(path)


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(rounds(20)))
def test_reading_state_and_cause_together_equals_reading_them_separately(seed, tmp_path):
    rows = [*random_rows(random.Random(seed)), ("photo_taken", {"photo": 1}), status(9, 99)]  # noqa: S311
    with JournalFile.open_snapshot(write_journal(tmp_path / "j", rows)) as file:
        inquiry, state = FailureAnalysis.with_state(file.every_run())
        alone = MissionState.from_stream(file.every_run())
        assert inquiry.find_cause() == FailureAnalysis.from_stream(file.last_run()).find_cause()
    assert vars(state) == {**vars(alone), "situation": state.situation}


TEXTS = [
    '{"node": 1, "tick": 2, "status": "RUNNING", "message": "a \\"b\\" \\u00fc"}',
    '{"node": 1, "tick": 2, "status": "SUCCESS", "message": "", "label": "near", "more": [1, {"x": null}]}',
    '{"node": 01, "tick": 2, "status": "SUCCESS", "message": ""}',
    '{"node": 1_0, "tick": 2, "status": "SUCCESS", "message": ""}',
    '{"node": 1, "tick": "2", "status": "SUCCESS", "message": ""}',
    '{"node": 1, "tick": 2.0, "status": "SUCCESS", "message": ""}',
    '{"node": -1, "tick": -2, "status": "SUCCESS", "message": ""}',
    '{"node": 1, "tick": 2, "status": "SUCCESS", "message": "", "tick": 3}',
    '{"node": 1, "tick": 2, "status": "SUCCESS", "status": "FAILURE", "message": ""}',
    '{"node": 1, "tick": 2, "status": 3, "message": ""}',
    '{"node": 1, "tick": 2, "status": "SUCCESS", "message": null}',
    '{"node": 1, "tick": 2, "status": "SUCCESS"',
    '{"tick": 2, "node": 1, "status": "SUCCESS", "message": ""}',
    '{"node": 1, "status": "SUCCESS", "message": ""}',
    '{"status": "SUCCESS"}',
    "[]",
    " {}",
]


@pytest.mark.parametrize("text", TEXTS)
def test_fast_status_parser_agrees_with_json_parser(text):
    def plainly():
        data = mapping(text)
        check_value_types(STATUS, data)
        return data

    def read():
        # The second row uses the cached result of the first one.
        first, second = entries_of([(number, 1, 0.0, 0.0, STATUS, text) for number in (1, 2)])
        assert first.data == second.data
        return second.data

    outcomes = []
    for get in (plainly, read):
        try:
            outcomes.append(get())
        except (TypeError, ValueError) as error:  # noqa: PERF203 - each may fail
            outcomes.append(type(error))
    assert outcomes[0] == outcomes[1]
    assert len({json_text(each) for each in outcomes if isinstance(each, dict)}) <= 1
