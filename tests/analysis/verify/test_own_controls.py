"""Tests of users' own controls and decorators: with `begin` and `resume`, or replaced by their semantics."""

import json
import re

import pytest

from sar_compiler.analysis.simulated_tree import UnknownBehaviourError, compile_simulated
from sar_compiler.analysis.verification_view import verification_as_json, verification_as_text
from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.verdicts import AN_END, EVERY_LEAF, NO_ERROR, NO_LIVELOCK, OWN_RECORDS
from sar_compiler.compiler import bind_main
from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.registry import load_registry
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.random_trees import random_tree
from tests.analysis.verify.stage import BROKEN, PROVED, TAGS, simulated_tree
from tests.analysis.verify.test_branching_points import PROPERTIES, graph_of
from tests.analysis.verify.test_same_as_py_trees import TICKS, Explored, tick_sequences
from tests.random_inputs import rounds
from tests.trees import forest

REGISTRY = load_registry(["tests.analysis.verify.leaves", "tests.analysis.verify.own_controls"])
_MOST_STATES = 2000
TWINS = ("Sequence", "Fallback", "ReactiveFallback", "Inverter")


def bind_or_skip(body):
    """Bind a tree; skip the test if the tree has errors."""
    try:
        return bind_main(forest(body), REGISTRY)
    except TreeError:
        pytest.skip("the parts of this tree do not go together")


def verify_body(body):
    simulated = compile_simulated(bind_or_skip(body), {}, all_runs=True)
    return verify(simulated, None, TAGS, _MOST_STATES)


def count_ticks(body):
    """Return the number of ticks between states; the number of shared steps depends on the nodes."""
    simulated = compile_simulated(bind_or_skip(body), {}, all_runs=True)
    graph = Explored(simulated, _MOST_STATES, forgets=True).graph
    return sum(len(graph.ticks(state)) for state in range(graph.expanded_count))


def verdicts_with_lengths(body):
    """Return the verdicts about a tree, each with the length of its trace in ticks."""
    return {
        verdict.question: (verdict.outcome, verdict.trace and len(verdict.trace.ticks) - verdict.trace.loop)
        for verdict in verify_body(body).verdicts
        if verdict.question != OWN_RECORDS
    }


def outcomes(body):
    return {verdict.question: verdict.outcome for verdict in verify_body(body).verdicts}


def with_own_copies(body):
    """Return a tree in which some nodes are replaced by their own-class copies."""
    for tag in TWINS:
        body = re.sub(rf"(</?){tag}\b", rf"\1Own{tag}", body)
    return body


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(400, 400 + rounds(20)))
def test_own_control_has_same_verdicts_as_original(seed):
    body = random_tree(seed)
    assert outcomes(with_own_copies(body)).get(OWN_RECORDS, PROVED) is PROVED
    assert verdicts_with_lengths(with_own_copies(body)) == verdicts_with_lengths(body)


WRITTEN = [
    "<OwnTurn><Fallback><A/><B/></Fallback><P/></OwnTurn>",
    "<Fallback><OwnTurn><Fallback><P/><B/></Fallback><P/></OwnTurn><OwnCount><B/></OwnCount></Fallback>",
    "<OwnRecovery><Sequence><P/><A/></Sequence><OwnInverter><P/></OwnInverter></OwnRecovery>",
    "<ReactiveSequence><P/><OwnRecovery><A/><OwnCount most='1'><B/></OwnCount></OwnRecovery></ReactiveSequence>",
    "<OwnSequence><OwnFallback><P/><A/></OwnFallback><OwnCount most='2'><B/></OwnCount></OwnSequence>",
    "<OwnTurn><StatusQueue queue='SUCCESS;FAILURE' eventually='RUNNING'/><P/></OwnTurn>",
    "<ReactiveFallback><P/><OwnTurn><A/><P/></OwnTurn></ReactiveFallback>",
]


@pytest.mark.unmeasured
@pytest.mark.parametrize(
    "body", [*WRITTEN, *map(with_own_copies, map(random_tree, range(500, 500 + rounds(8))))]
)
def test_states_of_own_classes_match_py_trees(body):
    binding = bind_or_skip(body)
    reached = set(tick_sequences(binding))
    explored = Explored(simulated_tree(binding), 50_000)
    graph = explored.graph
    near = [number for number in range(len(graph.states)) if len(graph.stem(number)) <= TICKS + 1]
    assert {explored.looked_at(number) for number in near} == reached


@pytest.mark.unmeasured
@pytest.mark.parametrize(
    "body",
    [
        *WRITTEN,
        *map(with_own_copies, map(random_tree, range(600, 600 + rounds(10)))),
        "<OwnRecovery retries='2'><Fallback><A/><A/></Fallback><Sequence><A/><A/><OwnCount most='2'><A/></OwnCount></Sequence></OwnRecovery>",
        "<OwnTwice><Fallback><A/><P/></Fallback><A/></OwnTwice>",
        "<OwnSequence><OwnTimeout><OwnFallback><A/><A/></OwnFallback></OwnTimeout><OwnTwice><A/><OwnFallback><P/><B/></OwnFallback></OwnTwice></OwnSequence>",
    ],
)
def test_merged_ticks_within_own_nodes_give_same_graph(body):
    binding = bind_or_skip(body)
    assert graph_of(binding, PROPERTIES, meets=True) == graph_of(binding, PROPERTIES, meets=False)


def test_retried_recovery_does_not_multiply_states():
    parts = "<Sequence><A/><B/></Sequence><Fallback><A/><B/></Fallback>"
    found = verify_body(f'<OwnRecovery retries="6">{parts}</OwnRecovery>')
    assert found.is_proved
    assert found.complete


PARTS = ("<X/>", "<Y/>", "<P/>", "<Inverter><P/></Inverter>", "<Fallback><X/><P/></Fallback>")


@pytest.mark.parametrize("first", PARTS)
@pytest.mark.parametrize("second", PARTS)
def test_recovery_has_same_verdicts_as_equivalent_nodes(first, second):
    known = f"<Fallback>{first}<Sequence>{second}{first}</Sequence></Fallback>"
    expected, found = (
        verdicts_with_lengths(known),
        verdicts_with_lengths(f"<OwnRecovery>{first}{second}</OwnRecovery>"),
    )
    for each in (expected, found):
        del each[EVERY_LEAF]  # the trees have different leaves
    assert found == expected


@pytest.mark.parametrize(
    "child", ["<A/>", "<Running/>", "<Fallback><P/><A/></Fallback>", "<Timeout msec='9'><A/></Timeout>"]
)
@pytest.mark.parametrize(
    "around", ["{}", "<Sequence>{}<A/></Sequence>", "<Fallback>{}<B/></Fallback>", "<Inverter>{}</Inverter>"]
)
def test_own_timeout_has_same_verdicts_as_built_in_timeout(child, around):
    own, known = (
        around.format(f"<{tag}>{child}</{tag.split()[0]}>") for tag in ("OwnTimeout", 'Timeout msec="5000"')
    )
    assert outcomes(own) == outcomes(known)


def test_timer_restarted_in_every_tick_never_expires():
    assert outcomes("<OwnDebounce><P/></OwnDebounce>")[NO_LIVELOCK] is BROKEN


def test_timer_with_zero_duration_is_never_awaited():
    assert outcomes('<OwnTimeout seconds="0"><Sequence><A/><B/></Sequence></OwnTimeout>') == {
        NO_ERROR: PROVED, EVERY_LEAF: PROVED, AN_END: PROVED, NO_LIVELOCK: PROVED,
    }  # fmt: skip


def test_cell_is_part_of_state_until_node_ends():
    endless = "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"
    assert verify_body("<OwnCount><A/></OwnCount>").is_proved
    assert verify_body(endless.format("<OwnCount><AlwaysSuccess/></OwnCount>")).states == 2


def test_persistent_cell_outlasts_end_and_halt():
    endless = "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"
    turns = "<OwnTurn><AlwaysSuccess/><AlwaysSuccess/><AlwaysSuccess/></OwnTurn>"
    assert verify_body(endless.format(turns)).states == 4
    halted = "<KeepRunningUntilFailure><Timeout msec='9'><OwnTurn><A/><B/></OwnTurn></Timeout></KeepRunningUntilFailure>"
    assert outcomes(halted)[EVERY_LEAF] is PROVED


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            "<OwnTally><A/></OwnTally>",
            ["'OwnTally' (", "OwnTally) changes its attribute 'ticks'", "self.cell()"],
        ),
        ("<OwnList><A/></OwnList>", ["'OwnList'", "changes its attribute 'seen'"]),
        ("<OwnHours><A/></OwnHours>", ["reads the clock", "start_timer()"]),
    ],
)
def test_unverifiable_class_is_reported_with_remedy(body, words):
    with pytest.raises(UndecidableError) as caught:
        verify_body(body)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("tag", "said"),
    [
        ("OwnSilence", "resume() returned None, which is not a status"),
        ("OwnStray", "begin() returned <"),
    ],
)
def test_class_that_returns_neither_status_nor_child_is_named_in_error(tag, said):
    verdict = next(each for each in verify_body(f"<{tag}><A/></{tag}>").verdicts if each.question == NO_ERROR)
    assert verdict.outcome is BROKEN
    assert verdict.reason.startswith(f"'{tag}' ({tag}) failed: {said}")
    assert verdict.reason.endswith("or the child to tick next")


def test_unbounded_cell_is_named():
    endless = verify_body("<OwnEndless><KeepRunningUntilFailure><A/></KeepRunningUntilFailure></OwnEndless>")
    assert not endless.complete
    assert endless.growing[0][0] == "OwnEndless.ticks"


def test_verification_repr_is_one_line():
    assert repr(verify_body("<Sequence><A/><AlwaysFailure/><B/></Sequence>")) == (
        "<Verification: 3 proved, 1 does not hold; 3 states>"
    )


def test_notebook_shows_verdicts_as_table():
    found = verify_body("<Sequence><A/><AlwaysFailure/><B/></Sequence>")
    table = found._repr_html_()
    assert "<caption>Verification: 3 proved, 1 does not hold; 3 states</caption>" in table
    assert table.count("<tr>") == len(found.verdicts) == 4
    row = "<tr><td>every leaf can run</td><td>does not hold</td><td>no run ticks &#x27;B&#x27;</td></tr>"
    assert row in table
    broken = next(each for each in found.verdicts if each.reason)
    assert broken._repr_html_() == f"<table><caption></caption>{row}</table>"


@pytest.mark.parametrize(
    ("body", "did", "ticks"),
    [
        (
            "<OwnLiar><A/><B/></OwnLiar>",
            (
                "'OwnLiar' (tests.analysis.verify.own_controls.OwnLiar) ticked 'B' although 'A' had returned FAILURE, but its "
                "declaration allows that only after SUCCESS. Correct the declared outcomes or semantics"
            ),
            1,
        ),
        (
            "<Sequence><A/><OwnBoast><P/></OwnBoast></Sequence>",
            "'OwnBoast' (tests.analysis.verify.own_controls.OwnBoast) returned FAILURE, but its declaration allows only SUCCESS here",
            1,
        ),
    ],
)
def test_class_that_contradicts_its_declaration_is_named_with_run(body, did, ticks):
    verdict = verify_body(body).verdicts[-1]
    assert (verdict.question, verdict.outcome) == (OWN_RECORDS, BROKEN)
    assert verdict.reason.startswith(did)
    assert len(verdict.trace.ticks) == ticks


def test_class_without_declaration_has_no_question():
    assert OWN_RECORDS not in outcomes("<OwnInverter><A/></OwnInverter>")
    assert outcomes("<OwnSequence><A/><B/></OwnSequence>")[OWN_RECORDS] is PROVED


BY_SEMANTICS = [
    ("<TickingSequence>{}</TickingSequence>", "<Sequence>{}</Sequence>"),
    ("<TickingFallback>{}</TickingFallback>", "<Fallback>{}</Fallback>"),
    ("<TickingReactive>{}</TickingReactive>", "<ReactiveFallback>{}</ReactiveFallback>"),
    ("<TickingPauses>{}</TickingPauses>", "<AsyncSequence>{}</AsyncSequence>"),
    ("<TickingPlace>{}</TickingPlace>", "<SequenceWithMemory>{}</SequenceWithMemory>"),
    ("<TickingTurn><Sequence>{}</Sequence></TickingTurn>", "<Inverter><Sequence>{}</Sequence></Inverter>"),
    (
        "<TickingPass><Sequence>{}</Sequence></TickingPass>",
        "<PassThrough><Sequence>{}</Sequence></PassThrough>",
    ),
    (
        "<TickingLimit><Sequence>{}</Sequence></TickingLimit>",
        "<Timeout msec='9'><Sequence>{}</Sequence></Timeout>",
    ),
    (
        "<TickingRetry><Sequence>{}</Sequence></TickingRetry>",
        "<Retry num_failures='2'><Sequence>{}</Sequence></Retry>",
    ),
    (
        "<TickingRounds attempts='-1'><Sequence>{}</Sequence></TickingRounds>",
        "<Repeat num_success='-1'><Sequence>{}</Sequence></Repeat>",
    ),
]


@pytest.mark.parametrize(("own", "known"), BY_SEMANTICS)
def test_class_with_own_tick_is_verified_by_its_semantics(own, known):
    parts = "<X/><Fallback><Y/><P/></Fallback>"
    own, known = own.format(parts), known.format(parts)
    found, expected = verify_body(own), verify_body(known)
    assert verdicts_with_lengths(own) == verdicts_with_lengths(known)
    assert (found.states, count_ticks(own)) == (expected.states, count_ticks(known))
    assert expected.by_semantics == ()


def test_report_names_classes_replaced_by_semantics():
    found = verify_body(
        "<TickingSequence><A/><TickingTurn><P/></TickingTurn><TickingTurn><P/></TickingTurn></TickingSequence>"
    )
    place = "tests.analysis.verify.own_controls"
    assert verification_as_text(found, 0.0).splitlines()[-2:] == [
        f"<{tag}> ({place}.{tag}) was replaced by its semantics. Its own methods are not verified."
        for tag in ("TickingSequence", "TickingTurn")
    ]
    assert json.loads(verification_as_json(found, 0.0))["by_semantics"] == [
        {"tag": tag, "class": f"{place}.{tag}"} for tag in ("TickingSequence", "TickingTurn")
    ]


@pytest.mark.parametrize(
    "body",
    [
        "<TickingMystery><A/></TickingMystery>",
        "<Sequence><Script code='n := 1'/><TickingLimit seconds='{n}'><A/></TickingLimit></Sequence>",
        "<TickingRetry attempts='0'><A/></TickingRetry>",
    ],
)
def test_class_with_own_tick_and_incomplete_semantics_is_rejected(body):
    with pytest.raises(
        UnknownBehaviourError,
        match=r"(?s)Ticking\w+> has its own methods .*with the methods begin and resume",
    ):
        verify_body(body)


def test_class_with_own_tick_is_used_in_simulation():
    simulated = compile_simulated(bind_or_skip("<TickingMystery><A/></TickingMystery>"), {})
    assert type(simulated.root).__name__ == "TickingMystery"
    assert simulated.by_semantics == ()
