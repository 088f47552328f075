"""Tests of stub leaves, which replace real ones and return outcomes that a policy chooses."""

import pytest
from py_trees.common import Status

from sar_compiler.analysis.numbered_board import NumberedBoard
from sar_compiler.analysis.stub_leaf import (
    FactVariables,
    StubLeaf,
    StubLeafError,
)
from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.events import HALTED, RETURNED, STARTED
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.runtime.variables import Enums

ARRIVED = Outcome("SUCCESS", "arrived", when="left > 0", then="at = 'zone'; left -= 1")
NOWHERE = Outcome("FAILURE", "nowhere", when="left == 0")
DRIVING = Outcome("RUNNING", "driving", when="left > 0")


class LabelPolicy:
    """Chooses outcomes by a list of labels, in order."""

    def __init__(self, *labels):
        self.labels = list(labels)
        self.asked = []

    def choose(self, leaf, options):
        self.asked.append(options)
        label = self.labels.pop(0)
        return next(answer for answer in options if answer.name == label)


@pytest.fixture
def facts():
    scope = Scope(Board("test_facts"))
    scope.resolve("left").write(1)
    scope.resolve("at").write("")
    return scope


@pytest.fixture
def keys():
    return Scope(Board("test_keys"))


@pytest.fixture
def make_leaf(facts, keys):
    def make(*answers):
        return StubLeaf("Go", "Drive", answers, FactVariables(facts, keys, Enums()), Enums())

    return make


def events_of(leaf):
    return [(event.what, event.outcome or None) for event in leaf.events]


def test_only_outcomes_with_true_condition_can_be_chosen(make_leaf):
    leaf = make_leaf(ARRIVED, NOWHERE, DRIVING)
    leaf.policy = LabelPolicy("driving", "arrived", "nowhere")
    for _ in range(3):
        leaf.tick_once()
    assert leaf.policy.asked == [(ARRIVED, DRIVING), (ARRIVED, DRIVING), (NOWHERE,)]


def test_outcome_changes_facts_which_keep_their_type(make_leaf, facts):
    leaf = make_leaf(ARRIVED)
    leaf.tick_once()
    assert leaf.status == Status.SUCCESS
    assert leaf.feedback_message == "arrived"
    assert (facts.resolve("left").read(), facts.resolve("at").read()) == (0, "zone")
    assert type(facts.resolve("left").read()) is int


def test_only_scripts_over_facts_alone_use_fast_runner(make_leaf):
    leaf = make_leaf(ARRIVED, Outcome("SUCCESS", "moved", then="goal := left"))
    variables = leaf.variables
    assert leaf.is_possible(ARRIVED)
    leaf.change(ARRIVED)
    assert not leaf.is_possible(ARRIVED)
    for program in (leaf._conditions[ARRIVED], leaf._effects[ARRIVED]):
        assert variables.fast_runner(program) is not None
    leaf.change(leaf.outcomes[1])
    assert variables.fast_runner(leaf._effects[leaf.outcomes[1]]) is None


def test_leaf_with_other_variables_changes_those(make_leaf, facts, keys):
    leaf = make_leaf(ARRIVED)
    leaf.change(ARRIVED)
    others = Scope(Board("test_other_facts"))
    others.resolve("left").write(5)
    others.resolve("at").write("")
    leaf.variables = FactVariables(others, keys, Enums())
    leaf.change(ARRIVED)
    assert (facts.resolve("left").read(), others.resolve("left").read()) == (0, 4)


def test_board_numbered_later_is_written_through_its_cells(make_leaf, facts):
    leaf = make_leaf(ARRIVED)
    assert leaf.is_possible(ARRIVED)
    entries = EntryCells()
    NumberedBoard.from_board(facts.board, entries)
    before = list(entries.now)
    leaf.change(ARRIVED)
    entries.update_contents()
    assert list(entries.now) != before
    assert not leaf.is_possible(ARRIVED)


def test_name_that_is_not_fact_is_key_of_tree(make_leaf, facts, keys):
    keys.resolve("battery").write(20)
    leaf = make_leaf(Outcome("SUCCESS", when="battery < 30", then="goal := battery + left"))
    leaf.tick_once()
    assert keys.resolve("goal").read() == 21
    assert not facts.resolve("goal").exists


def test_events_of_leaf_are_recorded(make_leaf):
    leaf = make_leaf(ARRIVED, DRIVING)
    leaf.policy = LabelPolicy("driving", "driving")
    leaf.tick_once()
    leaf.tick_once()
    leaf.stop(Status.INVALID)
    assert events_of(leaf) == [(STARTED, None), (RETURNED, "driving"), (RETURNED, "driving"), (HALTED, None)]


def test_outcome_with_failing_script_is_recorded_with_its_changes(make_leaf):
    leaf = make_leaf(Outcome("SUCCESS", "yes", then="at = 'zone'; left = 'x'"))
    with pytest.raises(StubLeafError):
        leaf.tick_once()
    assert [(event.action, event.facts) for event in leaf.events] == [
        (STARTED, ()),
        ("yes", (("at", "zone"),)),
    ]


def test_finished_leaf_is_not_halted(make_leaf):
    leaf = make_leaf(ARRIVED)
    leaf.tick_once()
    leaf.stop(Status.INVALID)
    assert (HALTED, None) not in events_of(leaf)


def test_outcome_can_be_skipped(make_leaf):
    leaf = make_leaf(Outcome("SKIPPED", "not today"))
    leaf.tick_once()
    assert leaf.skipped
    assert leaf.status == Status.INVALID


def test_leaf_without_possible_outcome_reports_all_conditions(make_leaf, facts):
    facts.resolve("left").write(-1)
    with pytest.raises(
        StubLeafError, match=r"'Go' \(Drive\) has no possible outcome .*'arrived' when left > 0, 'nowhere'"
    ):
        make_leaf(ARRIVED, NOWHERE).tick_once()


@pytest.mark.parametrize(
    ("answer", "part"),
    [
        (Outcome("SUCCESS", "yes", when="speed > 1"), "when"),
        (Outcome("SUCCESS", "yes", then="left = 'x'"), "then"),
    ],
)
def test_failing_script_is_reported_with_leaf_outcome_and_script(make_leaf, answer, part):
    with pytest.raises(StubLeafError, match=rf"'Go' \(Drive\), outcome 'yes': {part} '"):
        make_leaf(answer).tick_once()
