"""Tests of predictions: closed forms, bounds, times, influences, and the same values by simulation."""

import math
import re
from itertools import pairwise

import pytest

from sar_compiler import load
from sar_compiler.analysis.predict import weighed_graph
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.outcomes import Outcome, middle, probabilities
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.predict.stage import CHANCES, PERIOD_SEC, played, predicted, random_timed_tree
from tests.random_inputs import rounds

INDEPENDENT = """
A: [{outcome: SUCCESS, p: 0.9}]
B: [{outcome: SUCCESS, p: 0.8}]
C: [{outcome: SUCCESS, p: 0.5}]
"""


def approx_interval(low, high=None):
    return pytest.approx((low, low if high is None else high), abs=1e-9)


@pytest.mark.parametrize(
    ("body", "chance"),
    [
        ("<A/>", 0.9),
        ("<Inverter><A/></Inverter>", 0.1),
        ("<Sequence><A/><B/><C/></Sequence>", 0.9 * 0.8 * 0.5),
        ("<Fallback><B/><C/></Fallback>", 1 - 0.2 * 0.5),
        ('<Retry num_failures="3"><C/></Retry>', 1 - 0.5**3),
        ('<Repeat num_success="3"><A/></Repeat>', 0.9**3),
        ('<Parallel success_count="2" failure_count="2"><A/><B/><C/></Parallel>', None),
    ],
)
def test_independent_leaves_match_closed_form(body, chance):
    if chance is None:
        # Two of three: the third is not ticked once the first two agree.
        chance = 0.9 * 0.8 + 0.9 * 0.2 * 0.5 + 0.1 * 0.8 * 0.5
    found = predicted(body, INDEPENDENT)
    assert found.success == approx_interval(chance)
    assert found.ends == approx_interval(1.0)
    assert found.complete


def test_unlisted_outcomes_share_remaining_probability():
    assert predicted(
        "<Inverter><A/></Inverter>", "A: [{outcome: SUCCESS, p: 0.75}]"
    ).success == approx_interval(0.25)


def test_probability_interval_gives_bounds():
    found = predicted(
        "<Sequence><A/><B/></Sequence>",
        "A: [{outcome: SUCCESS, p: [0.6, 0.9]}]\nB: [{outcome: SUCCESS, p: 0.8}]",
    )
    assert found.success == approx_interval(0.6 * 0.8, 0.9 * 0.8)


def test_leaf_without_probabilities_gives_best_and_worst_case():
    found = predicted("<Fallback><A/><B/></Fallback>", "B: [{outcome: SUCCESS, p: 0.8}]")
    assert found.success == approx_interval(0.8, 1.0)
    assert found.unknown == (("Fallback", "A"),)


def test_worst_case_of_unknown_leaf_can_run_forever():
    found = predicted("<FailureIsRunning><A/></FailureIsRunning>", "")
    assert found.ends == approx_interval(0.0, 1.0)
    assert found.success == approx_interval(0.0, 1.0)


def test_retry_with_positive_probability_succeeds_eventually():
    found = predicted("<FailureIsRunning><A/></FailureIsRunning>", "A: [{outcome: SUCCESS, p: 0.01}]")
    assert found.success == approx_interval(1.0)
    # One tick for each attempt, and the first one is at once.
    assert found.time_sec == approx_interval(99 * PERIOD_SEC)


def test_impossible_outcomes_leave_their_probability_to_others():
    text = "Y: [{outcome: counted, p: 0.5}, {outcome: FAILURE, p: 0.5}]\nX: [{outcome: SUCCESS, p: 1}]"
    # Nothing was counted yet, so Y cannot count back; then it can.
    assert predicted("<Y/>", text).success == approx_interval(0.0)
    assert predicted("<Sequence><X/><Y/></Sequence>", text).success == approx_interval(0.5)


@pytest.mark.parametrize(
    ("limit_msec", "chance"),
    [(2500, 0.0), (3000, 0.25), (3500, 0.5), (4000, 0.75), (4001, 1.0)],
)
def test_timeout_and_leaf_duration_interact_as_in_run(limit_msec, chance):
    # The leaf ends by 2.5, 3, 3.5 or 4 s with equal probability; the limit is checked before the leaf ends.
    text = "A: [{outcome: SUCCESS, p: 1, sec: [2, 4]}]"
    assert predicted(f'<Timeout msec="{limit_msec}"><A/></Timeout>', text).success == approx_interval(chance)


@pytest.mark.parametrize(
    ("answers", "bounds"),
    [
        ([(0.9, 0.9), (0.1001, 0.1001)], [(0.9, 0.9), (0.1, 0.1)]),
        ([(0.9, 0.9), (0.1001, 0.1001), None], [(0.9, 0.9), (0.1, 0.1), (0.0, 0.0)]),
        ([(0.2, 0.2), (0.6, 0.6)], [(0.25, 0.25), (0.75, 0.75)]),
        ([(0.5, 0.7), None], [(0.5, 0.7), (0.3, 0.5)]),
        ([(0.5, 0.7), None, None], [(0.5, 0.7), (0.0, 0.5), (0.0, 0.5)]),
        ([(0.0, 0.0), (0.0, 0.0)], [(0.0, 1.0), (0.0, 1.0)]),
        ([(0.0, 0.0)], [(1.0, 1.0)]),
        ([None, None], [(0.0, 1.0), (0.0, 1.0)]),
    ],
)
def test_probabilities_of_possible_outcomes_add_up(answers, bounds):
    found = probabilities([Outcome("SUCCESS", str(number), p=p) for number, p in enumerate(answers)])
    assert found == [pytest.approx(each, abs=1e-3) for each in bounds]
    assert sum(middle(found)) == pytest.approx(1.0)


def test_passing_time_adds_no_states():
    short, long = (predicted("<A/>", f"A: [{{outcome: SUCCESS, p: 1, sec: {sec}}}]") for sec in (5, 5000))
    assert long.states == short.states
    assert (short.time_sec, long.time_sec) == (approx_interval(5.0), approx_interval(5000.0))


def test_duration_interval_is_uniform():
    found = predicted("<A/>", "A: [{outcome: SUCCESS, p: 1, sec: [10, 20]}]")
    ends = [0.0, *(share for _, _, share in found.distribution)]
    assert [after - before for before, after in pairwise(ends)] == pytest.approx([0.05] * 20)
    assert found.distribution[-1][0] == 20.0
    assert found.quantile(0.5) == 15.0


def test_property_probability_is_that_its_event_does_not_occur():
    text = "properties: {B never fails: {never: B FAILURE}, A at most once: {at_most_once: A SUCCESS}}"
    found = predicted("<Fallback><Sequence><A/><B/></Sequence><A/></Fallback>", INDEPENDENT, text)
    assert found.properties["B never fails"] == approx_interval(1 - 0.9 * 0.2)
    assert found.properties["A at most once"] == approx_interval(1 - 0.9 * 0.2 * 0.9)


def test_pending_property_is_not_kept_at_end():
    text = "properties: {B follows: {after: A SUCCESS, eventually: B SUCCESS}}"
    assert predicted("<Sequence><A/><B/></Sequence>", INDEPENDENT, text).properties[
        "B follows"
    ] == approx_interval(1 - 0.9 * 0.2)


def test_at_end_property_is_evaluated_at_end():
    chances, text = "X: [{outcome: SUCCESS, p: 0.7}]", "properties: {counted: {at_end: f == 1}}"
    assert predicted("<ForceSuccess><X/></ForceSuccess>", chances, text).properties[
        "counted"
    ] == approx_interval(0.7)


def test_error_in_tick_makes_prediction_undecidable():
    with pytest.raises(UndecidableError, match=r"a tick raises an error: .*there is no variable 'b'"):
        predicted('<Sequence><P/><Script code="a = b + 1"/></Sequence>', "P: [{outcome: SUCCESS, p: 0.3}]")


FAR = '<ScriptCondition code="d &gt; 1"/>'
MEASURED = {
    "a condition": (f'<Fallback><A/><Sequence><M distance="{{d}}"/>{FAR}</Sequence></Fallback>', (0.9, 0.96)),
    "all runs": (f'<Sequence><ForceSuccess><M distance="{{d}}"/></ForceSuccess>{FAR}</Sequence>', (0.0, 1.0)),
    "beside a leaf": (
        f'<Sequence><M distance="{{d}}"/><Fallback>{FAR}<A/></Fallback></Sequence>',
        (0.0, 0.6),
    ),
    "a branch": (f'<Sequence><A/><Fallback><M distance="{{d}}"/>{FAR}</Fallback></Sequence>', (0.54, 0.9)),
    "a round": (
        f'<RetryUntilSuccessful num_attempts="-1"><Sequence><A/><M distance="{{d}}"/><Inverter>{FAR}</Inverter></Sequence></RetryUntilSuccessful>',
        (0.0, 1.0),
    ),
    "no run": ('<Sequence><A/><M distance="{d}"/></Sequence>', (0.54, 0.54)),
}
MEASURES = f"{INDEPENDENT}\nM: [{{outcome: SUCCESS, p: 0.6}}, {{outcome: FAILURE, p: 0.4}}]"
DECIDED = 'M: [{{status: SUCCESS, p: 0.6, then: "d := {}"}}, {{status: FAILURE, p: 0.4, then: "d := {}"}}]'


@pytest.mark.parametrize("name", MEASURED)
def test_unknown_value_gives_bounds_that_hold_for_every_value(name):
    body, (low, high) = MEASURED[name]
    found = predicted(body, MEASURES)
    assert found.success == pytest.approx((low, high))
    assert bool(found.undecided) == (name != "no run")
    assert all("outcomes: {M: [{status: SUCCESS" in reason for reason in found.undecided)
    if found.undecided:
        assert (found.time_sec, found.success_sec, found.distribution, found.influences) == (
            None,
            None,
            (),
            (),
        )
    for values in ((0, 0), (0, 2), (2, 0), (2, 2)):
        exact = predicted(body, f"{INDEPENDENT}\n{DECIDED.format(*values)}").success
        assert low - 1e-9 <= exact.low <= exact.high <= high + 1e-9


def test_only_properties_with_unknown_value_in_condition_are_undecided():
    text = "{open: {at_end: d < 5}, known: {never: A FAILURE}, guarded: {never: A starts, while: d > 1}}"
    found = predicted('<Sequence><M distance="{d}"/><A/></Sequence>', MEASURES, f"properties: {text}")
    assert found.success == approx_interval(0.54)
    assert list(found.properties) == ["known", "guarded", "open"]
    assert found.properties["known"] == approx_interval(1 - 0.6 * 0.1)
    assert found.properties["open"] == found.properties["guarded"] == (0.0, 1.0)
    assert len(found.undecided) == 2


def test_end_condition_with_unknown_value_leaves_ends_undecided():
    text = (
        "end: d > 1\nproperties: {first: {never: M FAILURE}, owed: {after: M starts, eventually: A SUCCESS}}"
    )
    found = predicted('<Sequence><M distance="{d}"/><A/></Sequence>', MEASURES, text)
    assert found.success == found.ends == found.properties["owed"] == (0.0, 1.0)
    assert found.time_sec is None
    assert found.properties["first"].high < 1e-6  # the root is ticked forever
    (reason,) = found.undecided
    assert reason.startswith("'d > 1' cannot be evaluated")


@pytest.mark.parametrize(
    ("body", "ended"),
    [
        ("<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>", 0.0),
        ("<Fallback><A/><KeepRunningUntilFailure><B/></KeepRunningUntilFailure></Fallback>", 0.9 + 0.1 * 1.0),
        ("<Fallback><A/><KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure></Fallback>", 0.9),
    ],
)
def test_runs_that_cannot_end_are_not_followed(body, ended, monkeypatch):
    # Enough for runs that can end; a loop that is followed forever exceeds it.
    monkeypatch.setattr(weighed_graph, "_MOST_CARRIED", 100_000)
    found = predicted(body, INDEPENDENT)
    assert found.ends == approx_interval(ended)
    assert [each[2] for each in found.distribution[-1:]] == pytest.approx([ended] if ended else [], abs=1e-5)


def test_unexplored_states_have_unknown_probability():
    body = '<Repeat num_success="50"><A/></Repeat>'
    found = predicted(body, INDEPENDENT, max_states=20)
    low, high = found.success
    assert not found.complete
    assert low < 0.9**50 < high < 1.0


def test_influences_are_sorted_by_importance():
    found = predicted("<Sequence><A/><B/><C/></Sequence>", INDEPENDENT)
    assert [each.leaf[-1] for each in found.influences] == ["C", "B", "A"]
    assert [each.derivative for each in found.influences] == pytest.approx([0.72, 0.45, 0.4])
    assert [each.if_never_failed for each in found.influences] == pytest.approx([0.72, 0.45, 0.4])


def test_derivative_is_slope_of_success_probability():
    body = '<Retry num_failures="3"><Sequence><A/><Fallback><B/><C/></Fallback></Sequence></Retry>'
    more = INDEPENDENT.replace("p: 0.8", "p: 0.801")
    influence = next(each for each in predicted(body, INDEPENDENT).influences if each.leaf[-1] == "B")
    slope = (predicted(body, more).success.low - predicted(body, INDEPENDENT).success.low) / 0.001
    assert influence.derivative == pytest.approx(slope, rel=0.01)


def test_bounds_that_do_not_converge_are_not_reported(monkeypatch):
    monkeypatch.setattr(weighed_graph, "_MOST_ROUNDS", 1)
    with pytest.raises(UndecidableError, match="the bounds of a probability did not converge in 1 round"):
        predicted("<Fallback><A/><B/></Fallback>", "B: [{outcome: SUCCESS, p: 0.8}]")


@pytest.mark.random
@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(rounds(20)))
def test_bounds_do_not_depend_on_optimization_method(seed, monkeypatch):
    body = random_timed_tree(seed)
    chances = re.sub(r"p: 0\.([2-8])", r"p: [0.1, 0.\1]", CHANCES).replace("{outcome: FAILURE, p: 0.4}", "")
    found = []
    for few in (-1, 0, 2):
        monkeypatch.setattr(weighed_graph, "_FEW_ROUNDS", few)
        found.append(predicted(body, chances, max_states=300))
    for each in found[1:]:
        assert each.success == pytest.approx(found[0].success, abs=1e-6)
        assert each.ends == pytest.approx(found[0].ends, abs=1e-6)


@pytest.mark.random
@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(rounds(10)))
def test_predictions_match_simulated_runs(seed):
    # More trees find more errors than more runs of each: a wrong weight is rarely off by only a few percent.
    body, runs = random_timed_tree(seed), rounds(2_000)
    found = predicted(body)
    succeeded, ended, times = played(body, runs)
    assert found.complete
    assert found.unknown == ()
    for chance, count in ((found.success, succeeded), (found.ends, ended)):
        assert chance.low == pytest.approx(chance.high)
        sigma = math.sqrt(abs(runs * chance.low * (1.0 - chance.low)))
        assert abs(count - runs * chance.low) <= 4.0 * sigma + 1e-6
    if ended > 100:
        mean = sum(times) / ended
        spread = math.sqrt(sum((each - mean) ** 2 for each in times) / ended)
        assert abs(mean - found.time_sec.low) <= 4.0 * spread / math.sqrt(ended) + 1e-6


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ("A: [{outcome: SUCCESS, p: 0.7}, {outcome: FAILURE, p: 0.6}]", "add up to 1.3, not to 1"),
        ("A: [{outcome: SUCCESS, p: 0.2}, {outcome: FAILURE, p: 0.6}]", "add up to at most 0.8"),
        ("A: [{outcome: SUCCESS, p: [0.7, 0.6]}]", "the lower number of an interval must come first"),
        (
            "A: [{outcome: SUCCESS, p: 0.7}, {outcome: SUCCESS, p: 0.3}]",
            "'SUCCESS' of this leaf is listed twice",
        ),
        ("A: [{outcome: SUCCES, p: 0.7}]", "never returns 'SUCCES'"),
        ("P: [{outcome: SUCCESS, sec: 3}]", "none of these outcomes has the status RUNNING"),
        ("A: [{outcome: SUCCESS, when: f == 1}]", "'outcome' refers to a declared outcome"),
        ("A: [{outcome: SUCCESS, p: 1.5}]", "p"),
        ("A: [{p: 0.5}]", "needs"),
    ],
)
def test_invalid_probabilities_are_reported(answers, message):
    with pytest.raises(TreeError) as caught:
        predicted("<Sequence><A/><P/><X/></Sequence>", answers)
    assert message in str(caught.value)


def test_two_random_outcomes_in_one_step_are_rejected():
    body = '<ReactiveSequence><P/><TryCatch catch_on_halt="true"><A/><X/></TryCatch></ReactiveSequence>'
    with pytest.raises(
        UndecidableError, match="'X' has several outcomes with probabilities while another node ends"
    ):
        predicted(body)


def test_journal_statistics_can_be_used_as_outcomes_file(tmp_path):
    answers = tmp_path / "answers.yaml"
    answers.write_text(
        'outcomes:\n  "A":  # 12 outcomes\n  - {"outcome": "SUCCESS", "p": [0.6, 0.9], "sec": [2.0, 4.5]}\n',
        encoding="utf-8",
    )
    tree = tmp_path / "tree.xml"
    tree.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Tree"><A/></BehaviorTree></root>', encoding="utf-8"
    )
    found = load(tree, nodes=["tests.analysis.verify.leaves"]).predict(outcomes=[answers])
    assert found.success == approx_interval(0.6, 0.9)
    assert found.success_sec == approx_interval(3.5)
