"""Controls and decorators of a user's classes: written with `begin` and `resume`, or taken to do what their semantics say."""

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
from tests.analysis.verify.test_forking import PROPERTIES, graph_of
from tests.analysis.verify.test_same_as_py_trees import TICKS, Explored, tick_sequences
from tests.chance import rounds
from tests.trees import forest

REGISTRY = load_registry(["tests.analysis.verify.leaves", "tests.analysis.verify.own_controls"])
_MOST_STATES = 2000
TWINS = ("Sequence", "Fallback", "ReactiveFallback", "Inverter")


def own_binding(body):
    """Bind a tree; one whose parts do not go together is skipped."""
    try:
        return bind_main(forest(body), REGISTRY)
    except TreeError:
        pytest.skip("the parts of this tree do not go together")


def verified(body):
    simulated = compile_simulated(own_binding(body), {}, all_runs=True)
    return verify(simulated, None, TAGS, _MOST_STATES)


def ticks_of(body):
    """Return how many ticks there are between the states; how many steps they share depends on the nodes."""
    simulated = compile_simulated(own_binding(body), {}, all_runs=True)
    graph = Explored(simulated, _MOST_STATES, forgets=True).graph
    return sum(len(graph.ticks(state)) for state in range(graph.expanded_count))


def answers(body):
    """Return the answers about a tree, each with the number of ticks in which it is shown."""
    return {
        verdict.question: (verdict.outcome, verdict.trace and len(verdict.trace.ticks) - verdict.trace.loop)
        for verdict in verified(body).verdicts
        if verdict.question != OWN_RECORDS
    }


def outcomes(body):
    return {verdict.question: verdict.outcome for verdict in verified(body).verdicts}


def copied(body):
    """Return a tree with copies of some nodes in their place."""
    for tag in TWINS:
        body = re.sub(rf"(</?){tag}\b", rf"\1Own{tag}", body)
    return body


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(400, 400 + rounds(20)))
def test_a_control_of_ones_own_has_the_answers_of_the_one_that_it_copies(seed):
    body = random_tree(seed)
    assert outcomes(copied(body)).get(OWN_RECORDS, PROVED) is PROVED
    assert answers(copied(body)) == answers(body)


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
@pytest.mark.parametrize("body", [*WRITTEN, *map(copied, map(random_tree, range(500, 500 + rounds(8))))])
def test_every_state_that_py_trees_comes_to_with_ones_own_classes_is_found_and_no_other(body):
    binding = own_binding(body)
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
        *map(copied, map(random_tree, range(600, 600 + rounds(10)))),
        "<OwnRecovery retries='2'><Fallback><A/><A/></Fallback><Sequence><A/><A/><OwnCount most='2'><A/></OwnCount></Sequence></OwnRecovery>",
        "<OwnTwice><Fallback><A/><P/></Fallback><A/></OwnTwice>",
        "<OwnSequence><OwnTimeout><OwnFallback><A/><A/></OwnFallback></OwnTimeout><OwnTwice><A/><OwnFallback><P/><B/></OwnFallback></OwnTwice></OwnSequence>",
    ],
)
def test_where_ticks_meet_in_the_middle_of_ones_own_nodes_nothing_is_lost(body):
    binding = own_binding(body)
    assert graph_of(binding, PROPERTIES, meets=True) == graph_of(binding, PROPERTIES, meets=False)


def test_a_recovery_that_is_tried_often_does_not_multiply_what_its_leaves_answer():
    parts = "<Sequence><A/><B/></Sequence><Fallback><A/><B/></Fallback>"
    found = verified(f'<OwnRecovery retries="6">{parts}</OwnRecovery>')
    assert found.is_proved
    assert found.complete


PARTS = ("<X/>", "<Y/>", "<P/>", "<Inverter><P/></Inverter>", "<Fallback><X/><P/></Fallback>")


@pytest.mark.parametrize("first", PARTS)
@pytest.mark.parametrize("second", PARTS)
def test_a_recovery_has_the_answers_of_the_nodes_that_it_stands_for(first, second):
    known = f"<Fallback>{first}<Sequence>{second}{first}</Sequence></Fallback>"
    expected, found = answers(known), answers(f"<OwnRecovery>{first}{second}</OwnRecovery>")
    for each in (expected, found):
        del each[EVERY_LEAF]  # there are other leaves in them
    assert found == expected


@pytest.mark.parametrize(
    "child", ["<A/>", "<Running/>", "<Fallback><P/><A/></Fallback>", "<Timeout msec='9'><A/></Timeout>"]
)
@pytest.mark.parametrize(
    "around", ["{}", "<Sequence>{}<A/></Sequence>", "<Fallback>{}<B/></Fallback>", "<Inverter>{}</Inverter>"]
)
def test_a_time_out_of_ones_own_has_the_answers_of_the_librarys(child, around):
    own, known = (
        around.format(f"<{tag}>{child}</{tag.split()[0]}>") for tag in ("OwnTimeout", 'Timeout msec="5000"')
    )
    assert outcomes(own) == outcomes(known)


def test_a_time_that_begins_anew_in_every_tick_is_never_up():
    assert outcomes("<OwnDebounce><P/></OwnDebounce>")[NO_LIVELOCK] is BROKEN


def test_a_time_that_is_up_at_once_is_never_waited_for():
    assert outcomes('<OwnTimeout seconds="0"><Sequence><A/><B/></Sequence></OwnTimeout>') == {
        NO_ERROR: PROVED, EVERY_LEAF: PROVED, AN_END: PROVED, NO_LIVELOCK: PROVED,
    }  # fmt: skip


def test_what_a_cell_holds_is_part_of_the_state_until_the_node_has_ended():
    endless = "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"
    assert verified("<OwnCount><A/></OwnCount>").is_proved
    assert verified(endless.format("<OwnCount><AlwaysSuccess/></OwnCount>")).states == 2


def test_a_cell_that_keeps_what_it_holds_outlasts_the_end_and_a_halt():
    endless = "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"
    turns = "<OwnTurn><AlwaysSuccess/><AlwaysSuccess/><AlwaysSuccess/></OwnTurn>"
    assert verified(endless.format(turns)).states == 4
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
def test_what_cannot_be_gone_through_is_said_with_what_to_do_instead(body, words):
    with pytest.raises(UndecidableError) as caught:
        verified(body)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("tag", "said"),
    [
        ("OwnSilence", "resume() returned None, which is not a status"),
        ("OwnStray", "begin() returned <"),
    ],
)
def test_a_class_that_answers_neither_with_a_status_nor_with_a_child_is_an_error_that_names_it(tag, said):
    verdict = next(each for each in verified(f"<{tag}><A/></{tag}>").verdicts if each.question == NO_ERROR)
    assert verdict.outcome is BROKEN
    assert verdict.reason.startswith(f"'{tag}' ({tag}) failed: {said}")
    assert verdict.reason.endswith("or the child to tick next")


def test_a_cell_that_counts_without_end_is_named():
    endless = verified("<OwnEndless><KeepRunningUntilFailure><A/></KeepRunningUntilFailure></OwnEndless>")
    assert not endless.complete
    assert endless.growing[0][0] == "OwnEndless.ticks"


def test_a_verification_is_shown_in_one_line():
    assert repr(verified("<Sequence><A/><AlwaysFailure/><B/></Sequence>")) == (
        "<Verification: 3 proved, 1 does not hold; 3 states>"
    )


def test_a_notebook_has_the_questions_with_their_answers_as_a_table():
    found = verified("<Sequence><A/><AlwaysFailure/><B/></Sequence>")
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
def test_a_class_that_does_what_its_record_excludes_is_named_with_a_run(body, did, ticks):
    verdict = verified(body).verdicts[-1]
    assert (verdict.question, verdict.outcome) == (OWN_RECORDS, BROKEN)
    assert verdict.reason.startswith(did)
    assert len(verdict.trace.ticks) == ticks


def test_of_a_class_that_says_nothing_of_itself_nothing_is_asked():
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
def test_a_class_with_a_tick_of_its_own_is_taken_to_do_what_its_semantics_say(own, known):
    parts = "<X/><Fallback><Y/><P/></Fallback>"
    own, known = own.format(parts), known.format(parts)
    found, expected = verified(own), verified(known)
    assert answers(own) == answers(known)
    assert (found.states, ticks_of(own)) == (expected.states, ticks_of(known))
    assert expected.by_semantics == ()


def test_the_proof_names_the_classes_of_which_it_proves_nothing():
    found = verified(
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
def test_a_class_with_a_tick_of_its_own_whose_semantics_leave_something_open_is_refused(body):
    with pytest.raises(
        UnknownBehaviourError,
        match=r"(?s)Ticking\w+> has its own methods .*with the methods begin and resume",
    ):
        verified(body)


def test_where_single_runs_are_played_a_class_with_a_tick_of_its_own_is_ticked_by_it():
    simulated = compile_simulated(own_binding("<TickingMystery><A/></TickingMystery>"), {})
    assert type(simulated.root).__name__ == "TickingMystery"
    assert simulated.by_semantics == ()
