"""Parallel branches that share nothing are proved apart, with the same answers as in one search."""

import json

import pytest

from sar_compiler.analysis.verification_view import verification_as_json, verification_as_text
from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.properties import parse_property_file, properties_of
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.analysis.verify.verdicts import NO_ERROR
from sar_compiler.budget import Budget
from sar_compiler.compiler import bind_main
from tests.analysis.verify.random_branches import random_branches, random_properties
from tests.analysis.verify.stage import BROKEN, PROVED, REGISTRY, TAGS, outcome, simulated_tree, verdict
from tests.chance import rounds
from tests.trees import document, forest_of

_PLAINLY = 10**9
_MOST_STATES = 3000
_TELLING = (104,)
"""A run for ever of this tree needs several rounds of that of its parts."""


class Case:
    """A tree, and what is asked of it.

    Args:
        body: Its elements.
        properties: The text of a file of properties.
        other: The elements of another tree, `Other`.
    """

    def __init__(self, body, properties, other="<A/>"):
        trees = document(body).replace("</root>", f'<BehaviorTree ID="Other">{other}</BehaviorTree></root>')
        named = trees.replace("<root ", '<root main_tree_to_execute="Main" ')
        self._binding = bind_main(forest_of(named), REGISTRY)
        self.file = parse_property_file(properties, "props.yaml")

    def prepared(self):
        return simulated_tree(self._binding, self.file)

    def verified(self, plainly, max_states=_MOST_STATES):
        return verify(self.prepared(), self.file, TAGS, max_states, plainly=plainly)

    def judge(self, question):
        """Return what plays the tree as it is, and whether the question is a property, which it watches."""
        prepared = PreparedTree.prepare(self.prepared())
        properties = properties_of(self.file, prepared, TAGS)
        watched = [number for number, name in enumerate(properties.names) if name == question]
        return TreeStepper(prepared, properties.select(watched).rules, meets=False), bool(watched)

    def holds_against(self, question, trace):
        """Return whether a run is one of the tree as it is in which something does not hold."""
        stepper, is_property = self.judge(question)
        # A state, the one at the beginning of the loop, and what every tick since has waited for.
        ways, first = {(stepper.steps.start(), None, -1)}, len(trace.ticks) - trace.loop
        for number, record in enumerate(trace.ticks):
            following = set()
            for state, loop, waited in ways:
                start = state if number == first and trace.loop else loop
                for step in stepper.ticks(state):
                    played = stepper.tick_record(number + 1)
                    if played != record:
                        continue
                    waits = waited & step.waits[0] if number >= first else waited
                    if step.error is not None:
                        following.add((None, start, waits))
                        continue
                    judged = stepper.steps.judge(step.state, None)
                    broken = step.broken | judged.broken
                    owes = not is_property or judged.pending
                    if trace.loop and number >= first and (judged.ends or not owes):
                        continue
                    is_last = number + 1 == len(trace.ticks)
                    if is_last and not trace.loop and is_property and not broken:
                        continue
                    following.add((step.state, start, waits))
            ways = following
        if trace.loop:
            return any(state == loop and not waits for state, loop, waits in ways)
        return bool(ways) and (question != NO_ERROR or (None, None, -1) in ways)


def answers(verification):
    """Return the answers, with the lengths of runs; one that goes round for ever is as long as it takes to come back."""
    return [
        (
            each.question,
            each.outcome,
            each.reason,
            each.trace and (each.trace.loop > 0 or len(each.trace.ticks)),
        )
        for each in verification.verdicts
    ]


@pytest.mark.unmeasured
def test_random_trees_have_the_same_answers_apart_and_every_run_is_one_of_theirs():
    apart = 0
    for seed in [*range(rounds(40)), *_TELLING]:
        body = random_branches(seed)
        case = Case(body, random_properties(body, seed))
        plain = case.verified(_PLAINLY)
        if not plain.complete:
            continue
        found = case.verified(0)
        assert answers(found) == answers(plain), f"seed {seed}"
        for each in found.verdicts:
            assert each.trace is None or case.holds_against(each.question, each.trace), f"seed {seed}: {each}"
        apart += found.searches > 1
    assert apart > 10


def guarded(count, branch="<Sequence><A name='a{0}'/><B name='b{0}'/></Sequence>"):
    """Return a tree with branches that are tried again as long as a condition holds."""
    retried = f'<RetryUntilSuccessful num_attempts="3">{branch}</RetryUntilSuccessful>'
    branches = "".join(retried.replace("{0}", str(number)) for number in range(count))
    return f'<ReactiveSequence><P/><Parallel success_count="{count}" failure_count="1">{branches}</Parallel></ReactiveSequence>'


OF_A_BRANCH = "properties: {p: {never: b1 FAILURE}, q: {before: b1 starts, comes: a1 SUCCESS}}"


@pytest.mark.unmeasured
def test_many_branches_take_no_product_of_their_states():
    found = Case(guarded(8), OF_A_BRANCH).verified(100, 100_000)
    assert (found.searches, found.branches, found.complete) == (9, 8, True)
    assert found.states < 10_000
    assert outcome(found, "q") is PROVED
    assert (outcome(found, "p"), len(verdict(found, "p").trace.ticks)) == (BROKEN, 1)


def test_a_small_tree_is_searched_as_it_is():
    found = Case(guarded(2), OF_A_BRANCH).verified(10_000, 100_000)
    assert (found.searches, found.branches) == (1, 0)
    assert "branches" not in verification_as_text(found, 0.0)


def test_how_many_branches_stood_for_themselves_is_told():
    found = Case(guarded(2), OF_A_BRANCH).verified(10, 100_000)
    told = verification_as_text(found, 0.0)
    assert "\n2 parallel branches share no data, so they were searched separately, in 3 searches.\n" in told
    numbers = json.loads(verification_as_json(found, 0.0))
    assert (numbers["branches"], numbers["searches"]) == (2, 3)


@pytest.mark.parametrize(
    "branch",
    [
        '<Sequence><A name="a{0}"/><B name="b{0}"/><Script code="done := {0}"/></Sequence>',
        "<Sequence><A name='a{0}'/><B name='b{0}'/><X/></Sequence>",
        "<Sequence><A name='a{0}'/><B name='b{0}'/><UnsetBlackboard key='k'/></Sequence>",
    ],
    ids=["a key", "a fact", "whatever is removed"],
)
def test_branches_that_share_something_do_not_stand_for_themselves(branch):
    assert Case(guarded(2, branch), OF_A_BRANCH).verified(10, 100_000).searches == 1


def test_branches_that_read_what_nobody_changes_stand_for_themselves():
    branch = "<Sequence><A name='a{0}'/><B name='b{0}'/><Z/></Sequence>"
    assert Case(guarded(2, branch), OF_A_BRANCH).verified(10, 100_000).searches == 3


def test_a_branch_with_a_timer_stands_for_itself():
    timed = '<Timeout msec="10"><A name="a{0}"/></Timeout>'
    again = '<RetryUntilSuccessful num_attempts="-1">{}</RetryUntilSuccessful>'
    parallel = f'<Parallel success_count="2" failure_count="1">{timed.replace("{0}", "0")}{timed.replace("{0}", "1")}</Parallel>'
    case = Case(again.format(parallel), "properties: {p: {after: a1 starts, eventually: a1 SUCCESS}}")
    found = case.verified(1)
    assert found.searches == 3
    assert answers(found) == answers(case.verified(_PLAINLY))
    assert all(case.holds_against(each.question, each.trace) for each in found.verdicts if each.trace)


def test_a_branch_that_is_ticked_when_it_is_halted_does_not_stand_for_itself():
    branch = '<TryCatch catch_on_halt="true"><A name="a{0}"/><B name="b{0}"/></TryCatch>'
    assert Case(guarded(2, branch), OF_A_BRANCH).verified(10, 100_000).searches == 1


@pytest.mark.parametrize(
    "limits",
    [
        'success_count="1" failure_count="3"',
        'success_count="3" failure_count="0"',
        'success_count="3" failure_count="3"',
        'success_count="-1" failure_count="-1"',
    ],
)
@pytest.mark.parametrize("end", ["SUCCESS", "FAILURE"])
def test_how_many_have_to_succeed_or_may_fail_counts(limits, end):
    body = f'<Parallel {limits}><ForceFailure><A name="a0"/></ForceFailure><A name="a1"/><A name="a2"/></Parallel>'
    for each in (body, body.replace("ForceFailure", "Inverter")):
        case = Case(each, f"properties: {{p: {{at_end: root == '{end}'}}}}")
        assert answers(case.verified(1)) == answers(case.verified(_PLAINLY))


@pytest.mark.parametrize(
    ("asked", "searches"),
    [
        ("{never: b0 FAILURE, while: k0 == 1}", 1),
        ("{never: b0 FAILURE, while: n == 1}", 3),
        ("{at_end: n == 1 || idle}", 1),
    ],
    ids=["a key of a branch", "another key", "whether the tree idles"],
)
def test_what_a_condition_of_a_property_reads_is_shared_with_it(asked, searches):
    branch = '<Sequence><Script code="k{0} := 1"/><A name="a{0}"/><B name="b{0}"/></Sequence>'
    body = f'<Sequence><Script code="n := 1"/>{guarded(2, branch)}</Sequence>'
    assert Case(body, f"properties: {{p: {asked}}}").verified(10, 100_000).searches == searches


def test_a_branch_may_be_a_subtree():
    sub = '<SubTree ID="Other" name="s{0}"/>'
    found = Case(
        guarded(3, sub),
        "properties: {}",
        other='<Sequence><Script code="k := 0"/><A/><Script code="k += 1"/></Sequence>',
    ).verified(10, 100_000)
    assert (found.searches, found.is_proved) == (4, True)


def test_a_branch_that_is_skipped_is_asked_again():
    skipped = '<AlwaysFailure _skipIf="@k := 1 - @k; @k == 1"/>'
    body = f'<Parallel success_count="-1">{skipped}<AlwaysSuccess/><A/></Parallel>'
    asked = "{p: {after: A RUNNING, eventually: A SUCCESS}}"
    case = Case(body, f"outcomes: {{A: [SUCCESS, RUNNING]}}\nparameters: {{k: 0}}\nproperties: {asked}")
    found = case.verified(1)
    assert (found.searches, len(verdict(found, "p").trace.ticks)) == (4, 2)
    assert answers(found) == answers(case.verified(_PLAINLY))


def test_what_a_leaf_remembers_is_at_its_start_in_every_search():
    # Its behaviour has counted in the search before.
    body = guarded(3).replace("<P/>", '<SuccessEveryN n="3"/>')
    case = Case(body, OF_A_BRANCH)
    assert answers(case.verified(10)) == answers(case.verified(_PLAINLY))


def test_a_search_that_is_stopped_leaves_what_was_known():
    case = Case(guarded(5), OF_A_BRANCH)
    budget = Budget(on_progress=lambda progress: setattr(budget, "reason", "so" * (progress.states > 40)))
    found = verify(case.prepared(), case.file, TAGS, 100_000, budget, plainly=40)
    assert (found.stopped, found.complete, found.searches) == (True, False, 1)


def test_where_a_search_does_not_come_to_its_end_the_tree_is_searched_as_it_is():
    case = Case(guarded(5), OF_A_BRANCH)
    found = case.verified(10, 50)
    assert (found.states, found.complete, found.searches) == (50, False, 1)
