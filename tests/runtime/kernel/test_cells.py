"""Tests of the state of a flat tree: it consists only of the cells and the blackboard."""

import random

import pytest

from tests.random_inputs import rounds
from tests.runtime.kernel.flat import cells_of
from tests.runtime.kernel.random_trees import HAS_FOR_EACH
from tests.runtime.kernel.stage import Beat, FlatStage, Saved, Seen, bound, random_beats, random_bindings

pytestmark = pytest.mark.unmeasured

TREES = rounds(40)
TICKS = 12


def comparable_result(seen: Seen):
    """Return the result of a tick without messages and numbers of writes, which are no part of the state."""
    return seen.outcome, seen.events, seen.statuses, [entry[:3] for entry in seen.entries]


@pytest.mark.parametrize("skips", [False, True], ids=["stock nodes", "nodes that skip"])
def test_tree_restored_to_earlier_state_repeats_its_ticks(skips):
    for seed, binding in random_bindings(TREES, skips=skips):
        stage = FlatStage(binding, seed)
        beats = random_beats(seed, TICKS)
        states: list[Saved] = []
        first = []
        for beat in beats:
            states.append(stage.save())
            first.append(comparable_result(stage.play(beat)))
            if first[-1][0].startswith("raised"):
                break
        for index in random.Random(seed).sample(range(len(first)), min(4, len(first))):  # noqa: S311 - the same trees in every run
            stage.restore(states[index])
            again = [comparable_result(stage.play(beat)) for beat in beats[index : len(first)]]
            assert again == first[index:], f"seed {seed}, from tick {index}"


def states_of(body: str, ticks: int = 60) -> list[tuple[object, tuple[int, ...]]]:
    """Return the state of a tree after each of its first ticks."""
    stage = FlatStage(bound(body), seed=1)
    seen = []
    for number in range(ticks):
        stage.play(Beat(number, 0.0, halt=False))
        saved = stage.save()
        seen.append((saved.cells, tuple(saved.entries)))
    return seen


def distinct(states):
    return set(states)


@pytest.mark.parametrize(
    "body",
    [
        '<Repeat num_cycles="-1"><AlwaysSuccess/></Repeat>',
        '<RetryUntilSuccessful num_attempts="-1"><AlwaysFailure/></RetryUntilSuccessful>',
        '<Repeat num_success="0"><AlwaysSuccess/></Repeat>',
        "<Count><AlwaysSuccess/></Count>",
        '<SuccessEveryN n="1"/>',
        '<Sequence><Script code="a := 1"/><WasEntryUpdated entry="{a}"/></Sequence>',
        '<Sequence><Script code="a := 1; a := 1"/><WasEntryUpdated entry="{b}"/></Sequence>',
        '<Sequence><UnsetBlackboard key="a"/><Script code="a := 1"/><WasEntryUpdated entry="{a}"/></Sequence>',
    ],
)
def test_unbounded_counters_create_no_new_states(body):
    assert len(distinct(states_of(body)[5:])) == 1


def test_repeated_writes_to_watched_entry_create_one_state():
    body = (
        '<ReactiveSequence><Script code="a := 1"/><AlwaysFailure/>'
        '<WaitValueUpdate entry="{a}"><AlwaysSuccess/></WaitValueUpdate></ReactiveSequence>'
    )
    assert len(distinct(states_of(body)[3:])) == 1


@pytest.mark.parametrize(
    "body",
    [
        "<Sequence><AlwaysSuccess/><Running/></Sequence>",
        "<Selector><AlwaysFailure/><Running/></Selector>",
        "<AsyncSequence><AlwaysSuccess/><Running/></AsyncSequence>",
        '<Parallel success_count="2"><AlwaysSuccess/><Running/><Running/></Parallel>',
        '<ParallelAll max_failures="2"><AlwaysFailure/><Running/></ParallelAll>',
        '<Parallel policy="SuccessOnAll"><AlwaysSuccess/><Running/></Parallel>',
        "<IfThenElse><AlwaysSuccess/><Running/></IfThenElse>",
        '<Switch2 variable="a" case_1="b" case_2="a"><Running/><Running/><Running/></Switch2>',
        '<TryCatch catch_on_halt="true"><AlwaysSuccess/><Running/><AlwaysSuccess/></TryCatch>',
        "<TryCatch><AlwaysFailure/><Running/></TryCatch>",
        '<Repeat num_cycles="9"><AlwaysSuccess/></Repeat>',
        '<Retry num_failures="9"><AlwaysFailure/></Retry>',
        '<Repeat num_success="9"><AlwaysSuccess/></Repeat>',
        '<Timeout msec="5000"><Running/></Timeout>',
        '<Timeout duration="5"><Running/></Timeout>',
        '<Delay delay_msec="5000"><AlwaysSuccess/></Delay>',
        '<Sleep msec="5000"/>',
        '<Timer duration="5"/>',
        '<TickCounter duration="9" completion_status="SUCCESS"/>',
        '<LoopInt queue="1;2;3"><Running/></LoopInt>',
        '<LoopDouble queue="{numbers}"><Running/></LoopDouble>',
        pytest.param(
            '<ForEach source_key="numbers" target_key="x"><Running/></ForEach>',
            marks=pytest.mark.skipif(not HAS_FOR_EACH, reason="this py_trees is too old for it"),
        ),
        '<Precondition if="true"><Running/></Precondition>',
        '<Running _while="true"/>',
    ],
)
def test_halted_tree_returns_to_initial_state(body):
    stage = FlatStage(bound(body), seed=1)
    for number in range(3):
        assert stage.play(Beat(number, 0.0, halt=False)).outcome == "RUNNING"
    assert cells_of(stage.ticker) != cells_of(stage.flat.ticker(stage.times))
    stage.stop()
    assert cells_of(stage.ticker) == cells_of(stage.flat.ticker(stage.times))


@pytest.mark.parametrize(
    "body",
    [
        '<Sleep msec="125"/>',
        '<Timer duration="0.125"/>',
        '<Delay delay_msec="125"><AlwaysSuccess/></Delay>',
        '<Timeout msec="125"><Running/></Timeout>',
        '<Timeout duration="0.125"><Running/></Timeout>',
    ],
)
def test_expired_timer_leaves_only_statuses(body):
    stage = FlatStage(bound(body), seed=1)
    assert stage.play(Beat(0, 0.0, halt=False)).outcome == "RUNNING"
    assert stage.play(Beat(1, 0.25, halt=False)).outcome in {"SUCCESS", "FAILURE"}
    nodes = len(stage.flat.nodes)
    cells, values = cells_of(stage.ticker)
    first_cells, first_values = cells_of(stage.flat.ticker(stage.times))
    assert (cells[nodes:], values) == (first_cells[nodes:], first_values)
