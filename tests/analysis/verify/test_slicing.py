"""Tests of merging equivalent values: every verdict is that of the search that distinguishes all values."""

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
from tests.random_inputs import rounds
from tests.trees import forest_of

pytestmark = pytest.mark.unmeasured

_TREES = rounds(40)
_MOST_STATES = 800


def bind_trees(trees):
    text = f'<root BTCPP_format="4" main_tree_to_execute="Main">{trees}</root>'
    return bind_main(forest_of(text), REGISTRY, palettes=[enums_file(ENUMS)])


def verify_or_error(binding, properties, *, merges, most=_MOST_STATES):
    file = parse_property_file(properties, "props.yaml") if properties else None
    try:
        return verify(simulated_tree(binding, file), file, TAGS, most, merges=merges)
    except UndecidableError as error:
        return str(error)


def comparable_verdict(verdict):
    """Return a verdict with its run, without the run if it has a loop, which may be shorter."""
    trace = None if verdict.trace is None or verdict.trace.loop else verdict.trace.ticks
    return verdict.question, verdict.outcome, verdict.reason, trace


def test_random_trees_have_same_verdicts_and_runs_with_no_more_states():
    fewer, decided, tried = 0, 0, 0
    for seed in range(_TREES):
        chosen = RandomCounters(seed)
        trees = chosen.trees()
        try:
            binding = bind_trees(trees)
            properties = chosen.properties(trees)
            plain = verify_or_error(binding, properties, merges=False)
        except TreeError:
            continue
        tried += 1
        found = verify_or_error(binding, properties, merges=True)
        about = f"seed {seed}\n{trees}\n{properties}\n{found}"
        if isinstance(plain, str) or isinstance(found, str):
            assert found == plain, about
            continue
        if plain.complete:
            assert found.complete, about
            assert [*map(comparable_verdict, found.verdicts)] == [*map(comparable_verdict, plain.verdicts)], (
                about
            )
            assert found.states <= plain.states, about
            fewer += found.states < plain.states
            continue
        decided += found.complete
        for one, other in zip(found.verdicts, plain.verdicts, strict=True):
            if one.question == AN_END:
                continue  # the absence of a further end is known only in a complete search
            if other.outcome is BROKEN:
                assert comparable_verdict(one) == comparable_verdict(other), about
            elif one.trace and not one.trace.loop:
                assert len(one.trace.ticks) > plain.depth, about
    assert tried > _TREES // 2
    assert fewer + decided > _TREES // 20


def predict_or_error(binding, trees, properties, *, merges):
    file = file_of(trees, CHANCES, properties)
    try:
        return predict(simulated_tree(binding, file), file, TAGS, PERIOD_SEC, _MOST_STATES, merges=merges)
    except UndecidableError as error:
        return str(error)


def test_random_trees_have_same_predictions():
    merged = 0
    for seed in range(_TREES):
        chosen = RandomCounters(seed)
        trees = chosen.trees()
        try:
            binding = bind_trees(trees)
            properties = chosen.properties(trees)
            plain = predict_or_error(binding, trees, properties, merges=False)
        except TreeError:
            continue
        found = predict_or_error(binding, trees, properties, merges=True)
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


def endless_main_tree(*nodes):
    """Return a main tree that repeats forever."""
    inside = "".join(nodes)
    start = '<Script code="rounds := 0; down := 9"/>'
    return (
        f'<BehaviorTree ID="Main"><Sequence>{start}<KeepRunningUntilFailure><Sequence>{inside}</Sequence>'
        "</KeepRunningUntilFailure></Sequence></BehaviorTree>"
    )


ROUND = '<Script code="rounds = rounds + 1"/>'
LEAF = "<ForceSuccess><A/></ForceSuccess>"


def verify_merged(*nodes, properties=None):
    """Verify a tree that has too many states if all values are distinguished."""
    binding = bind_trees(endless_main_tree(*nodes))
    assert not verify_or_error(binding, properties, merges=False).complete
    found = verify_or_error(binding, properties, merges=True)
    assert found.complete
    return found


def test_patrol_that_counts_rounds_is_decided_with_note():
    found = verify_merged(ROUND, LEAF)
    assert outcome(found, NO_ERROR) is PROVED
    assert [*merging_notes(found.merged)] == [
        "Values of rounds are not distinguished, because no condition, control or property depends on these values."
    ]


def test_endless_run_shows_counted_rounds():
    trace = verdict(verify_merged(ROUND, LEAF), NO_LIVELOCK).trace
    assert trace.loop
    counted = [tick.keys["rounds"] for tick in trace.ticks if "rounds" in tick.keys]
    assert [now for _, now in counted] == [*range(1, len(counted) + 1)]


def test_compared_count_is_distinguished_up_to_compared_value():
    found = verify_merged(ROUND, '<A _skipIf="rounds &lt; 3"/>', LEAF)
    assert outcome(found, EVERY_LEAF) is PROVED
    assert [*merging_notes(found.merged)] == [
        "rounds is only compared with constants, so values of 4 and more are not distinguished."
    ]


def test_countdown_is_distinguished_down_to_compared_value():
    found = verify_merged('<Script code="down -= 1"/>', '<A _skipIf="down &gt; 7"/>')
    assert [*merging_notes(found.merged)] == [
        "down is only compared with constants, so values of 6 and less are not distinguished."
    ]


def test_property_can_read_count_and_its_run_shows_count():
    properties = "properties: {four: {never: A FAILURE, while: rounds > 4}, never: {never: A FAILURE, while: rounds < 0}}"
    found = verify_merged(ROUND, LEAF, properties=properties)
    assert outcome(found, "never") is PROVED
    trace = verdict(found, "four").trace
    assert len(trace.ticks) == 5
    assert [tick.keys["rounds"][1] for tick in trace.ticks] == [1, 2, 3, 4, 5]


def test_key_used_only_for_unused_keys_is_merged():
    found = verify_merged(ROUND, "<Script code=\"last := rounds; text := 'round ' .. last\"/>", LEAF)
    assert [each.name for each in found.merged] == ["rounds"]


def test_keys_of_subtree_follow_its_ports():
    inner = '<BehaviorTree ID="Inner"><Script code="k += 1; own := k"/></BehaviorTree>'
    trees = endless_main_tree('<SubTree ID="Inner" k="{rounds}"/>', LEAF) + inner
    assert verify_or_error(bind_trees(trees), None, merges=True).complete
    read = (
        endless_main_tree('<SubTree ID="Inner" k="{rounds}"/>', '<Repeat num_cycles="{rounds}"><A/></Repeat>')
        + inner
    )
    assert not verify_or_error(bind_trees(read), None, merges=True).complete


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
def test_values_with_other_uses_are_distinguished(nodes):
    found = verify_or_error(bind_trees(endless_main_tree(*nodes)), None, merges=True, most=300)
    assert isinstance(found, str) or not found.complete or outcome(found, NO_ERROR) is BROKEN


def test_integer_after_fraction_can_be_assigned_to_integer_key():
    # The first value of `n` has a fraction, and no value of `m` may have one.
    trees = endless_main_tree('<Script code="n := 0.5; n = 0; n += 1; m := 1; m = n"/>', LEAF)
    found = verify_or_error(bind_trees(trees), None, merges=True)
    assert found.complete
    assert outcome(found, NO_ERROR) is PROVED


def test_merged_key_keeps_its_type():
    # Unlike an equal integer, a real number may be followed by one with a fraction.
    again = '<UnsetBlackboard key="down"/><Script code="down := 2.0; down += 1"/>'
    copied = '<UnsetBlackboard key="m"/><Script code="m := down; m = 0.5"/>'
    found = verify_or_error(bind_trees(endless_main_tree(again, copied, LEAF)), None, merges=True)
    assert found.complete
    assert outcome(found, NO_ERROR) is PROVED


def test_initial_type_of_key_is_kept():
    file = "parameters: {half: 0}\nproperties: {p: {never: A FAILURE, while: rounds < 0}}"
    found = verify_or_error(
        bind_trees(endless_main_tree(ROUND, '<Script code="half = rounds / 2"/>', LEAF)), file, merges=True
    )
    assert outcome(found, NO_ERROR) is BROKEN
    assert len(verdict(found, NO_ERROR).trace.ticks) == 1


def test_unread_strings_are_not_distinguished():
    modes = "<Fallback><Sequence><A/><Script code=\"mode := 'left'\"/></Sequence><Script code=\"mode := 'right'\"/></Fallback>"
    binding = bind_trees(endless_main_tree(modes))
    found, plain = (verify_or_error(binding, None, merges=merges) for merges in (True, False))
    assert [each.name for each in found.merged] == ["mode"]
    assert found.states < plain.states
    assert [*map(comparable_verdict, found.verdicts)] == [*map(comparable_verdict, plain.verdicts)]


def test_error_is_raised_after_same_number_of_ticks():
    found = verify_or_error(
        bind_trees(endless_main_tree(ROUND, "<Script code=\"down := rounds &gt; 3 ? 'x' : 1\"/>", LEAF)),
        None,
        merges=True,
    )
    assert outcome(found, NO_ERROR) is BROKEN
    assert len(verdict(found, NO_ERROR).trace.ticks) == 4


def test_nothing_is_merged_if_end_depends_on_idleness():
    found = verify_or_error(
        bind_trees(endless_main_tree(ROUND, LEAF)),
        "end: idle\nproperties: {p: {never: A FAILURE}}",
        merges=True,
    )
    assert not found.complete
    assert found.merged == ()


def test_merging_in_separate_branches_matches_whole_tree():
    branches = "".join(
        f'<Sequence><Script code="{key} := 0" oneshot="ON_COMPLETION"/><Script code="{key} += 1"/>'
        f'<RetryUntilSuccessful num_attempts="2"><{leaf}/></RetryUntilSuccessful></Sequence>'
        for key, leaf in (("i", "A"), ("j", "B"), ("k", "C"))
    )
    parallel = f'<Parallel success_count="3" failure_count="1">{branches}</Parallel>'
    retried = f'<RetryUntilSuccessful num_attempts="-1">{parallel}</RetryUntilSuccessful>'
    binding = bind_trees(f'<BehaviorTree ID="Main">{retried}</BehaviorTree>')
    found = verify(simulated_tree(binding), None, TAGS, 20_000, plainly=3)
    whole = verify(simulated_tree(binding), None, TAGS, 20_000)
    assert (found.complete, found.branches, whole.branches) == (True, 3, 0)
    assert {each.name for each in found.merged} == {"i", "j", "k"}
    assert [*map(comparable_verdict, found.verdicts)] == [*map(comparable_verdict, whole.verdicts)]
    trace = verdict(found, NO_LIVELOCK).trace
    assert trace.loop
    counted = [tick.keys["i"] for tick in trace.ticks if "i" in tick.keys]
    assert all(before is None or now == before + 1 for before, now in counted[1:])
