"""What the records of the nodes say that a tick can come to, held against all runs of small trees."""

import functools
import itertools
from collections.abc import Callable

import pytest

from sar_compiler.compiler import bind_main
from sar_compiler.nodes.outcome_sets import ALL, ALLOWED, SURE, F, K, R, S, bits
from tests.chance import rounds
from tests.checks.outcome_oracle import REGISTRY, SUBSETS, RandomTrees, leaf, outcomes_of
from tests.node_forms import Form, forms
from tests.trees import forest

FORMS = forms(REGISTRY)
# One in so many combinations of what the children answer is tried of a node that reads keys, whose surroundings make
# each of them dear; with no divisor of the number of subsets, so that every child answers every one.
TRIED_WITH_KEYS = 71
RANDOM_TREES = rounds(60)


# How much of what it answers is known before; of all other nodes everything.
SURE_OF = {"RateController": 0.85}


def combinations(form: Form):
    count = form.count(1)
    if count == 1:
        return [(subset,) for subset in SUBSETS]
    first_two = itertools.product(SUBSETS, repeat=2)
    rest = [SUBSETS[-1]] * (form.count(2) - 2)
    found = [(first, second, *rest) for first, second in first_two]
    return found[:: TRIED_WITH_KEYS if form.reads_keys else 1]


def tree(form: Form, subsets) -> str:
    return form.text([leaf(subset, f"leaf{number}") for number, subset in enumerate(subsets)])


@pytest.mark.unmeasured
@pytest.mark.parametrize("form", FORMS, ids=str)
def test_a_node_answers_what_its_record_says_and_nothing_else(form):
    seen = known = 0
    for subsets in combinations(form):
        answers = outcomes_of(tree(form, subsets))
        if answers is not None:  # one that py_trees cannot skip, or a count out of reach
            assert answers.seen <= answers.may, subsets
            if answers.complete:
                assert answers.known <= answers.seen, subsets
            seen += len(answers.seen)
            known += len(answers.known & answers.seen)
    # A record that is sure of nothing would be right, and of no use.
    assert form.reads_keys or known >= SURE_OF.get(form.spec.tag, 1.0) * seen


@pytest.mark.unmeasured
def test_nodes_in_nodes_answer_what_their_records_say_together():
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
    """Return what a node makes of the outcome sets of its children."""
    bound = bind_main(forest(tree(form, [SUBSETS[0]] * form.count(2))), REGISTRY).main.root
    possible = form.spec.semantics.possible
    assert bound is not None
    assert possible is not None
    return functools.partial(possible, bound)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_what_is_known_is_allowed_and_what_is_known_of_nothing_is_allowed_for_everything(form):
    count = form.count(2)
    possible = possible_of(form)
    known_of_nothing = possible([0] * count, SURE)
    for children in itertools.product(range(1, ALL + 1), repeat=min(count, 2)):
        sets = [*children, *[children[-1]] * (count - len(children))]
        may = possible(sets, ALLOWED)
        assert known_of_nothing & ~may == 0, sets
        assert possible(sets, SURE) & ~may == 0, sets


def test_what_is_interrupted_in_every_other_tick_is_not_known_to_end():
    first = f"<AsyncSequence>{leaf(['SUCCESS'], 'a')}{leaf(['SUCCESS'], 'b')}</AsyncSequence>"
    second = f"<AsyncFallback>{leaf(['FAILURE'], 'c')}{leaf(['SUCCESS'], 'd')}</AsyncFallback>"
    answers = outcomes_of(f"<ReactiveSequence>{first}{second}</ReactiveSequence>")
    assert answers is not None
    assert answers.seen == answers.known == {"RUNNING"}


@pytest.mark.parametrize(
    ("tag", "variant"), dict.fromkeys((form.spec.tag, form.spec.variant) for form in FORMS)
)
def test_a_node_says_that_it_can_answer_what_its_record_allows(tag, variant):
    own = [form for form in FORMS if (form.spec.tag, form.spec.variant) == (tag, variant)]
    allowed = 0
    for form in own:
        count = form.count(2)
        allowed |= possible_of(form)([S | F | R] * count, ALLOWED)
    assert bits(own[0].spec.statuses) == allowed & ~K


def test_of_a_queue_that_is_written_in_the_file_everything_is_known():
    answers = outcomes_of('<StatusQueue queue="RUNNING;SUCCESS" eventually="SUCCESS"/>')
    assert answers is not None
    assert answers.seen == answers.may == answers.known == {"RUNNING", "SUCCESS"}
