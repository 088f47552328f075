"""Tests of separate searches for independent parallel branches: the verdicts are those of one search."""

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
from tests.random_inputs import rounds
from tests.trees import document, forest_of

_PLAINLY = 10**9
_MOST_STATES = 3000
_LONG_LOOP_SEEDS = (104,)
"""An endless run of this tree needs several loops of its parts."""


class Case:
    """A tree with properties.

    Args:
        body: Its elements.
        properties: The text of a properties file.
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
        """Return a stepper of the whole tree, and whether the question is a property to monitor."""
        prepared = PreparedTree.prepare(self.prepared())
        properties = properties_of(self.file, prepared, TAGS)
        watched = [number for number, name in enumerate(properties.names) if name == question]
        return TreeStepper(prepared, properties.select(watched).rules, meets=False), bool(watched)

    def holds_against(self, question, trace):
        """Return whether a trace is a run of the whole tree that violates a question."""
        stepper, is_property = self.judge(question)
        # A state, the state at the start of the loop, and the answers that every tick since has waited for.
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


def verdicts_with_lengths(verification):
    """Return the verdicts with the lengths of their runs; the length of a loop is not compared."""
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
def test_random_trees_have_same_verdicts_and_valid_traces_if_branches_are_separate():
    apart = 0
    for seed in [*range(rounds(40)), *_LONG_LOOP_SEEDS]:
        body = random_branches(seed)
        case = Case(body, random_properties(body, seed))
        plain = case.verified(_PLAINLY)
        if not plain.complete:
            continue
        found = case.verified(0)
        assert verdicts_with_lengths(found) == verdicts_with_lengths(plain), f"seed {seed}"
        for each in found.verdicts:
            assert each.trace is None or case.holds_against(each.question, each.trace), f"seed {seed}: {each}"
        apart += found.searches > 1
    assert apart > 10


def guarded(count, branch="<Sequence><A name='a{0}'/><B name='b{0}'/></Sequence>"):
    """Return a tree with branches that are retried while a condition holds."""
    retried = f'<RetryUntilSuccessful num_attempts="3">{branch}</RetryUntilSuccessful>'
    branches = "".join(retried.replace("{0}", str(number)) for number in range(count))
    return f'<ReactiveSequence><P/><Parallel success_count="{count}" failure_count="1">{branches}</Parallel></ReactiveSequence>'


BRANCH_PROPERTIES = "properties: {p: {never: b1 FAILURE}, q: {before: b1 starts, comes: a1 SUCCESS}}"


@pytest.mark.unmeasured
def test_many_branches_do_not_multiply_states():
    found = Case(guarded(8), BRANCH_PROPERTIES).verified(100, 100_000)
    assert (found.searches, found.branches, found.complete) == (9, 8, True)
    assert found.states < 10_000
    assert outcome(found, "q") is PROVED
    assert (outcome(found, "p"), len(verdict(found, "p").trace.ticks)) == (BROKEN, 1)


def test_small_tree_is_searched_as_whole():
    found = Case(guarded(2), BRANCH_PROPERTIES).verified(10_000, 100_000)
    assert (found.searches, found.branches) == (1, 0)
    assert "branches" not in verification_as_text(found, 0.0)


def test_number_of_separate_branches_is_reported():
    found = Case(guarded(2), BRANCH_PROPERTIES).verified(10, 100_000)
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
def test_branches_that_share_data_are_not_searched_separately(branch):
    assert Case(guarded(2, branch), BRANCH_PROPERTIES).verified(10, 100_000).searches == 1


def test_branches_that_share_unchanged_fact_are_searched_separately():
    branch = "<Sequence><A name='a{0}'/><B name='b{0}'/><Z/></Sequence>"
    assert Case(guarded(2, branch), BRANCH_PROPERTIES).verified(10, 100_000).searches == 3


def test_branch_with_timer_is_searched_separately():
    timed = '<Timeout msec="10"><A name="a{0}"/></Timeout>'
    again = '<RetryUntilSuccessful num_attempts="-1">{}</RetryUntilSuccessful>'
    parallel = f'<Parallel success_count="2" failure_count="1">{timed.replace("{0}", "0")}{timed.replace("{0}", "1")}</Parallel>'
    case = Case(again.format(parallel), "properties: {p: {after: a1 starts, eventually: a1 SUCCESS}}")
    found = case.verified(1)
    assert found.searches == 3
    assert verdicts_with_lengths(found) == verdicts_with_lengths(case.verified(_PLAINLY))
    assert all(case.holds_against(each.question, each.trace) for each in found.verdicts if each.trace)


def test_branch_ticked_during_halt_is_not_searched_separately():
    branch = '<TryCatch catch_on_halt="true"><A name="a{0}"/><B name="b{0}"/></TryCatch>'
    assert Case(guarded(2, branch), BRANCH_PROPERTIES).verified(10, 100_000).searches == 1


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
def test_success_and_failure_limits_of_parallel_are_respected(limits, end):
    body = f'<Parallel {limits}><ForceFailure><A name="a0"/></ForceFailure><A name="a1"/><A name="a2"/></Parallel>'
    for each in (body, body.replace("ForceFailure", "Inverter")):
        case = Case(each, f"properties: {{p: {{at_end: root == '{end}'}}}}")
        assert verdicts_with_lengths(case.verified(1)) == verdicts_with_lengths(case.verified(_PLAINLY))


@pytest.mark.parametrize(
    ("asked", "searches"),
    [
        ("{never: b0 FAILURE, while: k0 == 1}", 1),
        ("{never: b0 FAILURE, while: n == 1}", 3),
        ("{at_end: n == 1 || idle}", 1),
    ],
    ids=["a key of a branch", "another key", "whether the tree idles"],
)
def test_keys_of_property_condition_are_shared_data(asked, searches):
    branch = '<Sequence><Script code="k{0} := 1"/><A name="a{0}"/><B name="b{0}"/></Sequence>'
    body = f'<Sequence><Script code="n := 1"/>{guarded(2, branch)}</Sequence>'
    assert Case(body, f"properties: {{p: {asked}}}").verified(10, 100_000).searches == searches


def test_subtree_can_be_separate_branch():
    sub = '<SubTree ID="Other" name="s{0}"/>'
    found = Case(
        guarded(3, sub),
        "properties: {}",
        other='<Sequence><Script code="k := 0"/><A/><Script code="k += 1"/></Sequence>',
    ).verified(10, 100_000)
    assert (found.searches, found.is_proved) == (4, True)


def test_skipped_branch_is_ticked_again():
    skipped = '<AlwaysFailure _skipIf="@k := 1 - @k; @k == 1"/>'
    body = f'<Parallel success_count="-1">{skipped}<AlwaysSuccess/><A/></Parallel>'
    asked = "{p: {after: A RUNNING, eventually: A SUCCESS}}"
    case = Case(body, f"outcomes: {{A: [SUCCESS, RUNNING]}}\nparameters: {{k: 0}}\nproperties: {asked}")
    found = case.verified(1)
    assert (found.searches, len(verdict(found, "p").trace.ticks)) == (4, 2)
    assert verdicts_with_lengths(found) == verdicts_with_lengths(case.verified(_PLAINLY))


def test_memory_of_leaf_is_reset_for_each_search():
    # Its behaviour has counted in the previous search.
    body = guarded(3).replace("<P/>", '<SuccessEveryN n="3"/>')
    case = Case(body, BRANCH_PROPERTIES)
    assert verdicts_with_lengths(case.verified(10)) == verdicts_with_lengths(case.verified(_PLAINLY))


def test_stopped_search_returns_partial_result():
    case = Case(guarded(5), BRANCH_PROPERTIES)
    budget = Budget(on_progress=lambda progress: setattr(budget, "reason", "so" * (progress.states > 40)))
    found = verify(case.prepared(), case.file, TAGS, 100_000, budget, plainly=40)
    assert (found.stopped, found.complete, found.searches) == (True, False, 1)


def test_whole_tree_is_searched_if_separate_search_exceeds_limit():
    case = Case(guarded(5), BRANCH_PROPERTIES)
    found = case.verified(10, 50)
    assert (found.states, found.complete, found.searches) == (50, False, 1)
