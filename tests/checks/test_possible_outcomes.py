"""Tests that the outcome records of the nodes agree with all runs of small trees."""

import functools
import itertools
from collections.abc import Callable

import pytest

from sar_compiler.compiler import bind_main
from sar_compiler.nodes.outcome_sets import ALL, ALLOWED, SURE, F, K, R, S, bits
from tests.checks.outcome_oracle import REGISTRY, SUBSETS, RandomTrees, leaf, outcomes_of
from tests.node_forms import Form, forms
from tests.random_inputs import rounds
from tests.trees import forest

FORMS = forms(REGISTRY)
# For a node that reads keys, only one in this many combinations of the children's outcomes is tested, because its surrounding
# tree makes each one expensive. No divisor of the number of subsets, so that each child has every subset.
STEP_WITH_KEYS = 71
RANDOM_TREES = rounds(60)


# The minimum share of seen outcomes that the record states as certain; 1 for all other nodes.
MIN_CERTAIN_SHARE = {"RateController": 0.85}


def combinations(form: Form):
    count = form.count(1)
    if count == 1:
        return [(subset,) for subset in SUBSETS]
    first_two = itertools.product(SUBSETS, repeat=2)
    rest = [SUBSETS[-1]] * (form.count(2) - 2)
    found = [(first, second, *rest) for first, second in first_two]
    return found[:: STEP_WITH_KEYS if form.reads_keys else 1]


def tree(form: Form, subsets) -> str:
    return form.text([leaf(subset, f"leaf{number}") for number, subset in enumerate(subsets)])


@pytest.mark.unmeasured
@pytest.mark.parametrize("form", FORMS, ids=str)
def test_node_returns_only_outcomes_of_its_record(form):
    seen = known = 0
    for subsets in combinations(form):
        answers = outcomes_of(tree(form, subsets))
        if answers is not None:  # py_trees cannot skip the node, or a count is unreachable
            assert answers.seen <= answers.may, subsets
            if answers.complete:
                assert answers.known <= answers.seen, subsets
            seen += len(answers.seen)
            known += len(answers.known & answers.seen)
    # A record without certain outcomes would be correct, but useless.
    assert form.reads_keys or known >= MIN_CERTAIN_SHARE.get(form.spec.tag, 1.0) * seen


@pytest.mark.unmeasured
def test_nested_nodes_return_only_outcomes_of_their_records():
    seen = known = trees = 0
    random_trees = RandomTrees(seed=1)
    for _ in range(RANDOM_TREES):
        body = random_trees.tree(depth=3)
        answers = outcomes_of(body)
        if answers is None:
            continue
        trees += 1
        assert answers.seen <= answers.may, body
        if answers.complete:
            assert answers.known <= answers.seen, body
            seen += len(answers.seen)
            known += len(answers.known)
    assert trees > RANDOM_TREES / 4
    assert known >= 0.97 * seen


def possible_of(form: Form) -> Callable[[list[int], bool], int]:
    """Return the function that computes a node's outcomes from the outcome sets of its children."""
    bound = bind_main(forest(tree(form, [SUBSETS[0]] * form.count(2))), REGISTRY).main.root
    possible = form.spec.semantics.possible
    assert bound is not None
    assert possible is not None
    return functools.partial(possible, bound)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_certain_outcomes_are_allowed(form):
    count = form.count(2)
    possible = possible_of(form)
    known_of_nothing = possible([0] * count, SURE)
    for children in itertools.product(range(1, ALL + 1), repeat=min(count, 2)):
        sets = [*children, *[children[-1]] * (count - len(children))]
        may = possible(sets, ALLOWED)
        assert known_of_nothing & ~may == 0, sets
        assert possible(sets, SURE) & ~may == 0, sets


def test_children_that_interrupt_each_other_keep_running():
    first = f"<AsyncSequence>{leaf(['SUCCESS'], 'a')}{leaf(['SUCCESS'], 'b')}</AsyncSequence>"
    second = f"<AsyncFallback>{leaf(['FAILURE'], 'c')}{leaf(['SUCCESS'], 'd')}</AsyncFallback>"
    answers = outcomes_of(f"<ReactiveSequence>{first}{second}</ReactiveSequence>")
    assert answers is not None
    assert answers.seen == answers.known == {"RUNNING"}


@pytest.mark.parametrize(
    ("tag", "variant"), dict.fromkeys((form.spec.tag, form.spec.variant) for form in FORMS)
)
def test_declared_statuses_equal_allowed_outcomes(tag, variant):
    own = [form for form in FORMS if (form.spec.tag, form.spec.variant) == (tag, variant)]
    allowed = 0
    for form in own:
        count = form.count(2)
        allowed |= possible_of(form)([S | F | R] * count, ALLOWED)
    assert bits(own[0].spec.statuses) == allowed & ~K


def test_outcomes_of_literal_queue_are_certain():
    answers = outcomes_of('<StatusQueue queue="RUNNING;SUCCESS" eventually="SUCCESS"/>')
    assert answers is not None
    assert answers.seen == answers.may == answers.known == {"RUNNING", "SUCCESS"}
