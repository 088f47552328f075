"""The cells and the blackboard are all that a flat tree remembers."""

import random

import pytest

from tests.chance import rounds
from tests.runtime.kernel.flat import cells_of
from tests.runtime.kernel.random_trees import HAS_FOR_EACH
from tests.runtime.kernel.stage import Beat, FlatStage, Saved, Seen, bound, random_beats, random_bindings

pytestmark = pytest.mark.unmeasured

TREES = rounds(40)
TICKS = 12


def told(seen: Seen):
    """The result of a tick, without what is told but makes no difference: messages, and how often was written."""
    return seen.outcome, seen.events, seen.statuses, [entry[:3] for entry in seen.entries]


@pytest.mark.parametrize("skips", [False, True], ids=["stock nodes", "nodes that skip"])
def test_a_tree_that_is_put_back_into_an_earlier_state_does_the_same_again(skips):
    for seed, binding in random_bindings(TREES, skips=skips):
        stage = FlatStage(binding, seed)
        beats = random_beats(seed, TICKS)
        states: list[Saved] = []
        first = []
        for beat in beats:
            states.append(stage.save())
            first.append(told(stage.play(beat)))
            if first[-1][0].startswith("raised"):
                break
        for index in random.Random(seed).sample(range(len(first)), min(4, len(first))):  # noqa: S311 - the same trees in every run
            stage.restore(states[index])
            again = [told(stage.play(beat)) for beat in beats[index : len(first)]]
            assert again == first[index:], f"seed {seed}, from tick {index}"


def states_of(body: str, ticks: int = 60) -> list[tuple[object, tuple[int, ...]]]:
    """Return the states that a tree can reach."""
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
def test_what_only_counts_up_makes_no_new_state(body):
    assert len(distinct(states_of(body)[5:])) == 1


def test_an_entry_written_behind_a_node_that_waits_for_news_makes_one_state_however_often():
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
def test_a_tree_that_is_halted_in_the_middle_is_as_it_was_at_first(body):
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
def test_a_time_that_is_over_leaves_nothing_but_how_it_ended(body):
    stage = FlatStage(bound(body), seed=1)
    assert stage.play(Beat(0, 0.0, halt=False)).outcome == "RUNNING"
    assert stage.play(Beat(1, 0.25, halt=False)).outcome in {"SUCCESS", "FAILURE"}
    nodes = len(stage.flat.nodes)
    cells, values = cells_of(stage.ticker)
    first_cells, first_values = cells_of(stage.flat.ticker(stage.times))
    assert (cells[nodes:], values) == (first_cells[nodes:], first_values)
