"""A leaf that stands for a real one, and answers what somebody chooses."""

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


class Following:
    """Chooses by the labels that it was given, one after the other."""

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
def made(facts, keys):
    def make(*answers):
        return StubLeaf("Go", "Drive", answers, FactVariables(facts, keys, Enums()), Enums())

    return make


def deeds(leaf):
    return [(event.what, event.outcome or None) for event in leaf.events]


def test_only_the_answers_whose_condition_is_true_can_be_chosen(made):
    leaf = made(ARRIVED, NOWHERE, DRIVING)
    leaf.policy = Following("driving", "arrived", "nowhere")
    for _ in range(3):
        leaf.tick_once()
    assert leaf.policy.asked == [(ARRIVED, DRIVING), (ARRIVED, DRIVING), (NOWHERE,)]


def test_an_answer_changes_facts_which_keep_their_type(made, facts):
    leaf = made(ARRIVED)
    leaf.tick_once()
    assert leaf.status == Status.SUCCESS
    assert leaf.feedback_message == "arrived"
    assert (facts.resolve("left").read(), facts.resolve("at").read()) == (0, "zone")
    assert type(facts.resolve("left").read()) is int


def test_scripts_over_facts_alone_are_run_in_their_quick_form_and_others_as_they_are(made):
    leaf = made(ARRIVED, Outcome("SUCCESS", "moved", then="goal := left"))
    variables = leaf.variables
    assert leaf.is_possible(ARRIVED)
    leaf.change(ARRIVED)
    assert not leaf.is_possible(ARRIVED)
    for program in (leaf._conditions[ARRIVED], leaf._effects[ARRIVED]):
        assert variables.fast_runner(program) is not None
    leaf.change(leaf.outcomes[1])
    assert variables.fast_runner(leaf._effects[leaf.outcomes[1]]) is None


def test_a_leaf_that_is_given_other_variables_changes_those(made, facts, keys):
    leaf = made(ARRIVED)
    leaf.change(ARRIVED)
    others = Scope(Board("test_other_facts"))
    others.resolve("left").write(5)
    others.resolve("at").write("")
    leaf.variables = FactVariables(others, keys, Enums())
    leaf.change(ARRIVED)
    assert (facts.resolve("left").read(), others.resolve("left").read()) == (0, 4)


def test_a_board_that_is_numbered_afterwards_is_written_as_such(made, facts):
    leaf = made(ARRIVED)
    assert leaf.is_possible(ARRIVED)
    entries = EntryCells()
    NumberedBoard.from_board(facts.board, entries)
    before = list(entries.now)
    leaf.change(ARRIVED)
    entries.update_contents()
    assert list(entries.now) != before
    assert not leaf.is_possible(ARRIVED)


def test_a_name_that_is_no_fact_is_a_key_of_the_tree(made, facts, keys):
    keys.resolve("battery").write(20)
    leaf = made(Outcome("SUCCESS", when="battery < 30", then="goal := battery + left"))
    leaf.tick_once()
    assert keys.resolve("goal").read() == 21
    assert not facts.resolve("goal").exists


def test_what_a_leaf_does_is_noted(made):
    leaf = made(ARRIVED, DRIVING)
    leaf.policy = Following("driving", "driving")
    leaf.tick_once()
    leaf.tick_once()
    leaf.stop(Status.INVALID)
    assert deeds(leaf) == [(STARTED, None), (RETURNED, "driving"), (RETURNED, "driving"), (HALTED, None)]


def test_an_answer_whose_script_cannot_be_run_is_noted_with_what_it_has_changed(made):
    leaf = made(Outcome("SUCCESS", "yes", then="at = 'zone'; left = 'x'"))
    with pytest.raises(StubLeafError):
        leaf.tick_once()
    assert [(event.action, event.facts) for event in leaf.events] == [
        (STARTED, ()),
        ("yes", (("at", "zone"),)),
    ]


def test_a_leaf_that_has_finished_is_not_halted(made):
    leaf = made(ARRIVED)
    leaf.tick_once()
    leaf.stop(Status.INVALID)
    assert (HALTED, None) not in deeds(leaf)


def test_an_answer_can_be_that_the_leaf_is_skipped(made):
    leaf = made(Outcome("SKIPPED", "not today"))
    leaf.tick_once()
    assert leaf.skipped
    assert leaf.status == Status.INVALID


def test_a_leaf_without_a_possible_answer_says_what_each_would_need(made, facts):
    facts.resolve("left").write(-1)
    with pytest.raises(
        StubLeafError, match=r"'Go' \(Drive\) has no possible outcome .*'arrived' when left > 0, 'nowhere'"
    ):
        made(ARRIVED, NOWHERE).tick_once()


@pytest.mark.parametrize(
    ("answer", "part"),
    [
        (Outcome("SUCCESS", "yes", when="speed > 1"), "when"),
        (Outcome("SUCCESS", "yes", then="left = 'x'"), "then"),
    ],
)
def test_a_script_that_cannot_be_run_names_leaf_answer_and_script(made, answer, part):
    with pytest.raises(StubLeafError, match=rf"'Go' \(Drive\), outcome 'yes': {part} '"):
        made(answer).tick_once()
