"""Controls and decorators of a user's classes are ticked by their own methods, and what they remember is part of the state."""

import random
import re

import pytest

from sar_compiler.checks.verify import verify
from sar_compiler.checks.verify.verdicts import AN_END, EVERY_LEAF, NO_ERROR, NO_LIVELOCK, OWN_RECORDS
from sar_compiler.compiler import bind_main
from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.registry import load_registry
from sar_compiler.runtime.kernel.table import STOCK
from sar_compiler.tree.diagnostic import TreeError
from tests.checks.verify.random_trees import random_tree
from tests.checks.verify.stage import BROKEN, PROVED, TAGS, bound, simulated_tree
from tests.checks.verify.test_forking import NEVER, PROPERTIES, graph_of
from tests.checks.verify.test_same_as_py_trees import TICKS, Explored, tick_sequences
from tests.trees import forest

REGISTRY = load_registry(["tests.checks.verify.leaves", "tests.checks.verify.own_controls"])
_MOST_STATES = 2000


def as_foreign(simulated, seed):
    """Make some of py_trees' own composites and decorators objects of classes that nobody knows; return how many."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    nodes = [node for node in simulated.root.iterate() if node.children and type(node) in STOCK]
    chosen = [node for node in nodes if chance.random() < 0.7]
    for node in chosen:
        node.__class__ = type(f"Own{type(node).__name__}", (type(node),), {})
    return len(chosen)


def seen(explored):
    """Return the ticks of a tree by what can be seen before and after them, and whether all were gone through."""
    graph = explored.graph
    states = [explored.looked_at(number) for number in range(len(graph.states))]
    ticks = {
        (states[source], states[target], graph.ends[target])
        for source in range(graph.expanded)
        for target in graph.successors(source)
    }
    return ticks, graph.complete, graph.error is None


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(300, 380))
def test_a_class_that_does_as_py_trees_own_comes_to_the_same_states(seed):
    try:
        binding = bound(random_tree(seed))
    except TreeError:
        pytest.skip("the parts of this tree do not go together")
    known, foreign = simulated_tree(binding), simulated_tree(binding)
    as_foreign(foreign, seed)
    expected = seen(Explored(known, _MOST_STATES))
    # What a composite of py_trees remembers of its last child may tell states apart that look the same.
    assert not expected[1] or seen(Explored(foreign, 10 * _MOST_STATES)) == expected


def answers(body):
    """Return the answers about a tree, each with the number of ticks in which it is shown."""
    simulated = simulated_tree(bind_main(forest(body), REGISTRY))
    verification = verify(simulated, None, TAGS, _MOST_STATES)
    return {
        verdict.question: (verdict.outcome, verdict.trace and len(verdict.trace.ticks) - verdict.trace.loop)
        for verdict in verification.verdicts
    }


TWINS = ("Sequence", "Fallback", "ReactiveFallback")


def copied(body):
    """Return a tree with copies of some controls in their place."""
    for tag in TWINS:
        body = re.sub(rf"(</?){tag}\b", rf"\1Own{tag}", body)
    return body


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(400, 480))
def test_a_control_of_ones_own_has_the_answers_of_the_one_that_it_copies(seed):
    body = random_tree(seed)
    try:
        found = answers(copied(body))
    except TreeError:
        pytest.skip("a child of this tree can be skipped")
    # Nothing is claimed where none of the copies stands.
    assert found.pop(OWN_RECORDS, (PROVED, None)) == (PROVED, None)
    assert found == answers(body)


WITH_MEMORY = [
    "<OwnMemory><Fallback><A/><B/></Fallback><P/></OwnMemory>",
    "<OwnMemory><OwnFallback><A/><B/></OwnFallback><P/></OwnMemory>",
    "<Fallback><OwnMemory><Fallback><P/><B/></Fallback><P/></OwnMemory><OwnCount><B/></OwnCount></Fallback>",
    "<OwnRecovery><Sequence><P/><A/></Sequence><OwnInverter><P/></OwnInverter></OwnRecovery>",
    "<ReactiveSequence><P/><OwnRecovery><A/><OwnCount most='1'><B/></OwnCount></OwnRecovery></ReactiveSequence>",
    "<Sequence><OwnSharing><A/></OwnSharing><OwnSharing><P/></OwnSharing></Sequence>",
    "<OwnSequence><OwnFallback><P/><A/></OwnFallback><OwnCount most='2'><B/></OwnCount></OwnSequence>",
    "<OwnCatch><Sequence><A/><Script code='y := x'/></Sequence></OwnCatch>",
    "<OwnMemory><StatusQueue queue='SUCCESS;FAILURE' eventually='RUNNING'/><P/></OwnMemory>",
]


@pytest.mark.unmeasured
@pytest.mark.parametrize("body", [*WITH_MEMORY, *map(copied, map(random_tree, range(500, 530)))])
def test_every_state_that_py_trees_comes_to_with_ones_own_classes_is_found_and_no_other(body):
    try:
        binding = bind_main(forest(body), REGISTRY)
    except TreeError:
        pytest.skip("a child of this tree can be skipped")
    reached = set(tick_sequences(binding))
    explored = Explored(simulated_tree(binding), 50_000)
    graph = explored.graph
    near = [number for number in range(len(graph.states)) if graph.distance(number) <= TICKS]
    assert {explored.looked_at(number) for number in near} == reached


@pytest.mark.unmeasured
@pytest.mark.parametrize(
    "body",
    [
        *WITH_MEMORY,
        *map(copied, map(random_tree, range(600, 640))),
        "<OwnRecovery retries='2'><Fallback><A/><A/></Fallback><Sequence><A/><A/><OwnCount most='2'><A/></OwnCount></Sequence></OwnRecovery>",
        "<OwnTwice><Fallback><A/><P/></Fallback><A/></OwnTwice>",
        "<OwnSequence><OwnTimeout><OwnFallback><A/><A/></OwnFallback></OwnTimeout><OwnTwice><A/><OwnFallback><P/><B/></OwnFallback></OwnTwice></OwnSequence>",
    ],
)
def test_where_ticks_meet_in_the_middle_of_ones_own_methods_nothing_is_lost(body):
    try:
        binding = bind_main(forest(body), REGISTRY)
    except TreeError:
        pytest.skip("a child of this tree can be skipped")
    assert graph_of(binding, 0, PROPERTIES) == graph_of(binding, NEVER, PROPERTIES)


def test_a_recovery_that_is_tried_often_does_not_multiply_what_its_leaves_answer():
    parts = "<Sequence><A/><B/></Sequence><Fallback><A/><B/></Fallback>"
    found = verified(f'<OwnRecovery retries="6">{parts}</OwnRecovery>')
    assert found.proved
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


def verified(body):
    return verify(simulated_tree(bind_main(forest(body), REGISTRY)), None, TAGS, _MOST_STATES)


def outcomes(body):
    return {verdict.question: verdict.outcome for verdict in verified(body).verdicts}


@pytest.mark.parametrize(
    "child", ["<A/>", "<Running/>", "<Fallback><P/><A/></Fallback>", "<Timeout msec='9'><A/></Timeout>"]
)
@pytest.mark.parametrize(
    "around", ["{}", "<Sequence>{}<A/></Sequence>", "<Fallback>{}<B/></Fallback>", "<Inverter>{}</Inverter>"]
)
def test_a_time_out_of_ones_own_on_the_missions_clock_has_the_answers_of_the_librarys(child, around):
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


def test_what_an_object_counts_is_part_of_the_state():
    assert verified("<OwnCount><A/></OwnCount>").proved
    endless = "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"
    assert verified(endless.format("<OwnCount><AlwaysSuccess/></OwnCount>")).states == 2
    shared = verified(endless.format("<OwnSharing><AlwaysSuccess/></OwnSharing>"))
    assert shared.states == 4


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            "<OwnThread><A/></OwnThread>",
            ["OwnThread", "whose attribute 'worker' is a Thread", "cannot pickle '_thread."],
        ),
        ("<OwnChance><Fallback><P/><A/></Fallback></OwnChance>", ["the attribute 'drawn' of 'OwnChance'"]),
        ("<OwnStopwatch><A/></OwnStopwatch>", ["the attribute 'began' of 'OwnStopwatch'", "clock: Clock"]),
        ("<OwnTally><A/></OwnTally>", ["does not do the same", "OwnTally"]),
        ("<OwnOrphanage><A/><B/></OwnOrphanage>", ["'OwnOrphanage' has other children"]),
        (
            "<OwnCatch><OwnStopwatch><A/></OwnStopwatch></OwnCatch>",
            ["the attribute 'began' of 'OwnStopwatch'"],
        ),
        ("<OwnShortcut><A/></OwnShortcut>", ["'A' is asked for its answer by update()"]),
        ("<OwnHours><A/></OwnHours>", ["'OwnHours'", "needs the time as a number"]),
    ],
)
def test_what_cannot_be_gone_through_is_said_with_the_class_and_the_attribute(body, words):
    with pytest.raises(UndecidableError) as caught:
        verified(body)
    for word in words:
        assert word in str(caught.value)


def test_what_a_control_catches_of_its_children_is_no_error():
    body = '<Script code="y := x"/>'
    assert outcomes(f"<OwnSequence>{body}</OwnSequence>")[NO_ERROR] is BROKEN
    assert outcomes(f"<OwnCatch>{body}</OwnCatch>")[NO_ERROR] is PROVED


def test_a_decorator_that_answers_with_no_status_is_an_error_that_names_it():
    found = next(
        each for each in verified("<OwnForgetful><A/></OwnForgetful>").verdicts if each.question == NO_ERROR
    )
    assert found.outcome is BROKEN
    assert found.reason.startswith(
        "'OwnForgetful' (OwnForgetful) failed: update() returned None, which is no status"
    )


def test_an_attribute_that_grows_without_end_is_named():
    endless = verified("<OwnEndless><KeepRunningUntilFailure><A/></KeepRunningUntilFailure></OwnEndless>")
    assert not endless.complete
    assert endless.growing[0][0] == "OwnEndless.ticks"


def test_a_verification_is_shown_in_one_line():
    assert repr(verified("<Sequence><A/><AlwaysFailure/><B/></Sequence>")) == (
        "<Verification: 3 proved, 1 does not hold; 3 states>"
    )


@pytest.mark.parametrize(
    ("body", "did", "ticks"),
    [
        (
            "<OwnLiar><A/><B/></OwnLiar>",
            (
                "'OwnLiar' (tests.checks.verify.own_controls.OwnLiar) ticked 'B' although 'A' had returned FAILURE; its record "
                "has it go on only after SUCCESS: mend its outcomes or semantics"
            ),
            1,
        ),
        (
            "<Sequence><A/><OwnBoast><P/></OwnBoast></Sequence>",
            "'OwnBoast' (tests.checks.verify.own_controls.OwnBoast) returned FAILURE; by its record it returns SUCCESS here",
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
