"""Tests of counterfactuals: the smallest change of outcomes with which a run would have succeeded."""

import itertools

import pytest

from sar_compiler.analysis.verify.counterfactual import WhatIfSearch, counterfactual
from sar_compiler.analysis.verify.limits import remove_limits
from sar_compiler.analysis.verify.recorded_runs import NotReplayedError, OtherTreeError
from sar_compiler.errors import UndecidableError
from sar_compiler.journal.recorded_events import recorded_events
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.events import HALTED, RESET, RETURNED, Event, append_end
from sar_compiler.runtime.outcomes import nominal
from sar_compiler.runtime.walking import pre_order
from tests.random_inputs import rounds
from tests.trees import document
from tests.views.recorded_runs import REGISTRY, ScriptedPolicy, missions_with_fault, run_and_record, simulated


def change_of(path, body, registry=REGISTRY, **answers):
    """Run a tree with the given outcomes; return the change that leads to success, with names of nodes."""
    path.write_text(document(body), encoding="utf-8")
    tree = simulated(path, registry)
    stream, root = run_and_record(tree, ScriptedPolicy(**answers))
    assert root == "FAILURE"
    names = names_in(stream)
    change = counterfactual(simulated(path, registry), recorded_events(stream), names)
    if change is None:
        return None

    def describe(answer):
        return f"{names[answer.number]} {answer.outcome}"

    return (
        change.tick,
        describe(change.was),
        describe(change.instead),
        [describe(each) for each in change.then],
    )


def names_in(stream):
    def names(node):
        return itertools.chain([node["name"]], *map(names, node["children"]))

    return list(names(stream[0].data["tree"]))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "tree.xml"


def test_failed_leaf_must_succeed_and_later_leaves_return_usual_outcomes(path):
    body = '<Sequence><A name="one"/><A name="two"/><A name="three"/></Sequence>'
    assert change_of(path, body, one=["RUNNING", "SUCCESS"], two=["FAILURE"]) == (
        2,
        "two FAILURE",
        "two SUCCESS",
        ["three SUCCESS"],
    )


def test_last_alternative_is_changed(path):
    body = '<Fallback><A name="one"/><A name="two"/></Fallback>'
    assert change_of(path, body, one=["FAILURE"], two=["RUNNING", "FAILURE"])[:3] == (
        2,
        "two FAILURE",
        "two SUCCESS",
    )


def test_last_attempt_is_changed(path):
    body = '<RetryUntilSuccessful num_attempts="3"><A name="one"/></RetryUntilSuccessful>'
    tries = ["RUNNING", "FAILURE"] * 3
    assert change_of(path, body, one=tries)[:3] == (4, "one FAILURE", "one SUCCESS")


def test_leaf_that_timed_out_must_finish(path):
    body = '<Timeout msec="1200"><A name="one"/></Timeout>'
    assert change_of(path, body, one=["RUNNING"] * 9)[1:3] == ("one RUNNING", "one SUCCESS")


def test_facts_determine_possible_outcomes(path):
    body = '<Sequence><X name="up"/><Fallback><Y name="down"/><AlwaysFailure/></Fallback><Z name="look"/></Sequence>'
    assert change_of(path, body, down=["counted"], look=["RUNNING", "RUNNING"], up=["FAILURE"]) == (
        1,
        "up FAILURE",
        "up SUCCESS",
        ["down counted", "look SUCCESS"],
    )


def test_unusual_outcome_is_found(path):
    body = '<Sequence><A name="one"/><Inverter><P name="dark?"/></Inverter></Sequence>'
    assert change_of(path, body, one=["FAILURE"]) == (1, "one FAILURE", "one SUCCESS", ["dark? FAILURE"])


def test_tree_that_cannot_succeed_has_no_change(path):
    assert change_of(path, '<Sequence><A name="one"/><AlwaysFailure/></Sequence>') is None


def test_run_of_different_nodes_is_rejected(path):
    path.write_text(document('<A name="one"/>'), encoding="utf-8")
    with pytest.raises(OtherTreeError):
        counterfactual(simulated(path), [], ["two"])


def tick(number, time_sec, root, answers, label=""):
    """Return the events of a tick: the status of the root, and of leaves by number."""
    events = [Event((), leaf, RETURNED, status, label) for leaf, status in answers.items()]
    return append_end(events, "root", root, number, time_sec)


def test_impossible_run_is_rejected_with_first_impossible_tick(path):
    path.write_text(
        document('<Sequence name="all"><A name="one"/><A name="two"/></Sequence>'), encoding="utf-8"
    )
    record = [*tick(1, 0.0, "RUNNING", {1: "RUNNING"}), *tick(4, 1.5, "FAILURE", {1: "SUCCESS"})]
    with pytest.raises(NotReplayedError, match=r"cannot produce tick 4 \(1\.5 s\)"):
        counterfactual(simulated(path), record, ["all", "one", "two"])


@pytest.mark.parametrize(
    ("what", "wrong"),
    [
        pytest.param(HALTED, "cannot produce tick 1", id="no node halts it there"),
        pytest.param(RESET, "cannot produce tick 2", id="it begins anew"),
    ],
)
def test_idle_leaf_is_not_assumed_to_continue(path, what, wrong):
    path.write_text(
        document('<Sequence name="all"><A name="one"/><A name="two"/></Sequence>'), encoding="utf-8"
    )
    first, second = tick(1, 0.0, "RUNNING", {1: "RUNNING"}), tick(2, 0.5, "RUNNING", {})
    assert counterfactual(simulated(path), [*first, *second], ["all", "one", "two"]) is not None
    with pytest.raises(NotReplayedError, match=wrong):
        counterfactual(simulated(path), [Event((), 1, what, tick=1), *first, *second], ["all", "one", "two"])


def test_only_undeclared_decreasing_facts_lose_their_limit(path):
    path.write_text(document("<Sequence><BaseInReach/><NotHeld/></Sequence>"), encoding="utf-8")
    tree = simulated(path, default_registry())
    assert remove_limits(tree, ["zones_left"])
    assert tree.fact_values() == {
        "base_lost": False,
        "losses_left": 1e18,
        "orders_left": 1e18,
        "zones_left": 3,
        "zones_abandoned": 0,
    }


def test_tree_without_limits_is_unchanged(path):
    path.write_text(document("<DeliverReports/>"), encoding="utf-8")
    tree = simulated(path, default_registry())
    before = tree.fact_values()
    assert not remove_limits(tree, before)
    assert tree.fact_values() == before


def test_ticks_without_events_are_assumed_unchanged(path):
    count = '<TickCounter name="count" duration="3" completion_status="SUCCESS"/>'
    body = f'<Sequence name="all">{count}<A name="one"/></Sequence>'
    path.write_text(document(body), encoding="utf-8")
    first, last = (
        tick(1, 0.0, "RUNNING", {1: "RUNNING"}),
        tick(4, 1.5, "FAILURE", {1: "SUCCESS", 2: "FAILURE"}),
    )
    change = counterfactual(simulated(path), [*first, *last], ["all", "count", "one"])
    assert change is not None
    assert (change.tick, change.instead.number, change.instead.status) == (4, 2, "SUCCESS")


def test_tree_with_too_many_runs_is_undecidable(path, monkeypatch):
    monkeypatch.setattr("sar_compiler.analysis.verify.recorded_runs._MAX_EXPLORED", 3)
    path.write_text(document('<A name="one"/>'), encoding="utf-8")
    record = [event for number in range(1, 9) for event in tick(number, 0.0, "RUNNING", {0: "RUNNING"})]
    with pytest.raises(UndecidableError, match="too many possible runs"):
        counterfactual(simulated(path), [*record, *tick(9, 0.0, "FAILURE", {0: "FAILURE"})], ["one"])


def consequences_of(path, body, record, leaf, registry=REGISTRY):
    """Return the consequences of other outcomes of a leaf in the last recorded tick, with names of nodes."""
    path.write_text(document(body), encoding="utf-8")
    tree = simulated(path, registry)
    names = [each.name for each in pre_order(tree.root)]
    retrospect = WhatIfSearch(tree, names)
    found = retrospect.consequences(record, leaf)
    # Each question is independent of the previous one.
    assert retrospect.consequences(record, leaf) == found
    return {
        each.instead.label or each.instead.status: (
            [f"{names[answer.number]} {answer.status}" for answer in each.then],
            each.root,
        )
        for each in found
    }


def test_consequences_of_each_other_outcome_are_reported(path):
    body = '<Fallback name="any"><A name="one"/><A name="two"/></Fallback>'
    record = [*tick(1, 0.0, "RUNNING", {1: "RUNNING"}), *tick(2, 0.1, "SUCCESS", {1: "SUCCESS"})]
    assert consequences_of(path, body, record, 1) == {
        "RUNNING": (["one SUCCESS"], "SUCCESS"),
        "FAILURE": (["two SUCCESS"], "SUCCESS"),
    }
    assert consequences_of(path, body, record, 2) == {}


RUN_COUNT = rounds(25)


@pytest.mark.parametrize("label", ["aborted", "unavailable"])
def test_label_distinguishes_outcomes_of_same_status(path, label):
    path.write_text(document("<NavigateToZone/>"), encoding="utf-8")
    record = tick(1, 0.0, "FAILURE", {0: "FAILURE"}, label)
    change = counterfactual(simulated(path, default_registry()), record, ["NavigateToZone"])
    assert change is not None
    assert (change.was.label, change.instead.label) == (label, "arrived")


def test_any_outcome_of_status_matches_if_label_is_unknown(path):
    path.write_text(document("<NavigateToZone/>"), encoding="utf-8")
    record = tick(1, 0.0, "FAILURE", {0: "FAILURE"})
    change = counterfactual(simulated(path, default_registry()), record, ["NavigateToZone"])
    assert change is not None
    assert (change.was.status, change.instead.label) == ("FAILURE", "arrived")


def test_impossible_label_is_not_matched(path):
    path.write_text(document("<NavigateToZone/>"), encoding="utf-8")
    record = tick(1, 0.0, "FAILURE", {0: "FAILURE"}, "no zone")
    with pytest.raises(NotReplayedError):
        counterfactual(simulated(path, default_registry()), record, ["NavigateToZone"])


class ChangedPolicy:
    """Follows another policy up to one changed outcome, and then returns usual outcomes.

    Args:
        policy: The other policy.
        change: The change.
        leaf: The name of its leaf.
    """

    def __init__(self, policy, change, leaf):
        self._policy, self._change, self._leaf = policy, change, leaf
        self._is_made = False
        self.tick = 0

    def choose(self, leaf, options):
        if self._is_made:
            return nominal(options)
        answer = self._policy.choose(leaf, options)
        if self.tick == self._change.tick and leaf.name == self._leaf:
            self._is_made = True
            return next(each for each in options if each.status == self._change.instead.status)
        return answer


@pytest.mark.unmeasured
def test_changed_run_succeeds_and_change_usually_concerns_faulty_leaf(path):
    blamed = []
    for (faulty, stream, policy), _ in zip(missions_with_fault(path), range(RUN_COUNT), strict=False):
        names = names_in(stream)
        change = counterfactual(simulated(path), recorded_events(stream), names)
        assert change is not None
        assert change.unusual == 0
        leaf = names[change.instead.number]
        assert run_and_record(simulated(path), ChangedPolicy(policy(), change, leaf))[1] == "SUCCESS"
        blamed.append(leaf == faulty)
    assert len(blamed) == RUN_COUNT
    assert sum(blamed) >= 0.95 * RUN_COUNT
