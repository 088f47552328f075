"""Values that no run can tell apart are one: every answer is that of the search that tells all of them apart."""

import pytest

from sar_compiler.analysis.merging import merging_notes
from sar_compiler.analysis.predict import predict
from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.analysis.verify.verdicts import AN_END, EVERY_LEAF, NO_ERROR, NO_LIVELOCK
from sar_compiler.compiler import bind_main
from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.models import enums_file
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.predict.stage import CHANCES, PERIOD_SEC, file_of
from tests.analysis.verify.random_counters import ENUMS, RandomCounters
from tests.analysis.verify.stage import BROKEN, PROVED, REGISTRY, TAGS, outcome, simulated_tree, verdict
from tests.chance import rounds
from tests.trees import forest_of

pytestmark = pytest.mark.unmeasured

_TREES = rounds(40)
_MOST_STATES = 800


def bound(trees):
    text = f'<root BTCPP_format="4" main_tree_to_execute="Main">{trees}</root>'
    return bind_main(forest_of(text), REGISTRY, palettes=[enums_file(ENUMS)])


def judged(binding, properties, *, merges, most=_MOST_STATES):
    file = parse_property_file(properties, "props.yaml") if properties else None
    try:
        return verify(simulated_tree(binding, file), file, TAGS, most, merges=merges)
    except UndecidableError as error:
        return str(error)


def told(verdict):
    """Return an answer with its run, and without that if it goes round for ever: it may be a shorter one."""
    trace = None if verdict.trace is None or verdict.trace.loop else verdict.trace.ticks
    return verdict.question, verdict.outcome, verdict.reason, trace


def test_random_trees_have_the_same_answers_and_runs_in_no_more_states():
    fewer, decided, tried = 0, 0, 0
    for seed in range(_TREES):
        chosen = RandomCounters(seed)
        trees = chosen.trees()
        try:
            binding = bound(trees)
            properties = chosen.properties(trees)
            plain = judged(binding, properties, merges=False)
        except TreeError:
            continue
        tried += 1
        found = judged(binding, properties, merges=True)
        about = f"seed {seed}\n{trees}\n{properties}\n{found}"
        if isinstance(plain, str) or isinstance(found, str):
            assert found == plain, about
            continue
        if plain.complete:
            assert found.complete, about
            assert [*map(told, found.verdicts)] == [*map(told, plain.verdicts)], about
            assert found.states <= plain.states, about
            fewer += found.states < plain.states
            continue
        decided += found.complete
        for one, other in zip(found.verdicts, plain.verdicts, strict=True):
            if one.question == AN_END:
                continue  # that no end comes any more is only known in the end
            if other.outcome is BROKEN:
                assert told(one) == told(other), about
            elif one.trace and not one.trace.loop:
                assert len(one.trace.ticks) > plain.depth, about
    assert tried > _TREES // 2
    assert fewer + decided > _TREES // 20


def expected(binding, trees, properties, *, merges):
    file = file_of(trees, CHANCES, properties)
    try:
        return predict(simulated_tree(binding, file), file, TAGS, PERIOD_SEC, _MOST_STATES, merges=merges)
    except UndecidableError as error:
        return str(error)


def test_random_trees_are_predicted_to_do_the_same():
    merged = 0
    for seed in range(_TREES):
        chosen = RandomCounters(seed)
        trees = chosen.trees()
        try:
            binding = bound(trees)
            properties = chosen.properties(trees)
            plain = expected(binding, trees, properties, merges=False)
        except TreeError:
            continue
        found = expected(binding, trees, properties, merges=True)
        about = f"seed {seed}\n{trees}\n{properties}\n{found}"
        if isinstance(plain, str) or isinstance(found, str):
            assert found == plain, about
        elif plain.complete:
            assert found.success == pytest.approx(plain.success), about
            assert found.ends == pytest.approx(plain.ends), about
            assert found.time_sec == (plain.time_sec and pytest.approx(plain.time_sec)), about
            assert [*found.distribution] == [pytest.approx(each) for each in plain.distribution], about
            for name, kept in plain.properties.items():
                assert found.properties[name] == pytest.approx(kept), about
            assert {each.leaf: each.derivative for each in found.influences} == pytest.approx(
                {each.leaf: each.derivative for each in plain.influences}
            ), about
            merged += bool(found.merged)
    assert merged


def main(*nodes):
    """Return a main tree that goes its rounds for ever."""
    inside = "".join(nodes)
    start = '<Script code="rounds := 0; down := 9"/>'
    return (
        f'<BehaviorTree ID="Main"><Sequence>{start}<KeepRunningUntilFailure><Sequence>{inside}</Sequence>'
        "</KeepRunningUntilFailure></Sequence></BehaviorTree>"
    )


ROUND = '<Script code="rounds = rounds + 1"/>'
LEAF = "<ForceSuccess><A/></ForceSuccess>"


def decided(*nodes, properties=None):
    """Verify a tree that has too many states to be searched with all values told apart."""
    binding = bound(main(*nodes))
    assert not judged(binding, properties, merges=False).complete
    found = judged(binding, properties, merges=True)
    assert found.complete
    return found


def test_a_patrol_that_counts_its_rounds_is_decided_and_the_note_says_why():
    found = decided(ROUND, LEAF)
    assert outcome(found, NO_ERROR) is PROVED
    assert [*merging_notes(found.merged)] == [
        "Values of rounds are not distinguished, because no condition, control or property depends on these values."
    ]


def test_a_run_without_an_end_shows_the_rounds_as_they_are_counted():
    trace = verdict(decided(ROUND, LEAF), NO_LIVELOCK).trace
    assert trace.loop
    counted = [tick.keys["rounds"] for tick in trace.ticks if "rounds" in tick.keys]
    assert [now for _, now in counted] == [*range(1, len(counted) + 1)]


def test_rounds_that_are_only_compared_are_distinguished_as_far_as_they_are_compared():
    found = decided(ROUND, '<A _skipIf="rounds &lt; 3"/>', LEAF)
    assert outcome(found, EVERY_LEAF) is PROVED
    assert [*merging_notes(found.merged)] == [
        "rounds is only compared with constants, so values of 4 and more are not distinguished."
    ]


def test_a_count_down_is_distinguished_as_far_down_as_it_is_compared():
    found = decided('<Script code="down -= 1"/>', '<A _skipIf="down &gt; 7"/>')
    assert [*merging_notes(found.merged)] == [
        "down is only compared with constants, so values of 6 and less are not distinguished."
    ]


def test_a_property_can_ask_for_the_rounds_and_its_run_shows_them():
    properties = "properties: {four: {never: A FAILURE, while: rounds > 4}, never: {never: A FAILURE, while: rounds < 0}}"
    found = decided(ROUND, LEAF, properties=properties)
    assert outcome(found, "never") is PROVED
    trace = verdict(found, "four").trace
    assert len(trace.ticks) == 5
    assert [tick.keys["rounds"][1] for tick in trace.ticks] == [1, 2, 3, 4, 5]


def test_a_key_that_only_keys_without_use_are_made_of_is_without_use():
    found = decided(ROUND, "<Script code=\"last := rounds; text := 'round ' .. last\"/>", LEAF)
    assert [each.name for each in found.merged] == ["rounds"]


def test_keys_of_a_subtree_are_those_that_its_ports_say():
    inner = '<BehaviorTree ID="Inner"><Script code="k += 1; own := k"/></BehaviorTree>'
    trees = main('<SubTree ID="Inner" k="{rounds}"/>', LEAF) + inner
    assert judged(bound(trees), None, merges=True).complete
    read = main('<SubTree ID="Inner" k="{rounds}"/>', '<Repeat num_cycles="{rounds}"><A/></Repeat>') + inner
    assert not judged(bound(read), None, merges=True).complete


@pytest.mark.parametrize(
    "nodes",
    [
        [ROUND, '<Repeat num_cycles="{rounds}"><A/></Repeat>'],
        [ROUND, '<Script code="down := rounds; x := 1"/>', '<Repeat num_cycles="{down}"><A/></Repeat>'],
        ['<Script code="down -= 1; rounds += 1"/>', '<A _skipIf="rounds &lt; down"/>'],
        ['<Script code="rounds = rounds * 2 + 1"/>', LEAF],
        ['<Script code="rounds += 100000"/>', LEAF],
        [
            ROUND,
            '<Script code="down -= 1"/>',
            '<ForceSuccess><ScriptCondition code="down &gt; 1 &amp;&amp; rounds"/></ForceSuccess>',
        ],
        [ROUND, "<Script code=\"text := '1'; text = rounds / 2\"/>", LEAF],
    ],
    ids=[
        "a port",
        "a port of another key",
        "two keys compared",
        "a product",
        "large steps",
        "a truth value",
        "a number as a text",
    ],
)
def test_what_is_used_in_another_way_is_distinguished(nodes):
    found = judged(bound(main(*nodes)), None, merges=True, most=300)
    assert isinstance(found, str) or not found.complete or outcome(found, NO_ERROR) is BROKEN


def test_whole_numbers_are_no_numbers_with_a_fraction_where_they_are_given_to_a_key_of_whole_numbers():
    # The first value of `n` has a fraction, and no value of `m` may have one.
    trees = main('<Script code="n := 0.5; n = 0; n += 1; m := 1; m = n"/>', LEAF)
    found = judged(bound(trees), None, merges=True)
    assert found.complete
    assert outcome(found, NO_ERROR) is PROVED


def test_a_key_keeps_its_type():
    # Beside whole numbers that look like it, a real one may be followed by one with a fraction.
    again = '<UnsetBlackboard key="down"/><Script code="down := 2.0; down += 1"/>'
    copied = '<UnsetBlackboard key="m"/><Script code="m := down; m = 0.5"/>'
    found = judged(bound(main(again, copied, LEAF)), None, merges=True)
    assert found.complete
    assert outcome(found, NO_ERROR) is PROVED


def test_the_type_that_a_key_has_at_the_start_counts():
    file = "parameters: {half: 0}\nproperties: {p: {never: A FAILURE, while: rounds < 0}}"
    found = judged(bound(main(ROUND, '<Script code="half = rounds / 2"/>', LEAF)), file, merges=True)
    assert outcome(found, NO_ERROR) is BROKEN
    assert len(verdict(found, NO_ERROR).trace.ticks) == 1


def test_texts_that_nothing_reads_are_not_distinguished():
    modes = "<Fallback><Sequence><A/><Script code=\"mode := 'left'\"/></Sequence><Script code=\"mode := 'right'\"/></Fallback>"
    binding = bound(main(modes))
    found, plain = (judged(binding, None, merges=merges) for merges in (True, False))
    assert [each.name for each in found.merged] == ["mode"]
    assert found.states < plain.states
    assert [*map(told, found.verdicts)] == [*map(told, plain.verdicts)]


def test_what_raises_still_raises_after_as_many_ticks():
    found = judged(
        bound(main(ROUND, "<Script code=\"down := rounds &gt; 3 ? 'x' : 1\"/>", LEAF)), None, merges=True
    )
    assert outcome(found, NO_ERROR) is BROKEN
    assert len(verdict(found, NO_ERROR).trace.ticks) == 4


def test_nothing_is_merged_where_a_property_asks_whether_the_tree_idles():
    found = judged(bound(main(ROUND, LEAF)), "end: idle\nproperties: {p: {never: A FAILURE}}", merges=True)
    assert not found.complete
    assert found.merged == ()


def test_branches_that_stand_for_themselves_count_as_they_do_in_the_whole_tree():
    branches = "".join(
        f'<Sequence><Script code="{key} := 0" oneshot="ON_COMPLETION"/><Script code="{key} += 1"/>'
        f'<RetryUntilSuccessful num_attempts="2"><{leaf}/></RetryUntilSuccessful></Sequence>'
        for key, leaf in (("i", "A"), ("j", "B"), ("k", "C"))
    )
    parallel = f'<Parallel success_count="3" failure_count="1">{branches}</Parallel>'
    retried = f'<RetryUntilSuccessful num_attempts="-1">{parallel}</RetryUntilSuccessful>'
    binding = bound(f'<BehaviorTree ID="Main">{retried}</BehaviorTree>')
    found = verify(simulated_tree(binding), None, TAGS, 20_000, plainly=3)
    whole = verify(simulated_tree(binding), None, TAGS, 20_000)
    assert (found.complete, found.branches, whole.branches) == (True, 3, 0)
    assert {each.name for each in found.merged} == {"i", "j", "k"}
    assert [*map(told, found.verdicts)] == [*map(told, whole.verdicts)]
    trace = verdict(found, NO_LIVELOCK).trace
    assert trace.loop
    counted = [tick.keys["i"] for tick in trace.ticks if "i" in tick.keys]
    assert all(before is None or now == before + 1 for before, now in counted[1:])
